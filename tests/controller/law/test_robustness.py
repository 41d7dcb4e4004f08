"""Mass and torque off by 20 %: the loop in ticks, with hold, delay and differenced angles, stays stable."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.kinematics import Status
from controller.model.reach import posture_at
from controller.model.workspace import working_heights
from controller.offline import constrained
from controller.offline.simulation import ConstrainedArm, Moment
from hardware.parameters import RobotParameters, load_parameters
from hardware.table import TableSettings, square_place
from tests.controller.linear import linearise, sampled_loop

PARAMETERS = load_parameters()
MODEL = DeltaModel(PARAMETERS)
TICK = PARAMETERS.drive.tick
STEP = 1e-5
AIR, CONTACT = (70.0, 70.0, 70.0), (70.0, 70.0, 20.0)
"""ω of the axes in a game: in the air, and with z3 soft at the board [rad/s]."""


def weighing(factor: float) -> RobotParameters:
    """The robot with all its masses scaled."""
    inertia = PARAMETERS.inertia.model_dump()
    return PARAMETERS.model_copy(
        update={"inertia": PARAMETERS.inertia.model_copy(update={k: factor * v for k, v in inertia.items()})}
    )


def reference(point: FloatArray, omega: tuple[float, float, float]) -> FloatArray:
    k_p, k_v = (tuple(factor * w**power for w in omega) for factor, power in ((1.0, 2), (2.0, 1)))
    return pack_reference(tuple(point.tolist()), stiffness=k_p, damping=k_v)


class Law:
    """(23) of the nominal model at a reference at rest, as a plain function of (y, ẏ)."""

    def __init__(self, point: FloatArray, omega: tuple[float, float, float]) -> None:
        self.control, self.row = TaskSpaceController(MODEL), reference(point, omega)

    def __call__(self, state: FloatArray) -> FloatArray:
        self.control.reset()
        assert self.control.update(tuple(state[:3].tolist()), tuple(state[3:].tolist())) is Status.OK
        return np.array(self.control.torque(self.row))

    def feedback(self, angle: FloatArray) -> FloatArray:
        """∂u/∂(y, ẏ) at rest, shape (3, 6)."""
        rest = np.concatenate([angle, np.zeros(3)])
        columns = [(self(rest + STEP * u) - self(rest - STEP * u)) / (2.0 * STEP) for u in np.eye(6)]
        return np.stack(columns, axis=1)


def spectral_radius(model: DeltaModel, law: Law, gain: float, point: FloatArray, scale: float = 1.0) -> float:
    """Of the loop in ticks where it comes to rest with torques too strong or weak; ``scale`` raises the loop's gain."""
    angle = posture_at(MODEL, point).y
    for _ in range(4):  # Newton for gain · u(y) = τ_g(y): it rests a little off where masses or torques are wrong
        plant = linearise(model, angle)
        stiffness = -np.linalg.solve(plant.b[3:], plant.a[3:, :3])
        short = gain * law(np.concatenate([angle, np.zeros(3)])) - plant.holding
        slope = gain * law.feedback(angle)[:, :3] - stiffness
        angle = angle - np.linalg.solve(slope, short)
    loop = sampled_loop(
        linearise(model, angle), scale * gain * law.feedback(angle), TICK, delayed=True, differenced=True
    )
    return float(np.abs(np.linalg.eigvals(loop)).max())


def board_grid(stride: int) -> list[FloatArray]:
    table = TableSettings()
    return [
        table.base_from_board(np.array([*table.xy(square_place(8 * rank + file)), height]))
        for rank in range(0, 8, stride)
        for file in range(0, 8, stride)
        for height in working_heights()
    ]


@pytest.mark.slow
@pytest.mark.parametrize("omega", [AIR, CONTACT], ids=["air", "contact"])
def test_stable_with_masses_and_torques_off_by_twenty_per_cent(omega: tuple[float, float, float]) -> None:
    """Every other square in both directions and the corners, gripping and carrying, 9 combinations each."""
    worst: dict[tuple[float, float], float] = {}
    grid = [*board_grid(2), *board_grid(7)]
    models = {factor: DeltaModel(weighing(factor)) for factor in (0.8, 1.0, 1.2)}
    for point in grid:
        law = Law(point, omega)
        for mass, gain in product(models, (0.8, 1.0, 1.2)):
            radius = spectral_radius(models[mass], law, gain, point)
            worst[mass, gain] = max(worst.get((mass, gain), 0.0), radius)
    for (mass, gain), radius in worst.items():
        rate = -np.log(radius) / TICK
        print(f"ω = {omega}, mass x {mass}, torque x {gain}: |λ| at most {radius:.4f}, slowest decay {rate:.1f} 1/s")
    assert max(worst.values()) < 0.995
    assert -np.log(max(worst.values())) / TICK > 0.4 * min(omega)


def test_gain_margin_over_the_board() -> None:
    """How far the loop's gain can rise before a tick's hold and delay make it unstable; and how far ω."""
    margins = {}
    for point in board_grid(7):
        law = Law(point, AIR)
        low, high = 1.0, 40.0
        assert spectral_radius(MODEL, law, 1.0, point, high) > 1.0
        for _ in range(12):
            middle = 0.5 * (low + high)
            stable = spectral_radius(MODEL, law, 1.0, point, middle) < 1.0
            low, high = (middle, high) if stable else (low, middle)
        margins[tuple(point.round(3).tolist())] = low
    least = min(margins, key=lambda p: margins[p])
    print(
        f"gain margin at ω = 70 rad/s: {margins[least]:.2f} ({20 * np.log10(margins[least]):.1f} dB), least at {least}"
    )
    assert margins[least] > 3.0
    point = np.array([0.0, 0.0, 0.45])
    radii = {w: spectral_radius(MODEL, Law(point, (w, w, w)), 1.0, point) for w in (70.0, 150.0, 300.0, 400.0, 600.0)}
    print("spectral radius at the centre by ω:", {w: round(r, 3) for w, r in radii.items()})
    assert radii[70.0] < 0.97
    assert radii[600.0] > 1.0


@pytest.mark.parametrize(("mass", "gain"), [(0.8, 1.2), (1.2, 0.8)])
def test_the_dae_agrees_at_the_extremes(mass: float, gain: float) -> None:
    """A disturbed rest at a corner decays in the nonlinear plant as fast as its slowest eigenvalue says."""
    model = DeltaModel(weighing(mass))
    arm = ConstrainedArm(DeltaModel(model.parameters.model_copy(update={"friction": _without()})))
    point = np.array([0.14, -0.14, 0.45])
    row, control = reference(point, AIR), TaskSpaceController(MODEL)
    last: list[FloatArray] = []

    def controller(moment: Moment) -> FloatArray:
        angle = np.array(moment.angle)
        rate = (angle - last[-1]) / TICK if last else np.zeros(3)
        last[:] = [angle]
        assert control.update(moment.angle, tuple(rate.tolist())) is Status.OK
        return gain * np.array(control.torque(row))

    path = arm.simulate_sampled(arm.at(point), controller, round(1.0 / TICK))
    end = path.position[-1]
    away = np.linalg.norm(path.position - end, axis=1)
    radius = spectral_radius(model, Law(point, AIR), gain, point)
    print(
        f"mass x {mass}, torque x {gain}: rests {1e3 * np.linalg.norm(end - point):.2f} mm off, "
        f"|λ| {radius:.4f}, disturbance down to {away[400] / away[0]:.1e} in 400 ticks"
    )
    assert away[-100:].max() < 1e-6
    assert away[400] < 50.0 * away[0] * radius**400 + 1e-9


def _without() -> object:
    return PARAMETERS.friction.model_copy(update={"viscous": 0.0, "coulomb": 0.0})


def test_the_linear_loop_predicts_the_next_tick_of_the_dae() -> None:
    """12 states, three ticks from a small disturbance: hold, delay and differences are where they belong."""
    point = np.array([0.1, 0.05, 0.43])
    free = DeltaModel(PARAMETERS.model_copy(update={"friction": _without()}))
    arm, law = ConstrainedArm(free), Law(point, AIR)
    rest = arm.at(point)
    angle = rest.q[constrained.MEASURED]
    loop = sampled_loop(linearise(free, angle), law.feedback(angle), TICK, delayed=True, differenced=True)
    small = 1e-5 * np.array([1.0, -2.0, 1.5])
    q = rest.q.copy()
    q[constrained.MEASURED] += small
    last = [angle + small]

    def controller(moment: Moment) -> FloatArray:
        now = np.array(moment.angle)
        found = law(np.concatenate([now, (now - last[-1]) / TICK]))
        last[:] = [now]
        return found

    path = arm.simulate_sampled(arm.consistent(q, rest.v), controller, 20)
    holding = arm.holding_torque(rest.q)
    first = path.torque[0] - holding  # acts in the first two ticks
    row = np.concatenate([small, np.zeros(3), small, first])
    for k in range(20):
        np.testing.assert_allclose(path.angle[k] - angle, row[:3], rtol=2e-3, atol=2e-8)
        row = loop @ row
