"""The state machine of a CiA 402 drive, as pure functions of its status word (CiA 402-2, IEC 61800-7-201)."""

from enum import Enum, IntEnum
from typing import Final

MODE_TORQUE, MODE_VELOCITY = 10, 9
"""0x6060: cyclic synchronous torque (cst), cyclic synchronous velocity (csv)."""
FAULT_RESET: Final = 0x0080
_LIMITED: Final = 0x0800


class DriveState(Enum):
    """Of a drive; the words are for people."""

    NOT_READY = "Not ready to switch on"
    DISABLED = "Switch on disabled"
    READY = "Ready to switch on"
    SWITCHED_ON = "Switched on"
    ENABLED = "Operation enabled"
    QUICK_STOP = "Quick stop active"
    FAULT_REACTION = "Fault reaction active"
    FAULT = "Fault"


class Wanted(IntEnum):
    """What a drive is asked for, from less to more."""

    OFF = 0
    """No power; its brake is closed."""
    STANDBY = 1
    """Power on; its brake is closed, and torque is not followed yet."""
    RUN = 2
    """The command is followed, its brake is open."""


_SHUTDOWN, _SWITCH_ON, _ENABLE, _DISABLE_VOLTAGE = 0x0006, 0x0007, 0x000F, 0x0000
_BY_BITS: Final = {
    0x00: DriveState.NOT_READY,
    0x40: DriveState.DISABLED,
    0x01: DriveState.READY,
    0x03: DriveState.SWITCHED_ON,
    0x07: DriveState.ENABLED,
    0x0F: DriveState.FAULT_REACTION,
    0x08: DriveState.FAULT,
}
_LOOKUP: Final = tuple(
    DriveState.QUICK_STOP if word & 0x6F == 0x07 else _BY_BITS.get(word & 0x4F, DriveState.NOT_READY)
    for word in range(128)
)


def state_of(status: int) -> DriveState:
    """The state that a status word (0x6041) says."""
    return _LOOKUP[status & 0x7F]


def limited(status: int) -> bool:
    """Whether the drive itself cuts what it was asked for (bit 11)."""
    return bool(status & _LIMITED)


def control_word(state: DriveState, wanted: Wanted) -> int:
    """The next step (0x6040) from a state to what is wanted. Faults are not reset by it, see ``reset_word``."""
    if state in (DriveState.FAULT, DriveState.FAULT_REACTION, DriveState.NOT_READY, DriveState.QUICK_STOP):
        return _DISABLE_VOLTAGE
    if wanted is Wanted.OFF or state is DriveState.DISABLED:
        return _SHUTDOWN
    if wanted is Wanted.STANDBY or state is DriveState.READY:
        return _SWITCH_ON
    return _ENABLE


def reset_word(before: int) -> int:
    """What resets a fault after this control word: the reset bit counts where it rises."""
    return before ^ FAULT_RESET if before & FAULT_RESET else FAULT_RESET
