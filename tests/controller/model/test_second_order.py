"""Second derivatives and the term a: each against complex steps or differences, and against energy."""

from __future__ import annotations

import numpy as np
import pytest

from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.dynamics import joint_inertia
from controller.model.kinematics import arm_directions
from controller.model.reach import jacobians_at, posture_at, tool_point_at
from controller.model.second_order import arm_drift, tool_drift, velocity_torque
from controller.offline import constrained
from controller.offline.simulation import ConstrainedArm
from hardware.parameters import load_parameters
from tests.controller.linear import linearise, pose_at, tool_hessian

MODEL = DeltaModel(load_parameters())
ARM = ConstrainedArm(MODEL)
COMPLEX_STEP = 1e-30
STEP = 1e-5


def points() -> list[FloatArray]:
    around = np.linspace(0.0, 2.0 * np.pi, 7, endpoint=False) + 0.1
    return [
        np.array([radius * np.cos(phi), radius * np.sin(phi), depth])
        for depth in (0.35, 0.42, 0.50)
        for radius in (0.0, 0.12, 0.24)
        for phi in around
    ]


def printed_jacobian(arm: int, q: np.ndarray) -> np.ndarray:
    """∂psi_i/∂q_i of (1) by hand, column by column as printed; takes complex angles."""
    g = MODEL.parameters.geometry
    turn = (0.0, -2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0)[arm]
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0.0], [np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    l1, l2 = g.proximal_length, g.distal_length
    s1, c1, s2, c2, s3, c3 = np.sin(q[0]), np.cos(q[0]), np.sin(q[1]), np.cos(q[1]), np.sin(q[2]), np.cos(q[2])
    local = np.array(
        [[0.0 * c1, l2 * c2 * s3, l2 * s2 * c3], [-l1 * s1, -l2 * s2, 0.0 * s2], [l1 * c1, l2 * c2 * c3, -l2 * s2 * s3]]
    )
    return rotation @ local


def random_angles(count: int) -> list[FloatArray]:
    random = np.random.default_rng(5)
    return [random.uniform([-0.8, 0.6, -0.9], [2.0, 2.6, 0.9]) for _ in range(count)]


@pytest.mark.parametrize("arm", [0, 1, 2])
def test_arm_drift_is_the_complex_step_of_the_printed_jacobian(arm: int) -> None:
    random = np.random.default_rng(6)
    for q in random_angles(50):
        np.testing.assert_allclose(constrained.arm_jacobian(MODEL, arm, q), printed_jacobian(arm, q), atol=1e-15)
        slopes = [printed_jacobian(arm, q + 1j * COMPLEX_STEP * u).imag / COMPLEX_STEP for u in np.eye(3)]
        v = random.uniform(-5.0, 5.0, 3)
        drift = np.einsum("kij,i,j->k", np.stack(slopes, axis=2), v, v)
        written = arm_drift(MODEL.constants, arm, tuple(q.tolist()), tuple(v.tolist()))
        np.testing.assert_allclose(written, drift, rtol=0, atol=1e-13)


def test_constraint_drift_against_differences_and_without_mixed_terms() -> None:
    """(17) needs no ẏ-ẋ term: psi_i is a part in q_i1 plus a part in the others."""
    random = np.random.default_rng(1)
    for _ in range(20):
        q, v = np.concatenate(random_angles(3)), random.uniform(-5.0, 5.0, 9)
        slopes = [
            constrained.constraint_jacobian(MODEL, q + STEP * u) - constrained.constraint_jacobian(MODEL, q - STEP * u)
            for u in np.eye(9)
        ]
        hessian = np.stack(slopes, axis=2) / (2.0 * STEP)
        assert np.abs(hessian[:, constrained.MEASURED[:, None], constrained.UNMEASURED]).max() < 1e-10
        drift = np.einsum("kij,i,j->k", hessian, v, v)
        np.testing.assert_allclose(constrained.constraint_drift(MODEL, q, v), drift, rtol=0, atol=1e-8)


def test_tool_hessian_against_differences_of_both_forward_map_and_jacobian() -> None:
    for point in points():
        angle = posture_at(MODEL, point).y
        hessian = tool_hessian(MODEL, angle)
        np.testing.assert_allclose(hessian, hessian.transpose(0, 2, 1), rtol=0, atol=1e-13)

        def jacobian(y: FloatArray) -> FloatArray:
            return jacobians_at(MODEL, tool_point_at(MODEL, y)).control

        slopes = [(jacobian(angle + STEP * u) - jacobian(angle - STEP * u)) / (2.0 * STEP) for u in np.eye(3)]
        scale = max(1.0, float(np.abs(hessian).max()))
        np.testing.assert_allclose(hessian / scale, np.stack(slopes, axis=2) / scale, rtol=0, atol=1e-7)


def test_tool_drift_is_the_second_derivative_along_a_straight_line_of_angles() -> None:
    random, step = np.random.default_rng(2), 1e-4
    for point in points()[::3]:
        angle, rate = posture_at(MODEL, point).y, random.uniform(-2.0, 2.0, 3)
        ways = [tool_point_at(MODEL, angle + s * step * rate) for s in (-1.0, 0.0, 1.0)]
        second = (ways[0] - 2.0 * ways[1] + ways[2]) / step**2
        found = np.array(tool_drift(MODEL.constants, angle, rate, *pose_at(MODEL, angle)))
        np.testing.assert_allclose(found, second, rtol=1e-4, atol=1e-6)


def compiled_velocity_torque(angle: FloatArray, rate: FloatArray) -> FloatArray:
    d, e, jacobian = pose_at(MODEL, angle)
    drift = tool_drift(MODEL.constants, angle, rate, d, e, jacobian)
    return np.array(velocity_torque(MODEL.constants, angle, rate, e, jacobian, drift))


def test_term_a_without_unmeasured_angles_is_the_projection_of_the_papers_nine() -> None:
    """Rod ends against Tᵀ (C + M (0, ẍ)), all over the workspace at about 1.4 m/s."""
    random, largest = np.random.default_rng(4), 0.0
    for point in points():
        q, v = ARM.at(point, random.normal(0.0, 0.8, 3))
        found = compiled_velocity_torque(q[constrained.MEASURED], v[constrained.MEASURED])
        expected = constrained.velocity_torque(MODEL, q, v)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-11)
        largest = max(largest, float(np.abs(expected).max()))
    assert largest > 1.0  # it is worth having


def inertia_at(angle: FloatArray) -> FloatArray:
    matrix = np.empty((3, 3))
    point = tool_point_at(MODEL, angle)
    _, e = arm_directions(MODEL.constants, angle, tuple(point.tolist()))
    joint_inertia(MODEL.constants, e, jacobians_at(MODEL, point).control, matrix)
    return matrix


def test_term_a_follows_from_the_projected_energy() -> None:
    """Lagrange in the three measured angles: a = Ṁ_y ẏ - ½ ∂(ẏᵀ M_y ẏ)/∂y, with M_y differentiated numerically."""
    random = np.random.default_rng(6)
    for point in points()[::4]:
        angle, rate = posture_at(MODEL, point).y, random.uniform(-3.0, 3.0, 3)
        slopes = [(inertia_at(angle + STEP * u) - inertia_at(angle - STEP * u)) / (2.0 * STEP) for u in np.eye(3)]
        turning = sum(slope * r for slope, r in zip(slopes, rate, strict=True)) @ rate
        expected = turning - 0.5 * np.array([rate @ slope @ rate for slope in slopes])
        np.testing.assert_allclose(compiled_velocity_torque(angle, rate), expected, rtol=1e-5, atol=1e-7)


def test_term_a_is_quadratic_in_the_rates() -> None:
    angle, rate = posture_at(MODEL, np.array([0.1, -0.05, 0.42])).y, np.array([1.0, -2.0, 0.5])
    once, thrice = compiled_velocity_torque(angle, rate), compiled_velocity_torque(angle, -3.0 * rate)
    np.testing.assert_allclose(thrice, 9.0 * once, rtol=1e-12)


def test_gravity_stiffness_of_the_linear_model_is_the_slope_of_the_holding_torque() -> None:
    for point in points()[::4]:
        angle = posture_at(MODEL, point).y
        plant = linearise(MODEL, angle)
        slopes = [
            (linearise(MODEL, angle + STEP * u).holding - linearise(MODEL, angle - STEP * u).holding) / (2.0 * STEP)
            for u in np.eye(3)
        ]
        stiffness = -np.linalg.solve(plant.b[3:], plant.a[3:, :3])
        np.testing.assert_allclose(stiffness, np.stack(slopes, axis=1), rtol=1e-5, atol=1e-6)
