"""The same robot in Pinocchio: three serial chains with relative joint angles, closed by point constraints.

Pinocchio knows a universal joint's two relative angles (φ about the tangent from the proximal link on, then χ about the
rod's normal); the paper's q_i2, q_i3 are absolute. The rod's direction is the same:

    d = R_x(q1 + φ) R_z(χ) (0, 1, 0) = (-sin χ, cos χ cos(q1 + φ), cos χ sin(q1 + φ)) = (s2 s3, c2, s2 c3),

so w = f(q) with q1 + φ = atan2(s2 c3, c2) and χ = -asin(s2 s3), and with F = ∂f/∂q

    M = Fᵀ M_w F,     C + G = Fᵀ (M_w Ḟ q̇ + bias_w),     ẅ = F q̈ + Ḟ q̇.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import pytest

from controller.model.compiled import FloatArray
from controller.model.constants import STANDARD_GRAVITY, DeltaModel
from controller.offline import constrained
from controller.offline.simulation import ArmMotion, ConstrainedArm
from hardware.parameters import load_parameters
from hardware.sim.process.randomisation import Randomisation, uneven

PARAMETERS = uneven(
    Randomisation(arm_mass=0.2, arm_inertia=0.2, arm_friction=0.5), load_parameters(), np.random.default_rng(3)
)
PAYLOAD = 0.03
MODEL = DeltaModel(PARAMETERS, PAYLOAD)
STATES = 1000
TOLERANCE = 1e-8


class Twin(NamedTuple):
    """Pinocchio's model, its data, the last joint and the tip's frame of each arm."""

    model: Any
    data: Any
    joints: list[int]
    tips: list[int]


def rod(mass: float, length: float, about_axis: float = 0.0) -> Any:
    """A thin uniform rod along y from the origin; ``about_axis`` is added to the inertia about x."""
    across = mass * length**2 / 12.0
    return pin.Inertia(mass, np.array([0.0, length / 2.0, 0.0]), np.diag([across + about_axis, 0.0, across]))


@pytest.fixture(scope="module")
def twin() -> Twin:
    """Built from the parameters alone."""
    g, i = PARAMETERS.geometry, PARAMETERS.inertia
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, STANDARD_GRAVITY])
    joints, tips = [], []
    third = (i.moving_platform_mass + PAYLOAD) / 3.0
    for arm, angle in enumerate((0.0, -2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0)):
        # flange and gripper moved into the shoulder, so that the rod's end is the tool point
        shoulder = np.array([0.0, g.base_radius - g.flange_radius, g.gripper_height])
        place = pin.SE3(pin.utils.rotate("z", angle), np.zeros(3)) * pin.SE3(np.eye(3), shoulder)
        servo = model.addJoint(0, pin.JointModelRX(), place, f"servo{arm}")
        own = PARAMETERS.arm(arm)
        about = own.hinge_inertia - i.rotor_inertia
        centre = np.array([0.0, 0.6 * g.proximal_length, 0.0])
        mass = own.proximal_moment / centre[1]
        link = pin.Inertia(mass, centre, np.diag([own.hinge_inertia - mass * centre[1] ** 2, 0.0, about]))
        model.appendBodyToJoint(servo, link, pin.SE3.Identity())
        elbow = pin.SE3(np.eye(3), np.array([0.0, g.proximal_length, 0.0]))
        first = model.addJoint(servo, pin.JointModelRX(), elbow, f"universal{arm}a")
        second = model.addJoint(first, pin.JointModelRZ(), pin.SE3.Identity(), f"universal{arm}b")
        model.appendBodyToJoint(second, rod(own.distal_pair_mass, g.distal_length), pin.SE3.Identity())
        end = np.array([0.0, g.distal_length, 0.0])
        model.appendBodyToJoint(second, pin.Inertia(third, end, np.zeros((3, 3))), pin.SE3.Identity())
        joints.append(second)
        tips.append(model.addFrame(pin.Frame(f"tip{arm}", second, pin.SE3(np.eye(3), end), pin.FrameType.OP_FRAME)))
    return Twin(model, model.createData(), joints, tips)


def relative(q: np.ndarray) -> tuple[FloatArray, np.ndarray]:
    """w = f(q) and F = ∂f/∂q; F takes complex angles."""
    w, slope = np.empty(9), np.zeros((9, 9), dtype=q.dtype)
    for k in (0, 3, 6):
        s2, c2, s3, c3 = np.sin(q[k + 1]), np.cos(q[k + 1]), np.sin(q[k + 2]), np.cos(q[k + 2])
        cosine = np.sqrt(c2**2 + (s2 * c3) ** 2)
        w[k] = q[k].real
        w[k + 1] = np.arctan2((s2 * c3).real, c2.real) - q[k].real
        w[k + 2] = -np.arcsin((s2 * s3).real)
        slope[k : k + 3, k : k + 3] = [
            [1.0, 0.0, 0.0],
            [-1.0, c3 / cosine**2, -s2 * c2 * s3 / cosine**2],
            [0.0, -c2 * s3 / cosine, -s2 * c3 / cosine],
        ]
    return w, slope


class Mapped(NamedTuple):
    """A state in relative angles: w, ẇ, F and Ḟ q̇."""

    w: FloatArray
    rate: FloatArray
    slope: FloatArray
    drift: FloatArray


def mapped(q: FloatArray, v: FloatArray) -> Mapped:
    w, slope = relative(q)
    bend = relative(q + 1e-30j * v)[1].imag / 1e-30
    return Mapped(w, slope @ v, slope, bend @ v)


def open_states() -> list[ArmMotion]:
    """Arms that need not meet."""
    random = np.random.default_rng(11)
    low, high = np.array([-0.8, 0.6, -0.9] * 3), np.array([2.0, 2.6, 0.9] * 3)
    return [ArmMotion(random.uniform(low, high), random.uniform(-8.0, 8.0, 9)) for _ in range(STATES)]


def closed_states() -> list[tuple[ArmMotion, FloatArray]]:
    """Closed chains all over the workspace, moving at 1.4 m/s in the mean, with torques."""
    random, arm = np.random.default_rng(12), ConstrainedArm(MODEL)
    found = []
    for _ in range(STATES):
        radius, phi = 0.22 * np.sqrt(random.uniform()), random.uniform(0.0, 2.0 * np.pi)
        point = np.array([radius * np.cos(phi), radius * np.sin(phi), random.uniform(0.33, 0.50)])
        found.append((arm.at(point, random.normal(0.0, 0.9, 3)), random.normal(0.0, 2.0, 3)))
    return found


def test_forward_maps_agree(twin: Twin) -> None:
    for q, _ in open_states():
        pin.framesForwardKinematics(twin.model, twin.data, relative(q)[0])
        tips = np.array([twin.data.oMf[frame].translation for frame in twin.tips])
        np.testing.assert_allclose(tips, constrained.tool_points(MODEL, q), rtol=0, atol=1e-14)


def test_inertia_bias_and_gravity_at_a_thousand_random_states(twin: Twin) -> None:
    worst = dict.fromkeys(("M", "G", "C + G"), 0.0)
    for q, v in open_states():
        at = mapped(q, v)
        upper = np.triu(pin.crba(twin.model, twin.data, at.w))
        inertia = upper + np.triu(upper, 1).T
        bias = pin.nonLinearEffects(twin.model, twin.data, at.w, at.rate)
        gravity = pin.computeGeneralizedGravity(twin.model, twin.data, at.w)
        differences = {
            "M": at.slope.T @ inertia @ at.slope - constrained.inertia_matrix(MODEL, q),
            "G": at.slope.T @ gravity - constrained.gravity_torque(MODEL, q),
            "C + G": at.slope.T @ (inertia @ at.drift + bias)
            - constrained.coriolis_torque(MODEL, q, v)
            - constrained.gravity_torque(MODEL, q),
        }
        worst = {name: max(worst[name], float(np.abs(d).max())) for name, d in differences.items()}
    print("largest difference to Pinocchio [kg m², N m]:", {name: f"{value:.1e}" for name, value in worst.items()})
    assert max(worst.values()) < TOLERANCE


def test_constrained_forward_dynamics_at_a_thousand_random_states(twin: Twin) -> None:
    """Pinocchio's own constraint solver closes arm 1 with 2 and 3; Baumgarte has nothing to do on closed chains."""
    constraints, work = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    ends = [(twin.joints[arm], twin.model.frames[twin.tips[arm]].placement) for arm in range(3)]
    for arm in (1, 2):
        one = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, twin.model, *ends[0], *ends[arm])
        constraints.append(one)
        work.append(one.createData())
    pin.initConstraintDynamics(twin.model, twin.data, constraints, work)
    precise = pin.ProximalSettings(1e-14, 1e-14, 50)
    arm, worst, largest = ConstrainedArm(MODEL), 0.0, 0.0
    for (q, v), torque in closed_states():
        at = mapped(q, v)
        applied = constrained.input_matrix() @ torque - constrained.friction_torque(MODEL, v, arm.coulomb_speed)
        theirs = pin.constraintDynamics(
            twin.model, twin.data, at.w, at.rate, np.linalg.solve(at.slope.T, applied), constraints, work, precise
        )
        ours = at.slope @ arm.accelerations(q, v, torque).acceleration + at.drift
        worst, largest = max(worst, float(np.abs(ours - theirs).max())), max(largest, float(np.abs(theirs).max()))
    print(f"accelerations up to {largest:.0f} rad/s², largest difference to Pinocchio {worst:.1e} rad/s²")
    assert largest > 100.0
    assert worst < TOLERANCE


def test_constraint_forces_from_their_matrices(twin: Twin) -> None:
    """λ by the plain linear system of (2b) and (2c) with Pinocchio's M, bias and Jacobians."""
    arm, worst = ConstrainedArm(MODEL), 0.0
    for (q, v), torque in closed_states()[:200]:
        at = mapped(q, v)
        upper = np.triu(pin.crba(twin.model, twin.data, at.w))
        bias = pin.nonLinearEffects(twin.model, twin.data, at.w, at.rate)
        pin.computeJointJacobians(twin.model, twin.data, at.w)
        frame = pin.LOCAL_WORLD_ALIGNED
        jacobians = [pin.getFrameJacobian(twin.model, twin.data, tip, frame)[:3] for tip in twin.tips]
        pin.forwardKinematics(twin.model, twin.data, at.w, at.rate, np.zeros(9))
        bends = [pin.getFrameClassicalAcceleration(twin.model, twin.data, tip, frame).linear for tip in twin.tips]
        h_w = np.vstack([jacobians[0] - jacobians[1], jacobians[0] - jacobians[2]])
        applied = constrained.input_matrix() @ torque - constrained.friction_torque(MODEL, v, arm.coulomb_speed)
        system = np.block([[upper + np.triu(upper, 1).T, -h_w.T], [h_w, np.zeros((6, 6))]])
        right = np.concatenate(
            [np.linalg.solve(at.slope.T, applied) - bias, bends[1] - bends[0], bends[2] - bends[0]]
        )  # fmt: skip
        theirs = np.linalg.solve(system, right)[9:]
        worst = max(worst, float(np.abs(arm.accelerations(q, v, torque).multiplier - theirs).max()))
    print(f"constraint forces: largest difference to Pinocchio {worst:.1e} N")
    assert worst < TOLERANCE
