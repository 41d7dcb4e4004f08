"""The arm as joints and solids: MuJoCo, which derives the robot by itself, has its joints in the same places."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.scene.arm import ArmJoints, arm_joints, finger_solids, leg_solids, tool_solids
from app.scene.solids import Cuboid, RoundBar
from controller.model.constants import DeltaModel
from controller.model.reach import PoseError, posture_at
from hardware.interfaces import Triple
from hardware.parameters import RobotParameters, load_parameters
from hardware.sim.bodies.arm import add_arm
from tests.app.scene.posed import arm_solids

PARAMETERS = load_parameters()
MODEL = DeltaModel(PARAMETERS)
UNREACHED = (-3.0, -1.5, 0.5)
"""Servomotor angles with the elbows too far apart [rad]."""
POINTS = (st.floats(-0.17, 0.17), st.floats(-0.15, 0.15), st.floats(0.30, 0.44))


def angles_at(*point: float) -> Triple:
    a, b, c = posture_at(MODEL, np.array(point)).y.tolist()
    return a, b, c


def rod_lengths(joints: ArmJoints) -> list[float]:
    return [math.dist(wrist, elbow) for wrist, elbow in zip(joints.wrists, joints.elbows, strict=True)]


@pytest.fixture(scope="module")
def simulated() -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The simulation's arm in its base frame: turned half about x where it hangs from the world's origin."""
    spec = mujoco.MjSpec()
    add_arm(spec, PARAMETERS, (0.0, 0.0, 0.0))
    model = spec.compile()
    return model, mujoco.MjData(model)


@settings(max_examples=25)
@given(*POINTS)
def test_joints_lie_where_the_simulation_has_them(
    simulated: tuple[mujoco.MjModel, mujoco.MjData], x: float, y: float, z: float
) -> None:
    model, data = simulated
    angle = angles_at(x, y, z)
    for arm, servo in enumerate(angle):
        data.joint(f"servo{arm + 1}").qpos[0] = servo
    for axis, value in zip("xyz", (x, y, z), strict=True):
        data.joint(f"platform_{axis}").qpos[0] = value
    mujoco.mj_kinematics(model, data)
    joints = arm_joints(MODEL, angle)
    base = np.array([1.0, -1.0, -1.0])  # the world's axes in the base frame
    assert joints.tool == pytest.approx((x, y, z), abs=1e-9)
    for arm in range(3):
        shoulder, elbow = data.body(f"proximal{arm + 1}").xpos, data.site(f"elbow{arm + 1}").xpos
        assert base * shoulder == pytest.approx(joints.shoulders[arm], abs=1e-9)
        assert base * elbow == pytest.approx(joints.elbows[arm], abs=1e-9)
        assert base * data.site(f"flange_joint{arm + 1}").xpos == pytest.approx(joints.wrists[arm], abs=1e-9)


@settings(max_examples=25)
@given(*POINTS)
def test_rods_are_as_long_as_the_robots(x: float, y: float, z: float) -> None:
    joints = arm_joints(MODEL, angles_at(x, y, z))
    assert rod_lengths(joints) == pytest.approx([PARAMETERS.geometry.distal_length] * 3, abs=1e-9)
    bars = leg_solids(joints)
    lengths = sorted({round(math.dist(bar.start, bar.end), 9) for bar in bars})
    assert PARAMETERS.geometry.distal_length in lengths
    assert PARAMETERS.geometry.proximal_length in lengths
    assert sum(math.isclose(math.dist(b.start, b.end), PARAMETERS.geometry.distal_length) for b in bars) == 6


@pytest.mark.parametrize(
    ("angle", "why"), [((math.nan, 0.0, 0.0), "are not finite"), (UNREACHED, "allow no pose of the tool")]
)
def test_angles_without_a_pose_are_refused(angle: Triple, why: str) -> None:
    with pytest.raises(PoseError, match=why):
        arm_joints(MODEL, angle)


@given(st.floats(0.0, PARAMETERS.gripper.stroke))
def test_pads_are_as_far_apart_as_the_fingers_are_open(finger: float) -> None:
    joints = arm_joints(MODEL, angles_at(0.02, -0.05, 0.4))
    pads = [s for s in arm_solids(PARAMETERS, joints, finger) if isinstance(s, Cuboid)][-2:]
    right, left = (pad.centre[0] - side * pad.size[0] / 2.0 for pad, side in zip(pads, (1, -1), strict=True))
    assert right - joints.tool[0] == pytest.approx(finger, abs=1e-12)
    assert joints.tool[0] - left == pytest.approx(finger, abs=1e-12)


def test_what_hangs_from_the_flange_reaches_from_it_to_the_pads() -> None:
    flange, body = tool_solids(PARAMETERS)
    assert isinstance(flange, RoundBar)
    assert isinstance(body, Cuboid)
    assert flange.start[2] < -PARAMETERS.geometry.gripper_height < flange.end[2]
    assert flange.radius == PARAMETERS.geometry.flange_radius
    for side in (1, -1):
        bar, pad = finger_solids(PARAMETERS, side)
        assert isinstance(bar, RoundBar)
        assert isinstance(pad, Cuboid)
        assert abs(bar.start[2] - body.centre[2]) < body.size[2] / 2.0, "the fingers hang in the body"
        assert bar.end[2] == pad.centre[2] == 0.0, "and end at the tool point's height"


def test_another_robot_is_drawn_with_its_own_lengths() -> None:
    longer = PARAMETERS.model_dump()
    longer["geometry"]["distal_length"] = 0.45
    model = DeltaModel(RobotParameters.model_validate(longer))
    a, b, c = posture_at(model, np.array([0.0, 0.0, 0.45])).y.tolist()
    joints = arm_joints(model, (a, b, c))
    assert rod_lengths(joints) == pytest.approx([0.45] * 3)
