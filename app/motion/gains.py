"""Gains scheduled by the distance to the board: soft where contacts happen, stiff in the air."""

from __future__ import annotations

from enum import Enum

import numpy as np

from app.motion.path import Vector
from app.motion.settings import Gains


class Softness(Enum):
    """Of z₁, the finger axis, at the start of a motion."""

    STIFF = 0
    """Stiff throughout."""
    BEGINS = 1
    """Its stiffness goes, and stays away for as long as the tool is near the board."""
    LASTS = 2
    """It has none, and gets it back with the distance to the board."""


def in_air(count: int, gains: Gains) -> tuple[Vector, Vector]:
    """Stiffness and damping away from contacts, (count, 3) each."""
    frequency = np.full((count, 3), gains.frequency_in_air)
    return frequency**2, 2.0 * gains.damping_ratio * frequency


def smooth(share: Vector) -> Vector:
    """From 0 to 1 with a continuous derivative."""
    share = np.clip(share, 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def scheduled(
    height: Vector, share: Vector, time: Vector, begun: Vector, softness: Softness, gains: Gains
) -> tuple[Vector, Vector]:
    """Stiffness and damping of each axis.

    Args:
        height: of the carried foot, or of the pads above their lowest point, over the board, shape (n,) [m].
        share: of the motion's way that is done, (n,).
        time: since the arm moved off, negative before, (n,) [s].
        begun: since the motion began, (n,) [s].
        softness: of z₁ at the start.
        gains: frequencies and where they apply.

    Returns:
        k_p (n, 3) [1/s²] and k_v (n, 3) [1/s]. Both are continuous, with a continuous derivative.
    """
    stiff = smooth((np.asarray(height) - gains.soft_height) / (gains.stiff_height - gains.soft_height))
    frequency = np.full((len(stiff), 3), gains.frequency_in_air)
    frequency[:, 2] = gains.frequency_at_contact + stiff * (gains.frequency_in_air - gains.frequency_at_contact)
    damping = 2.0 * gains.damping_ratio * frequency
    if softness is not Softness.STIFF:
        # with the distance on the way up, and on the way down to the next contact it stays; but no quicker than a tool
        # that went to its piece can come back: else it would seem to be held
        firm = np.minimum(np.maximum(stiff, smooth((share - 0.3) / 0.4)), smooth(time / gains.firming))
        if softness is Softness.BEGINS:
            firm = np.maximum(firm, 1.0 - smooth(begun / gains.yielding))
        frequency[:, 0] *= firm
        damping[:, 0] = gains.grasp_damping + firm * (damping[:, 0] - gains.grasp_damping)
    return frequency**2, damping
