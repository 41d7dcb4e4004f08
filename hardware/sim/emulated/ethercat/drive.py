"""A CiA 402 drive behind a slave controller: state machine, cyclic synchronous torque and velocity, its own faults.

It knows motors, not joints: angles, velocities and torques are those at the motor's shaft. What turns the shaft, and
what the torque does, is the plant's business.
"""

import math
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final, Self

from hardware.sim.emulated.ethercat.dictionary import (
    INPUT_ASSIGNMENT,
    INPUT_MAPPING,
    OUT_OF_RANGE,
    OUTPUT_ASSIGNMENT,
    OUTPUT_MAPPING,
    Abort,
    Dictionary,
    Entry,
)
from hardware.sim.emulated.ethercat.process_data import ProcessData
from hardware.sim.emulated.ethercat.sii import Identity

CST, CSV = 10, 9
COMMUNICATION_FAULT: Final = 0x7500
"""What the drive reports once its watchdog has bitten."""
_MODES: Final = 1 << (CSV - 1) | 1 << (CST - 1)
_ROOM: Final = 16
"""Objects in a PDO at most."""


class Power(IntEnum):
    """States of a drive by their bits in the status word."""

    DISABLED = 0x0040
    READY = 0x0021
    SWITCHED_ON = 0x0023
    ENABLED = 0x0027
    QUICK_STOP = 0x0007
    FAULT = 0x0008


_VOLTAGE, _REMOTE, _LIMITED, _FOLLOWS = 0x0010, 0x0200, 0x0800, 0x1000
_FAULT_RESET: Final = 0x80


@dataclass(frozen=True, slots=True)
class DriveKind:
    """What a drive is: identity, counts of its encoder for a turn, its motor's torque, unit of velocities."""

    identity: Identity
    counts: int = 1 << 22
    rated_torque: float = 2.4
    """[N m]; in steps of 1 mN m."""
    velocity_unit: float = math.tau / (1 << 22)
    """[rad/s]: by default counts/s."""
    velocity_limit: bool = False
    """Whether it has object 0x2D20, as the MR-J4-TM."""

    @classmethod
    def counting(cls, identity: Identity, counts: int, rated_torque: float) -> Self:
        """A drive that says velocities in counts a second."""
        return cls(identity, counts, rated_torque, math.tau / counts)


@dataclass(slots=True)
class PlantedFaults:
    """Faults to be planted in a drive."""

    follows: float = 1.0
    """How much of its torque the motor gives."""
    cause: int = 0
    """Code of a fault whose cause is still there, so that no reset takes it away; 0: there is none."""
    jump: float = 0.0
    """Added to the encoder's angle [rad]."""
    cut: bool = field(default=False)
    """The power stage gives no torque, and nobody is told."""


class EmulatedDrive:
    """``Application`` of one drive.

    Attributes:
        angle, velocity: of the motor's shaft, set by the plant [rad, rad/s].
        torque: that the motor gives [N m]; in velocity mode the plant says it.
        speed: wanted in velocity mode [rad/s].
        flaws: planted.
    """

    def __init__(self, kind: DriveKind, mode: int) -> None:
        self.identity = kind.identity
        self.kind = kind
        self.angle = self.velocity = self.torque = self.speed = 0.0
        self.flaws = PlantedFaults()
        self._power, self._control = Power.DISABLED, 0
        self._limited = False
        self.dictionary: Dictionary = _dictionary(kind, mode)
        self._objects = {key[0]: entry for key, entry in self.dictionary.entries.items() if not key[1]}
        self._data = ProcessData(self.dictionary)

    # what the plant asks

    @property
    def enabled(self) -> bool:
        """The power stage is on and follows; its brake is open."""
        return self._power is Power.ENABLED

    @property
    def mode(self) -> int:
        """That it works in."""
        return self._objects[0x6061].value

    def fault(self, code: int) -> None:
        """It switches itself off and brakes, with an error code of 0x603F."""
        self._power, self._objects[0x603F].value = Power.FAULT, code
        self._let_go()

    # Application

    def sizes(self) -> tuple[int, int]:
        """See ``Application``."""
        return self._data.sizes()

    def start(self) -> None:
        """See ``Application``."""
        self._data.map()

    def take(self, outputs: bytes) -> None:
        """See ``Application``."""
        self._data.take(outputs)
        objects = self._objects
        objects[0x6061].value = objects[0x6060].value
        self._step(objects[0x6040].value)
        self._drive()

    def give(self) -> bytes:
        """See ``Application``."""
        objects, kind = self._objects, self.kind
        counts = round((self.angle + self.flaws.jump) / math.tau * kind.counts)
        objects[0x6064].value = (counts + (1 << 31)) % (1 << 32) - (1 << 31)
        objects[0x606C].value = round(self.velocity / kind.velocity_unit)
        objects[0x6077].value = max(-32768, min(32767, round(self.torque / kind.rated_torque * 1000.0)))
        word = int(self._power) | _REMOTE | _VOLTAGE
        word |= (_LIMITED if self._limited else 0) | (_FOLLOWS if self.enabled else 0)
        objects[0x6041].value = word
        return self._data.give()

    def stop(self, *, watchdog: bool) -> None:
        """See ``Application``. Whoever was enabled and hears nothing more has a fault."""
        if watchdog and self._power not in (Power.DISABLED, Power.FAULT):
            self.fault(COMMUNICATION_FAULT)
        elif self._power is not Power.FAULT:
            self._power = Power.DISABLED
            self._let_go()

    # inside

    def _step(self, control: int) -> None:
        """The state machine under a control word (CiA 402-2, table 30)."""
        reset, self._control = control & ~self._control & _FAULT_RESET, control
        power = self._power
        if power is Power.FAULT:
            if reset and not self.flaws.cause:
                self._power, self._objects[0x603F].value = Power.DISABLED, 0
            return
        if not control & 0x02:  # disable voltage
            self._power = Power.DISABLED
        elif not control & 0x04:  # quick stop: without power it is the same as the above
            self._power = Power.QUICK_STOP if power in (Power.ENABLED, Power.QUICK_STOP) else Power.DISABLED
        elif power is Power.QUICK_STOP:
            pass  # only a disabled voltage ends it
        elif not control & 0x01:
            self._power = Power.READY
        elif power is Power.DISABLED:
            pass  # first it has to be shut down
        elif not control & 0x08 or power is Power.READY:
            self._power = Power.SWITCHED_ON
        else:
            self._power = Power.ENABLED
        if self._power is not Power.ENABLED:
            self._let_go()

    def _drive(self) -> None:
        objects = self._objects
        if not self.enabled:
            return
        if self.mode == CSV:
            self.speed = objects[0x60FF].value * self.kind.velocity_unit
            return
        most, asked = objects[0x6072].value, objects[0x6071].value
        given = max(-most, min(most, asked))
        self._limited = given != asked
        self.torque = 0.0 if self.flaws.cut else given * 0.001 * self.kind.rated_torque * self.flaws.follows

    def _let_go(self) -> None:
        self._limited = False
        if self.mode == CST:
            self.torque = 0.0


def _dictionary(kind: DriveKind, mode: int) -> Dictionary:
    """The objects of a drive, with a PDO of each direction that does not fit what a master wants yet."""
    objects = Dictionary()
    add = objects.add
    identity = kind.identity
    add(0x1000, 0, Entry(32, 0x00020192))
    add(0x1008, 0, Entry(8, text=identity.name.encode("ascii")))
    add(0x1018, 0, Entry(8, 4))
    for place, number in enumerate((identity.vendor, identity.product, identity.revision, identity.serial), 1):
        add(0x1018, place, Entry(32, number))
    add(0x1C00, 0, Entry(8, 4))
    for manager in range(4):
        add(0x1C00, manager + 1, Entry(8, manager + 1))
    for manager in (0x1C32, 0x1C33):
        add(manager, 0, Entry(8, 2))
        add(manager, 1, Entry(16, 0, writable=True))
        add(manager, 2, Entry(32, 0, writable=True))
    add(0x603F, 0, Entry(16))
    add(0x6040, 0, Entry(16, writable=True))
    add(0x6041, 0, Entry(16, int(Power.DISABLED)))
    for index in (0x605A, 0x605E):
        add(index, 0, Entry(16, 2, signed=True, writable=True))
    add(0x6060, 0, Entry(8, mode, signed=True, writable=True, check=_check_mode))
    add(0x6061, 0, Entry(8, mode, signed=True))
    for index in (0x6064, 0x606C):
        add(index, 0, Entry(32, signed=True))
    add(0x6071, 0, Entry(16, signed=True, writable=True))
    add(0x6072, 0, Entry(16, 3500, writable=True))
    add(0x6076, 0, Entry(32, round(kind.rated_torque * 1000.0), writable=True))
    add(0x6077, 0, Entry(16, signed=True))
    add(0x6079, 0, Entry(32, 311_000))
    add(0x608F, 0, Entry(8, 2))
    add(0x608F, 1, Entry(32, kind.counts))
    add(0x608F, 2, Entry(32, 1))
    add(0x60C2, 0, Entry(8, 2))
    add(0x60C2, 1, Entry(8, 1, writable=True))
    add(0x60C2, 2, Entry(8, -3, signed=True, writable=True))
    add(0x60FF, 0, Entry(32, signed=True, writable=True))
    add(0x6502, 0, Entry(32, _MODES))
    if kind.velocity_limit:
        add(0x2D20, 0, Entry(32, writable=True))
    objects.add_pdo(OUTPUT_MAPPING, [(0x6040, 0, 16), (0x6060, 0, 8)], _ROOM)
    objects.add_pdo(INPUT_MAPPING, [(0x6041, 0, 16), (0x6061, 0, 8)], _ROOM)
    objects.add_assignment(OUTPUT_ASSIGNMENT, [OUTPUT_MAPPING], 1)
    objects.add_assignment(INPUT_ASSIGNMENT, [INPUT_MAPPING], 1)
    return objects


def _check_mode(mode: int) -> None:
    if mode and not _MODES >> (mode - 1) & 1:
        raise Abort(OUT_OF_RANGE)
