"""Gains scheduled by the distance to the board: soft in z₃ where contacts happen, stiff in the air."""

from __future__ import annotations

import numpy as np

from app.motion.reference import Vector
from app.motion.settings import Gains


def scheduled(height: Vector, gains: Gains) -> tuple[Vector, Vector]:
    """Stiffness and damping of each axis for heights above the contact.

    Args:
        height: of the carried foot, or of the pads above their lowest point, over the board, shape (n,) [m].
        gains: frequencies and where they apply.

    Returns:
        k_p (n, 3) [1/s²] and k_v (n, 3) [1/s]. Both are continuous in height, with a continuous derivative.
    """
    span = gains.stiff_height - gains.soft_height
    share = np.clip((np.asarray(height) - gains.soft_height) / span, 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    frequency = np.full((len(share), 3), gains.frequency_in_air)
    frequency[:, 2] = gains.frequency_at_contact + share * (gains.frequency_in_air - gains.frequency_at_contact)
    return frequency**2, 2.0 * gains.damping_ratio * frequency
