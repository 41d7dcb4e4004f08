"""Laws and DAE together: the exact law, hold and delay, what the approximation costs, printed beside projected."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from ruckig import InputParameter, Result, Ruckig
from ruckig import Trajectory as Profile

from controller.law.settings import LawSettings
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.kinematics import Status
from controller.model.reach import posture_at
from controller.model.second_order import arm_drift
from controller.offline import constrained
from controller.offline.simulation import ConstrainedArm, Moment, Trajectory
from hardware.parameters import load_parameters
from hardware.table import TableSettings, square_place

PARAMETERS = load_parameters()
MODEL = DeltaModel(PARAMETERS)
ARM = ConstrainedArm(MODEL, coulomb_speed=LawSettings().coulomb_speed)
TICK = PARAMETERS.drive.tick
CENTRE = np.array([0.0, 0.0, 0.45])
OFF_CENTRE = np.array([0.12, -0.10, 0.43])
STIFF = 70.0
"""ω of all axes in the air [rad/s]."""

Reference = Callable[[float], FloatArray]
Triple = tuple[float, float, float]


def controlled(
    torque: Callable[[TaskSpaceController, FloatArray], Triple], reference: Reference
) -> Callable[..., Triple]:
    """A law of the moment: estimate, then torque."""
    control = TaskSpaceController(MODEL)

    def law(moment: Moment) -> Triple:
        assert control.update(moment.angle, moment.rate) is Status.OK
        return torque(control, reference(moment.time))

    return law


def approximate(control: TaskSpaceController, reference: FloatArray) -> Triple:
    return control.torque(reference)


def exact_task(control: TaskSpaceController, reference: FloatArray) -> Triple:
    return control.exact_task_torque(reference)


def exact_joint(control: TaskSpaceController, reference: FloatArray) -> Triple:
    return control.exact_joint_torque(reference)


class Wave(NamedTuple):
    """Sines about a middle, each coordinate with its own amplitude, frequency and gains."""

    middle: FloatArray
    amplitude: FloatArray
    omega: FloatArray
    gain: FloatArray

    def __call__(self, time: float) -> FloatArray:
        angle = self.omega * time + np.arange(3.0)
        position = self.middle + self.amplitude * np.sin(angle)
        velocity = self.amplitude * self.omega * np.cos(angle)
        acceleration = -self.amplitude * self.omega**2 * np.sin(angle)
        return np.concatenate([position, velocity, acceleration, self.gain**2, 2.0 * self.gain, [0.0]])

    def error(self, time: FloatArray, first: FloatArray, rate: FloatArray) -> FloatArray:
        """(22) solved: critically damped, from an error and its rate at time 0, shape (n, 3)."""
        t = time[:, None]
        return (first + (rate + self.gain * first) * t) * np.exp(-self.gain * t)


def simulate(law: Callable[..., Triple], point: FloatArray, velocity: FloatArray, duration: float) -> Trajectory:
    return ARM.simulate(ARM.at(point, velocity), law, duration, rtol=1e-10, atol=1e-12)


# ------------------------------------------------------------------------------------------------------ the exact laws


def test_exact_law_in_joint_space_gives_eq_22_to_1e_6() -> None:
    """Continuous time, sines at up to 3 rad/s, started 0.1 rad and 1 rad/s off, three different gains."""
    start = ARM.at(OFF_CENTRE)
    y = start.q[constrained.MEASURED]
    amplitude, omega = np.array([0.25, 0.20, 0.15]), np.array([12.0, 15.0, 18.0])
    wave = Wave(y - amplitude * np.sin(np.arange(3.0)), amplitude, omega, np.array([20.0, 35.0, 50.0]))
    jacobian = constrained.virtual_jacobian(MODEL, start.q) @ constrained.tangent(MODEL, start.q)
    off = np.array([0.08, -0.1, 0.06])
    first_rate = wave(0.0)[3:6] + np.array([1.0, -0.5, 0.8])
    wave = wave._replace(middle=wave.middle - off)
    path = simulate(controlled(exact_joint, wave), OFF_CENTRE, jacobian @ first_rate, 0.6)
    reference = np.array([wave(t) for t in path.time])
    error = path.angle - reference[:, :3]
    expected = wave.error(path.time, error[0], first_rate - reference[0, 3:6])
    apart = np.abs(error - expected).max()
    speed = np.abs(path.rate).max()
    print(f"exact law (20): {apart:.1e} rad from (22), joints up to {speed:.1f} rad/s")
    assert speed > 3.5
    assert np.abs(error[0]).max() > 0.09
    assert apart < 1e-6


def test_exact_law_in_task_space_gives_the_same_for_the_tool() -> None:
    """With J̇_c ẏ and a put back, (23) is exact: a 30 mm error decays at 1 m/s as if nothing moved."""
    wave = Wave(
        OFF_CENTRE * 0.5 + CENTRE * 0.5, np.array([0.09, 0.08, 0.03]), np.array([8.0, 9.0, 12.0]), np.full(3, 30.0)
    )
    start = wave(0.0)
    off = np.array([0.03, -0.02, 0.01])
    path = simulate(controlled(exact_task, wave), start[:3] + off, start[3:6], 0.6)
    reference = np.array([wave(t) for t in path.time])
    expected = wave.error(path.time, off, np.zeros(3))
    apart = np.abs(path.position - reference[:, :3] - expected).max()
    speed = np.linalg.norm(path.velocity, axis=1).max()
    print(f"exact law in task space: {1e3 * apart:.1e} mm from the linear law, tool up to {speed:.2f} m/s")
    assert speed > 0.8
    assert apart < 1e-6


def test_leaving_a_out_of_eq_20_shows() -> None:
    """The joint-space check is sharp: the same loop without a misses (22) by more than a thousand times."""
    start = ARM.at(OFF_CENTRE)
    amplitude, omega = np.array([0.25, 0.20, 0.15]), np.array([12.0, 15.0, 18.0])
    middle = start.q[constrained.MEASURED] - amplitude * np.sin(np.arange(3.0))
    wave = Wave(middle, amplitude, omega, np.array([20.0, 35.0, 50.0]))
    jacobian = constrained.virtual_jacobian(MODEL, start.q) @ constrained.tangent(MODEL, start.q)

    def without_a(control: TaskSpaceController, reference: FloatArray) -> Triple:
        state = control.state
        wanted = reference[9:12] * (reference[:3] - state.angle) + reference[12:15] * (reference[3:6] - state.rate)
        u = state.inertia @ (wanted + reference[6:9]) + state.friction + state.gravity
        return float(u[0]), float(u[1]), float(u[2])

    path = simulate(controlled(without_a, wave), OFF_CENTRE, jacobian @ wave(0.0)[3:6], 0.4)
    error = np.abs(path.angle - np.array([wave(t)[:3] for t in path.time])).max()
    print(f"(20) without a: {error:.1e} rad from (22)")
    assert error > 1e-3


# ------------------------------------------------------------------------------------------- hold and one tick's delay


def test_hold_and_delay_cost_what_is_stated() -> None:
    """The same sines, torque held for 0.88 ms and a tick late: what is left of (22) is an error of the clock."""
    wave = Wave(CENTRE, np.array([0.09, 0.08, 0.03]), np.array([8.0, 9.0, 12.0]), np.full(3, STIFF))
    begin = wave(0.0)
    start = ARM.at(begin[:3], begin[3:6])
    ticks = round(0.8 / TICK)
    worst = {}
    for name, torque in (("exact", exact_task), ("approximate", approximate)):
        for delay in (0, 1):
            path = ARM.simulate_sampled(start, controlled(torque, wave), ticks, delay=delay)
            wanted = np.array([wave(t)[:3] for t in path.time])
            worst[name, delay] = 1e3 * np.linalg.norm(path.position - wanted, axis=1).max()
    for (name, delay), error in worst.items():
        print(f"{name} law in task space, held for a tick and {delay} late: {error:.3f} mm at worst")
    assert worst["exact", 0] < worst["exact", 1] < 0.3
    assert worst["approximate", 1] < 0.6


def test_a_step_with_hold_and_delay_stays_near_the_linear_law() -> None:
    """10 mm in z1 at the stiffest gains: hold and delay add an overshoot, stated in per cent of the step."""
    reference = pack_reference((0.01, 0.0, 0.45), stiffness=(STIFF**2,) * 3, damping=(2.0 * STIFF,) * 3)
    results = {}
    for delay in (0, 1):
        law = controlled(exact_task, lambda _: reference)
        path = ARM.simulate_sampled(ARM.at(CENTRE), law, round(0.2 / TICK), delay=delay)
        linear = 0.01 * (1.0 - (1.0 + STIFF * path.time) * np.exp(-STIFF * path.time))
        results[delay] = 100.0 * np.abs(path.position[:, 0] - linear).max() / 0.01
    print(f"10 mm step at ω = {STIFF:.0f} rad/s: {results[0]:.2f} % off (22) with hold, {results[1]:.2f} % with delay")
    assert results[0] < 3.0
    assert results[0] < results[1] < 6.0


# ---------------------------------------------------------------------------------------- what the approximation costs


class Line:
    """A straight line from rest to rest, time-optimal within speed, acceleration and jerk, as motions of a game are."""

    def __init__(self, start: FloatArray, goal: FloatArray, speed: float, acceleration: float, jerk: float) -> None:
        wanted = InputParameter(1)
        wanted.target_position = [float(np.linalg.norm(goal - start))]
        wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = [speed], [acceleration], [jerk]
        self.profile, self.start = Profile(1), start
        self.direction = (goal - start) / wanted.target_position[0]
        assert Ruckig(1).calculate(wanted, self.profile) == Result.Working

    def __call__(self, time: float) -> FloatArray:
        s, v, a = (value[0] for value in self.profile.at_time(min(time, self.profile.duration)))
        motion = [self.start + s * self.direction, v * self.direction, a * self.direction]
        return np.concatenate([*motion, np.full(3, STIFF**2), np.full(3, 2.0 * STIFF), [0.0]])


def chess_lines(speed: float, acceleration: float, jerk: float) -> list[Line]:
    """Between squares at the height at which pieces are carried, and straight down onto squares."""
    random, table = np.random.default_rng(1), TableSettings()
    lines = []
    for _ in range(20):
        a, b = random.choice(64, 2, replace=False)
        ends = [table.base_from_board(np.array([*table.xy(square_place(int(s))), 0.1])) for s in (a, b)]
        lines.append(Line(ends[0], ends[1], speed, acceleration, jerk))
    for square in (0, 7, 27, 60):
        ends = [table.base_from_board(np.array([*table.xy(square_place(square)), h])) for h in (0.1, 0.025)]
        lines.append(Line(ends[0], ends[1], min(speed, 0.45), acceleration, jerk))
    corners = [table.base_from_board(np.array([*table.xy(square_place(s)), 0.1])) for s in (0, 63)]
    return [*lines, Line(corners[0], corners[1], speed, acceleration, jerk)]


def residual_along(line: Line) -> tuple[float, float]:
    """Largest |J̇_c ẏ - J_c M_y⁻¹ a| [m/s²] and largest joint velocity [rad/s] along a perfectly tracked line."""
    control, largest, fastest = TaskSpaceController(MODEL), 0.0, 0.0
    for time in np.linspace(0.0, line.profile.duration, 60):
        row = line(time)
        q, v = ARM.at(row[:3], row[3:6])
        assert (
            control.update(tuple(q[constrained.MEASURED].tolist()), tuple(v[constrained.MEASURED].tolist()))
            is Status.OK
        )
        largest = max(largest, float(np.linalg.norm(control.residual())))
        fastest = max(fastest, float(np.abs(v[constrained.MEASURED]).max()))
    return largest, fastest


@pytest.mark.parametrize(
    ("profile", "residual", "tracking"), [((0.8, 15.0, 500.0), 1.0, 0.2), ((1.5, 25.0, 1000.0), 3.0, 0.6)]
)
def test_residual_of_the_approximate_law_at_the_speeds_of_chess(
    profile: tuple[float, float, float], residual: float, tracking: float
) -> None:
    """What (23) neglects, as an acceleration and as the tracking error it makes; exact law beside it."""
    lines = chess_lines(*profile)
    found = [residual_along(line) for line in lines]
    worst = lines[int(np.argmax([value for value, _ in found]))]
    errors = {}
    for name, torque in (("approximate", approximate), ("exact", exact_task)):
        path = ARM.simulate(
            ARM.at(worst(0.0)[:3]), controlled(torque, worst), worst.profile.duration, rtol=1e-8, atol=1e-10
        )
        wanted = np.array([worst(t)[:3] for t in path.time])
        errors[name] = 1e3 * float(np.linalg.norm(path.position - wanted, axis=1).max())
    largest, fastest = max(value for value, _ in found), max(rate for _, rate in found)
    print(
        f"chess at {profile[0]} m/s, joints up to {fastest:.1f} rad/s: (23) neglects up to {largest:.2f} m/s² "
        f"({100 * largest / profile[1]:.1f} % of the acceleration), {errors['approximate']:.3f} mm off at worst at "
        f"ω = {STIFF:.0f} rad/s; exact law {errors['exact']:.1e} mm"
    )
    assert largest < residual
    assert errors["approximate"] < tracking
    assert errors["exact"] < 1e-3
    assert errors["approximate"] > 20.0 * errors["exact"]


def test_the_residual_is_the_difference_between_law_and_plant() -> None:
    """The closed formula against the DAE: the tool gets v plus the residual, to rounding."""
    random, control = np.random.default_rng(2), TaskSpaceController(MODEL)
    for _ in range(20):
        point = CENTRE + random.uniform(-0.1, 0.1, 3) * (1.0, 1.0, 0.5)
        (q, v), asked = ARM.at(point, random.normal(0.0, 0.8, 3)), random.normal(0.0, 5.0, 3)
        control.reset()
        control.update(tuple(q[constrained.MEASURED].tolist()), tuple(v[constrained.MEASURED].tolist()))
        reference = pack_reference((0.0, 0.0, 0.0), acceleration=tuple(asked.tolist()))
        acceleration = ARM.accelerations(q, v, control.torque(reference)).acceleration
        moved = constrained.arm_jacobian(MODEL, 0, q[:3]) @ acceleration[:3]
        moved += arm_drift(MODEL.constants, 0, tuple(q[:3].tolist()), tuple(v[:3].tolist()))
        np.testing.assert_allclose(moved - asked, control.residual(), rtol=0, atol=1e-8)


@pytest.mark.parametrize("omega", [20.0, STIFF])
@pytest.mark.parametrize("point", [CENTRE, OFF_CENTRE, np.array([-0.14, -0.14, 0.45])], ids=["centre", "off", "corner"])
def test_a_step_in_z1_moves_z2_and_z3_by_less_than_two_per_cent(point: FloatArray, omega: float) -> None:
    size = 0.01
    goal = point + np.array([size, 0.0, 0.0])
    reference = pack_reference(tuple(goal.tolist()), stiffness=(omega**2,) * 3, damping=(2.0 * omega,) * 3)
    law = controlled(approximate, lambda _: reference)
    path = ARM.simulate_sampled(ARM.at(point), law, round(8.0 / omega / TICK), delay=1)
    aside = 100.0 * np.abs(path.position[:, 1:] - point[1:]).max(axis=0) / size
    linear = point[0] + size * (1.0 - (1.0 + omega * path.time) * np.exp(-omega * path.time))
    along = 100.0 * np.abs(path.position[:, 0] - linear).max() / size
    print(f"10 mm step at {point} m, ω = {omega:.0f}: z2 {aside[0]:.2f} %, z3 {aside[1]:.2f} %, z1 {along:.2f} % off")
    assert aside.max() < 2.0
    assert path.position[-1, 0] == pytest.approx(goal[0], abs=1e-4)


# ---------------------------------------------------------------------------------------- as printed, beside projected


def printed(control: TaskSpaceController, reference: FloatArray) -> Triple:
    """(23) with (19) to the letter: M̄11 + M̄12 ∂g/∂y for the inertia, D̄1, gravity by (15); J_c mended, see (12)."""
    state = control.state
    q = constrained.coordinates(state.angle, posture_at(MODEL, state.position).x)
    matrix = constrained.inertia_matrix(MODEL, q)[constrained.MEASURED]
    rates = constrained.tangent(MODEL, q)[constrained.UNMEASURED]
    inertia = matrix[:, constrained.MEASURED] + matrix[:, constrained.UNMEASURED] @ rates
    wanted = reference[9:12] * (reference[:3] - state.position) + reference[12:15] * (reference[3:6] - state.velocity)
    u = inertia @ state.jacobian_inverse @ (wanted + reference[6:9]) + state.friction
    u = u + constrained.gravity_compensation(MODEL, q)
    return float(u[0]), float(u[1]), float(u[2])


def test_printed_equations_beside_the_projected_ones() -> None:
    """The same 10 mm step off the centre and the same move: printed (19) is soft, cross-coupled and lags behind."""
    omega, size = 30.0, 0.01
    goal = OFF_CENTRE + np.array([size, 0.0, 0.0])
    reference = pack_reference(tuple(goal.tolist()), stiffness=(omega**2,) * 3, damping=(2.0 * omega,) * 3)
    line = Line(np.array([-0.14, 0.14, 0.37]), np.array([0.14, -0.14, 0.37]), 0.8, 15.0, 500.0)
    table = {}
    for name, torque in (("printed", printed), ("projected", approximate)):
        path = ARM.simulate(ARM.at(OFF_CENTRE), controlled(torque, lambda _: reference), 0.3, rtol=1e-7, atol=1e-9)
        linear = OFF_CENTRE[0] + size * (1.0 - (1.0 + omega * path.time) * np.exp(-omega * path.time))
        off = 100.0 * np.abs(path.position[:, 0] - linear).max() / size
        aside = 100.0 * np.abs(path.position[:, 1:] - OFF_CENTRE[1:]).max() / size
        move = ARM.simulate(
            ARM.at(line.start), controlled(torque, line), line.profile.duration, rtol=1e-7, atol=1e-9
        ).position  # fmt: skip
        times = np.linspace(0.0, line.profile.duration, len(move))
        lag = 1e3 * np.linalg.norm(move - np.array([line(t)[:3] for t in times]), axis=1).max()
        table[name] = (off, aside, lag)
        print(f"{name}: step {off:.2f} % off (22), {aside:.2f} % into z2 and z3; a1-h8 at 0.8 m/s {lag:.2f} mm off")
    assert table["printed"][0] > 10.0 > 2.0 > table["projected"][0]
    assert table["printed"][1] > 3.0 > 2.0 > table["projected"][1]
    assert table["printed"][2] > 1.0 > 0.2 > table["projected"][2]
