"""Kinematics for planners and people: arrays in, arrays out, one clear sentence where there is no pose.

An arm reaches a wrist at w (its frame, seen from the shoulder) exactly if 4 l1² (l2² - w1²) ≥ (l1² + l2² - |w|²)²; the
difference of the two sides is (2 l1 l2 d_i·e_i)², so the same formula tells how far an arm is from being stretched.
"""

import math
from typing import NamedTuple

import numpy as np

from controller.model.compiled import FloatArray, Vector
from controller.model.constants import DISTAL, HEIGHT, PROXIMAL, RADIUS, DeltaModel
from controller.model.kinematics import (
    MIN_DETERMINANT,
    MIN_TRANSMISSION,
    OK,
    UNREACHABLE,
    arm_directions,
    control_jacobian,
    elbow,
    inverse_kinematics,
    spheres_meet,
)
from controller.model.nearest import nearest_point
from controller.model.vectors import minus, turn_back


class PoseError(ValueError):
    """There is no such pose, or none to work with; the message names what fails, by how much, and what is near.

    ``value`` is what was found, ``limit`` what it must keep to, in the unit that the message names; ``nearest`` the
    nearest tool point with a regular pose, shape (3,) [m], base frame; None if nothing is near to it.
    """

    def __init__(self, sentence: str, value: float, limit: float, nearest: FloatArray | None) -> None:
        if nearest is not None:
            sentence += f"; the nearest point to work at is {_point(nearest)}"
        super().__init__(sentence)
        self.value = value
        self.limit = limit
        self.nearest = nearest


class Unreachable(PoseError):
    """The links are too long or too short to meet."""


class Singular(PoseError):
    """The pose exists, but is too near a kinematic singularity or beyond it: J_c or its inverse is of no use."""


class Posture(NamedTuple):
    """All nine angles: y, shape (3,), measured, and x, shape (6,), unmeasured [rad]."""

    y: FloatArray
    x: FloatArray


class Jacobians(NamedTuple):
    """J_c, shape (3, 3) [m/rad], and its inverse [rad/m]."""

    control: FloatArray
    inverse: FloatArray


def posture_at(model: DeltaModel, point: FloatArray) -> Posture:
    """Inverse kinematics, outward branch, of a tool point in the base frame, shape (3,) [m].

    Raises ``Unreachable`` if an arm cannot reach the point, or it is not finite, and ``Singular`` if it can only with
    the tool in or above the plane of the elbows, where the robot does not get to.
    """
    y, x = np.empty(3), np.empty(6)
    z = _vector(point)
    status, arm = inverse_kinematics(model.constants, z, y, x)
    if status != OK:
        raise _out_of_reach(model, z, arm)
    d, e = arm_directions(model.constants, y, z)
    volume = control_jacobian(model.constants, d, e, np.empty((3, 3)), np.empty((3, 3)))[1]
    if not volume >= MIN_DETERMINANT:
        raise _above_the_elbows(model, z, volume)
    return Posture(y, x)


def tool_point_at(model: DeltaModel, angle: FloatArray) -> FloatArray:
    """Forward kinematics in closed form, the pose below the elbows: the tool point in the base frame, shape (3,) [m].

    Of servomotor angles y, shape (3,) [rad]. Raises ``Unreachable`` if the chain cannot be closed at these angles, and
    ``Singular`` if the elbows lie in one line.
    """
    y1, y2, y3 = _vector(angle)
    which = f"servomotor angles ({y1:.4f}, {y2:.4f}, {y3:.4f}) rad"
    if not all(math.isfinite(a) for a in (y1, y2, y3)):
        raise Unreachable(f"{which} are not finite: give three finite angles", math.nan, math.inf, None)
    status, z = spheres_meet(model.constants, y1, y2, y3)
    if status != OK:
        raise _no_pose_below(model, which, status, (y1, y2, y3))
    return np.array(z)


def jacobians_at(model: DeltaModel, point: FloatArray) -> Jacobians:
    """J_c of (13) and its inverse at a tool point in the base frame, shape (3,) [m], outward branch.

    Raises ``Unreachable`` if an arm cannot reach the point, and ``Singular`` if the pose is too near a singularity, or
    beyond it.
    """
    y, _ = posture_at(model, point)
    control, inverse = np.empty((3, 3)), np.empty((3, 3))
    z = _vector(point)
    d, e = arm_directions(model.constants, y, z)
    status, volume, transmission = control_jacobian(model.constants, d, e, control, inverse)
    if status == OK:
        return Jacobians(control, inverse)
    if transmission < MIN_TRANSMISSION:
        raise Singular(
            f"point {_point(z)} leaves an arm stretched: its elbow passes on {transmission:.4f} of its speed along "
            f"the distal link, at least {MIN_TRANSMISSION:.4f} is needed",
            transmission, MIN_TRANSMISSION, nearest_point(model.constants, z),
        )  # fmt: skip
    raise _above_the_elbows(model, z, volume)


def _above_the_elbows(model: DeltaModel, z: Vector, volume: float) -> Singular:
    return Singular(
        f"point {_point(z)} lies in or above the plane of the elbows: the distal links span a volume of {volume:.4f}, "
        f"at least {MIN_DETERMINANT:.4f} is needed",
        volume, MIN_DETERMINANT, nearest_point(model.constants, z),
    )  # fmt: skip


def _vector(values: FloatArray) -> Vector:
    return float(values[0]), float(values[1]), float(values[2])


def _point(z: FloatArray | Vector) -> str:
    x, y, depth = (round(float(c), 4) + 0.0 for c in z)  # no minus zero
    return f"({x:.4f}, {y:.4f}, {depth:.4f}) m"


def _out_of_reach(model: DeltaModel, z: Vector, arm: int) -> Unreachable:
    """The point, the arm, how far its elbow can be from the wrist and how long the link is."""
    where = f"point {_point(z)}"
    if not all(math.isfinite(c) for c in z):
        return Unreachable(
            f"{where} is not finite: give three finite coordinates in the base frame", math.nan, math.inf, None
        )
    l1, l2 = float(model.constants[PROXIMAL]), float(model.constants[DISTAL])
    w = minus(turn_back(arm, z), (0.0, float(model.constants[RADIUS]), float(model.constants[HEIGHT])))
    least = math.hypot(w[0], math.hypot(w[1], w[2]) - l1)
    most = math.hypot(w[0], math.hypot(w[1], w[2]) + l1)
    if least > l2:
        value, limit = least, f"gets no closer to it than {least:.4f} m"
    else:
        value, limit = most, f"gets no farther from it than {most:.4f} m"
    sentence = f"{where} is out of reach of arm {arm + 1}: the elbow {limit} while the distal link is {l2:.4f} m long"
    return Unreachable(sentence, value, l2, nearest_point(model.constants, z))


def _no_pose_below(model: DeltaModel, which: str, status: int, angle: Vector) -> PoseError:
    """The radius of the circle through the elbows must not exceed the distal links' length."""
    l2 = float(model.constants[DISTAL])
    elbows = [np.array(elbow(model.constants, arm, q)[0]) for arm, q in enumerate(angle)]
    a, b = elbows[1] - elbows[0], elbows[2] - elbows[0]
    normal = np.cross(a, b)
    area = float(np.linalg.norm(normal))
    if status != UNREACHABLE:
        return Singular(
            f"{which} allow no pose of the tool: the elbows lie in one line; choose angles closer to each other",
            area, 0.0, None,
        )  # fmt: skip
    centre = elbows[0] + (np.dot(a, a) * np.cross(b, normal) + np.dot(b, b) * np.cross(normal, a)) / (2.0 * area**2)
    radius = float(np.linalg.norm(centre - elbows[0]))
    return Unreachable(
        f"{which} allow no pose of the tool: no point is nearer than {radius:.4f} m to all three elbows while the "
        f"distal links are {l2:.4f} m long; choose angles closer to each other",
        radius, l2, None,
    )  # fmt: skip
