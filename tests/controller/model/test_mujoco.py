"""The same robot in MuJoCo, as the world builds it: bodies, hinges, slides and closures, from the parameters alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import FloatArray
from controller.model.constants import STANDARD_GRAVITY, DeltaModel
from controller.model.second_order import arm_drift
from controller.offline import constrained
from controller.offline.simulation import ArmMotion, ConstrainedArm, Moment
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import build_model
from hardware.table import TableSettings

PARAMETERS = load_parameters()
MODEL = DeltaModel(PARAMETERS)
TICK = PARAMETERS.drive.tick
STEPS = 10
"""Of MuJoCo in a tick: 0.088 ms each."""
ARM = ConstrainedArm(MODEL, coulomb_speed=0.005)
"""MuJoCo's dry friction is a constraint; here its sign is smoothed over little."""
JOINTS = [name.format(arm) for arm in (1, 2, 3) for name in ("servo{}", "universal{}a", "universal{}b")]


class World:
    """MuJoCo's arm over an empty board, at states and torques of our choice."""

    def __init__(self) -> None:
        model = build_model(PARAMETERS, TableSettings(), (), np.array([0.0, 0.0, 0.40]), TICK / STEPS)
        assert model.eq_solimp[:, :2].min() >= 0.9999
        assert model.opt.timestep <= 1e-4
        assert model.opt.gravity[2] == pytest.approx(-STANDARD_GRAVITY, rel=1e-3)
        model.opt.gravity[2] = -STANDARD_GRAVITY  # to the last digit, as 0.03 % is seen here
        self.model, self.data = model, mujoco.MjData(model)
        self.q = np.array([model.joint(name).qposadr[0] for name in JOINTS])
        self.v = np.array([model.joint(name).dofadr[0] for name in JOINTS])
        self.tool_q = np.array([model.joint(f"platform_{axis}").qposadr[0] for axis in "xyz"])
        self.tool_v = np.array([model.joint(f"platform_{axis}").dofadr[0] for axis in "xyz"])
        self.motors = np.array([model.actuator(f"servo{arm}").id for arm in (1, 2, 3)])

    def put(self, state: ArmMotion) -> None:
        """Universal joints have relative angles here: φ = atan2(d3, d2) - q1, χ = -asin d1 for a rod direction d."""
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        for k in (0, 3, 6):
            q1, q2, q3 = state.q[k : k + 3]
            v1, v2, v3 = state.v[k : k + 3]
            s2, c2, s3, c3 = np.sin(q2), np.cos(q2), np.sin(q3), np.cos(q3)
            d = np.array([s2 * s3, c2, s2 * c3])
            rate = v2 * np.array([c2 * s3, -s2, c2 * c3]) + v3 * np.array([s2 * c3, 0.0, -s2 * s3])
            square = d[1] ** 2 + d[2] ** 2
            lift = (d[1] * rate[2] - d[2] * rate[1]) / square
            self.data.qpos[self.q[k : k + 3]] = q1, np.arctan2(d[2], d[1]) - q1, -np.arcsin(d[0])
            self.data.qvel[self.v[k : k + 3]] = v1, lift - v1, -rate[0] / np.sqrt(square)
        self.data.qpos[self.tool_q] = constrained.tool_points(MODEL, state.q).mean(axis=0)
        self.data.qvel[self.tool_v] = constrained.virtual_jacobian(MODEL, state.q) @ state.v

    def run(self, torque: Callable[[float], Any], ticks: int) -> FloatArray:
        """Tool points at the start of each tick and at the end; the torque is asked at each step of MuJoCo."""
        found = [self.data.qpos[self.tool_q].copy()]
        for _ in range(ticks):
            for _ in range(STEPS):
                self.data.ctrl[self.motors] = torque(self.data.time)
                mujoco.mj_step(self.model, self.data)
            found.append(self.data.qpos[self.tool_q].copy())
        assert self.data.ncon == 0
        return np.array(found)


@pytest.fixture(scope="module")
def world() -> World:
    return World()


def tool_acceleration(q: FloatArray, v: FloatArray, acceleration: FloatArray) -> FloatArray:
    drift = arm_drift(MODEL.constants, 0, tuple(q[:3].tolist()), tuple(v[:3].tolist()))
    return constrained.arm_jacobian(MODEL, 0, q[:3]) @ acceleration[:3] + np.array(drift)


def test_accelerations_agree_within_a_per_cent(world: World) -> None:
    """All over the board, at about 0.9 m/s, with 0.5 N m beside the holding torque.

    Shafts faster than 0.05 rad/s only: MuJoCo lets slower ones stick, which is another law of friction.
    """
    random = np.random.default_rng(3)
    errors = []
    while len(errors) < 300:
        radius, phi = 0.2 * np.sqrt(random.uniform()), random.uniform(0.0, 2.0 * np.pi)
        point = (radius * np.cos(phi), radius * np.sin(phi), random.uniform(0.34, 0.44))
        state = ARM.at(point, random.normal(0.0, 0.5, 3))
        torque = ARM.holding_torque(state.q) + random.normal(0.0, 0.5, 3)
        if np.abs(state.v[constrained.MEASURED]).min() < 0.05:
            continue
        world.put(state)
        world.data.ctrl[world.motors] = torque
        mujoco.mj_forward(world.model, world.data)
        ours = tool_acceleration(*state, ARM.accelerations(*state, torque).acceleration)
        errors.append(np.linalg.norm(world.data.qacc[world.tool_v] - ours) / np.linalg.norm(ours))
    print(
        f"tool acceleration: {100 * np.mean(errors):.2f} % off MuJoCo's in the mean, {100 * max(errors):.2f} % at worst"
    )
    assert max(errors) < 0.01


def band_limited(seed: int) -> Callable[[float], FloatArray]:
    """Torque of three servomotors, sines up to 8 Hz from zero on, at most 0.2 N m each [N m]."""
    random = np.random.default_rng(seed)
    share = random.uniform(0.2, 1.0, (3, 4))
    share *= 0.2 / share.sum(axis=1, keepdims=True)
    omega = 2.0 * np.pi * random.uniform(1.0, 8.0, (3, 4))
    return lambda time: np.asarray((share * np.sin(omega * time)).sum(axis=1))


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.40), (0.14, -0.14, 0.43), (-0.10, 0.12, 0.36)])
def test_open_loop_paths_agree_within_a_millimetre(world: World, point: tuple[float, float, float]) -> None:
    start, ticks = ARM.at(point), round(0.3 / TICK)
    hold, more = ARM.holding_torque(start.q), band_limited(5)
    ours = ARM.simulate(
        start, lambda moment: hold + more(moment.time), ticks * TICK, rtol=1e-7, atol=1e-9,
        times=np.arange(ticks + 1) * TICK * (1.0 - 1e-15),
    )  # fmt: skip
    world.put(start)
    theirs = world.run(lambda time: hold + more(time), ticks)
    apart = np.linalg.norm(ours.position - theirs, axis=1).max()
    way = np.linalg.norm(ours.position[-1] - ours.position[0])
    print(f"open loop from {point}: {1e3 * way:.1f} mm in 0.3 s, {1e3 * apart:.3f} mm off MuJoCo's path at worst")
    assert way > 5e-3
    assert apart < 1e-3


def chess_move(time: float) -> FloatArray:
    """From over one corner of the board to the other and half way back, up and down, in a second: up to 1.4 m/s."""
    start, reach = np.array([-0.12, 0.12, 0.43]), np.array([0.24, -0.24, -0.06])
    u, rate = min(time / 0.5, 1.0), 2.0
    s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    s1 = rate * 30.0 * u**2 * (1.0 - u) ** 2
    s2 = rate**2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    if time > 0.5:
        u = (time - 0.5) / 0.5
        s = 1.0 - 0.5 * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        s1 = -0.5 * rate * 30.0 * u**2 * (1.0 - u) ** 2
        s2 = -0.5 * rate**2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    a, b, c = ((start + reach * s).tolist(), (reach * s1).tolist(), (reach * s2).tolist())
    return pack_reference(a, velocity=b, acceleration=c, stiffness=(4900.0,) * 3, damping=(140.0,) * 3)


def test_paths_under_the_law_agree_within_a_millimetre(world: World) -> None:
    """One second of a fast move under (23), asked every 0.88 ms in both worlds."""
    ticks = round(1.0 / TICK)
    start = ARM.at(chess_move(0.0)[:3])
    law = TaskSpaceController(MODEL)

    def controller(moment: Moment) -> tuple[float, float, float]:
        law.update(moment.angle, moment.rate)
        return law.torque(chess_move(moment.time))

    ours = ARM.simulate_sampled(start, controller, ticks, delay=0)
    other, held = TaskSpaceController(MODEL), np.zeros(3)
    servos = constrained.MEASURED

    def held_torque(time: float) -> FloatArray:
        tick = time / TICK
        if abs(tick - round(tick)) < 1e-6:
            angle, rate = world.data.qpos[world.q[servos]], world.data.qvel[world.v[servos]]
            other.update(tuple(angle.tolist()), tuple(rate.tolist()))
            held[:] = other.torque(chess_move(time))
        return held

    world.put(start)
    theirs = world.run(held_torque, ticks)
    wanted = np.array([chess_move(k * TICK)[:3] for k in range(ticks + 1)])
    apart = np.linalg.norm(ours.position - theirs, axis=1).max()
    off = np.linalg.norm(ours.position - wanted, axis=1).max()
    fastest = np.linalg.norm(ours.velocity, axis=1).max()
    print(
        f"under (23), 1 s, up to {fastest:.2f} m/s: {1e3 * apart:.3f} mm off MuJoCo's path, "
        f"{1e3 * off:.3f} mm off the reference"
    )
    assert fastest > 1.2
    assert apart < 1e-3
