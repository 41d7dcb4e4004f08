"""What torque a drive may give now: its peak, what its winding bears (I²t), and how warm it says it is.

A winding is a first-order system: its heat follows torque squared with the thermal time, and at the RMS torque it is as
warm as it may ever be. Up to ``FREE`` of that heat the peak is allowed; from there it falls evenly to the RMS torque,
at which the heat rises no more. Temperatures of the drive lower the torque in the same way, to none at their limit.
"""

import math
from typing import Final, NamedTuple

from hardware.drives.settings import JointSettings
from hardware.parameters import Drive

FREE: Final = 0.8
"""Share of the winding's full heat up to which the peak is allowed."""


class Rated(NamedTuple):
    """A torque within what is allowed, and whether anything was cut off."""

    torque: float
    cut: bool


def derating(temperature: float, begins: float, limit: float) -> float:
    """Share of the peak that is allowed at a temperature [°C]: 1 up to ``begins``, 0 from ``limit`` on.

    1 for a temperature that is no number: the drive tells none.
    """
    return 1.0 if math.isnan(temperature) else min(1.0, max(0.0, (limit - temperature) / (limit - begins)))


def allowed(heat: float, peak: float, rms: float) -> float:
    """Torque that a winding may have [N m] at a share of its full heat."""
    if rms >= peak:
        return peak
    return rms + (peak - rms) * min(1.0, max(0.0, (1.0 - heat) / (1.0 - FREE)))


class TorqueRating:
    """Cuts the torques of one joint.

    ``heat`` is the share of the winding's full heat, 0 at the start; ``peak`` the largest torque [N m].
    """

    def __init__(self, settings: JointSettings, drive: Drive) -> None:
        self.peak, self._rms = settings.peak(drive), settings.rms(drive)
        self._time = settings.thermal_time
        self._begins, self._limit = settings.derating_temperature, settings.temperature_limit
        self.heat = 0.0

    def rate(self, torque: float, temperature: float, elapsed: float) -> Rated:
        """Cut a torque [N m], given the drive's temperature [°C], for so long [s], and count its heat."""
        most = min(
            allowed(self.heat, self.peak, self._rms), self.peak * derating(temperature, self._begins, self._limit)
        )
        given = min(most, max(-most, torque))
        self.heat += ((given / self._rms) ** 2 - self.heat) * -math.expm1(-elapsed / self._time)
        return Rated(given, given != torque)

    def rest(self, elapsed: float) -> None:
        """So long without a torque [s]."""
        self.heat *= math.exp(-elapsed / self._time)
