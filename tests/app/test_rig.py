"""What a rig refuses before any process starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.devices import RigFailed
from app.sim_rig import SimRig
from app.sim_settings import SimRigSettings
from hardware.sim.settings import WorldSettings
from hardware.table import TableSettings


def test_a_board_out_of_reach_is_refused_with_its_squares_before_anything_starts(tmp_path: Path) -> None:
    world = WorldSettings(pieces=(), home=(0.0, 0.0, 0.4), table=TableSettings(centre_in_base=(0.25, 0.0, 0.47)))
    said: list[str] = []
    with pytest.raises(
        RigFailed, match=r"does not fit: \d+ of 64 squares \(.*h1.*\) and .* tray places .* out of reach"
    ):
        SimRig(tmp_path / "run", SimRigSettings(world=world), said.append)
    assert said == []
    assert not (tmp_path / "run").exists()
