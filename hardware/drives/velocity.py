"""A joint's velocity from its positions.

Where the encoder is fine, the difference of two positions is the velocity: a count of 20 bits in 1 ms is 6 mrad/s.
Below that an observer follows the positions: ``q̂' = v̂ + 2ω (q - q̂)``, ``v̂' = ω² (q - q̂)``. At ω = 400 rad/s a count
of 14 bits, 0.38 mrad, makes a bump of ω/e × 0.38 mrad = 0.06 rad/s instead of 0.38 rad/s, and the velocity comes
2/ω = 5 ms late. For the law at 70 rad/s, whose loop crosses over at 144 rad/s, that leaves 40° of phase margin of 76°,
before the tick's own delay of 12°; at 30 rad/s 60°. So a coarse encoder needs softer gains, or a finer one has to be
bought.
"""

import math
from typing import Final, Protocol

from hardware.drives.settings import JointSettings

FINE: Final = 20
"""Encoders of so many bits a turn are differentiated."""
BANDWIDTH: Final = 400.0
"""Of the observer of coarser ones, ω [rad/s]."""
_LONGEST: Final = 0.1
"""After a pause so long the estimate begins anew [s]."""


class VelocityEstimate(Protocol):
    """Takes positions in, one after the other, and gives the velocity."""

    def take(self, angle: float, elapsed: float) -> float:
        """The velocity [rad/s] at an angle [rad] that was measured so long after the one before [s]."""


class Difference:
    """The difference of the last two positions; 0 at the first."""

    def __init__(self) -> None:
        self._before = math.nan

    def take(self, angle: float, elapsed: float) -> float:
        """See ``VelocityEstimate``."""
        moved, self._before = angle - self._before, angle
        return moved / elapsed if math.isfinite(moved) and elapsed > 0.0 else 0.0


class VelocityObserver:
    """A second-order observer, critically damped with ω [rad/s]; at rest at the first position."""

    def __init__(self, bandwidth: float = BANDWIDTH) -> None:
        self._omega = bandwidth
        self._angle, self._velocity = math.nan, 0.0

    def take(self, angle: float, elapsed: float) -> float:
        """See ``VelocityEstimate``. The fading-memory filter: stable for any time between two positions."""
        if not (math.isfinite(self._angle) and 0.0 < elapsed < _LONGEST):
            self._angle, self._velocity = angle, 0.0
            return 0.0
        keep = math.exp(-self._omega * elapsed)
        ahead = self._angle + self._velocity * elapsed
        error = ahead - angle
        self._angle = ahead - (1.0 - keep * keep) * error
        self._velocity -= (1.0 - keep) ** 2 / elapsed * error
        return self._velocity


def estimate_of(settings: JointSettings) -> VelocityEstimate:
    """What fits a joint's encoder."""
    return Difference() if settings.encoder_bits >= FINE else VelocityObserver()
