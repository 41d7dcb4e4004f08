"""Dynamics: closed forms against energies of many mass points, projection against the paper's nine coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from controller.model.compiled import FloatArray
from controller.model.constants import PLATFORM_MASS, STANDARD_GRAVITY, DeltaModel
from controller.model.dynamics import (
    arm_coriolis,
    arm_energy,
    arm_gravity,
    arm_inertia,
    gravity_torque,
    joint_inertia,
    shaft_friction,
)
from controller.model.kinematics import Status, arm_directions, control_jacobian
from controller.model.reach import posture_at
from controller.offline import constrained
from hardware.parameters import load_parameters

MODEL = DeltaModel(load_parameters())
COMPLEX_STEP = 1e-30
BOARD_CENTRE = np.array([0.0, 0.0, 0.45])
POINTS = [
    BOARD_CENTRE,
    np.array([0.1, 0.0, 0.40]),
    np.array([-0.05, 0.15, 0.47]),
    np.array([0.14, -0.14, 0.45]),
    np.array([0.0, -0.2, 0.36]),
]


class Projected(NamedTuple):
    """Everything about one pose, from the compiled functions."""

    q: FloatArray
    jacobian: FloatArray
    inverse: FloatArray
    inertia: FloatArray
    gravity: FloatArray

    @property
    def task(self) -> FloatArray:
        """Λ, the inertia felt at the tool [kg]."""
        return self.inverse.T @ self.inertia @ self.inverse


def project(point: FloatArray, model: DeltaModel = MODEL) -> Projected:
    y, x = posture_at(model, point)
    d, e = arm_directions(model.constants, y, tuple(point.tolist()))
    jacobian, inverse, inertia = (np.empty((3, 3)) for _ in range(3))
    gravity = np.empty(3)
    assert control_jacobian(model.constants, d, e, jacobian, inverse)[0] == Status.OK
    joint_inertia(model.constants, e, jacobian, inertia)
    gravity_torque(model.constants, e, jacobian, gravity)
    return Projected(constrained.coordinates(y, x), jacobian, inverse, inertia, gravity)


def mass_points(q: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """An arm as mass points: Simpson's rule along bar and both rods (exact for energies), platform third at the tip.

    In the arm's own frame; takes complex angles. The rods run at both sides of the arm's plane.
    """
    g, inertia = MODEL.parameters.geometry, MODEL.parameters.inertia
    shoulder = np.array([0.0, g.base_radius - g.flange_radius, g.gripper_height])
    arm = g.proximal_length * np.array([0.0, np.cos(q[0]), np.sin(q[0])])
    rod = g.distal_length * np.array([np.sin(q[1]) * np.sin(q[2]), np.cos(q[1]), np.sin(q[1]) * np.cos(q[2])])
    points = [(inertia.moving_platform_mass / 3.0, shoulder + arm + rod)]
    for part, weight in ((0.0, 1.0 / 6.0), (0.5, 4.0 / 6.0), (1.0, 1.0 / 6.0)):
        points.append((weight * inertia.proximal_mass, shoulder + part * arm))
        for side in (-0.03, 0.03):
            at = shoulder + arm + part * rod + np.array([side, 0.0, 0.0])
            points.append((weight * inertia.distal_pair_mass / 2.0, at))
    return points


def kinetic_energy(q: FloatArray, v: FloatArray) -> float:
    """Of one arm, velocities by the complex step."""
    moving = mass_points(q + 1j * COMPLEX_STEP * v)
    translating = sum(m * np.sum((p.imag / COMPLEX_STEP) ** 2) for m, p in moving)
    return float(0.5 * translating + 0.5 * MODEL.parameters.inertia.rotor_inertia * v[0] ** 2)


def numeric_inertia(q: FloatArray) -> FloatArray:
    """M of one arm by polarisation of the energy."""
    unit = np.eye(3)
    return np.array(
        [[kinetic_energy(q, a + b) - kinetic_energy(q, a) - kinetic_energy(q, b) for a in unit] for b in unit]
    )


def poses(count: int) -> list[tuple[FloatArray, FloatArray]]:
    random = np.random.default_rng(7)
    low, high = np.array([-0.8, 1.0, -0.8]), np.array([1.5, 2.8, 0.8])
    return [(random.uniform(low, high), random.uniform(-5.0, 5.0, 3)) for _ in range(count)]


def test_inertia_of_an_arm_is_that_of_its_mass_points() -> None:
    for q, _ in poses(20):
        m11, m12, m13, m22, m33 = arm_inertia(MODEL.constants, 0, *q)
        closed = np.array([[m11, m12, m13], [m12, m22, 0.0], [m13, 0.0, m33]])
        np.testing.assert_allclose(closed, numeric_inertia(q), rtol=0, atol=1e-15)


def test_coriolis_torque_of_an_arm_follows_from_its_energy() -> None:
    """C = Ṁ v - ½ ∂(vᵀ M v)/∂q, with M differentiated numerically."""
    step = 1e-5
    for q, v in poses(20):
        slopes = [(numeric_inertia(q + step * u) - numeric_inertia(q - step * u)) / (2 * step) for u in np.eye(3)]
        rate = sum(slope * vk for slope, vk in zip(slopes, v, strict=True))
        expected = rate @ v - 0.5 * np.array([v @ slope @ v for slope in slopes])
        closed = arm_coriolis(MODEL.constants, 0, tuple(q.tolist()), tuple(v.tolist()))
        np.testing.assert_allclose(closed, expected, rtol=0, atol=1e-9)


def test_gravity_of_an_arm_is_the_slope_of_its_potential() -> None:
    for q, _ in poses(20):
        expected = [
            -STANDARD_GRAVITY * sum(m * p[2].imag for m, p in mass_points(q + 1j * COMPLEX_STEP * u)) / COMPLEX_STEP
            for u in np.eye(3)
        ]
        np.testing.assert_allclose(arm_gravity(MODEL.constants, 0, *q), expected, rtol=0, atol=1e-14)


def test_constraint_jacobian_and_drift_against_finite_differences() -> None:
    step = 1e-5
    random = np.random.default_rng(3)
    for point in POINTS:
        q, v = project(point).q, random.uniform(-5.0, 5.0, 9)
        columns = [
            (constrained.constraint(MODEL, q + step * u) - constrained.constraint(MODEL, q - step * u)) / (2 * step)
            for u in np.eye(9)
        ]
        np.testing.assert_allclose(
            constrained.constraint_jacobian(MODEL, q), np.stack(columns, axis=1), rtol=0, atol=1e-10
        )
        ahead, behind = (constrained.constraint_jacobian(MODEL, q + s * step * v) for s in (1.0, -1.0))
        drift = (ahead - behind) @ v / (2 * step)
        np.testing.assert_allclose(constrained.constraint_drift(MODEL, q, v), drift, rtol=0, atol=1e-7)


def test_virtual_jacobian_restricted_to_the_tangent_is_the_control_jacobian() -> None:
    for point in POINTS:
        found = project(point)
        product = constrained.virtual_jacobian(MODEL, found.q) @ constrained.tangent(MODEL, found.q)
        np.testing.assert_allclose(product, found.jacobian, rtol=0, atol=1e-13)


def test_projected_inertia_is_the_nine_coordinate_one_projected() -> None:
    for point in POINTS:
        found = project(point)
        t = constrained.tangent(MODEL, found.q)
        np.testing.assert_allclose(constrained.constraint_jacobian(MODEL, found.q) @ t, 0.0, atol=1e-14)
        expected = t.T @ constrained.inertia_matrix(MODEL, found.q) @ t
        np.testing.assert_allclose(found.inertia, expected, rtol=0, atol=1e-14)


def test_gravity_torque_solves_eq_15_and_is_the_projection() -> None:
    for point in POINTS:
        found = project(point)
        projected = constrained.tangent(MODEL, found.q).T @ constrained.gravity_torque(MODEL, found.q)
        np.testing.assert_allclose(found.gravity, projected, rtol=0, atol=1e-13)
        np.testing.assert_allclose(found.gravity, constrained.gravity_compensation(MODEL, found.q), rtol=0, atol=1e-12)


def test_gravity_compensation_holds_the_constrained_robot_still() -> None:
    for point in POINTS:
        found = project(point)
        applied = constrained.input_matrix() @ found.gravity
        still = constrained.acceleration(MODEL, found.q, np.zeros(9), applied, (0.0, 0.0))
        np.testing.assert_allclose(still, 0.0, atol=1e-9)


def test_effective_mass_at_the_board_agrees_with_figure_5() -> None:
    """A push along z1 at rest: constrained dynamics, task inertia and the paper's Fig. 5 tell one mass."""
    found = project(BOARD_CENTRE)
    push = constrained.virtual_jacobian(MODEL, found.q).T @ np.array([1.0, 0.0, 0.0])
    applied = constrained.input_matrix() @ found.gravity + push
    rates = constrained.acceleration(MODEL, found.q, np.zeros(9), applied, (0.0, 0.0))
    mass = 1.0 / (found.jacobian @ rates[constrained.MEASURED])[0]
    print(f"effective mass along z1 at the board's centre: {mass:.4f} kg")
    assert mass == pytest.approx(1.08, rel=0.10)
    assert mass == pytest.approx(found.task[0, 0], rel=1e-9)
    assert 1.0 + 2.0 * mass == pytest.approx(np.sqrt(10.0), rel=0.02)


def test_payload_adds_to_the_mass_at_the_tool() -> None:
    loaded = DeltaModel(load_parameters(), payload=0.03)
    assert loaded.constants[PLATFORM_MASS] == MODEL.constants[PLATFORM_MASS] + 0.03
    for point in POINTS:
        difference = project(point, loaded).task - project(point).task
        np.testing.assert_allclose(difference, 0.03 * np.eye(3), atol=1e-12)


def delivered(inertia: FloatArray, found: Projected) -> FloatArray:
    """Tool acceleration for each acceleration asked, if the law uses this inertia; through the full dynamics."""
    columns = []
    for asked in np.eye(3):
        torque = inertia @ found.inverse @ asked + found.gravity
        applied = constrained.input_matrix() @ torque
        rates = constrained.acceleration(MODEL, found.q, np.zeros(9), applied, (0.0, 0.0))
        columns.append(found.jacobian @ rates[constrained.MEASURED])
    return np.stack(columns, axis=1)


def printed_inertia(q: FloatArray) -> FloatArray:
    """(19) as printed: M11 + M12 ∂g/∂y."""
    m = constrained.inertia_matrix(MODEL, q)[constrained.MEASURED]
    m11, m12 = m[:, constrained.MEASURED], m[:, constrained.UNMEASURED]
    return m11 + m12 @ constrained.tangent(MODEL, q)[constrained.UNMEASURED]


def test_projected_inertia_delivers_what_is_asked() -> None:
    for point in POINTS:
        found = project(point)
        np.testing.assert_allclose(delivered(found.inertia, found), np.eye(3), atol=1e-9)


def test_printed_eq_19_delivers_about_a_third_in_the_plane_with_cross_terms() -> None:
    found = project(BOARD_CENTRE)
    ratio = delivered(printed_inertia(found.q), found)
    print(f"(19) as printed delivers of z1, z2, z3: {np.diag(ratio).round(3)}")
    assert ratio[0, 0] == pytest.approx(1.0 / 3.0, abs=0.08)
    assert ratio[1, 1] == pytest.approx(1.0 / 3.0, abs=0.08)
    found = project(np.array([0.14, -0.14, 0.45]))
    ratio = delivered(printed_inertia(found.q), found)
    print(f"(19) as printed at a corner square:\n{ratio.round(3)}")
    assert np.abs(ratio - np.diag(np.diag(ratio))).max() > 0.1


def test_friction_is_viscous_and_coulomb_and_odd() -> None:
    assert shaft_friction(0.0, 0.004, 0.02, 0.05) == 0.0
    assert shaft_friction(2.0, 0.004, 0.02, 0.05) == pytest.approx(0.028)
    assert shaft_friction(-2.0, 0.004, 0.02, 0.05) == pytest.approx(-0.028)
    v = np.arange(9.0)
    torque = constrained.friction_torque(MODEL, v, 0.01)
    assert np.flatnonzero(torque).tolist() == [3, 6]
    assert torque[6] == pytest.approx(0.02 + 6.0 * 0.004)


def test_energy_of_an_arm_is_that_of_its_mass_points() -> None:
    zero = np.array([0.0, np.pi / 2.0, np.pi / 2.0])

    def potential(q: FloatArray) -> float:
        return -STANDARD_GRAVITY * sum(m * p[2].real for m, p in mass_points(q))

    for q, v in poses(20):
        kinetic, height = arm_energy(MODEL.constants, 0, tuple(q.tolist()), tuple(v.tolist()))
        assert kinetic == pytest.approx(kinetic_energy(q, v), rel=1e-12)
        assert height == pytest.approx(potential(q) - potential(zero), abs=1e-12)
