"""Plants faults between the emulated drives and the plant, and in the drives, when their time has come."""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, Protocol

from hardware.drives.joint import JointScale
from hardware.interfaces import Triple
from hardware.sim.process.planted import ON_DEVICE, PlantedFault, PlantedKind

_THREE: Final = range(3)


class Faulty(Protocol):
    """Devices in which faults can be planted."""

    def plant(self, kind: PlantedKind, device: int, amount: float) -> None:
        """A kind of ``ON_DEVICE`` begins."""

    def mend(self, kind: PlantedKind, device: int) -> None:
        """It ends."""


class Wires(NamedTuple):
    """What a plant shows and does behind faulty wires, shafts and sensors."""

    angle: list[float]
    """Of the servomotors' own shafts [rad]."""
    velocity: list[float]
    readings: list[float]
    """Of the force sensors, in units of their input."""


class Planting:
    """Faults of one world.

    Args:
        faults: to be planted.
        scales: of the servomotors.
        newton: units of the force sensors' input for 1 N each.
        brakes: told the share of each brake's torque that acts while it is open, and while it is closed.
        devices: in which faults of devices are planted.
    """

    def __init__(
        self,
        faults: Sequence[PlantedFault],
        scales: Sequence[JointScale],
        newton: Sequence[float],
        brakes: Callable[[Triple, Triple], None],
        devices: Faulty,
    ) -> None:
        self._waiting = sorted(faults, key=lambda fault: fault.at)
        self._scales, self._newton, self._brakes, self._devices = scales, newton, brakes, devices
        self._active: list[PlantedFault] = []
        self._ends: dict[PlantedFault, float] = {}
        self._age = self._driven = 0.0
        self._frozen: dict[int, float] = {}

    def turn(self, elapsed: float, *, driven: bool) -> None:
        """A tick begins, so long after the one before [s]; the arm was driven or stood on its brakes."""
        self._age += elapsed
        self._driven += elapsed if driven else 0.0
        ended = [fault for fault in self._active if self._ends.get(fault, math.inf) <= self._age]
        for fault in ended:
            self._active.remove(fault)
            if fault.kind in ON_DEVICE:
                self._devices.mend(fault.kind, fault.device)
            elif fault.kind is PlantedKind.ENCODER_DEAD:
                self._frozen.pop(fault.device - 1, None)
        begun = False
        while self._waiting and self._waiting[0].at <= self._driven:
            fault = self._waiting.pop(0)
            self._active.append(fault)
            if fault.lasts is not None:
                self._ends[fault] = self._age + fault.lasts
            begun = True
            if fault.kind in ON_DEVICE:
                self._devices.plant(fault.kind, fault.device, fault.size)
        if begun or ended:
            self._set_brakes()

    def shown(self, angle: Triple, velocity: Triple, readings: Sequence[float]) -> Wires:
        """What sensors say of where the motors really are."""
        wires = Wires(list(angle), list(velocity), list(readings))
        for fault in self._active:
            self._show(fault, wires)
        return wires

    def given(self, torque: Triple) -> Triple:
        """What the motors really give of what their drives give [N m]."""
        real = list(torque)
        for fault in self._active:
            i, size = fault.device - 1, fault.size
            if fault.kind is PlantedKind.TORQUE_SIGN:
                real[i] = -real[i]
            elif fault.kind is PlantedKind.TORQUE_SCALE:
                real[i] *= size
            elif fault.kind is PlantedKind.EXCHANGED:
                _swap(real, i, int(size) - 1)
        a, b, c = real
        return a, b, c

    def _show(self, fault: PlantedFault, wires: Wires) -> None:
        i, size = fault.device - 1, fault.size
        angle, velocity, readings = wires
        match fault.kind:
            case PlantedKind.ENCODER_SIGN:
                angle[i], velocity[i] = -angle[i], -velocity[i]
            case PlantedKind.ENCODER_SCALE:
                angle[i], velocity[i] = size * angle[i], size * velocity[i]
            case PlantedKind.ZERO | PlantedKind.ENCODER_JUMP:
                angle[i] += self._scales[i].motor_velocity(size)
            case PlantedKind.ENCODER_DEAD:
                angle[i], velocity[i] = self._frozen.setdefault(i, angle[i]), 0.0
            case PlantedKind.EXCHANGED | PlantedKind.ENCODERS_EXCHANGED:
                _swap(angle, i, int(size) - 1)
                _swap(velocity, i, int(size) - 1)
            case PlantedKind.FORCE_DEAD:
                readings[i] = 0.0
            case PlantedKind.FORCE_OFFSET:
                readings[i] += size * self._newton[i]

    def _set_brakes(self) -> None:
        stuck = {fault.device - 1 for fault in self._active if fault.kind is PlantedKind.BRAKE_STUCK}
        left = {fault.device - 1: fault.size for fault in self._active if fault.kind is PlantedKind.BRAKE_SLIPS}
        opened, closed = [float(i in stuck) for i in _THREE], [left.get(i, 1.0) for i in _THREE]
        self._brakes((opened[0], opened[1], opened[2]), (closed[0], closed[1], closed[2]))


def _swap(values: list[float], one: int, other: int) -> None:
    values[one], values[other] = values[other], values[one]
