"""What is wrong with a controller, from what it says: pure but for counting how long something lasts."""

from typing import Final

from hardware.drives.faults import DriveFinding
from hardware.drives.moteus.cycle import Told
from hardware.drives.moteus.registers import Mode, fault_words
from hardware.drives.moteus.settings import MoteusSettings
from hardware.interfaces import DriveTrouble

_CODES: Final = {34: DriveTrouble.OVER_VOLTAGE, 38: DriveTrouble.TOO_HOT, 40: DriveTrouble.UNDER_VOLTAGE}
"""Fault codes that have a word of their own."""
_SLOW_TO_START: Final = 0.5
"""So long a controller may take from its first command to its operating mode [s]; it measures its currents first."""


def look_at(told: Told, temperature_limit: float, settings: MoteusSettings) -> DriveFinding | None:
    """What a single answer tells."""
    if told.mode == Mode.FAULT:
        return DriveFinding(_CODES.get(told.code, DriveTrouble.FAULT_CODE), fault_words(told.code))
    if told.temperature >= temperature_limit:
        seen = f"{told.temperature:.0f} °C, at most {temperature_limit:.0f} °C is accepted"
        return DriveFinding(DriveTrouble.TOO_HOT, seen)
    if told.voltage < settings.lowest_voltage:
        seen = f"{told.voltage:.1f} V, at least {settings.lowest_voltage:.1f} V is accepted"
        return DriveFinding(DriveTrouble.UNDER_VOLTAGE, seen)
    if told.voltage > settings.highest_voltage:
        seen = f"{told.voltage:.1f} V, at most {settings.highest_voltage:.1f} V is accepted"
        return DriveFinding(DriveTrouble.OVER_VOLTAGE, seen)
    return None


class ControllerWatch:
    """What several answers of one controller tell, and answers that do not come.

    Args:
        lost_replies: so many in a row may be missing.
    """

    def __init__(self, lost_replies: int) -> None:
        self._most = lost_replies
        self._idle = 0.0
        self._ran = False
        self._missing = self._damaged = 0
        self._last_words = ""

    def missed(self, damage: str | None) -> DriveFinding | None:
        """An exchange without an answer; ``damage`` says what came instead."""
        if damage is not None:
            self._damaged += 1
            self._last_words = damage
        self._missing += 1
        if self._missing <= self._most:
            return None
        if self._damaged:
            return DriveFinding(DriveTrouble.WRONG_REPLY, self._last_words)
        return DriveFinding(DriveTrouble.NO_REPLY, f"{self._missing} exchanges in a row")

    def answered(self) -> None:
        """An exchange with an answer."""
        self._missing = self._damaged = 0

    def operates(self, mode: int, wanted: bool, elapsed: float) -> DriveFinding | None:
        """Whether it is in its operating mode, once it should be; who has left it has lost power, and its settings."""
        operating = mode == Mode.POSITION
        fell = wanted and self._ran and not operating
        self._ran = wanted and (self._ran or operating)
        self._idle = self._idle + elapsed if wanted and not operating else 0.0
        if fell:
            seen = f"mode {mode} instead of {int(Mode.POSITION)}; if it has lost power, restart the controller"
            return DriveFinding(DriveTrouble.NOT_OPERATIONAL, seen)
        if self._idle <= _SLOW_TO_START:
            return None
        seen = f"mode {mode} instead of {int(Mode.POSITION)} for {self._idle:.1f} s"
        return DriveFinding(DriveTrouble.NOT_OPERATIONAL, seen)


def of_all(findings: list[DriveFinding | None]) -> DriveFinding | None:
    """Where nobody answers any more, nobody's own cable is the cause; None: somebody does."""
    ill = [finding for finding in findings if finding is not None]
    if len(ill) < len(findings):
        return None
    worst = next((one for one in ill if one.trouble is DriveTrouble.WRONG_REPLY), ill[0])
    return DriveFinding(worst.trouble, f"none of {len(ill)} controllers, {worst.detail}")
