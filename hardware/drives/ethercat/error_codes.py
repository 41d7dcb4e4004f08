"""What a drive's error code (0x603F) means: CiA 402-2, table 21 (as DRIVECOM and IEC 61800-7-201), for the groups that
servo drives use. A code that is not known is told by its group; makers add codes of their own (0xFF00 to 0xFFFF).
"""

from typing import Final

from hardware.interfaces import DriveTrouble

_WORDS: Final = {
    0x2310: "continuous over-current",
    0x2320: "short circuit or earth leakage at the motor",
    0x2330: "earth leakage",
    0x2340: "short circuit at the motor",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3130: "a mains phase is missing",
    0x3210: "over-voltage in the intermediate circuit",
    0x3220: "under-voltage in the intermediate circuit",
    0x4110: "its surroundings are too hot",
    0x4210: "the device is too hot",
    0x4310: "the drive is too hot",
    0x5112: "its control supply is too low",
    0x5441: "its safe-torque-off input is open",
    0x5530: "its parameter memory is damaged",
    0x6010: "its own watchdog has tripped",
    0x6320: "a parameter is wrong",
    0x7121: "the motor is blocked",
    0x7122: "the commutation is wrong",
    0x7300: "a sensor failed",
    0x7305: "the incremental encoder failed",
    0x7306: "the second incremental encoder failed",
    0x7380: "the position sensor failed",
    0x7500: "communication was lost",
    0x8311: "too much torque",
    0x8400: "it does not follow the velocity",
    0x8500: "it does not follow the position",
    0x8611: "the following error is too large",
    0x8700: "it is out of step with SYNC0",
}
_GROUPS: Final = {
    0x2: "current", 0x3: "voltage", 0x4: "temperature", 0x5: "its own electronics", 0x6: "its own software",
    0x7: "an additional module", 0x8: "monitoring", 0x9: "something outside", 0xF: "the manufacturer's own codes",
}  # fmt: skip
_TROUBLES: Final = (
    (0x4000, 0xF000, DriveTrouble.TOO_HOT),
    (0x3120, 0xFFF0, DriveTrouble.UNDER_VOLTAGE),
    (0x3130, 0xFFF0, DriveTrouble.UNDER_VOLTAGE),
    (0x3220, 0xFFF0, DriveTrouble.UNDER_VOLTAGE),
    (0x5110, 0xFFF0, DriveTrouble.UNDER_VOLTAGE),
    (0x3110, 0xFFF0, DriveTrouble.OVER_VOLTAGE),
    (0x3210, 0xFFF0, DriveTrouble.OVER_VOLTAGE),
    (0x8700, 0xFFF0, DriveTrouble.OUT_OF_STEP),
)


def words_of(code: int) -> str:
    """An error code for people."""
    known = _WORDS.get(code)
    group = _GROUPS.get(code >> 12)
    return known or (f"something about {group}" if group else "not explained by the standard")


def trouble_of(code: int) -> DriveTrouble:
    """Which kind of trouble an error code tells of."""
    for start, mask, trouble in _TROUBLES:
        if code & mask == start:
            return trouble
    return DriveTrouble.FAULT_CODE
