"""Where the arm is, as capsules: all that MuJoCo has of it lies within them, and history tells where it was."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.guard.arm_silhouette import ArmHistory, ArmPose, arm_capsules
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from controller.protocol.datagram_fields import Flag
from controller.protocol.messages import Telemetry
from hardware.parameters import load_parameters
from hardware.sim.bodies.arm import add_arm, inverse_kinematics
from hardware.table import TableSettings

PARAMETERS, TABLE = load_parameters(), TableSettings()
MOVING = ("proximal", "platform", "finger", "mount")


@pytest.fixture(scope="module")
def arm() -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The robot alone, in the board frame."""
    spec = mujoco.MjSpec()
    x, y, z = TABLE.board_from_base(np.zeros(3)).tolist()
    add_arm(spec, PARAMETERS, (x, y, z))
    model = spec.compile()
    return model, mujoco.MjData(model)


def surface(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Any:
    """Points all over a geom's surface, board frame (n, 3) [m]."""
    size, kind = model.geom_size[geom], model.geom_type[geom]
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 7)] * 3), axis=-1).reshape(-1, 3)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        local = grid * size
    else:
        turn = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
        circle = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1) * size[0]
        local = np.concatenate([circle + np.array([0.0, 0.0, h * size[1]]) for h in np.linspace(-1.0, 1.0, 9)])
    return data.geom_xpos[geom] + local @ data.geom_xmat[geom].reshape(3, 3).T


def outside(points: Any, ends: Any, radii: Any) -> float:
    """How far the farthest point is outside of all capsules [m]."""
    start, way = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.maximum((way**2).sum(axis=1), 1e-12)
    along = np.clip(((points[:, None] - start) * way).sum(axis=2) / length, 0.0, 1.0)
    nearest = start + along[..., None] * way
    return float((np.linalg.norm(points[:, None] - nearest, axis=2) - radii).min(axis=1).max())


@settings(max_examples=12)
@given(st.floats(-0.17, 0.17), st.floats(-0.15, 0.15), st.floats(0.30, 0.44), st.floats(0.0, 0.02))
def test_all_that_the_simulation_has_of_the_arm_lies_in_its_capsules(
    arm: tuple[mujoco.MjModel, mujoco.MjData], x: float, y: float, z: float, finger: float
) -> None:
    model, data = arm
    tool = np.array([x, y, z])
    joints = inverse_kinematics(PARAMETERS, tool)
    for k in range(3):
        for name, value in zip((f"servo{k + 1}", f"universal{k + 1}a", f"universal{k + 1}b"), joints[k], strict=True):
            data.joint(name).qpos[0] = value
    for axis, value in zip("xyz", tool, strict=True):
        data.joint(f"platform_{axis}").qpos[0] = value
    for name in ("finger_right", "finger_left"):
        data.joint(name).qpos[0] = finger
    mujoco.mj_kinematics(model, data)
    angles = posture_at(DeltaModel(PARAMETERS), tool).y
    a, b, c = np.asarray(angles).tolist()
    capsules = arm_capsules(PARAMETERS, TABLE, ArmPose((a, b, c), finger))
    checked = 0
    for geom in range(model.ngeom):
        name = model.body(model.geom_bodyid[geom]).name
        if name.startswith(MOVING):
            checked += 1
            assert outside(surface(model, data, geom), capsules.ends, capsules.radii) < 0.008, (name, geom)
    assert checked >= 12


# ------------------------------------------------------------------------------------------------------------ history

TICK = 0.001


def told(tick: int, angle: float, flags: Flag = Flag.NONE) -> Telemetry:
    arm = {"angle": (angle, 2.0 * angle, -angle), "finger_position": 0.01 * angle}
    return cast("Telemetry", SimpleNamespace(tick=tick, flags=flags, **arm))


def test_in_lockstep_what_is_told_besides_by_the_wall_clock_changes_nothing() -> None:
    """Two runs are then told the same of the same ticks."""
    one, other = ArmHistory(TICK), ArmHistory(TICK)
    for tick in range(0, 160, 16):
        for history in (one, other):
            history.take(told(tick, tick**2, Flag.LOCKSTEP))
        other.take(told(tick + tick % 13 + 1, tick**2 + 5.0, Flag.LOCKSTEP))
    assert [one.at(0.001 * k) for k in range(144)] == [other.at(0.001 * k) for k in range(144)]


def test_between_two_telemetries_the_pose_is_between_them() -> None:
    history = ArmHistory(TICK)
    for tick, angle in ((0, 0.0), (16, 1.0), (32, 3.0)):
        history.take(told(tick, angle))
    pose = history.at(0.020)
    assert pose is not None
    np.testing.assert_allclose(pose.angle, (1.5, 3.0, -1.5))
    assert pose.finger == pytest.approx(0.015)
    assert history.newest == pytest.approx(0.032)
    exact = history.at(0.016)
    assert exact is not None
    assert exact.angle == (1.0, 2.0, -1.0)


def test_nobody_can_say_where_the_arm_was_before_the_first_telemetry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.guard.arm_silhouette._MOST_WAIT", 0.01)
    history = ArmHistory(TICK, kept=0.05)
    assert history.at(0.0) is None
    for tick in range(0, 200, 10):
        history.take(told(tick, float(tick)))
    history.take(told(100, 7.0))  # late, and older than what is known
    assert history.at(0.02) is None
    assert history.at(0.300) is None
    pose = history.at(0.185)
    assert pose is not None
    assert pose.angle[0] == pytest.approx(185.0)
