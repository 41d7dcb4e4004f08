"""The renderer's process: draws the world at given joint positions into a file, until its socket closes."""

from __future__ import annotations

import os
import signal
import socket
import sys
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.sim.renderer import HEIGHT, MODEL_FILE, READY, REPLY, REQUEST, WIDTH, frame_bytes, frame_path

ROD_HALF_DISTANCE = 0.024
"""Between the rods of a pair, each from the middle [m]; they are drawn, the physics lumps them."""
ROD_RADIUS = 0.004
NICE = 5
"""Pictures step back behind the plant's ticks [steps of the scheduler's niceness]."""


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
            scene.ngeom += 1


def _serve(run_dir: Path, link: socket.socket) -> None:
    model = mujoco.MjModel.from_binary_path(str(run_dir / MODEL_FILE))
    data = mujoco.MjData(model)
    renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
    option = mujoco.MjvOption()
    option.geomgroup[3] = 0
    files: dict[int, NDArray[np.uint8]] = {}
    mujoco.mj_forward(model, data)
    renderer.update_scene(data, camera="camera", scene_option=option)
    renderer.render()  # the first picture is slow: shaders are compiled
    link.send(READY)
    while message := link.recv(1 << 16):
        slot, camera, depth = REQUEST.unpack_from(message)
        data.qpos[:] = np.frombuffer(message, dtype=np.float64, offset=REQUEST.size)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        renderer.update_scene(data, camera=camera.rstrip(b"\0").decode(), scene_option=option)
        draw_rods(renderer.scene, data)
        if slot not in files:
            files[slot] = np.memmap(frame_path(run_dir, slot), dtype=np.uint8, mode="w+", shape=(frame_bytes(),))
        picture = files[slot]
        pixels = WIDTH * HEIGHT
        picture[: 3 * pixels] = renderer.render().ravel()
        if depth:
            renderer.enable_depth_rendering()
            picture[3 * pixels :] = renderer.render().astype(np.float32).view(np.uint8).ravel()
            renderer.disable_depth_rendering()
        link.send(REPLY.pack(slot))


def main() -> None:
    """Entry of the process: run directory and inherited socket as arguments."""
    run_dir, number = Path(sys.argv[1]), int(sys.argv[2])
    # Only the world ends this process, by closing the socket; Ctrl-C in a terminal must not tear a picture.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICE)
    _serve(run_dir, socket.socket(fileno=number))


if __name__ == "__main__":
    main()
