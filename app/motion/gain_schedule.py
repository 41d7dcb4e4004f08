"""Gains scheduled by the distance to the board: soft where contacts happen, stiff in the air."""

from enum import Enum

import numpy as np

from app.motion.gains import Gains
from app.motion.path import Vector
from controller.model.compiled import ROW, STATUS, TABLE, FloatArray, compiled, compiled_as


class Softness(Enum):
    """Of z₁, the finger axis, at the start of a motion."""

    STIFF = 0
    """Stiff throughout."""
    BEGINS = 1
    """Its stiffness goes, and stays away for as long as the tool is near the board."""
    LASTS = 2
    """It has none, and gets it back with the distance to the board."""


_STIFF = Softness.STIFF.value
_BEGINS = Softness.BEGINS.value


def critical(frequency: tuple[float, float, float], count: int) -> Vector:
    """k_p [1/s²] and k_v [1/s] of each axis for constant natural frequencies [rad/s] at damping ratio 1, (count, 6)."""
    each = np.tile(frequency, (count, 1))
    return np.hstack([each**2, 2.0 * each])


@compiled_as(ROW(TABLE))
def progress(motion: FloatArray) -> FloatArray:
    """Share of the whole way that is done at each row of a motion, (n, 9) to (n,); 0 where there is no way."""
    gone = np.zeros(motion.shape[0])
    for i in range(1, motion.shape[0]):
        x, y, z = (
            motion[i, 0] - motion[i - 1, 0], motion[i, 1] - motion[i - 1, 1], motion[i, 2] - motion[i - 1, 2],
        )  # fmt: skip
        gone[i] = gone[i - 1] + np.sqrt(x * x + y * y + z * z)
    if gone[-1] > 0.0:
        gone /= gone[-1]
    return gone


@compiled
def _smooth(share: float) -> float:
    """From 0 to 1 with a continuous derivative."""
    share = min(1.0, max(0.0, share))
    return share * share * (3.0 - 2.0 * share)


@compiled_as(TABLE(ROW, ROW, ROW, ROW, STATUS, ROW))
def _scheduled(
    height: FloatArray, share: FloatArray, time: FloatArray, begun: FloatArray, softness: int, gains: FloatArray
) -> FloatArray:
    """See `scheduled`; stiffness and damping side by side, (n, 6)."""
    in_air, at_contact, double_ratio, soft, stiff, grasp_damping, yielding, firming = gains
    out = np.empty((height.size, 6))
    begins = _smooth((height[0] - soft) / (stiff - soft))
    for i in range(height.size):
        away = _smooth((height[i] - soft) / (stiff - soft))
        # with the distance, both on the way up and on the way down to the next contact; but after a contact no quicker
        # than a tool that went to its piece, or sagged, can come back: else it would seem to be held
        in_time = _smooth(time[i] / firming)
        across, upright = in_air, at_contact + min(away, max(begins, in_time)) * (in_air - at_contact)
        damping = double_ratio * in_air
        if softness != _STIFF:
            # on the way down to the next contact it stays
            firm = min(max(away, _smooth((share[i] - 0.3) / 0.4)), in_time)
            if softness == _BEGINS:
                firm = max(firm, 1.0 - _smooth(begun[i] / yielding))
            across *= firm
            damping = grasp_damping + firm * (damping - grasp_damping)
        out[i, 0], out[i, 1], out[i, 2] = across * across, in_air * in_air, upright * upright
        out[i, 3], out[i, 4], out[i, 5] = damping, double_ratio * in_air, double_ratio * upright
    return out


def scheduled(height: Vector, share: Vector, time: Vector, begun: Vector, softness: Softness, gains: Gains) -> Vector:
    """Stiffness k_p [1/s²] and damping k_v [1/s] of each axis, (n, 6); both are continuous.

    Args:
        height: of the carried foot, or of the pads above their lowest point, over the board, shape (n,) [m].
        share: of the motion's way that is done, (n,).
        time: since the arm moved off, negative before, (n,) [s].
        begun: since the motion began, (n,) [s].
        softness: of z₁ at the start.
        gains: frequencies and where they apply.
    """
    numbers = np.array([
        gains.frequency_in_air, gains.frequency_at_contact, 2.0 * gains.damping_ratio, gains.soft_height,
        gains.stiff_height, gains.grasp_damping, gains.yielding, gains.firming,
    ])  # fmt: skip
    return _scheduled(height, share, time, begun, softness.value, numbers)
