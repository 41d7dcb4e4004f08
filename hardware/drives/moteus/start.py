"""What a driver makes sure of before it drives: who is there, watchdogs, gains, and that positions are known.

Nothing moves here.
"""

import math
import time
from collections.abc import Callable
from typing import Final, NamedTuple

from hardware.drives.joint import FingerScale, JointScale
from hardware.drives.moteus import frames
from hardware.drives.moteus.adapter import Adapter
from hardware.drives.moteus.cycle import TURN, CommandLimits, Controller
from hardware.drives.moteus.registers import Mode, Register, Resolution, analog
from hardware.drives.moteus.settings import MoteusSettings, PinSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import HardwareError
from hardware.parameters import RobotParameters

DAMP: Final = Mode.BRAKE
"""What a servomotor does when its watchdog bites, where power-off brakes close at the same time …"""
HOLD: Final = Mode.POSITION
"""… and where there are none."""
GRIPPER: Final = 3
"""Place of the gripper among the controllers."""


class Firmware(NamedTuple):
    """Who answered."""

    device: int
    version: str
    model: int


class Machine(NamedTuple):
    """Four controllers, and what they are told."""

    controllers: tuple[Controller, ...]
    """Of servomotors 1 to 3 and of the gripper."""
    forces: tuple[tuple[int, int], tuple[int, int]] | None
    """Where the right and the left sensor are read: place of the controller, place among its inputs."""
    pump: tuple[int, int] | None
    """Which controller opens the brakes, and the bit of its output."""


def machine_of(drives: DriveSettings, settings: MoteusSettings, parameters: RobotParameters) -> Machine:
    """Frames as the settings want them."""
    inputs: dict[int, list[int]] = {device: [] for device in settings.ids}
    for pin in settings.forces or ():
        inputs[pin.id].append(analog(pin.aux, pin.pin))
    most = [
        abs(JointScale.of(joint).motor_torque(joint.peak(parameters.drive))) for joint in drives.joints
    ]  # fmt: skip
    finger = drives.finger
    force = parameters.gripper.max_force if finger.force_limit is None else finger.force_limit
    most.append(FingerScale.of(finger).motor_torque(force))
    controllers = tuple(
        Controller(
            device, CommandLimits(limit, drives.watchdog), sorted(set(inputs[device])), _output(settings.brakes, device)
        )
        for device, limit in zip(settings.ids, most, strict=True)
    )  # fmt: skip

    def place(pin: PinSettings) -> tuple[int, int]:
        return settings.ids.index(pin.id), sorted(set(inputs[pin.id])).index(analog(pin.aux, pin.pin))

    forces = None if settings.forces is None else (place(settings.forces[0]), place(settings.forces[1]))
    brakes = settings.brakes
    pump = None if brakes is None else (settings.ids.index(brakes.id), 1 << brakes.pin)
    return Machine(controllers, forces, pump)


def _output(brakes: PinSettings | None, device: int) -> int | None:
    if brakes is None or brakes.id != device:
        return None
    return Register.AUX1_OUTPUTS if brakes.aux == 1 else Register.AUX2_OUTPUTS


def start(
    adapter: Adapter,
    drives: DriveSettings,
    settings: MoteusSettings,
    parameters: RobotParameters,
    sleep: Callable[[float], None] = time.sleep,
) -> list[Firmware]:
    """See that all is as it has to be, and set what has to be set; who answered.

    Raises ``HardwareError``: somebody does not answer, does not know its position, or does not keep what it is set to;
    or a watchdog does not bite.
    """
    found = [identify(adapter, device) for device in settings.ids]
    for device in settings.ids:
        adapter.ask(device, frames.write(Resolution.INT8, Register.MODE, [Mode.STOPPED]) + _mode_query())
    for device, joint in zip(settings.ids, drives.joints, strict=False):
        _require_position(adapter, device)
        scale = JointScale.of(joint)
        slope = abs(scale.motor_torque(1.0) / scale.motor_velocity(1.0)) * TURN  # of joint to motor, of rad to turns
        configure_servo(adapter, device, drives, settings, slope)
    configure_gripper(adapter, settings.ids[GRIPPER], drives, parameters)
    for device in settings.ids[:GRIPPER]:
        prove_watchdog(adapter, device, drives.watchdog, sleep)
    return found


def identify(adapter: Adapter, device: int) -> Firmware:
    """Who has an id."""
    version = int(adapter.register(device, Register.FIRMWARE))
    model = int(adapter.register(device, Register.MODEL_NUMBER))
    words = ".".join(str(version >> shift & 0xFF) for shift in (16, 8, 0))
    return Firmware(device, words, model)


def configure_servo(
    adapter: Adapter, device: int, drives: DriveSettings, settings: MoteusSettings, slope: float
) -> None:
    """Watchdog, what follows when it bites, and the gains of a servomotor that holds by itself."""
    after = HOLD if settings.brakes is None else DAMP
    adapter.configure(device, "servo.default_timeout_s", drives.watchdog)
    adapter.configure(device, "servo.timeout_mode", float(after))
    adapter.configure(device, "servo.pid_position.kp", settings.hold_stiffness * slope)
    adapter.configure(device, "servo.pid_position.ki", 0.0)
    adapter.configure(device, "servo.pid_position.kd", settings.hold_damping * slope)


def configure_gripper(adapter: Adapter, device: int, drives: DriveSettings, parameters: RobotParameters) -> None:
    """A servo of velocity alone, as strong as the robot's parameters say.

    In stall it presses with its gain times the velocity that it is asked for.
    """
    travel = drives.finger.travel
    gain = 2.0 * travel * parameters.gripper.velocity_gain * travel * TURN  # of both fingers; N m for a turn/s
    adapter.configure(device, "servo.pid_position.kp", 0.0)
    adapter.configure(device, "servo.pid_position.ki", 0.0)
    adapter.configure(device, "servo.pid_position.kd", gain)


def _require_position(adapter: Adapter, device: int) -> None:
    if not adapter.register(device, Register.HOME_STATE, Resolution.INT8) > 0:
        raise HardwareError(
            f"controller {device} does not know its position after power-up: give it an absolute encoder at the "
            "output, and configure it as source of its position"
        )


def prove_watchdog(adapter: Adapter, device: int, timeout: float, sleep: Callable[[float], None]) -> None:
    """A command of no torque, silence, and the watchdog must have bitten; then stopped again."""
    command = Controller(device, CommandLimits(0.0, timeout))
    line = command.hold(_angle(adapter, device))
    data = bytes.fromhex(line.split()[3].decode())
    until = time.monotonic() + 2.0
    while (mode := command.read(adapter.ask(device, data)).mode) != Mode.POSITION:
        if time.monotonic() > until or mode in (Mode.FAULT, Mode.TIMEOUT):
            raise HardwareError(
                f"controller {device} does not start to work, it stays in mode {mode}: check its fault with moteus_tool"
            )
        sleep(0.002)
    sleep(2.0 * timeout + 0.01)
    mode = int(adapter.register(device, Register.MODE, Resolution.INT8))
    adapter.ask(device, frames.write(Resolution.INT8, Register.MODE, [Mode.STOPPED]) + _mode_query())
    if mode != Mode.TIMEOUT:
        raise HardwareError(
            f"the watchdog of controller {device} does not trip: {2e3 * timeout + 10.0:.0f} ms after its last command "
            f"it is in mode {mode} instead of {int(Mode.TIMEOUT)}: do not drive the arm, update its firmware"
        )


def _angle(adapter: Adapter, device: int) -> float:
    turns = adapter.register(device, Register.POSITION, Resolution.FLOAT)
    if not math.isfinite(turns):
        raise HardwareError(f"controller {device} reports no position: check its encoder")
    return turns * TURN


def _mode_query() -> bytes:
    return frames.read(Resolution.INT8, Register.MODE)
