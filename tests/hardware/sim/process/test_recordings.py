"""A world writes down where everything is: exactly at the ticks asked for, and it waits for nobody about it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from hardware.interfaces import HardwareError
from hardware.sim.clients.camera import SimClock
from hardware.sim.clients.referee import SimReferee
from hardware.sim.clients.trajectory import TrajectoryRecording
from hardware.sim.plant.trajectory import TrajectoryFile
from hardware.sim.process.scene_control import SceneControl
from hardware.sim.process.settings import WorldSettings
from hardware.sim.render.settings import MountSettings, SceneState
from tests.hardware.sim.process.test_world import TICK, Controller, WorldProcess, gl, settings_for

__all__ = ["gl"]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory, gl: bool) -> Iterator[WorldProcess]:
    if not gl:
        pytest.skip("a world with cameras needs OpenGL")
    one = WorldProcess(tmp_path_factory.mktemp("world"), settings_for(cameras=True), {})
    yield one
    one.kill()


def test_positions_are_recorded_while_time_runs(world: WorldProcess, tmp_path: Path) -> None:
    path, knocked = tmp_path / "positions.bin", MountSettings(shift=(0.0, 0.01, 0.0))
    with (
        Controller(world.run_dir) as controller,
        closing(SimClock(world.run_dir)) as clock,
        closing(SceneControl(world.run_dir)) as scene,
    ):
        begun = controller.settle()
        recording = TrajectoryRecording(world.run_dir, path, 20)
        assert controller.settle() == begun  # it needs no time of its own
        clock.sleep(50 * TICK)
        scene.change(mount=knocked)
        clock.sleep(50 * TICK)
        with closing(SimReferee(world.run_dir)) as referee:
            now = np.array(referee.positions())
        recording.finish()
        clock.sleep(50 * TICK)
    file = TrajectoryFile(path)
    frames = [(frame.tick, frame.positions.copy(), SceneState.model_validate(frame.note)) for frame in file.frames()]
    due = [tick for tick in range(begun + 1, begun + 101) if tick % 20 == 0]
    assert [tick for tick, _, _ in frames] == [begun, *due]
    assert frames[-1][1] == pytest.approx(now, abs=1e-6)
    assert [looks.mount == knocked for tick, _, looks in frames] == [tick > begun + 50 for tick, _, _ in frames]
    assert WorldSettings.model_validate(file.header.world) == settings_for(cameras=True)


def test_what_the_world_cannot_write_is_told(world: WorldProcess, tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match="No such file or directory"):
        TrajectoryRecording(world.run_dir, tmp_path / "nowhere" / "positions.bin", 20)
    (tmp_path / "taken").write_bytes(b"a record")
    with pytest.raises(HardwareError, match="File exists"):
        TrajectoryRecording(world.run_dir, tmp_path / "taken", 20)
    assert (tmp_path / "taken").read_bytes() == b"a record"


def test_a_world_that_is_killed_leaves_what_it_wrote(tmp_path: Path, gl: bool) -> None:
    if not gl:
        pytest.skip("a world with cameras needs OpenGL")
    world = WorldProcess(tmp_path / "run", settings_for(cameras=True), {})
    with closing(SimClock(world.run_dir)) as clock:  # time runs for it, also without a controller
        recording = TrajectoryRecording(world.run_dir, tmp_path / "positions.bin", 20)
        clock.sleep(100 * TICK)
    world.kill()
    recording.finish()
    span = TrajectoryFile(tmp_path / "positions.bin").span()
    assert span is not None
    assert span[1] - span[0] >= 80
