"""Addresses in a slave controller's memory, and the sizes of what stands there (ET1100 data sheet, section II)."""

from typing import Final

MEMORY: Final = 0x3000
"""Registers below 0x1000, process memory above [bytes]."""
TYPE, PORTS, FEATURES, STATION = 0x0000, 0x0007, 0x0008, 0x0010
DL_STATUS, AL_CONTROL, AL_STATUS, AL_CODE = 0x0110, 0x0120, 0x0130, 0x0134
PDI_CONTROL, RX_ERRORS = 0x0140, 0x0300
WATCHDOG_DIVIDER, WATCHDOG_TIME, WATCHDOG_STATUS, WATCHDOG_COUNT = 0x0400, 0x0420, 0x0440, 0x0442
EEPROM_CONTROL, EEPROM_ADDRESS, EEPROM_DATA = 0x0502, 0x0504, 0x0508
FMMU, FMMU_SIZE, FMMUS = 0x0600, 16, 4
SYNC_MANAGER, SYNC_MANAGER_SIZE, SYNC_MANAGERS = 0x0800, 8, 4
RECEIVE_TIMES, SYSTEM_TIME, UNIT_TIME, TIME_OFFSET, TIME_DELAY, TIME_DIFFERENCE = (
    0x0900, 0x0910, 0x0918, 0x0920, 0x0928, 0x092C,
)  # fmt: skip
SYNC_ACTIVATION, SYNC0_START, SYNC0_CYCLE = 0x0981, 0x0990, 0x09A0

EEPROM_READ: Final = 0x0100
EEPROM_EIGHT_BYTES: Final = 0x0040
DC_FEATURE: Final = 0x0004

OUTPUTS_SM, INPUTS_SM = 2, 3
MAILBOX_FULL: Final = 0x08
SM_ENABLED, SM_REPEAT = 0x01, 0x02
SM_WATCHDOG: Final = 0x40
"""In the control byte: writing to this sync manager feeds the watchdog."""

DIVIDER_DEFAULT, WATCHDOG_DEFAULT = 0x09C2, 1000
"""100 µs, and 100 ms of them."""
DIVIDER_TICK: Final = 40
"""Of the watchdog's divider, which counts from 2 [ns]."""

INIT, PREOP, SAFEOP, OP = 1, 2, 4, 8
ERROR: Final = 0x10
"""In AL status: a change of state was refused or forced; in AL control: acknowledged."""
STATE_NAMES: Final = {INIT: "INIT", PREOP: "PRE-OP", SAFEOP: "SAFE-OP", OP: "OP"}

INVALID_CHANGE, UNKNOWN_STATE, BAD_MAILBOX, SYNC_MANAGER_WATCHDOG = 0x0011, 0x0012, 0x0016, 0x001B
BAD_OUTPUTS, BAD_INPUTS, NO_VALID_OUTPUTS = 0x001D, 0x001E, 0x0019
"""AL status codes (ETG.1000.6, table 11)."""
