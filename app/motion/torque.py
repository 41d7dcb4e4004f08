"""What torques a motion asks of the servomotors, by the inverse dynamics of the model."""

from __future__ import annotations

from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from controller.law import TaskSpaceController, pack_reference
from controller.model.constants import DeltaModel
from controller.model.kinematics import OK, inverse_kinematics
from hardware.parameters import RobotParameters

EVERY: Final = 8
"""Samples are looked at so far apart: 7 ms, in which a torque changes by some tenths of a newton metre."""


@cache
def _law(parameters: RobotParameters) -> tuple[DeltaModel, TaskSpaceController]:
    model = DeltaModel(parameters)
    return model, TaskSpaceController(model)


def peak_torque(samples: NDArray[Any], parameters: RobotParameters) -> tuple[float, float]:
    """The largest torque of a motion, and the largest of what rest would take at the same places [N m].

    Args:
        samples: of type ``SAMPLE``, all within reach.
        parameters: robot.
    """
    model, law = _law(parameters)
    law.reset()
    angles, distal, reference = np.empty(3), np.empty(6), pack_reference((0.0, 0.0, 0.0))
    columns = (samples[name][::EVERY].tolist() for name in ("position", "velocity", "acceleration"))
    peak = still = 0.0
    before: list[float] | None = None
    for position, velocity, acceleration in zip(*columns, strict=True):
        if position == before:
            continue
        before = position
        x, y, z = position
        status, arm = inverse_kinematics(model.constants, (x, y, z), angles, distal)
        if status != OK:
            raise ValueError(f"arm {arm + 1} does not reach ({x:.3f}, {y:.3f}, {z:.3f}) m")
        a, b, c = angles.tolist()
        law.update((a, b, c), (0.0, 0.0, 0.0))
        (aa, ab, ac), (ba, bb, bc), (ca, cb, cc) = law.state.jacobian_inverse.tolist()
        u, v, w = velocity
        law.update((a, b, c), (aa * u + ab * v + ac * w, ba * u + bb * v + bc * w, ca * u + cb * v + cc * w))
        reference[0:3], reference[6:9] = position, acceleration
        ta, tb, tc = law.exact_task_torque(reference)
        peak = max(peak, abs(ta), abs(tb), abs(tc))
        still = max(still, *map(abs, law.holding_torque()))
    return peak, still
