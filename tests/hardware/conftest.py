"""Who asks a simulated world waits for it, however busy the machine."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from hardware.sim.clients import wire
from hardware.sim.clients.bus import SimServoBus
from tests.waiting import PATIENCE


@pytest.fixture(scope="module", autouse=True)
def _patient_clients() -> Iterator[None]:
    """For the world's start, and for each of its answers; fixtures of a module have such clients, too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hardware.sim.clients.bus.SILENCE", PATIENCE)
        patch.setattr(wire.connect, "__defaults__", (PATIENCE,))
        patch.setattr(SimServoBus.__init__, "__defaults__", (PATIENCE,))
        yield
