"""The DAE in time: energy, closure, integrators against each other, forward against inverse, what is attached."""

from __future__ import annotations

import re

import numpy as np
import pytest

from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.kinematics import Status
from controller.model.reach import Unreachable
from controller.offline import constrained
from controller.offline.simulation import ArmMotion, ConstrainedArm, Method, Moment, SimulationFailed, Trajectory
from hardware.parameters import RobotParameters, load_parameters
from hardware.table import TableSettings, square_place
from tests.controller.linear import linearise

PARAMETERS = load_parameters()
MODEL = DeltaModel(PARAMETERS)
ARM = ConstrainedArm(MODEL)
CENTRE = (0.0, 0.0, 0.45)


def without_friction(parameters: RobotParameters = PARAMETERS) -> DeltaModel:
    still = parameters.friction.model_copy(update={"viscous": 0.0, "coulomb": 0.0})
    return DeltaModel(parameters.model_copy(update={"friction": still}))


FREE = ConstrainedArm(without_friction())


def limp(moment: Moment) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


# ------------------------------------------------------------------------------------------------------- at an instant


def random_states(count: int, arm: ConstrainedArm = ARM) -> list[tuple[ArmMotion, FloatArray, FloatArray]]:
    """Closed chain in motion, with torques and a force on the tool."""
    random = np.random.default_rng(8)
    found = []
    for _ in range(count):
        point = np.array([0.0, 0.0, 0.42]) + random.uniform(-0.12, 0.12, 3) * (1.0, 1.0, 0.5)
        state = arm.at(point, random.normal(0.0, 0.8, 3))
        found.append((state, random.normal(0.0, 2.0, 3), random.normal(0.0, 10.0, 3)))
    return found


def test_compiled_solution_is_the_one_of_the_full_system() -> None:
    """Arm by arm and a 6x6 against the 15x15 of (2b) and (2c); also with the chain open, where Baumgarte works."""
    random = np.random.default_rng(9)
    for state, torque, force in random_states(100):
        q, v = state.q + random.normal(0.0, 0.01, 9), state.v + random.normal(0.0, 0.1, 9)
        applied = constrained.input_matrix() @ torque + constrained.virtual_jacobian(MODEL, q).T @ force
        applied -= constrained.friction_torque(MODEL, v, ARM.coulomb_speed)
        expected = constrained.acceleration(MODEL, q, v, applied, ARM.baumgarte)
        found = ARM.accelerations(q, v, torque, force)
        np.testing.assert_allclose(found.acceleration, expected, rtol=1e-10, atol=1e-8)
        h_q = constrained.constraint_jacobian(MODEL, q)
        balance = constrained.inertia_matrix(MODEL, q) @ found.acceleration + constrained.coriolis_torque(MODEL, q, v)
        balance += constrained.gravity_torque(MODEL, q) - applied - h_q.T @ found.multiplier
        np.testing.assert_allclose(balance, 0.0, atol=1e-10)


def test_inverse_dynamics_undoes_forward_dynamics() -> None:
    for (q, v), torque, force in random_states(100):
        forward = ARM.accelerations(q, v, torque, force)
        back = ARM.torques(q, v, forward.acceleration[constrained.MEASURED], force)
        np.testing.assert_allclose(back.torque, torque, rtol=0, atol=1e-9)
        np.testing.assert_allclose(back.multiplier, forward.multiplier, rtol=0, atol=1e-9)


def test_a_force_on_the_tool_acts_through_both_jacobians_alike() -> None:
    """(10): τ_v = J_vᵀ f moves the robot as the servomotor torques J_cᵀ f do, away from singularities."""
    for (q, v), torque, force in random_states(50):
        as_torque = (constrained.virtual_jacobian(MODEL, q) @ constrained.tangent(MODEL, q)).T @ force
        pushed = ARM.accelerations(q, v, torque, force).acceleration
        driven = ARM.accelerations(q, v, torque + as_torque).acceleration
        np.testing.assert_allclose(pushed, driven, rtol=0, atol=1e-8)


def test_payload_is_a_mass_at_the_tool() -> None:
    """What hangs on the tool pulls with its weight and its inertia: 0.1 kg in place of an equal force."""
    payload = 0.1
    for (q, v), torque, _ in random_states(20):
        loaded = ARM.accelerations(q, v, torque, payload=payload).acceleration
        assert np.abs(loaded - ARM.accelerations(q, v, torque).acceleration).max() > 0.1
        jacobian = constrained.virtual_jacobian(MODEL, q)
        step = 1e-6
        ahead, behind = (constrained.virtual_jacobian(MODEL, q + s * step * v) for s in (1.0, -1.0))
        tool = jacobian @ loaded + (ahead - behind) @ v / (2.0 * step)
        reaction = payload * (np.array([0.0, 0.0, 9.80665]) - tool)
        same = ARM.accelerations(q, v, torque, reaction).acceleration
        np.testing.assert_allclose(loaded, same, rtol=0, atol=1e-5)


# ------------------------------------------------------------------------------------------------------------- in time


@pytest.mark.slow
@pytest.mark.parametrize(
    ("point", "velocity"), [((0.0, 0.0, 0.45), (0.3, -0.2, 0.0)), ((0.1, 0.05, 0.5), (0.0, 0.0, 0.0))]
)
def test_energy_of_the_free_robot_is_conserved_over_five_seconds(
    point: tuple[float, float, float], velocity: tuple[float, float, float]
) -> None:
    """No friction, no torque: arms fall through their stretched poses and swing, without a switch of model."""
    path = FREE.simulate(FREE.at(point, velocity), limp, 5.0)
    kinetic, potential = path.energy().T
    change = float(np.ptp(kinetic + potential)) / float(kinetic.max())
    elbows = np.cos(path.q[:, 0])  # arm 1 leaves the outward branch when it swings inward
    print(
        f"free swing from {point} m, 5 s: up to {kinetic.max():.2f} J kinetic, energy changes by {change:.1e} of it, "
        f"gap at most {path.gap().max():.1e} m, {path.evaluations} evaluations"
    )
    assert kinetic.max() > 1.5
    assert elbows.min() < -0.5 < 0.5 < elbows.max()
    assert change < 1e-6
    assert path.gap().max() < 1e-9


def test_friction_takes_exactly_the_energy_that_is_lost() -> None:
    path = ARM.simulate(ARM.at((0.1, 0.05, 0.5)), limp, 2.0)
    power = [
        constrained.friction_torque(MODEL, v, ARM.coulomb_speed)[constrained.MEASURED] @ rate
        for v, rate in zip(path.v, path.rate, strict=True)
    ]
    lost = np.trapezoid(power, path.time)
    total = path.energy().sum(axis=1)
    assert lost > 0.05
    assert total[0] - total[-1] == pytest.approx(lost, rel=1e-4)
    assert (np.diff(total) < 1e-9).all()


@pytest.mark.parametrize("method", ["RK45", "Radau", "LSODA", "RK4"])
def test_integrators_agree(method: Method) -> None:
    """Explicit and implicit, with error control and without."""
    start = FREE.at((0.1, -0.05, 0.42), (0.5, 0.2, -0.3))
    hold = FREE.holding_torque(start.q)

    def law(moment: Moment) -> FloatArray:
        return hold + 0.1 * np.sin(20.0 * moment.time + np.arange(3.0))

    best = FREE.simulate(start, law, 0.2, rtol=1e-12, atol=1e-13)
    other = FREE.simulate(start, law, 0.2, method=method, rtol=1e-9, atol=1e-11)
    assert np.abs(best.position - other.position).max() < 1e-8
    assert np.linalg.norm(best.position[-1] - best.position[0]) > 0.05


def test_rk4_is_of_fourth_order() -> None:
    start = FREE.at((0.1, -0.05, 0.42), (0.5, 0.2, -0.3))
    ends = np.array([0.0, 0.1])
    best = FREE.simulate(start, limp, 0.1, rtol=1e-13, atol=1e-14, times=ends).last
    errors = [
        np.abs(FREE.simulate(start, limp, 0.1, method="RK4", step=step, times=ends).last.q - best.q).max()
        for step in (4e-3, 2e-3, 1e-3)
    ]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders.min() > 3.5


def test_constraint_drift_stays_bounded_where_the_plain_index_reduction_lets_it_grow() -> None:
    """RK4 with a coarse step makes errors in h; Baumgarte pulls them in, ḧ = 0 alone adds them up."""
    start = FREE.at((0.1, 0.05, 0.5), (0.4, -0.3, 0.0))
    loose = ConstrainedArm(FREE.model, baumgarte=(1e-12, 1e-12))
    gaps = {
        name: arm.simulate(start, limp, 2.0, method="RK4", step=2e-3).gap()
        for name, arm in (("Baumgarte", FREE), ("plain", loose))
    }
    half = len(gaps["plain"]) // 2
    print("gap of the chain, RK4 with 2 ms [m]:", {name: f"{gap.max():.1e}" for name, gap in gaps.items()})
    assert gaps["Baumgarte"].max() < 1e-6
    assert gaps["plain"].max() > 10.0 * gaps["Baumgarte"].max()
    assert gaps["plain"][half:].max() > 1.5 * gaps["plain"][:half].max()


def test_an_open_chain_closes_as_baumgartes_polynomial_says() -> None:
    """h + α₁/α₀ ḣ + ... = 0: with a double pole at 200 1/s a gap shrinks as (1 + 200 t) exp(-200 t)."""
    state = ARM.at(CENTRE)
    gap = np.array([0.0, 1e-4, 0.0, 0.0, -5e-5, 0.0, 5e-5, 0.0, 1e-4])
    path = ARM.simulate(ArmMotion(state.q + gap, state.v), lambda moment: ARM.holding_torque(state.q), 0.05)
    h = np.array([constrained.constraint(MODEL, q) for q in path.q])
    expected = h[0] * ((1.0 + 200.0 * path.time) * np.exp(-200.0 * path.time))[:, None]
    np.testing.assert_allclose(h, expected, rtol=0, atol=1e-9)
    assert np.abs(h[0]).max() > 2e-5


def test_an_inconsistent_state_is_made_consistent() -> None:
    random = np.random.default_rng(4)
    state = ARM.at((0.1, 0.0, 0.40), (0.3, 0.2, -0.1))
    spoiled = ArmMotion(state.q.copy(), state.v.copy())
    spoiled.q[constrained.UNMEASURED] += random.normal(0.0, 0.02, 6)
    spoiled.v[constrained.UNMEASURED] += random.normal(0.0, 0.5, 6)
    found = ARM.consistent(*spoiled)
    np.testing.assert_allclose(found.q, state.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.v, state.v, rtol=0, atol=1e-8)


def test_a_state_at_a_point_has_the_velocity_asked() -> None:
    for point in ((0.0, 0.0, 0.45), (0.14, -0.14, 0.45), (-0.2, 0.05, 0.38)):
        velocity = (0.3, -0.7, 0.2)
        state = ARM.at(point, velocity)
        moment = Moment(0.0, state.q, state.v, np.empty(0), MODEL)
        np.testing.assert_allclose(moment.tool[0], point, rtol=0, atol=1e-12)
        np.testing.assert_allclose(moment.tool[1], velocity, rtol=0, atol=1e-12)
        np.testing.assert_allclose(constrained.constraint_jacobian(MODEL, state.q) @ state.v, 0.0, atol=1e-12)


# ----------------------------------------------------------------------------------------------- open-loop instability


def test_most_rest_positions_over_the_board_are_unstable_in_open_loop() -> None:
    """Held by a constant torque the arm leaves its place, as Bortoff (2018) reports: eigenvalues with Re > 0."""
    table = TableSettings()
    growth = {}
    for height in (0.02, 0.06, 0.10):
        corner = [(*table.xy(square_place(square)), height) for square in range(64)]
        points = table.base_from_board(np.array(corner))
        growth[height] = [linearise(FREE.model, FREE.at(p).q[constrained.MEASURED]).poles().real.max() for p in points]
    for height, rates in growth.items():
        unstable = sum(rate > 1e-6 for rate in rates)
        print(f"{1e3 * height:.0f} mm over the board: {unstable} of 64 squares unstable, fastest {max(rates):.2f} 1/s")
    assert all(rate > 1.0 for rate in growth[0.10])
    assert max(growth[0.02]) > 1.0


def test_the_dae_leaves_an_unstable_place_as_its_linearisation_says() -> None:
    """A nudge of 10 µrad along the unstable eigenvector grows by exp(s t)."""
    rest = FREE.at((0.0, 0.0, 0.36))
    hold = FREE.holding_torque(rest.q)
    plant = linearise(FREE.model, rest.q[constrained.MEASURED])
    poles, vectors = np.linalg.eig(plant.a)
    fastest = int(np.argmax(poles.real))
    growth, nudge = float(poles[fastest].real), 1e-5 * vectors[:, fastest].real
    assert abs(poles[fastest].imag) < 1e-9
    q, v = rest.q.copy(), rest.v.copy()
    q[constrained.MEASURED] += nudge[:3]
    v[constrained.MEASURED] += nudge[3:]
    path = FREE.simulate(FREE.consistent(q, v), lambda moment: hold, 0.8, rtol=1e-10, atol=1e-13)
    away = np.linalg.norm(path.angle - rest.q[constrained.MEASURED], axis=1)
    print(f"at (0, 0, 0.36) m a nudge grows with {growth:.2f} 1/s: by {away[-1] / away[0]:.0f} in 0.8 s")
    assert growth > 4.0
    np.testing.assert_allclose(away[200:], away[0] * np.exp(growth * path.time[200:]), rtol=0.01)


# --------------------------------------------------------------------------------------------------------- attachments


class Bumper:
    """A damped spring beside the tool along z1, and a low-pass that senses it."""

    def start(self) -> FloatArray:
        return np.zeros(1)

    def press(self, moment: Moment) -> float:
        (x, _, _), (speed, _, _) = moment.tool
        return min(0.0, -2e3 * (x - 0.005) - 20.0 * speed) if x > 0.005 else 0.0

    def rates(self, moment: Moment) -> FloatArray:
        return 100.0 * (np.array([self.press(moment)]) - moment.own)

    def force(self, moment: Moment) -> tuple[float, float, float]:
        return self.press(moment), 0.0, 0.0


def pushed(moment: Moment) -> tuple[float, float, float]:
    return 2.0, 0.0, 0.0


def test_an_attachment_acts_and_has_states_of_its_own() -> None:
    """Pushed by 2 N under gravity compensation the tool comes to rest on a bumper, which feels the 2 N."""

    control = TaskSpaceController(FREE.model)
    # no stiffness along z1; the bumper's damping is enough there
    reference = pack_reference(CENTRE, stiffness=(0.0, 900.0, 900.0), damping=(8.0, 60.0, 60.0))

    def law(moment: Moment) -> tuple[float, float, float]:
        assert control.update(moment.angle, moment.rate) is Status.OK
        return control.torque(reference)

    path = FREE.simulate(FREE.at(CENTRE), law, 1.0, pushed, attachment=Bumper(), rtol=1e-6, atol=1e-8, step=5e-3)
    assert path.own.shape == (len(path.time), 1)
    assert path.position[-1, 0] == pytest.approx(0.005 + 2.0 / 2e3, abs=2e-5)
    assert path.own[-1, 0] == pytest.approx(-2.0, rel=0.01)


# ------------------------------------------------------------------------------------------------------------ in ticks


def test_a_sampled_controller_is_asked_once_a_tick_and_its_torque_comes_late() -> None:
    hold = ARM.holding_torque(ARM.at(CENTRE).q)
    asked: list[float] = []

    def controller(moment: Moment) -> FloatArray:
        asked.append(moment.time)
        return hold + 0.01 * len(asked)

    path = ARM.simulate_sampled(ARM.at(CENTRE), controller, 5, delay=1)
    tick = PARAMETERS.drive.tick
    np.testing.assert_allclose(asked, tick * np.arange(5), rtol=1e-12)
    np.testing.assert_allclose((path.torque - hold)[:, 0] * 100.0, [1.0, 1.0, 2.0, 3.0, 4.0, 4.0], rtol=1e-9)
    prompt = ARM.simulate_sampled(ARM.at(CENTRE), lambda moment: hold + 10.0 * moment.time, 3, delay=0)
    np.testing.assert_allclose((prompt.torque - hold)[:, 0], 10.0 * tick * np.array([0, 1, 2, 2]), rtol=1e-9)
    assert path.time[-1] == pytest.approx(5 * tick)


def test_a_constant_torque_gives_the_same_path_sampled_or_not() -> None:
    start = ARM.at(CENTRE)
    torque = ARM.holding_torque(start.q) + np.array([0.1, -0.05, 0.02])
    ticks = 100
    sampled = ARM.simulate_sampled(start, lambda moment: torque, ticks)
    plain = ARM.simulate(start, lambda moment: torque, float(sampled.time[-1]), times=sampled.time)
    np.testing.assert_allclose(sampled.q, plain.q, rtol=0, atol=1e-9)
    assert isinstance(sampled, Trajectory)


# -------------------------------------------------------------------------------------------------------------- errors


def test_what_cannot_be_simulated_is_named() -> None:
    start = ARM.at(CENTRE)
    with pytest.raises(Unreachable, match="out of reach of arm 1"):
        ARM.at((0.0, 0.0, 0.9))
    lying = start.q.copy()
    lying[1] = np.pi
    with pytest.raises(
        SimulationFailed, match=r"^the equations of motion are singular at q = \[.*keep \|sin q_i2\| above"
    ):
        ARM.accelerations(lying, start.v, (0.0, 0.0, 0.0))
    apart = start.q.copy()
    apart[constrained.MEASURED] = -2.5, -1.0, 0.0
    sentence = "the chain cannot be closed at servomotor angles [-2.5, -1.0, 0.0] rad: start from angles that"
    with pytest.raises(SimulationFailed, match=f"^{re.escape(sentence)}"):
        ARM.consistent(apart, start.v)
    with pytest.raises(ValueError, match=r"^baumgarte \(-1\.0, 2\.0\) and coulomb_speed 0\.05 rad/s must be positive"):
        ConstrainedArm(MODEL, baumgarte=(-1.0, 2.0))
    with pytest.raises(ValueError, match=r"^times must be two or more that rise from 0 to at most 0\.1 s, these are"):
        ARM.simulate(start, limp, 0.1, times=np.array([0.0, 0.2]))
