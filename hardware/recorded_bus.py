"""A servo bus that says again what drives once said: to look at a controller with the ticks of a recorded flight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import BusLost, Command, DriveStatus, Measurement


class RecordedServoBus:
    """``ServoBus`` from a recording. What is commanded changes nothing; after the last tick the drives are gone.

    Args:
        said: measurements, oldest first; at least one.
        period: of a tick [s].

    Attributes:
        commands: all that was commanded.

    Raises:
        ValueError: nothing was recorded.
    """

    lockstep = True
    """Nothing can be late: the recording waits."""

    def __init__(self, said: Sequence[Measurement], period: float) -> None:
        if not said:
            raise ValueError("a recording without a tick cannot be played: record at least one")
        self.period = period
        self.commands: list[Command] = []
        self._said = tuple(said)
        self._closed = False

    @classmethod
    def from_columns(cls, columns: Mapping[str, NDArray[Any]] | NDArray[Any], period: float) -> RecordedServoBus:
        """Of columns as a flight's file has them.

        Args:
            columns: tick (n,), angle (n, 3) [rad], angle_velocity (n, 3) [rad/s], finger_position (n,) [m], tactile
                (n, 2) [N] and drive_status (n,); others do not matter.
            period: of a tick [s].
        """
        names = ("tick", "angle", "angle_velocity", "finger_position", "tactile", "drive_status")
        rows = zip(*(np.asarray(columns[name]).tolist() for name in names), strict=True)
        said = [
            Measurement(int(tick), tuple(angle), tuple(speed), finger, tuple(tactile), DriveStatus(int(status)))
            for tick, angle, speed, finger, tactile, status in rows
        ]
        return cls(said, period)

    def exchange(self, command: Command) -> Measurement:
        """See ``ServoBus.exchange``."""
        if self._closed:
            raise BusLost("this recording was closed: open it again to play it")
        if len(self.commands) == len(self._said):
            raise BusLost(f"the recording ends with tick {self._said[-1].tick}")
        self.commands.append(command)
        return self._said[len(self.commands) - 1]

    def close(self) -> None:
        """See ``ServoBus.close``."""
        self._closed = True
