"""Grips that are lost: the simulated gripper's motor lets go by itself while a piece is held, as often as is asked for.

A fault of the device, seen from inside of it alone: the motor runs open for a moment, whatever is commanded, and then
obeys again. What the piece does then is up to contacts and gravity. The hold and the moment are decided by the world's
seed, or named.
"""

import math
from typing import Annotated, Final, NamedTuple, Self

import numpy as np
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from hardware.frozen import FrozenFinite

_HOLDS: Final = 1.0
"""A piece is held while both pads feel more than this [N]."""
_LOST: Final = 0.2
"""It is no longer when either feels less [N]."""


class GripFaults(FrozenFinite):
    """When the fingers lose what they hold. All by default: never."""

    share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Of all holds, drawn by the seed."""
    holds: tuple[PositiveInt, ...] = ()
    """These holds as well, counted from 1 since the world began."""
    earliest: PositiveFloat = 0.10
    """So long at least holds a grip before it is lost [s] …"""
    latest: PositiveFloat = 0.90
    """… and at most so long [s]."""
    duration: PositiveFloat = 0.30
    """So long the motor runs open [s] …"""
    speed: Annotated[float, Field(gt=0.0, le=0.12)] = 0.06
    """… by each finger [m/s]."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.latest < self.earliest:
            raise ValueError(f"latest {self.latest} s is before earliest {self.earliest} s: exchange them")
        return self


NEVER: Final = GripFaults()


class Obedience(NamedTuple):
    """How long the motor does what it is asked to, whoever asks: see ``GripFault.obeys``.

    Attributes:
        above: the lesser of both forces on the pads is larger than this [N] …
        up_to: … and at most this [N] …
        before: … and the tick is an earlier one than this.
    """

    above: float
    up_to: float
    before: float


class GripFault:
    """The gripper's motor as one seed makes it. A world that is continued from a snapshot counts holds anew.

    ``possible`` says whether it ever lets go, ``lost`` how many grips were lost so far.
    """

    def __init__(self, faults: GripFaults, seed: int) -> None:
        self._set = faults
        self._rng = np.random.default_rng([seed, 0x6217])
        self._count, self._holding = 0, False
        self._begin = self._end = -1
        self.possible = bool(faults.share > 0.0 or faults.holds)
        self.lost = 0

    def velocity(self, tick: int, period: float, asked: float, right: float, left: float) -> float:
        """What the motor makes of a velocity asked of each finger, opening positive, at a tick of a period [m/s, s].

        ``right`` and ``left`` are the forces on the pads [N].
        """
        self._watch(tick, period, min(right, left))
        if self._begin <= tick < self._end:
            if tick == self._begin:
                self.lost += 1
            return self._set.speed
        return asked

    def obeys(self, tick: int) -> Obedience:
        """While this holds from a tick on, ``velocity`` would change nothing and need not be asked."""
        if not self.possible:
            return Obedience(-math.inf, math.inf, math.inf)
        lets_go = self._begin < self._end and tick < self._end
        if self._holding:
            return Obedience(_LOST, math.inf, self._begin if lets_go else math.inf)
        if tick < self._end:  # let go in time, and no other hold counts before; or it lets go now
            return Obedience(-math.inf, math.inf, tick if lets_go else self._end)
        return Obedience(-math.inf, _HOLDS, math.inf)

    def _watch(self, tick: int, period: float, felt: float) -> None:
        if self._holding:
            self._holding = felt > _LOST
            if not self._holding and tick < self._begin:
                self._end = self._begin  # let go in time
            return
        if felt <= _HOLDS or tick < self._end:
            return
        self._holding = True
        self._count += 1
        chance, moment = self._rng.random(2).tolist()  # both for every hold, so that none depends on others' fate
        if chance < self._set.share or self._count in self._set.holds:
            after = self._set.earliest + moment * (self._set.latest - self._set.earliest)
            self._begin = tick + round(after / period)
            self._end = self._begin + round(self._set.duration / period)
