"""Registers of a moteus controller, how integers stand for their values, modes, and fault codes in words.

From the register reference of its documentation, docs/protocol/registers.md.
"""

import math
from enum import IntEnum, unique
from typing import Final


@unique
class Register(IntEnum):
    """Those that this driver reads or writes."""

    MODE = 0x000
    POSITION = 0x001
    VELOCITY = 0x002
    TORQUE = 0x003
    HOME_STATE = 0x00C
    VOLTAGE = 0x00D
    TEMPERATURE = 0x00E
    FAULT = 0x00F
    COMMAND_POSITION = 0x020
    COMMAND_VELOCITY = 0x021
    COMMAND_TORQUE = 0x022
    COMMAND_KP_SCALE = 0x023
    COMMAND_KD_SCALE = 0x024
    COMMAND_MAX_TORQUE = 0x025
    COMMAND_STOP_POSITION = 0x026
    COMMAND_TIMEOUT = 0x027
    COMMAND_ILIMIT_SCALE = 0x02B
    AUX1_OUTPUTS = 0x05C
    AUX2_OUTPUTS = 0x05D
    AUX1_ANALOG = 0x060
    AUX2_ANALOG = 0x068
    MILLISECONDS = 0x070
    MODEL_NUMBER = 0x100
    FIRMWARE = 0x101
    REGISTER_MAP = 0x102
    SET_OUTPUT_NEAREST = 0x130
    SET_OUTPUT_EXACT = 0x131


@unique
class Mode(IntEnum):
    """What a controller is doing."""

    STOPPED = 0
    FAULT = 1
    ENABLING = 2
    CALIBRATING = 3
    CALIBRATED = 4
    POSITION = 10
    TIMEOUT = 11
    ZERO_VELOCITY = 12
    BRAKE = 15
    """All phases shorted."""


class Resolution(IntEnum):
    """How a register's value travels; its number stands in the frames."""

    INT8 = 0
    INT16 = 1
    INT32 = 2
    FLOAT = 3


TOLD_EACH_TICK: Final = {
    Register.MODE: Resolution.INT8,
    Register.POSITION: Resolution.FLOAT,
    Register.VELOCITY: Resolution.FLOAT,
    Register.TORQUE: Resolution.FLOAT,
    Register.VOLTAGE: Resolution.INT8,
    Register.TEMPERATURE: Resolution.INT8,
    Register.FAULT: Resolution.INT8,
}
"""What each controller tells of itself in every tick, and how finely: what a few volts and degrees are asked for needs
no more, and a short frame is a quick one."""

_POSITION = (0.01, 0.0001, 0.00001)
_VELOCITY = (0.1, 0.00025, 0.00001)
_TORQUE = (0.5, 0.01, 0.001)
_SHARE = (1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2147483647.0)
_TIME = (0.01, 0.001, 0.000001)
_NUMBER = (1.0, 1.0, 1.0)
_SCALES: Final = {
    Register.POSITION: _POSITION,
    Register.VELOCITY: _VELOCITY,
    Register.TORQUE: _TORQUE,
    Register.VOLTAGE: (0.5, 0.1, 0.001),
    Register.TEMPERATURE: (1.0, 0.1, 0.001),
    Register.COMMAND_POSITION: _POSITION,
    Register.COMMAND_VELOCITY: _VELOCITY,
    Register.COMMAND_TORQUE: _TORQUE,
    Register.COMMAND_KP_SCALE: _SHARE,
    Register.COMMAND_KD_SCALE: _SHARE,
    Register.COMMAND_MAX_TORQUE: _TORQUE,
    Register.COMMAND_STOP_POSITION: _POSITION,
    Register.COMMAND_TIMEOUT: _TIME,
    Register.COMMAND_ILIMIT_SCALE: _SHARE,
    Register.SET_OUTPUT_NEAREST: _POSITION,
    Register.SET_OUTPUT_EXACT: _POSITION,
}
_LARGEST: Final = (127, 32767, 2147483647)
ANALOG_PINS: Final = 5
"""Of each auxiliary port."""


def analog(aux: int, pin: int) -> int:
    """Register of an analog input, pin 0 to 4 of port 1 or 2, as ``aux?.pins.X`` counts them."""
    return (Register.AUX1_ANALOG if aux == 1 else Register.AUX2_ANALOG) + pin


def _is_analog(register: int) -> bool:
    return any(0 <= register - first < ANALOG_PINS for first in (Register.AUX1_ANALOG, Register.AUX2_ANALOG))


def _is_physical(register: int) -> bool:
    """Whether it is no mere number, as a mode or a version is."""
    return register in _SCALES or _is_analog(register)


def scale_of(register: int, resolution: Resolution) -> float:
    """What 1 stands for; 1 of numbers that are no physical value, and of floats."""
    if resolution is Resolution.FLOAT:
        return 1.0
    scales = _SHARE if _is_analog(register) else _SCALES.get(register, _NUMBER)  # type: ignore[call-overload]
    return float(scales[resolution])


def value_of(register: int, resolution: Resolution, raw: float) -> float:
    """A value from what was received; the most negative integer of a physical value stands for no number."""
    if resolution is Resolution.FLOAT:
        return raw
    if raw == -_LARGEST[resolution] - 1 and _is_physical(register):
        return math.nan
    return raw * scale_of(register, resolution)


def raw_of(register: int, resolution: Resolution, value: float) -> float:
    """What to send for a value: cut off where an integer cannot hold it."""
    if resolution is Resolution.FLOAT:
        return value
    largest = _LARGEST[resolution]
    if not math.isfinite(value):
        return -largest - 1
    return int(max(-largest, min(largest, value / scale_of(register, resolution))))


FAULTS: Final = {
    32: "calibration fault: the encoder sees no magnet",
    33: "motor driver fault, most often too little voltage",
    34: "over voltage",
    35: "encoder fault: its readings are not those of a magnet",
    36: "motor not configured: calibrate it with moteus_tool",
    37: "PWM cycle overrun",
    38: "over temperature",
    39: "outside of its position limits",
    40: "under voltage",
    41: "its configuration was changed in operation",
    42: "no valid commutation encoder",
    43: "no valid output encoder",
    44: "the gate driver cannot be enabled",
    45: "stop position together with limits",
    46: "timing violation",
    47: "back-EMF feed-forward without an acceleration limit",
    48: "impossible position limits",
    49: "position control error",
    50: "velocity control error",
    96: "limited by servo.max_velocity",
    97: "limited by servo.max_power_W",
    98: "limited by the supply's voltage",
    99: "limited by servo.max_current_A",
    100: "limited by the temperature of its transistors",
    101: "limited by the motor's temperature",
    102: "limited by the commanded maximum torque",
    103: "limited by its position bounds",
    104: "flux braking",
    105: "field weakening",
}
"""Register 0x00f in words; from 96 on no fault, but what limits the output at present."""


def fault_words(code: int) -> str:
    """A fault code, for people."""
    return f"code {code}: {FAULTS.get(code, 'not in its documentation')}"
