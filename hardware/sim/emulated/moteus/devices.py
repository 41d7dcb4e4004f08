"""Emulated controllers as devices of a plant: three servomotors, the gripper, and the relay of the brakes."""

import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from hardware.drives.moteus.registers import Register, analog
from hardware.drives.moteus.settings import MoteusSettings, PinSettings
from hardware.sim.emulated.answer_times import AnswerTimes
from hardware.sim.emulated.moteus.adapter import EmulatedAdapter
from hardware.sim.emulated.moteus.controller import EmulatedController
from hardware.sim.emulated.plant_drives import MotorCommand, MotorState
from hardware.sim.process.planted import PlantedKind

PORT: Final = "moteus"
"""Name of the pseudo-terminal's link in the run directory."""
RELAY_TIME: Final = 0.044
"""The relay of the brakes lets go when its input has not changed for so long [s]."""
_GRIPPER: Final = 3
_TOO_HOT, _TOO_LITTLE, _DRIVER_FAULT = 95.0, 11.0, 33
"""What a controller says when it is too hot [°C], has too little voltage [V], or its motor driver fails (a code)."""


class MoteusDevices:
    """``EmulatedDevices`` of one moteus bus; ``controllers`` are in the order of the settings' ids."""

    def __init__(self, run_dir: Path, settings: MoteusSettings, times: AnswerTimes | None = None) -> None:
        self.controllers = [EmulatedController(device) for device in settings.ids]
        by_id = {controller.device: controller for controller in self.controllers}
        self._adapter = EmulatedAdapter(run_dir / PORT, by_id)
        self.times = times
        self._relay = None if settings.brakes is None else Relay(by_id[settings.brakes.id], settings.brakes)
        self._inputs = [(by_id[pin.id], analog(pin.aux, pin.pin)) for pin in settings.forces or ()]
        self._given: set[int] = set()
        self._acted = math.nan
        self.heard = 0.0

    @property
    def numbers(self) -> Sequence[int]:
        """See ``EmulatedDevices``."""
        return (self._adapter.number,)

    @property
    def prompt(self) -> bool:
        """See ``EmulatedDevices``."""
        return False

    @property
    def complete(self) -> bool:
        """See ``EmulatedDevices``."""
        return len(self._given) == len(self.controllers)

    def hear(self) -> None:
        """See ``EmulatedDevices``."""
        self.heard = time.monotonic()
        self._given |= self._adapter.serve(self.heard)
        if self.times is not None:
            self.times.note(self.heard, time.monotonic())
        if self._relay is not None:
            self._relay.look(self.heard)

    def act(self, now: float) -> MotorCommand:
        """See ``EmulatedDevices``."""
        elapsed, self._acted = now - self._acted if math.isfinite(self._acted) else 0.0, now
        self._given.clear()
        a, b, c, _ = (controller.act(now, elapsed) for controller in self.controllers)
        # without brakes an arm that is not driven as a whole is taken to stand on something
        powered = all(controller.drives for controller in self.controllers[:_GRIPPER])
        braked = not powered if self._relay is None else not self._relay.feeds(now)
        one, two, three = (controller.damping for controller in self.controllers[:_GRIPPER])
        speed = self.controllers[_GRIPPER].asked_velocity
        return MotorCommand((a, b, c), speed, braked, powered or not braked, (one, two, three))

    def sense(self, state: MotorState) -> None:
        """See ``EmulatedDevices``."""
        for controller, angle, velocity in zip(self.controllers, state.angle, state.velocity, strict=False):
            controller.sense(angle, velocity)
        self.controllers[_GRIPPER].sense(state.gripper_angle, 0.0)
        for (controller, register), reading in zip(self._inputs, state.readings, strict=False):
            controller.inputs[register] = reading

    def plant(self, kind: PlantedKind, device: int, amount: float) -> None:
        """See ``Faulty``."""
        injected = self.controllers[device - 1].injected
        match kind:
            case PlantedKind.NOT_FOLLOWED:
                injected.torque_share = amount
            case PlantedKind.TOO_HOT:
                injected.temperature = _TOO_HOT
            case PlantedKind.UNDER_VOLTAGE:
                injected.voltage = _TOO_LITTLE
            case PlantedKind.DROPS_OUT:
                injected.code = _DRIVER_FAULT
            case PlantedKind.SILENT:
                injected.lost_replies = sys.maxsize
            case PlantedKind.LOST_FRAMES:
                injected.lost_replies = int(amount)
            case PlantedKind.CORRUPT_FRAMES:
                injected.corrupt_replies = int(amount)
            case PlantedKind.WATCHDOG_DEAD:
                injected.watchdog_bites = False
            case _:
                raise ValueError(f"{kind} is not a fault of a device")

    def mend(self, kind: PlantedKind, device: int) -> None:
        """See ``Faulty``."""
        injected = self.controllers[device - 1].injected
        match kind:
            case PlantedKind.NOT_FOLLOWED:
                injected.torque_share = 1.0
            case PlantedKind.TOO_HOT:
                injected.temperature = None
            case PlantedKind.UNDER_VOLTAGE:
                injected.voltage = None
            case PlantedKind.SILENT | PlantedKind.LOST_FRAMES:
                injected.lost_replies = 0
            case PlantedKind.CORRUPT_FRAMES:
                injected.corrupt_replies = 0
            case PlantedKind.WATCHDOG_DEAD:
                injected.watchdog_bites = True

    def close(self) -> None:
        """See ``EmulatedDevices``."""
        self._adapter.close()


class Relay:
    """Feeds the brakes' coils while an output of a controller changes."""

    def __init__(self, controller: EmulatedController, pin: PinSettings) -> None:
        self._controller = controller
        self._register = int(Register.AUX1_OUTPUTS if pin.aux == 1 else Register.AUX2_OUTPUTS)
        self._bit = 1 << pin.pin
        self._changed = -math.inf

    def look(self, now: float) -> None:
        """See whether the output has changed since; it may have done so twice."""
        if self._controller.toggled.pop(self._register, 0) & self._bit:
            self._changed = now

    def feeds(self, now: float) -> bool:
        """Whether it feeds the coils, so that the brakes are open."""
        return now - self._changed < RELAY_TIME
