"""Frames and what rests in them: put together they are the arm in its pose."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.rig.simulation.nominal_view import nominal_pose
from app.scene.arm import arm_joints
from app.scene.frames import BOARD, FramePose, fixed_frames, moving_frames, quaternion_of, robot_solids, turned_by
from app.scene.solids import Cuboid, RoundBar
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from hardware.interfaces import Triple
from hardware.parameters import load_parameters
from hardware.table import TableSettings
from tests.app.scene.posed import arm_solids

PARAMETERS = load_parameters()
MODEL = DeltaModel(PARAMETERS)
NUMBERS = st.floats(-1.0, 1.0)


def in_base(frames: dict[str, FramePose], frame: str, point: Triple) -> np.ndarray:
    while frame != "base":
        pose = frames[frame]
        point = tuple(np.add(turned_by(pose.turned, point), pose.at).tolist())  # type: ignore[assignment]
        frame = pose.parent
    return np.array(point)


@given(st.floats(-0.17, 0.17), st.floats(-0.15, 0.15), st.floats(0.30, 0.44), st.floats(0.0, 0.022))
def test_frames_and_solids_together_are_the_arm(x: float, y: float, z: float, finger: float) -> None:
    a, b, c = posture_at(MODEL, np.array([x, y, z])).y.tolist()
    joints = arm_joints(MODEL, (a, b, c))
    frames = {pose.child: pose for pose in moving_frames(joints, finger, (0.0, 0.0, 0.4))}
    bars = [s for s in arm_solids(PARAMETERS, joints, finger) if isinstance(s, RoundBar)]
    blocks = [s for s in arm_solids(PARAMETERS, joints, finger) if isinstance(s, Cuboid)]
    framed = [(part.frame, solid) for part in robot_solids(PARAMETERS) for solid in part.solids]
    assert len(framed) == len(bars) + len(blocks)
    for frame, solid in framed:
        if isinstance(solid, Cuboid):
            centre = in_base(frames, frame, solid.centre)
            assert min(math.dist(centre, block.centre) for block in blocks) < 1e-9
        else:
            ends = in_base(frames, frame, solid.start), in_base(frames, frame, solid.end)
            assert any(
                bar.radius == solid.radius
                and (
                    math.dist(ends[0], bar.start) + math.dist(ends[1], bar.end) < 1e-8
                    or math.dist(ends[1], bar.start) + math.dist(ends[0], bar.end) < 1e-8
                )
                for bar in bars
            ), (frame, solid)


@given(NUMBERS, NUMBERS, NUMBERS, NUMBERS)
def test_quaternions_turn_as_their_matrices_do(x: float, y: float, z: float, w: float) -> None:
    length = math.hypot(x, y, z, w)
    if length < 1e-3:
        return
    q = (x / length, y / length, z / length, w / length)
    columns = [turned_by(q, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    again = quaternion_of(np.array(columns).T.tolist())
    assert math.hypot(*again) == pytest.approx(1.0)
    assert abs(sum(p * r for p, r in zip(q, again, strict=True))) == pytest.approx(1.0), "q and -q are one turn"


@pytest.mark.parametrize("yaw", [0.0, 0.03, -0.02])
def test_the_base_hangs_where_the_table_says(yaw: float) -> None:
    table = TableSettings(centre_in_base=(0.01, -0.02, 0.47), yaw_in_base=yaw)
    (pose,) = fixed_frames(table)
    assert pose.parent == BOARD
    camera_from_board = nominal_pose(table)
    again, camera = fixed_frames(table, np.linalg.inv(camera_from_board)[:3].tolist())
    assert again == pose
    assert (camera.parent, camera.child) == (BOARD, "camera")
    for point in ((0.0, 0.0, 0.0), (0.02, -0.05, 0.4)):
        there = np.add(turned_by(camera.turned, point), camera.at)
        assert (camera_from_board @ [*there, 1.0])[:3] == pytest.approx(point, abs=1e-9)
    for point in ((0.0, 0.0, 0.0), (0.1, -0.05, 0.4)):
        seen = np.add(turned_by(pose.turned, point), pose.at)
        assert seen == pytest.approx(table.board_from_base(np.array(point)), abs=1e-12)
