"""The renderer's process: light, mount and noise in pictures as they are drawn."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from hardware.interfaces import HardwareError
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import CAMERAS, build_model
from hardware.sim.process.construction import Construction
from hardware.sim.process.randomisation import Randomisation
from hardware.sim.process.settings import stand_pieces
from hardware.sim.render.d435 import DEPTH_HEIGHT, DEPTH_WIDTH
from hardware.sim.render.drawing import draw_rods
from hardware.sim.render.renderer import DEPTH_BYTES, MODEL_FILE, Renderer, RenderRequest, Sensor, frame_path, make_slot
from hardware.sim.render.sensor_model import STEREO
from hardware.sim.render.settings import CameraSettings, ExposureSettings, LightSettings, MountSettings, SceneState
from hardware.table import TableSettings
from tests.hardware.sim.process.test_world import settings_for

TABLE = TableSettings()
IDEAL = CameraSettings(noise=False, depth_unit=1e-4)
BESIDE = (1.0, 0.0)
"""A bare place of the desk beside the board (x, y) [m]."""


class Studio:
    """A table with three pieces, and the renderer's process."""

    def __init__(self, folder: Path) -> None:
        settings = settings_for(randomisation=Randomisation(placement_sigma=0.0))
        model = build_model(load_parameters(), TABLE, stand_pieces(settings), np.array(settings.home))
        mujoco.mj_saveModel(model, str(folder / MODEL_FILE))
        make_slot(folder, 0)
        self._file = frame_path(folder, 0)
        self._positions = np.array(model.key_qpos[0])
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        above, hit = np.array([*BESIDE, 0.5]), np.zeros(1, np.int32)
        self.desk = 0.5 - mujoco.mj_ray(model, data, above, np.array([0.0, 0.0, -1.0]), None, 1, -1, hit)
        """Height of the desk beside the board [m]."""
        self.renderer = Renderer(folder)

    def shoot(
        self,
        camera: CameraSettings = IDEAL,
        seed: int = 1,
        tick: int = 1,
        depth: bool = True,
        colour: bool = True,
        **looks: Any,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Colour (h, w, 3) and depth (480, 848) [m]."""
        sensor = Sensor(camera=camera, seed=seed, tick=tick, depth=depth, colour=colour)
        shot = RenderRequest(slot=0, view="camera", looks=SceneState(**looks), sensor=sensor)
        self.renderer.request(shot, self._positions)
        self.renderer.take(wait=True)
        shape = (camera.height, camera.width, 3)
        picture = np.fromfile(self._file, np.uint8, offset=DEPTH_BYTES, count=math.prod(shape)).reshape(shape)
        units = np.fromfile(self._file, np.uint16, count=DEPTH_WIDTH * DEPTH_HEIGHT)
        return picture, units.reshape(DEPTH_HEIGHT, DEPTH_WIDTH) * camera.depth_unit


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    one = Studio(tmp_path_factory.mktemp("studio"))
    try:
        one.renderer.wait_ready()
    except HardwareError as error:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(error))
    yield one
    one.renderer.close()


def straight_down(height: float) -> MountSettings:
    """Beside the board, looking straight down from so high above its surface [m]."""
    pose = CAMERAS["camera"]
    tilt = math.atan2(pose.position[2] - pose.target[2], pose.position[1] - pose.target[1])
    place = np.array([*BESIDE, height]) - pose.position
    return MountSettings(shift=tuple(place), turn=(-(math.pi / 2.0 - tilt), 0.0, 0.0))


@pytest.mark.parametrize("distance", [0.35, 0.6])
def test_depth_of_the_desk_is_its_distance_and_errs_as_stated(studio: Studio, distance: float) -> None:
    mount = straight_down(studio.desk + distance)
    _, ideal = studio.shoot(mount=mount)
    middle = np.s_[100:380, 250:600]
    assert ideal[middle] == pytest.approx(distance, abs=2e-4), "the camera hangs as it was told to, and looks down"
    noisy = CameraSettings(depth_unit=1e-4)
    _, depth = studio.shoot(noisy, mount=mount)
    valid = depth[middle][depth[middle] > 0.0]
    sigma = distance**2 * math.hypot(STEREO.subpixel, STEREO.step / math.sqrt(12.0)) / STEREO.scale
    assert valid.std() == pytest.approx(sigma, rel=0.1)
    assert valid.mean() == pytest.approx(distance, abs=0.2 * sigma)
    assert valid.size / depth[middle].size > 0.99
    band = int(STEREO.scale / distance)
    assert not depth[:, : band - 3].any()


def test_the_same_seed_and_tick_give_the_same_bytes(studio: Studio) -> None:
    noisy = CameraSettings()
    colour, depth = studio.shoot(noisy)
    again = studio.shoot(noisy)
    assert (again[0] == colour).all()
    assert (again[1] == depth).all()
    for change in ({"seed": 2}, {"tick": 2}):
        other = studio.shoot(noisy, **change)
        assert (other[0] != colour).mean() > 0.5
        assert (other[1] != depth).mean() > 0.5
    assert (studio.shoot(noisy, depth=False)[0] == colour).all(), "a picture is the same without depth"


@pytest.mark.parametrize("when", ["at rest", "with a picture under way"])
def test_a_killed_renderer_is_replaced_and_draws_the_same_bytes(
    studio: Studio, when: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    noisy, light = CameraSettings(), LightSettings(brightness=0.4)
    colour, depth = studio.shoot(noisy, light=light)
    first = studio.renderer.pid
    if when == "at rest":
        os.kill(first, signal.SIGKILL)
    else:
        ask = studio.renderer.request

        def ask_and_kill(shot: RenderRequest, positions: Any) -> None:
            os.kill(first, signal.SIGSTOP)  # else it may have drawn before it is killed
            ask(shot, positions)
            os.kill(first, signal.SIGKILL)

        monkeypatch.setattr(studio.renderer, "request", ask_and_kill)
    again = studio.shoot(noisy, light=light)
    assert studio.renderer.pid != first
    assert (again[0] == colour).all()
    assert (again[1] == depth).all()


def test_a_renderer_that_ends_again_and_again_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo leaves a file of its own about a model that is not there
    renderer = Renderer(tmp_path)  # there is no model to draw
    with pytest.raises(HardwareError, match=r"stuck or has ended again and again; renderer\.log in the run directory"):
        renderer.take(wait=True)
    renderer.close()
    assert (tmp_path / "renderer.log").read_text(encoding="utf-8").count(MODEL_FILE) >= 2, "what each said is kept"


@pytest.mark.parametrize("brightness", [0.6, 1.2])
def test_depth_is_the_same_without_colour_but_at_edges_of_glare(studio: Studio, brightness: float) -> None:
    noisy, light = CameraSettings(), LightSettings(brightness=brightness)
    _, whole = studio.shoot(noisy, light=light)
    _, bare = studio.shoot(noisy, light=light, colour=False)
    both = (whole > 0.0) & (bare > 0.0)
    assert (whole[both] == bare[both]).all()
    assert ((whole == 0.0) != (bare == 0.0)).mean() < 0.01


def test_a_camera_turned_upside_down_sees_all_upside_down(studio: Studio) -> None:
    upright, _ = studio.shoot()
    turned, _ = studio.shoot(mount=MountSettings(turn=(0.0, 0.0, math.pi)))
    differ = np.abs(turned[::-1, ::-1].astype(int) - upright).max(axis=2) > 12
    assert differ.mean() < 0.02  # only edges, whose samples are not symmetric
    shifted, _ = studio.shoot(mount=MountSettings(shift=(0.01, 0.0, 0.0)))
    assert (np.abs(shifted.astype(int) - upright).max(axis=2) > 12).mean() > 0.03


def test_light_is_what_it_is_told_to_be(studio: Studio) -> None:
    usual, _ = studio.shoot()
    dark, _ = studio.shoot(light=LightSettings(brightness=0.0, fill=0.0, ambient=0.0))
    board = np.s_[150:350, 150:480]
    assert dark[board].max() <= 2
    red, _ = studio.shoot(light=LightSettings(colour=(1.0, 0.0, 0.0), fill=0.0, ambient=0.0, brightness=0.8))
    assert red[board][..., 1:].max() <= 2 < red[board][..., 0].mean()
    even, _ = studio.shoot(light=LightSettings(shadows=False))
    assert np.percentile(even.astype(int) - usual, 1.0) > -3, "without shadows nothing but edges is darker"
    assert (even.astype(int) - usual).max() > 40
    other, _ = studio.shoot(light=LightSettings(direction=(-0.9, 0.5, 1.0)))
    moved = np.abs(other.astype(int) - usual).max(axis=2) > 40
    assert moved.mean() > 0.01, "the lamp's shadows moved"
    back, _ = studio.shoot()
    assert (back == usual).all(), "and back again"


def test_a_large_lamp_has_soft_shadows(studio: Studio) -> None:
    """Between light and shadow much of the picture lies in half shadow."""

    def half_shadow(radius: float) -> float:
        lit, _ = studio.shoot(light=LightSettings(radius=radius, shadows=False))
        shaded, _ = studio.shoot(light=LightSettings(radius=radius))
        ratio = ((shaded[..., 1] + 1.0) / (lit[..., 1] + 1.0)) ** 2.2
        return float(((ratio > 0.66) & (ratio < 0.92)).mean())

    assert half_shadow(0.12) > 3.0 * half_shadow(0.0) + 0.01


def test_exposure_reaches_the_picture(studio: Studio) -> None:
    usual, _ = studio.shoot()
    longer, _ = studio.shoot(exposure=ExposureSettings(time=2.0))
    assert longer.mean() > 1.2 * usual.mean()
    wide, _ = studio.shoot(CameraSettings(noise=False, size="1280x720"))
    assert wide.shape == (720, 1280, 3)
    small = wide[::2, ::2][:, 80:560].mean()  # 4:3 out of the middle
    assert small == pytest.approx(usual.mean(), rel=0.1)


def test_settings_out_of_range_are_refused() -> None:
    with pytest.raises(ValidationError, match="lies below the table: give a direction whose third number is above 0"):
        LightSettings(direction=(1.0, 0.0, 0.0))
    with pytest.raises(ValidationError, match="Extra inputs are not permitted"):
        CameraSettings.model_validate({"sise": "640x480"})
    with pytest.raises(ValidationError):
        CameraSettings.model_validate({"size": "800x600"})
    with pytest.raises(ValidationError):
        ExposureSettings(gain=0.5)


def test_what_stood_in_memory_before_has_no_say_in_how_rods_are_drawn() -> None:
    """MuJoCo initialises some fields of a geom alone; the others decided, by chance, whether a rod had depth."""
    model = Construction.of(settings_for(cameras=True)).model(looks=True)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    drawn = []
    for garbage in (0, 77):
        scene = mujoco.MjvScene(model, maxgeom=16)
        for geom in scene.geoms:
            geom.category = geom.objtype = geom.objid = geom.segid = geom.transparent = geom.texcoord = garbage
            geom.camdist = geom.modelrbound = float(garbage)
        scene.ngeom = 0
        draw_rods(scene, data)
        fields = [name for name in dir(scene.geoms[0]) if not name.startswith("_")]
        drawn.append([[np.asarray(getattr(g, name)).tolist() for name in fields] for g in scene.geoms[: scene.ngeom]])
    assert len(drawn[0]) == 6
    assert drawn[0] == drawn[1]


def test_a_picture_is_the_same_whatever_number_of_threads_draws_it(
    studio: Studio, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a campaign's worker, which has no thread beside the one that draws."""
    monkeypatch.setenv("LP_NUM_THREADS", "0")
    lonely = Studio(tmp_path)
    try:
        lonely.renderer.wait_ready()
        assert b"LP_NUM_THREADS=0" in Path(f"/proc/{lonely.renderer.pid}/environ").read_bytes().split(b"\0")
        for colour in (True, False):
            one, other = (who.shoot(CameraSettings(), colour=colour) for who in (studio, lonely))
            assert all(np.array_equal(mine, theirs) for mine, theirs in zip(one, other, strict=True))
    finally:
        lonely.renderer.close()
