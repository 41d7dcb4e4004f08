"""Kinematics for planners and people: arrays in, arrays out, one clear sentence where there is no pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controller.model.compiled import FloatArray, Vector
from controller.model.constants import DISTAL, HEIGHT, PROXIMAL, RADIUS, DeltaModel
from controller.model.kinematics import OK, inverse_kinematics, spheres_meet
from controller.model.vectors import minus, turn_back


class Unreachable(ValueError):
    """A point or a set of angles has no pose; the message names what fails and by how much."""


class Posture(NamedTuple):
    """All nine angles: y, shape (3,), measured, and x, shape (6,), unmeasured [rad]."""

    y: FloatArray
    x: FloatArray


def posture_at(model: DeltaModel, point: FloatArray) -> Posture:
    """Inverse kinematics, outward branch.

    Args:
        model: the robot.
        point: shape (3,), tool point in the base frame [m].

    Raises:
        Unreachable: an arm cannot reach the point, or the point is not finite.
    """
    y, x = np.empty(3), np.empty(6)
    z = (float(point[0]), float(point[1]), float(point[2]))
    status, arm = inverse_kinematics(model.constants, z, y, x)
    if status != OK:
        raise Unreachable(_why_not(model, z, arm))
    return Posture(y, x)


def tool_point_at(model: DeltaModel, angle: FloatArray) -> FloatArray:
    """Forward kinematics in closed form, the pose below the base.

    Args:
        model: the robot.
        angle: shape (3,), servomotor angles y [rad].

    Returns:
        Shape (3,), the tool point in the base frame [m].

    Raises:
        Unreachable: the chain cannot be closed at these angles.
    """
    y1, y2, y3 = float(angle[0]), float(angle[1]), float(angle[2])
    which = f"servomotor angles ({y1:.4f}, {y2:.4f}, {y3:.4f}) rad"
    if not all(math.isfinite(a) for a in (y1, y2, y3)):
        raise Unreachable(f"{which} are not finite: give three finite angles")
    status, z = spheres_meet(model.constants, y1, y2, y3)
    if status != OK:
        raise Unreachable(
            f"{which} leave no pose of the tool below the base: the distal links, {model.constants[DISTAL]:.4f} m "
            "long, cannot meet; choose angles nearer to each other"
        )
    return np.array(z)


def _why_not(model: DeltaModel, z: Vector, arm: int) -> str:
    """One sentence: the point, the arm, how far its elbow can be from the wrist and how long the link is."""
    where = f"point ({z[0]:.4f}, {z[1]:.4f}, {z[2]:.4f}) m"
    if not all(math.isfinite(c) for c in z):
        return f"{where} is not finite: give three finite coordinates in the base frame"
    l1, l2 = float(model.constants[PROXIMAL]), float(model.constants[DISTAL])
    w = minus(turn_back(arm, z), (0.0, float(model.constants[RADIUS]), float(model.constants[HEIGHT])))
    nearest = math.hypot(w[0], math.hypot(w[1], w[2]) - l1)
    farthest = math.hypot(w[0], math.hypot(w[1], w[2]) + l1)
    if nearest > l2:
        limit, step = f"comes no nearer to it than {nearest:.4f} m", "nearer to"
    else:
        limit, step = f"gets no farther from it than {farthest:.4f} m", "farther from"
    return (
        f"{where} is out of reach of arm {arm + 1}: the elbow {limit} while the distal link is {l2:.4f} m long; "
        f"choose a point {step} the shoulder of arm {arm + 1}"
    )
