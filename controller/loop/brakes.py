"""The way off the brakes when the controller starts, and onto them at its end, or while nobody needs the arm."""

from __future__ import annotations

from typing import Final, NamedTuple

from controller.protection.limits import Violation, check_drives
from controller.protocol.causes import Cause
from controller.protocol.states import Event, State
from controller.settings import ControllerSettings
from hardware.interfaces import DriveStatus, DriveTrouble, Measurement, fault_of

_ENABLED = int(DriveStatus.ENABLED)
_BLIND: Final = (DriveTrouble.NO_REPLY, DriveTrouble.WRONG_REPLY)
"""Troubles with which velocities that are told may be those of before."""


class BrakeStep(NamedTuple):
    """What a tick on this way asks for.

    Attributes:
        holds: the law's torque; else none, or as it was.
        limp: no torque.
        event: that happens.
        trouble: for which the arm stays on its brakes.
    """

    holds: bool = False
    limp: bool = False
    event: Event | None = None
    trouble: Violation | None = None


class BrakeSequence:
    """Opens and closes the brakes in an order in which the arm never falls.

    Attributes:
        energised: the drives are asked to be enabled.
        armed: the arm is to be held; else it waits on its brakes for a client that enables it.
        retiring: on the way to the brakes for good.
        parking: on the way to the brakes until a client enables the arm.
        finished: the arm rests on its brakes for good.
        exhausted: the arm did not come to rest on its brakes.
    """

    def __init__(self, settings: ControllerSettings) -> None:
        self._settings = settings
        self.energised, self.armed = False, True
        self.retiring = self.parking = False
        self.finished = self.exhausted = False
        self._enable_asked = False
        self._since = -1

    def begin(self, tick: int) -> None:
        """The first tick, from which it is counted."""
        if self._since < 0:
            self._since = tick

    def boot(self, measurement: Measurement, trouble: Violation | None) -> BrakeStep:
        """Brakes until the arm rests and its pose is known, then enable."""
        waited, patience = measurement.tick - self._since, self._settings.boot_ticks
        speed = _fastest(measurement)
        if trouble is not None or speed > self._settings.rest_speed:
            self.energised = False
            moving = trouble or Violation(Cause.NOT_AT_REST, speed, float(patience))
            return BrakeStep(limp=True, trouble=moving if waited > patience else None)
        if not self.armed or not self.energised:
            # a tick with the drives disabled comes first: it clears what their watchdog remembers
            self.energised, self._since = self.armed and waited > 0, measurement.tick
            return BrakeStep()
        return BrakeStep(holds=True)

    def enabled(self, measurement: Measurement) -> BrakeStep:
        """Whether the drives follow, once torques were computed for them."""
        drives, status = check_drives(int(measurement.status)), int(measurement.status)
        if drives is None and status & _ENABLED:
            return BrakeStep(event=Event.ENABLED)
        patience = self._settings.boot_ticks
        if measurement.tick - self._since > patience:
            return BrakeStep(trouble=drives or Violation(Cause.NOT_ENABLED, float(status), float(patience)))
        return BrakeStep()

    def switch_off(self, measurement: Measurement, trouble: Violation | None) -> BrakeStep:
        """Goes on holding while the brakes close, then disables and waits for rest."""
        waited, speed = measurement.tick - self._since, _fastest(measurement)
        if self.energised and trouble is None and waited < self._settings.brake_ticks:
            return BrakeStep(holds=True)
        self.energised = False
        if waited > self._settings.brake_ticks and speed <= self._settings.rest_speed:
            if self.retiring:
                self.finished = True
                return BrakeStep(limp=True)
            self.armed, self.parking = self._enable_asked, False
            self._since = measurement.tick
            return BrakeStep(limp=True, event=Event.PARKED)
        if waited > self._settings.rest_ticks:
            self.finished = self.exhausted = True
            moving = Violation(Cause.NOT_AT_REST, speed, float(self._settings.rest_ticks))
            return BrakeStep(limp=True, trouble=_blind(int(measurement.status)) or moving)
        return BrakeStep(limp=True)

    def close(self, state: State, tick: int) -> bool:
        """Begin the way onto the brakes where it is due, from rest alone; whether it begins now."""
        if not (self.retiring or self.parking) or state in (State.OFF, State.TRACK, State.STOPPING):
            return False
        self.energised, self._since = state is State.HOLD, tick
        return True

    def park(self) -> None:
        """Until a client enables the arm."""
        self.parking, self._enable_asked = True, False

    def enable(self, state: State, tick: int) -> None:
        """Open the brakes, now or as soon as the arm is parked."""
        if state is State.BOOT and not self.armed:
            self.armed, self._since = True, tick
        self._enable_asked = state is State.OFF and self.parking


def _fastest(measurement: Measurement) -> float:
    """Speed of the fastest servomotor [rad/s]."""
    return max(abs(rate) for rate in measurement.velocity)


def _blind(status: int) -> Violation | None:
    """Why nobody can say whether the arm moves; None: its velocities are known."""
    return check_drives(status) if status & DriveStatus.FAULT and fault_of(status)[1] in _BLIND else None
