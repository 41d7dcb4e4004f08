"""Frames of every tick: what each controller is told and asked in one frame, and how its answer is read.

The text of a frame is put together from parts that were made once, so that an exchange costs this computer some 10 µs
for each controller. Motors count turns; everything here is in radians.
"""

import math
import struct
from collections.abc import Sequence
from typing import Final, NamedTuple

from hardware.drives.moteus.frames import AnswerLayout, Asked, FrameError, address, padded, write
from hardware.drives.moteus.registers import TOLD_EACH_TICK, Mode, Register, Resolution, raw_of, scale_of, value_of

TURN: Final = 2.0 * math.pi
_FLOAT: Final = struct.Struct("<f")
_NEVER: Final = math.nan
_OUTPUTS: Final = 32
"""States of a port's five digital outputs."""
_VOLT, _DEGREE = (scale_of(one, TOLD_EACH_TICK[one]) for one in (Register.VOLTAGE, Register.TEMPERATURE))
_NO_DEGREES: Final = raw_of(Register.TEMPERATURE, TOLD_EACH_TICK[Register.TEMPERATURE], math.nan)


class Told(NamedTuple):
    """What a controller says of itself."""

    mode: int
    angle: float
    """[rad]."""
    velocity: float
    """[rad/s]."""
    torque: float
    """At its shaft, from its currents [N m]."""
    voltage: float
    """Of its supply [V]."""
    temperature: float
    """Of its transistors [°C]; no number if it cannot tell."""
    code: int
    """Of its fault, or of what limits it."""
    inputs: tuple[float, ...] = ()
    """Analog inputs, as shares of their range."""


class CommandLimits(NamedTuple):
    """What a controller is told with every command."""

    torque: float
    """Largest, at its shaft [N m]."""
    timeout: float
    """Without a command for so long it brakes by itself [s]; no number: never."""


class _Text(NamedTuple):
    """Text of a frame around a value."""

    before: bytes
    after: list[bytes]
    """For each state of the digital outputs."""


class Controller:
    """Frames for one controller, as text; and its answers.

    Args:
        device: its id on the bus.
        limits: of its torque, and its watchdog.
        inputs: registers of analog inputs that it is asked for, in ascending order.
        output: register of digital outputs that goes with every command; None: there is none.
    """

    def __init__(
        self, device: int, limits: CommandLimits, inputs: Sequence[int] = (), output: int | None = None
    ) -> None:
        self.device = device
        self._inputs = tuple(inputs)
        self._layout = AnswerLayout(
            _together([*TOLD_EACH_TICK.items(), *((register, Resolution.INT16) for register in inputs)])
        )
        self._output = output
        self._head = b"can send %04x " % address(device)
        scale = limits.torque, limits.timeout
        self._torque = self._parts(_position_mode(_NEVER, 0.0, 0.0, 0.0, *scale), Register.COMMAND_TORQUE)
        self._velocity = self._parts(_position_mode(_NEVER, 0.0, 0.0, 1.0, *scale), Register.COMMAND_VELOCITY)
        self._kept = self._parts(_position_mode(_NEVER, 0.0, 0.0, 1.0, scale[0], _NEVER), Register.COMMAND_VELOCITY)
        self._hold = self._parts(_position_mode(0.0, 0.0, 0.0, 1.0, *scale), Register.COMMAND_POSITION)
        self._modes = {mode: write(Resolution.INT8, Register.MODE, [mode]) for mode in (Mode.STOPPED, Mode.BRAKE)}

    # commands, as lines without their ends; ``pump`` is the state of the digital outputs

    def torque(self, torque: float, pump: int = 0) -> bytes:
        """Give a torque [N m]."""
        return _line(self._torque, torque, pump)

    def velocity(self, velocity: float, pump: int = 0, *, kept: bool = False) -> bytes:
        """Turn with a velocity [rad/s]; ``kept``: also if no other command comes."""
        return _line(self._kept if kept else self._velocity, velocity / TURN, pump)

    def hold(self, angle: float, pump: int = 0) -> bytes:
        """Stay at an angle [rad], by the controller's own position loop."""
        return _line(self._hold, angle / TURN, pump)

    def mode(self, mode: Mode, pump: int = 0) -> bytes:
        """Stop, which clears faults; or brake by shorting the motor."""
        data = self._modes[mode] + self._outputs(pump) + self._layout.query
        return self._head + padded(data).hex().encode() + b" BF"

    def read(self, data: bytes) -> Told:
        """The answer to any of these; raises ``FrameError`` if it is to something else, or holds no numbers."""
        mode, turns, speed, torque, volts, degrees, code, *inputs = self._layout.unpack(data)
        if not math.isfinite(turns + speed + torque):
            raise FrameError("position, velocity or torque is not a number")
        shares = tuple(
            value_of(register, Resolution.INT16, raw) for register, raw in zip(self._inputs, inputs, strict=True)
        )
        temperature = math.nan if degrees == _NO_DEGREES else degrees * _DEGREE
        return Told(int(mode), turns * TURN, speed * TURN, torque, volts * _VOLT, temperature, int(code), shares)

    # their text

    def _outputs(self, pump: int) -> bytes:
        return b"" if self._output is None else write(Resolution.INT8, self._output, [pump])

    def _parts(self, command: tuple[bytes, dict[int, int]], changing: Register) -> _Text:
        """The text of a command around the value that changes."""
        data, at = command
        place = 2 * at[changing]
        whole = [padded(data + self._outputs(pump) + self._layout.query).hex().encode() for pump in range(_OUTPUTS)]
        return _Text(self._head + whole[0][:place], [one[place + 8 :] + b" BF" for one in whole])


def _together(registers: Sequence[tuple[int, Resolution]]) -> list[Asked]:
    """Questions for ascending registers; those that follow each other in one resolution are one."""
    asked: list[Asked] = []
    for register, resolution in registers:
        last = asked[-1] if asked else None
        if last and register == last.register + last.number and resolution is last.resolution:
            asked[-1] = last._replace(number=last.number + 1)
        else:
            asked.append(Asked(resolution, register, 1))
    return asked


def _line(text: _Text, value: float, pump: int) -> bytes:
    return text.before + _FLOAT.pack(value).hex().encode() + text.after[pump]


def _position_mode(
    position: float, velocity: float, torque: float, gain: float, most: float, timeout: float
) -> tuple[bytes, dict[int, int]]:
    """A command of mode 10, and at which bytes its floats stand; gains are shares of those configured.

    The integrator follows the gain; position in turns, velocity in turns/s.
    """
    data, at = write(Resolution.INT8, Register.MODE, [Mode.POSITION]), {}
    floats = {
        Register.COMMAND_POSITION: position, Register.COMMAND_VELOCITY: velocity, Register.COMMAND_TORQUE: torque
    }  # fmt: skip
    part = write(Resolution.FLOAT, Register.COMMAND_POSITION, list(floats.values()))
    for number, register in enumerate(floats):
        at[int(register)] = len(data) + len(part) - 4 * (3 - number)
    data += part
    scale = raw_of(Register.COMMAND_KP_SCALE, Resolution.INT8, gain)
    data += write(Resolution.INT8, Register.COMMAND_KP_SCALE, [scale, scale])
    data += write(Resolution.FLOAT, Register.COMMAND_MAX_TORQUE, [most])
    data += write(Resolution.FLOAT, Register.COMMAND_TIMEOUT, [timeout])
    data += write(Resolution.INT8, Register.COMMAND_ILIMIT_SCALE, [scale])
    return data, at
