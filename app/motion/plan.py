"""A plan is data: motions made of timed samples, ready to be streamed, stored, drawn or replayed.

A motion carries how it goes where it begins elsewhere than planned, as a guard ended the one before it wherever the
board is: its `Continuation`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from app import UserError
from app.motion.path import Path, Vector
from app.motion.route import Route, timed
from app.motion.settings import MotionSettings
from app.pieces.inventory import Stage
from controller.protocol import Result
from hardware.table import TableSettings

if TYPE_CHECKING:
    from app.motion.obstacles import Obstacle

SAME: Final = 1e-9
"""A reference this close to where a motion begins is the same [m]."""
FURTHEST: Final = 0.020
"""Samples are moved up or down by no more than this, to where a touch ended the motion before [m]."""


class PlanRefused(UserError):
    """A plan would collide, leave the workspace or break a limit; nothing was sent."""


class InTheWay(PlanRefused):
    """A piece is where the fingers have to go; once it is moved away, they may.

    ``around`` is what they would be around, and where; None: they would not open.
    """

    def __init__(self, sentence: str, piece: Obstacle, around: Obstacle | None = None) -> None:
        super().__init__(sentence)
        self.piece, self.around = piece, around


class BoxInTheWay(PlanRefused):
    """A box is where the fingers have to go; what they have to get at must be pushed away from it."""


@dataclass(frozen=True, slots=True)
class Continuation:
    """All that a motion's samples follow from, planned with it and handed over with it."""

    settings: MotionSettings
    """Speeds, gains, heights."""
    table: TableSettings
    """Board and trays."""
    tick: float
    """Of the samples [s]."""
    route: Route | None = None
    """Where it goes; None: its samples do not follow from a route."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One announced motion of the arm: a row of samples a tick apart."""

    label: str
    """What it does, for people."""
    samples: NDArray[Any]
    """Shape (n,), dtype ``controller.protocol.SAMPLE``; read-only."""
    expected: float
    """How long it should take [s]; less than n ticks where a guard ends it."""
    grips: bool = False
    """The motion must end by its grip guard, else nothing was grasped."""
    seats_at: float | None = None
    """Position of the fingers that grip a piece by its middle [m]; None: that is not known."""
    touches: bool = False
    """The motion must end by its touch guard, else nothing stands there."""
    continuation: Continuation | None = None
    """How it goes where the motion before ended elsewhere than planned; None: as planned, always."""
    paths: tuple[Path, ...] = ()
    """Where the tool goes, between stops."""
    transfer: int | None = None
    """Of the plan's transfers it belongs to: which, from 0; None where it belongs to none."""
    stage: Stage | None = None
    """Of that transfer."""
    touches_at: float | None = None
    """How low the tool should be when it touches, base frame z₃ [m]; None: that is what it finds out."""

    @property
    def wanted(self) -> Result:
        """How the motion must end."""
        return Result.GRIPPED if self.grips else Result.TOUCHED if self.touches else Result.DONE

    @property
    def route(self) -> Route | None:
        """What the samples follow from; None for samples of another origin."""
        return None if self.continuation is None else self.continuation.route

    def continued(self, reference: Vector) -> Motion:
        """The motion as it must be where the one before it ended, at a reference in the base frame (3,) [m].

        It is timed again from there; if it has no route, its samples are moved up or down by as much. Where that is too
        far the planned ones stay, and the controller refuses them.
        """
        off = reference - self.samples["position"][0]
        if self.continuation is None or np.abs(off).max() < SAME:
            return self
        if self.route is not None:
            how = self.continuation
            done = timed(self.route.from_point(reference), how.settings, how.table, how.tick)
            return replace(self, samples=done.samples, paths=done.paths, expected=done.expected)
        if np.abs(off[:2]).max() > 1e-6 or abs(off[2]) > FURTHEST:
            return self
        samples = self.samples.copy()
        samples["position"] += off
        samples.flags.writeable = False
        return replace(self, samples=samples)


@dataclass(frozen=True, slots=True)
class Plan:
    """Motions that follow each other without a pause."""

    label: str
    """What it does, for people."""
    motions: tuple[Motion, ...]
    """In order; each starts where the one before ends."""
    lead: float = 0.0
    """Plant time between two motions, needed to announce the next [s]."""

    @property
    def expected(self) -> float:
        """How long the whole should take [s]."""
        return sum(motion.expected for motion in self.motions) + self.lead * (len(self.motions) - 1)
