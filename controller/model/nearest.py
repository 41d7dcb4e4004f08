"""The nearest tool point at which the robot can work: for the sentences of errors, not for the loop."""

import math

import numpy as np

from controller.model.compiled import FloatArray, Vector
from controller.model.constants import DISTAL, HEIGHT, PROXIMAL, RADIUS
from controller.model.kinematics import arm_directions, control_jacobian, elbow
from controller.model.vectors import cross, dot, minus, turn_back

LEAST_TRANSMISSION = 0.05
"""Of the point that is offered: five times the law's limit, so that it still holds after rounding to 0.1 mm."""
LEAST_VOLUME = 0.05
"""Likewise, of the distal directions."""
LEAST_LEVEL = 0.1
"""Cosine of the elbows' plane to the horizontal."""


def room(constants: FloatArray, z: Vector) -> FloatArray:
    """Distance from the singularities, shape (6,), at least 0 where the robot can work; smooth beyond its reach too.

    For each arm 4 l1² (l2² - w1²) - (l1² + l2² - |w|²)² over (2 l1 l2)², which is (d_i·e_i)², less its minimum; the
    volume of the distal directions, its minimum likewise taken off; how far the flange is below the base, over l2; and
    how level the elbows' plane is, less its minimum: tipped over, "below the elbows" would be the other pose.
    """
    l1, l2 = float(constants[PROXIMAL]), float(constants[DISTAL])
    values, y = np.empty(6), np.empty(3)
    for arm in range(3):
        w = minus(turn_back(arm, z), (0.0, float(constants[RADIUS]), float(constants[HEIGHT])))
        square = w[0] ** 2 + w[1] ** 2 + w[2] ** 2
        spread = (4.0 * l1**2 * (l2**2 - w[0] ** 2) - (l1**2 + l2**2 - square) ** 2) / (2.0 * l1 * l2) ** 2
        values[arm] = spread - LEAST_TRANSMISSION**2
        ratio = (square + l1**2 - l2**2) / (2.0 * l1 * max(math.hypot(w[1], w[2]), 1e-9))
        y[arm] = math.atan2(w[2], w[1]) - math.acos(min(1.0, max(-1.0, ratio)))
    d, e = arm_directions(constants, y, z)
    values[3] = control_jacobian(constants, d, e, np.empty((3, 3)), np.empty((3, 3)))[1] - LEAST_VOLUME
    values[4] = (z[2] - float(constants[HEIGHT])) / l2
    first, second, third = (elbow(constants, arm, float(y[arm]))[0] for arm in range(3))
    normal = cross(minus(third, first), minus(second, first))
    values[5] = normal[2] / math.sqrt(dot(normal, normal)) - LEAST_LEVEL
    return values


def nearest_point(constants: FloatArray, z: Vector) -> FloatArray | None:
    """The nearest point to z [m] at which no limit of `room` fails, shape (3,) [m]; None if z is not finite."""
    target = np.array(z)
    if not np.isfinite(target).all():
        return None
    far = 100.0 * float(constants[PROXIMAL] + constants[DISTAL])
    target = np.clip(target, -far, far)  # seen from there the direction is the same, and squares do not overflow
    inside = _heart(constants)
    scale = float(constants[DISTAL])
    starts = sorted(_grid(constants), key=lambda p: float(np.sum((p - target) ** 2)))[:3]
    best = _towards(constants, inside, target)

    def distance(p: FloatArray) -> float:
        return float(np.sum((p - target) ** 2)) / scale**2

    from scipy.optimize import NonlinearConstraint, minimize  # takes a third of a second to load, and no start wants it

    limits = NonlinearConstraint(lambda p: room(constants, (float(p[0]), float(p[1]), float(p[2]))), 0.0, np.inf)
    for start in (best, *starts):
        found = minimize(distance, start, method="SLSQP", constraints=limits, tol=1e-14)
        candidate = _towards(constants, start, np.asarray(found.x, dtype=np.float64))
        if np.linalg.norm(candidate - target) < np.linalg.norm(best - target):
            best = candidate
    return best


def _fits(constants: FloatArray, p: FloatArray) -> bool:
    return bool(room(constants, (float(p[0]), float(p[1]), float(p[2]))).min() >= 0.0)


def _heart(constants: FloatArray) -> FloatArray:
    """The point on the base's axis that is farthest from all singularities."""
    length = float(constants[PROXIMAL] + constants[DISTAL])
    depths = float(constants[HEIGHT]) + np.linspace(0.0, length, 61)
    return np.array([0.0, 0.0, max(depths.tolist(), key=lambda z: float(room(constants, (0.0, 0.0, z)).min()))])


def _grid(constants: FloatArray) -> list[FloatArray]:
    """Points a fifth of the arm's length apart at which the robot can work: somewhere to start from."""
    length, height = float(constants[PROXIMAL] + constants[DISTAL]), float(constants[HEIGHT])
    lattice = 0.2 * length * np.arange(-5, 6)
    points = [np.array([x, y, height + z]) for x in lattice for y in lattice for z in lattice[5:]]
    return [p for p in points if _fits(constants, p)]


def _towards(constants: FloatArray, inside: FloatArray, target: FloatArray) -> FloatArray:
    """The last point that fits on the way from inside to the target."""
    if _fits(constants, target):
        return target
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _fits(constants, inside + middle * (target - inside)) else (low, middle)
    return np.asarray(inside + low * (target - inside), dtype=np.float64)
