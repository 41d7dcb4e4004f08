"""What went wrong on the cable, from what was seen to a ``DriveFault``: pure functions."""

from collections.abc import Sequence
from typing import Final

from hardware.drives.ethercat import al_status
from hardware.drives.ethercat.cia402 import DriveState
from hardware.drives.ethercat.error_codes import trouble_of, words_of
from hardware.drives.ethercat.network import Health
from hardware.drives.ethercat.settings import ARMS, Device
from hardware.drives.faults import DriveFault, DriveFinding
from hardware.interfaces import DriveTrouble

WRONG: Final = 3
"""Working counters in a row that are wrong before the bus asks who is missing."""
FRAMES, LOSSES = 500, 0.1
"""Among so many frames, the last ones, a larger share of lost ones is a fault."""
STAY: Final = 1.0
"""A drive that does not begin to follow its control word for so long is a fault [s]; power stages take some tenths."""
NUMBERS: Final = {
    **{arm: number for number, arm in enumerate(ARMS, 1)},
    Device.GRIPPER: 4,
    Device.FORCES: 5,
    Device.OTHER: 0,
}
"""Of devices in a ``DriveFault``."""


def of_drive(device: Device, place: int, finding: DriveFinding) -> DriveFault:
    """What a drive's data tell."""
    return DriveFault(NUMBERS[device], finding.trouble, f"{finding.detail}; device {place + 1} on the cable")


def of_code(device: Device, place: int, code: int) -> DriveFault:
    """A drive that has switched itself off, and its error code (0x603F)."""
    return DriveFault(
        NUMBERS[device], trouble_of(code), f"error code 0x{code:04X}, {words_of(code)}; device {place + 1} on the cable"
    )


def of_health(devices: Sequence[Health]) -> DriveFault | None:
    """Of the first device that is not in OP; one that does not answer comes first. None: all are well."""
    ill = [one for one in devices if not one.well]
    if not ill:
        return None
    worst = next((one for one in ill if not one.state), ill[0])
    if not worst.state:
        kind = DriveTrouble.NO_REPLY
    elif worst.code == al_status.WATCHDOG:
        kind = DriveTrouble.WATCHDOG_BIT
    else:
        kind = DriveTrouble.NOT_OPERATIONAL
    others = len(ill) - 1
    more = f", and {others} more" if others else ""
    return DriveFault(NUMBERS[worst.device], kind, worst.words + more)


def of_counter(found: int, expected: int) -> DriveFault:
    """A working counter that is wrong while all devices are in OP."""
    return DriveFault(
        0, DriveTrouble.WRONG_REPLY, f"working counter {found} instead of {expected}, though all devices are in OP"
    )


def of_fall(device: Device, place: int, state: DriveState) -> DriveFault:
    """A drive that was running, and is not any more, though it reports no fault."""
    return DriveFault(
        NUMBERS[device], DriveTrouble.NOT_OPERATIONAL,
        f"it is in '{state.value}' without a fault, as after STO or an E-stop; device {place + 1} on the cable",
    )  # fmt: skip


def of_stay(device: Device, place: int, state: DriveState, seconds: float) -> DriveFault:
    """A drive that does not begin to do what it is asked for."""
    return DriveFault(
        NUMBERS[device], DriveTrouble.NOT_OPERATIONAL,
        f"it has stayed in '{state.value}' for {seconds:.1f} s; device {place + 1} on the cable",
    )  # fmt: skip


def of_losses(lost: int, frames: int, grown: Sequence[tuple[Device, int, int]]) -> DriveFault:
    """Frames that do not come back; ``grown``: devices, places and the damaged frames that they have counted."""
    where = "no device has counted a damaged frame"
    number = 0
    if grown:
        device, place, count = max(grown, key=lambda one: one[2])
        number = NUMBERS[device]
        where = f"device {place + 1} on the cable has counted {count} damaged frames"
    return DriveFault(number, DriveTrouble.FRAMES_LOST, f"{lost} of {frames} frames did not come back; {where}")
