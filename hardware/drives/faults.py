"""Faults of drives: which device, what is wrong, and the numbers; one sentence for a person."""

from dataclasses import dataclass
from typing import Final, NamedTuple

from hardware.interfaces import DriveStatus, DriveTrouble, fault_of, status_of

DEVICES: Final = ("the bus", "servomotor 1", "servomotor 2", "servomotor 3", "the gripper", "the force sensors")
"""What a fault can be of, by number."""


_FLAGS: Final = (1 << 7) - 1
"""Of a status word, below the number of a device."""


def status_words(status: int) -> str:
    """What a status word says, for people."""
    said = (DriveStatus(status & _FLAGS).name or "OK").replace("|", ", ").lower()
    if not status & DriveStatus.FAULT:
        return said
    device, trouble = fault_of(status)
    return f"{said}: {DEVICES[device]} {trouble.words}"


class DriveFinding(NamedTuple):
    """What is wrong with a device, and what was seen, with its number and limit."""

    trouble: DriveTrouble
    detail: str


@dataclass(frozen=True, slots=True)
class DriveFault:
    """A fault as a driver has found it."""

    device: int
    """Number in ``DEVICES``."""
    trouble: DriveTrouble
    detail: str
    """What was seen, with its number and limit, and how the device is called on its bus."""

    @property
    def status(self) -> DriveStatus:
        """What a measurement says of it."""
        return status_of(self.device, self.trouble)

    @property
    def sentence(self) -> str:
        """For people: device, cause, numbers, next step."""
        return (
            f"{DEVICES[self.device]} {self.trouble.words} ({self.detail}): {self.trouble.remedy}, then clear the fault"
        )
