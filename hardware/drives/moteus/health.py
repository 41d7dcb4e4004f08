"""What is wrong with a controller, from what it says: pure but for counting how long something lasts."""

from __future__ import annotations

from typing import Final

from hardware.drives.faults import Finding
from hardware.drives.moteus.cycle import Told
from hardware.drives.moteus.registers import Mode, fault_words
from hardware.drives.moteus.settings import MoteusSettings
from hardware.interfaces import DriveTrouble

_CODES: Final = {34: DriveTrouble.OVER_VOLTAGE, 38: DriveTrouble.TOO_HOT, 40: DriveTrouble.UNDER_VOLTAGE}
"""Fault codes that have a word of their own."""
_SLOW_TO_START: Final = 0.5
"""So long a controller may take from its first command to its operating mode [s]; it measures its currents first."""


def look_at(told: Told, temperature_limit: float, settings: MoteusSettings) -> Finding | None:
    """What a single answer tells."""
    if told.mode == Mode.FAULT:
        return Finding(_CODES.get(told.code, DriveTrouble.FAULT_CODE), fault_words(told.code))
    if told.temperature >= temperature_limit:
        seen = f"{told.temperature:.0f} °C, at most {temperature_limit:.0f} °C is accepted"
        return Finding(DriveTrouble.TOO_HOT, seen)
    if told.voltage < settings.lowest_voltage:
        seen = f"{told.voltage:.1f} V, at least {settings.lowest_voltage:.1f} V is accepted"
        return Finding(DriveTrouble.UNDER_VOLTAGE, seen)
    if told.voltage > settings.highest_voltage:
        seen = f"{told.voltage:.1f} V, at most {settings.highest_voltage:.1f} V is accepted"
        return Finding(DriveTrouble.OVER_VOLTAGE, seen)
    return None


class ControllerWatch:
    """What several answers of one controller tell.

    Args:
        settings: limits.
        most: peak torque at its shaft [N m].
    """

    def __init__(self, settings: MoteusSettings, most: float) -> None:
        self._settings = settings
        self._allowed = settings.torque_error * most
        self._apart = self._idle = 0.0
        self._missing = self._damaged = 0
        self._last_words = ""

    def missed(self, damage: str | None) -> Finding | None:
        """An exchange without an answer; ``damage`` says what came instead."""
        if damage is not None:
            self._damaged += 1
            self._last_words = damage
        self._missing += 1
        if self._missing <= self._settings.lost_replies:
            return None
        if self._damaged:
            return Finding(DriveTrouble.WRONG_REPLY, self._last_words)
        return Finding(DriveTrouble.NO_REPLY, f"{self._missing} exchanges in a row")

    def answered(self) -> None:
        """An exchange with an answer."""
        self._missing = self._damaged = 0

    def torque(self, asked: float | None, given: float, code: int, elapsed: float) -> Finding | None:
        """Whether it gives what it was asked for [N m]; None: it was asked for none."""
        if asked is None or abs(asked - given) <= self._allowed:
            self._apart = 0.0
            return None
        self._apart += elapsed
        if self._apart <= self._settings.torque_time:
            return None
        limited = f"; {fault_words(code)}" if code else ""
        seen = f"{given:.2f} N m instead of {asked:.2f} N m for {1e3 * self._apart:.0f} ms{limited}"
        return Finding(DriveTrouble.TORQUE_NOT_FOLLOWED, seen)

    def operates(self, mode: int, wanted: bool, elapsed: float) -> Finding | None:
        """Whether it is in its operating mode, once it should be."""
        self._idle = self._idle + elapsed if wanted and mode != Mode.POSITION else 0.0
        if self._idle <= _SLOW_TO_START:
            return None
        return Finding(DriveTrouble.NOT_OPERATIONAL, f"mode {mode} instead of {int(Mode.POSITION)}")

    def encoder(self, jump: float, unsure: float, longest: float) -> Finding | None:
        """Whether a joint is where its mean velocity before and after has taken it.

        Args:
            jump: how far it is from there [rad].
            unsure: how far it may have moved while it is not known when it was read [rad].
            longest: time that may have passed between the two readings [s].
        """
        settings = self._settings
        # with bounded acceleration the mean of two velocities is off by a quarter of it at most
        accepted = settings.encoder_jump + unsure + 0.25 * settings.acceleration * longest**2
        if abs(jump) <= accepted:
            return None
        seen = f"{jump:+.4f} rad beyond its own velocity, at most {accepted:.3g} rad is accepted"
        return Finding(DriveTrouble.ENCODER_JUMPED, seen)
