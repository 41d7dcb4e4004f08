"""Arm, gripper and law in closed loop, linearised about rest by differences of the full model: ξ = (q, v, own)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.measure.figures.gripper import SPEED, STATES, Fingers, TactileLaw, push
from controller.model.compiled import FloatArray
from controller.offline import constrained
from controller.offline.simulation import ArmMotion, ConstrainedArm, Moment

ComplexArray = NDArray[np.complex128]

STEP = 1e-5
"""Of a central difference [rad, rad/s, m, m/s, N]."""


class LinearLoop(NamedTuple):
    """ξ̇ = A ξ + B f, finger velocity = C ξ + D f for a force f on the right finger; D is zero."""

    a: FloatArray
    """Shape (22, 22)."""
    b: FloatArray
    """Shape (22,)."""
    c: FloatArray
    """Shape (22,)."""

    def state(self, omega: float) -> ComplexArray:
        """Ξ(jω) / F, shape (22,)."""
        system = 1j * omega * np.eye(len(self.b)) - self.a
        return np.asarray(np.linalg.solve(system, self.b.astype(np.complex128)))

    def response(self, omega: FloatArray) -> ComplexArray:
        """A(jω), the admittance at frequencies (n,) [rad/s]: shape (n,) [m/(N s)]."""
        return np.array([self.c @ self.state(float(w)) for w in omega])


def linearised(arm: ConstrainedArm, at: ArmMotion, law: TactileLaw, fingers: Fingers) -> LinearLoop:
    """Differentiate the closed loop at a rest position.

    Args:
        arm: the plant.
        at: where it rests under the law.
        law: smooth (``warm`` False).
        fingers: gripper and sensors.
    """
    rest = np.concatenate([at.q, at.v, np.zeros(STATES)])

    def along(unit: FloatArray, step: float) -> FloatArray:
        return rates(rest + step * unit, 0.0)

    def rates(row: FloatArray, force: float) -> FloatArray:
        moment = Moment(0.0, row[:9].copy(), row[9:18].copy(), row[18:].copy(), arm.model)
        forces = (force, 0.0)
        found = arm.accelerations(moment.q, moment.v, law(moment), push(forces))
        return np.concatenate([moment.v, found.acceleration, fingers.rates(moment.own, forces)])

    columns = [_difference(partial(along, unit)) for unit in np.eye(rest.size)]
    velocity = np.zeros(rest.size)
    velocity[9:18] = constrained.virtual_jacobian(arm.model, at.q)[0]
    velocity[18 + SPEED] = 1.0
    return LinearLoop(np.stack(columns, axis=1), _difference(lambda s: rates(rest, s)), velocity)


def _difference(function: Callable[[float], FloatArray]) -> FloatArray:
    return (function(STEP) - function(-STEP)) / (2.0 * STEP)
