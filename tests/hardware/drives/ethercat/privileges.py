"""Who may test the EtherCAT bus: root as he is, anybody else in a network of his own."""

from __future__ import annotations

import pytest

from hardware.sim.emulated.ethercat import namespace


def require_privileges() -> None:
    """Skip what only works where this process may enter a network; for all others ``test_ordinary_user`` runs it."""
    if not namespace.privileged():
        pytest.skip("this process may not enter a network; tests/hardware/drives/ethercat/test_ordinary_user.py may")
