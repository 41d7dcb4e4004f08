"""Faults of drives that are planted in a simulated world with emulated drives: what, in which device, from when on."""

import math
from enum import StrEnum
from typing import Annotated, Final, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from hardware.frozen import Frozen


class PlantedKind(StrEnum):
    """What can be wrong: first between motor and arm, on every bus alike."""

    ENCODER_SIGN = "encoder-sign"
    """The encoder counts against the motor."""
    TORQUE_SIGN = "torque-sign"
    """The motor turns against its torque: two phases exchanged."""
    EXCHANGED = "exchanged"
    """The drive is wired to the motor and encoder of servomotor ``amount``, and the other way round."""
    ENCODERS_EXCHANGED = "encoders-exchanged"
    """So are the encoders alone."""
    ZERO = "zero"
    """The motor's zero is off by ``amount`` [rad, of the joint]."""
    ENCODER_DEAD = "encoder-dead"
    """The encoder says what it said then for ever."""
    ENCODER_JUMP = "encoder-jump"
    """The encoder is off by ``amount`` [rad, of the joint] from one tick to the next."""
    ENCODER_SCALE = "encoder-scale"
    """A turn is ``amount`` turns for the encoder: a wrong ratio, or other counts."""
    TORQUE_SCALE = "torque-scale"
    """The motor gives ``amount`` of the torque that the drive says it gives: a wrong torque constant."""
    NOT_FOLLOWED = "not-followed"
    """The drive gives ``amount`` of the torque it is asked for, and says so."""
    BRAKE_STUCK = "brake-stuck"
    """The brake does not open."""
    BRAKE_SLIPS = "brake-slips"
    """The brake holds ``amount`` of its torque."""
    FORCE_DEAD = "force-dead"
    """The force sensor of pad ``device``, 1 right or 2 left, reads nothing."""
    FORCE_OFFSET = "force-offset"
    """It reads ``amount`` [N] too much."""
    # of the device itself
    TOO_HOT = "too-hot"
    UNDER_VOLTAGE = "under-voltage"
    DROPS_OUT = "drops-out"
    """The device leaves its operating state by itself."""
    SILENT = "silent"
    """It does not answer; on a chain nobody behind it does."""
    LOST_FRAMES = "lost-frames"
    """The next ``amount`` answers are lost."""
    CORRUPT_FRAMES = "corrupt-frames"
    """The next ``amount`` answers are damaged."""
    WATCHDOG_DEAD = "watchdog-dead"
    """The device goes on without commands."""


ON_DEVICE: Final = frozenset({
    PlantedKind.NOT_FOLLOWED, PlantedKind.TOO_HOT, PlantedKind.UNDER_VOLTAGE, PlantedKind.DROPS_OUT, PlantedKind.SILENT,
    PlantedKind.LOST_FRAMES, PlantedKind.CORRUPT_FRAMES, PlantedKind.WATCHDOG_DEAD,
})  # fmt: skip
"""What the emulated device itself has to do."""
_AMOUNTS: Final = {
    PlantedKind.EXCHANGED: 2.0, PlantedKind.ENCODERS_EXCHANGED: 2.0, PlantedKind.ZERO: math.radians(5.0),
    PlantedKind.ENCODER_JUMP: 0.05, PlantedKind.ENCODER_SCALE: 0.5, PlantedKind.TORQUE_SCALE: 0.5,
    PlantedKind.NOT_FOLLOWED: 0.0, PlantedKind.BRAKE_SLIPS: 0.0, PlantedKind.FORCE_OFFSET: 2.0,
    PlantedKind.LOST_FRAMES: 20.0, PlantedKind.CORRUPT_FRAMES: 20.0,
}  # fmt: skip
"""Where nobody chose; other kinds have none."""


class PlantedFault(Frozen):
    """One fault; it goes with the drives of a world, whoever drives them."""

    kind: PlantedKind
    device: Annotated[int, Field(ge=1, le=4)] = 1
    """Servomotor 1, 2, 3, or 4, the gripper."""
    amount: float | None = None
    """See the kinds; a usual one if left out."""
    at: NonNegativeFloat = 0.0
    """Once the arm has been driven, with open brakes, for so long in all [s, plant]; 0: as it is switched on."""
    lasts: PositiveFloat | None = None
    """Mended by itself after so long [s, plant]; never if left out."""

    @property
    def size(self) -> float:
        """``amount``, or the usual one."""
        return _AMOUNTS.get(self.kind, 0.0) if self.amount is None else self.amount

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.amount is not None and self.kind not in _AMOUNTS:
            raise ValueError(f"{self.kind} has no amount: leave it out")
        if self.kind not in ON_DEVICE and self.device == 4:
            raise ValueError(f"{self.kind} is of a servomotor, 1 to 3, not of the gripper")
        if self.kind in (PlantedKind.EXCHANGED, PlantedKind.ENCODERS_EXCHANGED) and self.size not in (1.0, 2.0, 3.0):
            raise ValueError(f"{self.kind} with servomotor {self.size:g}: give amount 1, 2 or 3")
        if self.kind in (PlantedKind.FORCE_DEAD, PlantedKind.FORCE_OFFSET) and self.device > 2:
            raise ValueError(f"{self.kind} is of pad 1, right, or 2, left, not {self.device}")
        return self
