"""The renderer's process: draws the world at given joint positions into a file, until its socket closes."""

import atexit
import gc
import os
import signal
import socket
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.sim.render.camera_mount import Mount
from hardware.sim.render.d435 import DEPTH_HEIGHT, DEPTH_WIDTH, GLANCE, LEFT_IMAGER, colour_intrinsics
from hardware.sim.render.lamps import set_lamps
from hardware.sim.render.quality import GLARE, LOOK, PictureQuality
from hardware.sim.render.rasteriser import FreeView, Rasteriser
from hardware.sim.render.renderer import (
    DEPTH_BYTES,
    FRAME_BYTES,
    GO,
    HEIGHT,
    LOG_FILE,
    MODEL_FILE,
    READY,
    REPLY,
    WIDTH,
    RenderRequest,
    Sensor,
    frame_path,
    unpack_request,
)
from hardware.sim.render.sensor_model import (
    COLOUR,
    GLANCING,
    STEREO,
    colour_picture,
    depth_picture,
    seen_from_left,
    whole_units,
)
from hardware.sim.render.settings import SceneState

ROD_HALF_DISTANCE = 0.024
"""Between the rods of a pair, each from the middle [m]; they are drawn, the physics lumps them."""
ROD_RADIUS = 0.004
COARSE = 2
"""What tells of glare alone has so many times fewer pixels along each axis."""
NICE = 5
"""Pictures step back behind the plant's ticks [steps of the scheduler's niceness]."""
SENSOR_VIEW = "camera"
"""The view that the RGB-D camera has."""
_COLOUR_NOISE, _DEPTH_NOISE, _GLANCE_NOISE = 0, 1, 2
"""Noise of the two sensors is drawn apart, so that a picture is the same with and without depth."""


def draw_rods(scene: mujoco.MjvScene, data: mujoco.MjData) -> None:
    """The pair of distal rods of each arm, drawn where they are; the physics lumps them."""
    for arm in (1, 2, 3):
        elbow, flange = data.site(f"elbow{arm}").xpos, data.site(f"flange_joint{arm}").xpos
        tangent = data.body(f"mount{arm}").xmat.reshape(3, 3)[:, 0]
        for side in (-1.0, 1.0):
            shift = side * ROD_HALF_DISTANCE * tangent
            geom = scene.geoms[scene.ngeom]
            rgba = np.array([0.1, 0.1, 0.11, 1.0], dtype=np.float32)
            mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
            mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, ROD_RADIUS, elbow + shift, flange + shift)
            # MuJoCo leaves these as they were in memory, and a geom of another category has no depth
            geom.category, geom.objtype = mujoco.mjtCatBit.mjCAT_DYNAMIC, mujoco.mjtObj.mjOBJ_UNKNOWN
            geom.objid = geom.segid = -1
            geom.transparent = geom.texcoord = 0
            geom.camdist = geom.modelrbound = 0.0
            scene.ngeom += 1


class SceneDrawer:
    """The world as it is drawn: a model of its own, compiled with looks."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        # with sleep on, MuJoCo would leave lamps and cameras where they were at first
        model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        self._data = mujoco.MjData(model)
        self._rasteriser = Rasteriser(model, draw_rods)
        self._mount = Mount(model, SENSOR_VIEW)
        self._aside = ThreadPoolExecutor(1, "colour")
        self._looks = SceneState()  # as the scene is compiled
        mujoco.mj_forward(model, self._data)

    def draw(self, shot: RenderRequest, positions: NDArray[np.float64], file: NDArray[np.uint8]) -> None:
        """Draw a picture of all joints' positions (nq,) into the bytes of a slot's file, shape (``FRAME_BYTES``,)."""
        self.arrange(positions, shot.looks)
        sensor = shot.sensor
        if sensor is not None and sensor.glance:
            self._mount.look(self._looks.mount, depth=True)
            units = self._glimpse(sensor)
            file[: 2 * units.size] = units.view(np.uint8).ravel()
            return
        if sensor is not None and not sensor.colour:
            self._sense_depth(sensor, file, self._glance(sensor))
            return
        picture = self._sense(sensor, file) if sensor is not None else self.see(shot.view, WIDTH, HEIGHT, shot.quality)
        file[DEPTH_BYTES : DEPTH_BYTES + picture.size] = picture.ravel()

    def arrange(self, positions: NDArray[np.float64], looks: SceneState | None = None) -> None:
        """Let all joints be at their positions (nq,); None: light and camera are as they were before."""
        self._data.qpos[:] = positions
        mujoco.mj_kinematics(self._model, self._data)
        if looks is not None and looks.light != self._looks.light:
            set_lamps(self._model, looks.light)
        self._looks = looks or self._looks
        self._mount.look(self._looks.mount, depth=False)

    def see(self, view: str | FreeView, width: int, height: int, quality: PictureQuality) -> NDArray[np.uint8]:
        """A clean picture of a view, RGB (height, width, 3)."""
        mujoco.mj_camlight(self._model, self._data)
        self._rasteriser.aim(self._data, view)
        return self._rasteriser.colour(width, height, quality)

    def warm_up(self) -> None:
        """Draw once. Raises whatever OpenGL raises where it does not work; the world tells the last line of it."""
        self.see(SENSOR_VIEW, WIDTH, HEIGHT, LOOK)

    def close(self) -> None:
        """Give OpenGL back."""
        self._aside.shutdown()
        self._rasteriser.close()

    def _sense(self, sensor: Sensor, file: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The colour picture; depth goes into the file at once, if it is wanted."""
        camera, exposure = sensor.camera, self._looks.exposure
        ideal = self.see(SENSOR_VIEW, camera.width, camera.height, LOOK)
        errors = self._aside.submit(  # beside depth and its own errors, which take as long
            colour_picture, ideal, COLOUR.noisier(camera.noise) if camera.noise else None, exposure=exposure.time,
            gain=exposure.gain, white_balance=exposure.white_balance, rng=_noise(sensor, _COLOUR_NOISE),
        )  # fmt: skip
        if sensor.depth:
            self._sense_depth(sensor, file, ideal)
        return errors.result()

    def _sense_depth(self, sensor: Sensor, file: NDArray[np.uint8], ideal: NDArray[np.uint8]) -> None:
        self._mount.look(self._looks.mount, depth=True)
        units = self._measure(sensor, self._see_depth(), ideal)
        file[:DEPTH_BYTES] = units.view(np.uint8).ravel()

    def _glimpse(self, sensor: Sensor) -> NDArray[np.uint16]:
        """Coarse depth without glare, which takes four times as long: the board glares, not what is before it."""
        depth, camera = self._see_depth(DEPTH_WIDTH // GLANCE, DEPTH_HEIGHT // GLANCE, coarse=True), sensor.camera
        if not camera.noise:
            return whole_units(depth, camera.depth_unit)
        noise = _noise(sensor, _GLANCE_NOISE)
        return depth_picture(depth, None, GLANCING.noisier(camera.noise), camera.depth_unit, noise)

    def _glance(self, sensor: Sensor) -> NDArray[np.uint8]:
        """Where it is so bright that depth fails, for a frame without colour: coarse, and without smooth edges.

        With shadows, although they take most of its time: OpenGL cuts off the light of all lamps together where there
        are none, and bright squares would not glare.
        """
        width, height = sensor.camera.width // COARSE, sensor.camera.height // COARSE
        return self.see(SENSOR_VIEW, width, height, GLARE)

    def _measure(self, sensor: Sensor, depth: NDArray[np.float32], ideal: NDArray[np.uint8]) -> NDArray[np.uint16]:
        camera = sensor.camera
        if not camera.noise:
            return whole_units(depth, camera.depth_unit)
        pinhole = colour_intrinsics(ideal.shape[1], ideal.shape[0])
        grey = seen_from_left(ideal, pinhole, depth, STEREO.intrinsics, LEFT_IMAGER)
        return depth_picture(depth, grey, STEREO.noisier(camera.noise), camera.depth_unit, _noise(sensor, _DEPTH_NOISE))

    def _see_depth(
        self, width: int = DEPTH_WIDTH, height: int = DEPTH_HEIGHT, *, coarse: bool = False
    ) -> NDArray[np.float32]:
        mujoco.mj_camlight(self._model, self._data)
        self._rasteriser.aim(self._data, SENSOR_VIEW)
        return self._rasteriser.depth(width, height, coarse=coarse)


def _noise(sensor: Sensor, which: int) -> np.random.Generator:
    """The same for the same world at the same tick, whoever looks and however often."""
    return np.random.default_rng([sensor.seed, sensor.tick, which])


def _say_into(log: Path) -> None:
    """From here on what this process says goes there."""
    with log.open("ab") as file:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(file.fileno(), stream.fileno())


def _serve(run_dir: Path, link: socket.socket) -> None:
    if link.recv(1 << 16) != GO:
        return  # nobody wants pictures
    _say_into(run_dir / LOG_FILE)
    drawer = SceneDrawer(mujoco.MjModel.from_binary_path(str(run_dir / MODEL_FILE)))
    drawer.warm_up()  # the first picture is slow: shaders are compiled
    files: dict[int, NDArray[np.uint8]] = {}
    link.send(READY)
    while message := link.recv(1 << 16):
        shot, positions = unpack_request(message)
        if shot.slot not in files:
            path = frame_path(run_dir, shot.slot)
            files[shot.slot] = np.memmap(path, dtype=np.uint8, mode="r+", shape=(FRAME_BYTES,))
        drawer.draw(shot, positions, files[shot.slot])
        link.send(REPLY.pack(shot.slot))
    drawer.close()


def main() -> None:
    """Entry of the process: run directory and inherited socket as arguments."""
    run_dir, number = Path(sys.argv[1]), int(sys.argv[2])
    # Only the world ends this process, by closing the socket; Ctrl-C in a terminal must not tear a picture.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICE)
    atexit.register(gc.freeze)  # the end is not held up by a search for what could be thrown away
    _serve(run_dir, socket.socket(fileno=number))


if __name__ == "__main__":
    main()
