"""One emulated controller: what it does with frames, and what its motor gives.

Modes follow each other as in the firmware (``bldc_servo_control.h``): from stopped to anything by way of enabling, from
fault and timeout to stopped alone; the watchdog bites in position mode alone, and latches.
"""

import math
import time
from collections.abc import Callable, Sequence
from typing import Final

from hardware.drives.moteus import frames
from hardware.drives.moteus.cycle import TURN
from hardware.drives.moteus.frames import FrameError, Subframe, SubframeKind
from hardware.drives.moteus.registers import ANALOG_PINS, Mode, Register, analog, raw_of, value_of
from hardware.sim.emulated.moteus.console import Console
from hardware.sim.emulated.moteus.injected import Injected
from hardware.sim.emulated.moteus.plans import FramePlan, plan_of, runs_of

ENABLING_TIME: Final = 0.020
"""From stopped to its first mode of operation: the firmware measures its current sensors first [s]."""
SHORTED: Final = 0.6
"""Damping of a motor with shorted phases: Kt² / R of a motor with 0.5 N m/A and 0.4 Ω [N m s/rad]."""
VOLTAGE: Final = 24.0
TEMPERATURE: Final = 30.0
"""Usual ones [V, °C]."""
_FACTS: Final[dict[int, float]] = {
    Register.MODEL_NUMBER: 0x0411, Register.FIRMWARE: 0x010000, Register.REGISTER_MAP: 5
}  # fmt: skip
_DEFAULTS: Final[dict[int, float]] = {
    Register.COMMAND_POSITION: 0.0, Register.COMMAND_VELOCITY: 0.0, Register.COMMAND_TORQUE: 0.0,
    Register.COMMAND_KP_SCALE: 1.0, Register.COMMAND_KD_SCALE: 1.0, Register.COMMAND_MAX_TORQUE: math.nan,
    Register.COMMAND_STOP_POSITION: math.nan, Register.COMMAND_TIMEOUT: 0.0, Register.COMMAND_ILIMIT_SCALE: 1.0,
}  # fmt: skip
"""What a command says where nothing was written."""
_NO_SUCH_REGISTER: Final = 1
_MODE: Final = int(Register.MODE)
_POSITION: Final = int(Register.COMMAND_POSITION)
_PLANS: Final = 6
"""So many kinds of frames are remembered."""
_IDLE: Final = (Mode.STOPPED, Mode.FAULT, Mode.ENABLING)


class EmulatedController:
    """Registers of one controller; all times are ``time.monotonic`` [s].

    Attributes:
        mode: what it does.
        inputs: readings of analog inputs, by register.
        outputs: of both auxiliary ports, by register.
        toggled: those of them that have changed, until somebody takes that away.
        injected: faults.
        commands: so many command frames it has taken.
    """

    def __init__(self, device: int) -> None:
        self.device, self.injected = device, Injected()
        self.console = Console(device, self.injected)
        self.mode, self.code, self.commands = Mode.STOPPED, 0, 0
        self.inputs = {analog(aux, pin): 0.0 for aux in (1, 2) for pin in range(ANALOG_PINS)}
        self.outputs = {int(Register.AUX1_OUTPUTS): 0, int(Register.AUX2_OUTPUTS): 0}
        self.toggled: dict[int, int] = {}
        self._command = dict(_DEFAULTS)
        self._plans: list[FramePlan] = []
        injected = self.injected
        self._own: dict[int, Callable[[], float]] = {
            Register.MODE: lambda: self.mode,
            Register.POSITION: lambda: self._angle / TURN + injected.encoder_jump,
            Register.VELOCITY: lambda: self._velocity / TURN,
            Register.TORQUE: lambda: self._given,
            Register.HOME_STATE: lambda: injected.home_state,
            Register.VOLTAGE: lambda: VOLTAGE if injected.voltage is None else injected.voltage,
            Register.TEMPERATURE: lambda: TEMPERATURE if injected.temperature is None else injected.temperature,
            Register.FAULT: lambda: self.code,
            Register.MILLISECONDS: lambda: int(1e3 * time.monotonic()) % 8388608,
        }
        self._wanted = Mode.STOPPED
        self._angle = self._velocity = self._given = 0.0
        self._target = math.nan
        self._heard_at = self._enabled_at = math.inf

    # frames

    def take(self, data: bytes, now: float) -> bytes:
        """A frame; the answer to it, without NOPs."""
        self._watch(now)
        if self.injected.dead:
            return b""
        plan = next((plan for plan in self._plans if plan.fits(data)), None)
        if plan is not None:
            self._write(plan.values(data), now)
            answer = plan.reply(self._value)
            if answer is not None:
                return answer
        return self._take_apart(data, now)

    def _take_apart(self, data: bytes, now: float) -> bytes:
        """A frame that is new, or holds text."""
        try:
            parts = list(frames.parse(data))
        except FrameError:
            return b""
        plan = plan_of(data, parts)
        if plan is not None:
            self._plans = [plan, *self._plans[: _PLANS - 1]]
        for part in parts:
            if part.part is SubframeKind.TEXT_IN:
                self.console.hear(part.text)
        self._write(
            [
                (part.register, value_of(part.register, part.resolution, part.value))
                for part in parts
                if part.part is SubframeKind.WRITE
            ],
            now,
        )
        polled = [frames.text_out(self.console.say(part.register)) for part in parts if part.part is SubframeKind.POLL]
        return b"".join(polled) + self._answers(parts)

    def _write(self, written: Sequence[tuple[int, float]], now: float) -> None:
        command, mode = None, None
        for register, value in written:
            if register == _MODE:
                mode, command = int(value), dict(_DEFAULTS)
            elif register in self.outputs:
                self.toggled[register] = self.toggled.get(register, 0) | (self.outputs[register] ^ int(value))
                self.outputs[register] = int(value)
            elif command is not None and register in command:
                command[register] = value
        if mode is None or command is None:
            return
        self.commands += 1
        self._command, self._heard_at = command, now
        self._ask_for(mode, now)
        if math.isfinite(position := command[_POSITION]):
            self._target = position

    def _ask_for(self, mode: int, now: float) -> None:
        """Change the mode as the firmware would."""
        if mode == Mode.STOPPED:
            self.mode, self.code = Mode.STOPPED, 0
        elif mode in (Mode.POSITION, Mode.ZERO_VELOCITY, Mode.BRAKE):
            self._wanted = Mode(mode)
            if self.mode is Mode.STOPPED and not self.injected.stays:
                self.mode, self._enabled_at = Mode.ENABLING, now + ENABLING_TIME
            elif self.mode not in (Mode.STOPPED, Mode.FAULT, Mode.TIMEOUT, Mode.ENABLING):
                self._enter(self._wanted)

    def _enter(self, mode: Mode) -> None:
        if mode is not self.mode:
            self.mode, self._target = mode, self._angle / TURN

    def _watch(self, now: float) -> None:
        """What time alone brings about."""
        if self.injected.code:
            self.mode, self.code, self.injected.code = Mode.FAULT, self.injected.code, 0
        if self.injected.reset:
            self.mode, self.injected.reset = Mode.STOPPED, False
            self.console.forget()
        if self.mode is Mode.ENABLING and now >= self._enabled_at:
            self._enter(self._wanted)
        if self.mode is Mode.POSITION and self.injected.watchdog_bites:
            timeout = self._command[Register.COMMAND_TIMEOUT] or self.console.values["servo.default_timeout_s"]
            if now - self._heard_at > timeout:  # a time-out that is no number never passes
                self._enter(Mode.TIMEOUT)

    def _answers(self, parts: Sequence[Subframe]) -> bytes:
        """Answers to all questions of a frame; registers that follow each other are answered together."""
        answer = b""
        for run in runs_of([part for part in parts if part.part is SubframeKind.READ]):
            values = [self._value(part.register) for part in run]
            if None in values:
                answer += frames.read_error(run[values.index(None)].register, _NO_SUCH_REGISTER)
                continue
            first, kind = run[0].register, run[0].resolution
            raw = [raw_of(first + k, kind, value or 0.0) for k, value in enumerate(values)]
            answer += frames.reply(kind, first, raw)
        return answer

    def _value(self, register: int) -> float | None:
        """What a register says; None: there is no such one."""
        own = self._own.get(register)
        return own() if own else self._command.get(register, self.inputs.get(register, _FACTS.get(register)))

    # the motor

    def sense(self, angle: float, velocity: float) -> None:
        """Where its motor is now [rad, rad/s]."""
        self._angle, self._velocity = angle, velocity

    def act(self, now: float, elapsed: float) -> float:
        """Torque for the time to come [N m]; so much has passed since it was asked last [s]."""
        self._watch(now)
        self._given = self.injected.torque_share * self._torque(elapsed)
        return self._given

    @property
    def drives(self) -> bool:
        """Whether its motor is driven, or shorted."""
        return self.mode not in _IDLE

    @property
    def asked_velocity(self) -> float | None:
        """What the motor is asked for in position mode [rad/s]; None in others."""
        if self.mode is not Mode.POSITION:
            return None
        return self._command[Register.COMMAND_VELOCITY] * TURN

    @property
    def damping(self) -> float:
        """Of its motor, by shorted phases [N m s/rad]."""
        after = self.mode is Mode.TIMEOUT and self.console.values["servo.timeout_mode"] == Mode.BRAKE
        return SHORTED if self.mode is Mode.BRAKE or after else 0.0

    def _torque(self, elapsed: float) -> float:
        mode, command, values = self.mode, self._command, self.console.values
        if mode in _IDLE:
            return 0.0
        most = command[Register.COMMAND_MAX_TORQUE]
        if mode is Mode.TIMEOUT:
            mode = Mode(int(values["servo.timeout_mode"]))
            command, most = _DEFAULTS, math.nan
            if mode is Mode.ZERO_VELOCITY:
                most = values["servo.timeout_max_torque_Nm"]
        if mode is Mode.BRAKE:
            return 0.0
        return _cut(self._loop(mode, command, elapsed), most)

    def _loop(self, mode: Mode, command: dict[int, float], elapsed: float) -> float:
        """The position loop."""
        values = self.console.values
        asked = command[Register.COMMAND_VELOCITY]
        self._target += asked * elapsed
        error = 0.0 if mode is Mode.ZERO_VELOCITY else self._target - self._angle / TURN
        torque = command[Register.COMMAND_KP_SCALE] * values["servo.pid_position.kp"] * error
        slower = asked - self._velocity / TURN
        torque += command[Register.COMMAND_KD_SCALE] * values["servo.pid_position.kd"] * slower
        return torque + (command[Register.COMMAND_TORQUE] if mode is Mode.POSITION else 0.0)


def _cut(torque: float, most: float) -> float:
    return min(most, max(-most, torque)) if math.isfinite(most) else torque
