"""What people around the table do to how it looks, over the world's real socket."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest

from hardware.interfaces import HardwareError
from hardware.sim.clients import wire
from hardware.sim.clients.camera import SimCamera
from hardware.sim.process.scene_control import SceneControl
from hardware.sim.render.settings import CameraSettings, ExposureSettings, LightSettings, MountSettings
from tests.hardware.sim.process.test_world import Controller, WorldProcess, settings_for

START = CameraSettings(size="1280x720", exposure=ExposureSettings(time=0.8), depth_unit=1e-4)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[WorldProcess]:
    one = WorldProcess(tmp_path_factory.mktemp("stage"), settings_for(cameras=True, camera=START), {})
    try:
        with closing(SimCamera(one.run_dir)):
            pass
    except HardwareError:
        if os.environ.get("CI") or "OpenGL" not in one.log:
            raise
        pytest.skip(one.log)
    yield one
    one.kill()


def test_changes_count_from_the_next_exposure_on(world: WorldProcess) -> None:
    with ExitStack() as stack:
        stage, controller = stack.enter_context(closing(SceneControl(world.run_dir))), Controller(world.run_dir)
        stack.enter_context(controller)
        camera = stack.enter_context(closing(SimCamera(world.run_dir)))
        assert stage.looks.exposure.time == 0.8, "as the settings say"
        before = camera.read()
        assert before.colour.shape == (720, 1280, 3)
        assert before.depth is not None
        assert before.depth.shape == (720, 1280)

        tick = stage.change(exposure=ExposureSettings(time=0.2))
        assert tick == controller.settle(), "plant time stands meanwhile"
        assert camera.read().colour.mean() < 0.7 * before.colour.mean()
        stage.change(light=LightSettings(brightness=0.0, fill=0.0, ambient=0.0))
        assert camera.read().colour.mean() < 5.0
        assert stage.looks.exposure.time == 0.2, "what is not named stays"
        stage.change(LightSettings(), ExposureSettings(time=0.8), MountSettings(shift=(0.0, 0.0, 0.05)))
        knocked = camera.read()
        assert knocked.depth is not None
        board = np.s_[400:600, 400:900]
        assert np.median(knocked.depth[board]) > np.median(before.depth[board]) + 0.02
        assert knocked.intrinsics == before.intrinsics, "the app knows nothing of it"

        with closing(SceneControl(world.run_dir)) as second:
            assert second.looks == stage.looks


@pytest.mark.parametrize(
    ("wish", "said"),
    [
        ({"lamp": {}}, "lamp: Extra inputs are not permitted"),
        ({"light": {"brightness": -1.0}}, "light.brightness: Input should be greater than or equal to 0"),
        ({"light": {"direction": [0.0, 1.0, -1.0]}}, "lies below the table"),
        ({"mount": {"shift": [0.0, 0.0]}}, "mount.shift"),
        ({"exposure": {"time": "long"}}, "exposure.time"),
    ],
)
def test_malformed_wishes_are_answered(world: WorldProcess, wish: dict[str, object], said: str) -> None:
    link, answer = wire.connect(world.run_dir, "stage")
    with closing(link):
        with pytest.raises(HardwareError, match=said.replace(".", r"\.")):
            wire.ask(link, wish)
        assert wire.ask(link, {})["looks"] == answer["looks"], "nothing has changed"


def test_pictures_have_no_depth_where_there_is_no_sensor(world: WorldProcess) -> None:
    with pytest.raises(HardwareError, match="the view 'film' has no depth: ask for frames without it"):
        SimCamera(world.run_dir, "film")
    link, _ = wire.connect(world.run_dir, "camera")
    with closing(link), pytest.raises(HardwareError, match="the view 'film' has no depth: 'camera' has"):
        wire.ask(link, {"camera": "film", "depth": True})


def test_a_stage_needs_a_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wire, "_reach", lambda _dir, _timeout: (_ for _ in ()).throw(HardwareError("no world")))
    with pytest.raises(HardwareError, match="no world"):
        SceneControl(tmp_path)
