"""What a rig refuses."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest

from app.rig.devices import RigFailed
from app.rig.rig_file import WorldSection
from app.rig.simulation.settings import own_rig
from app.rig.simulation.sim import SimRig, require_present
from hardware.sim.clients.wire import world_pid
from hardware.sim.plant.live_state import LIVE_FILE, LiveState
from hardware.table import TableSettings


def test_a_board_out_of_reach_is_refused_with_its_squares_and_nothing_is_left(tmp_path: Path) -> None:
    table = TableSettings(centre_in_base=(0.25, 0.0, 0.47))
    said: list[str] = []
    with pytest.raises(
        RigFailed, match=r"does not fit: \d+ of 64 squares \(.*h1.*\) and .* tray places .* out of reach"
    ):
        SimRig(own_rig(tmp_path / "run", WorldSection(), table=table), said.append)
    assert len(said) == 1
    assert world_pid(tmp_path / "run") is None


def test_a_world_that_is_older_than_the_record_is_not_gone_on_with(tmp_path: Path) -> None:
    require_present(tmp_path, 1.0, 0.001)  # nothing lies there: said elsewhere
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    LiveState(tmp_path / LIVE_FILE, model, mujoco.MjData(model), 1000)
    require_present(tmp_path, 1.005, 0.001)
    for _ in range(2):  # however often it is tried
        with pytest.raises(RigFailed, match=r"as it stood at 1\.00 s, but the record continues until 1\.50 s, so the"):
            require_present(tmp_path, 1.5, 0.001)
    (tmp_path / LIVE_FILE).write_bytes(b"nonsense")
    with pytest.raises(RigFailed, match="is not the state of a world: delete it"):
        require_present(tmp_path, 1.0, 0.001)
