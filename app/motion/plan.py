"""A plan is data: motions made of timed samples, ready to be streamed, stored, drawn or replayed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from app import UserError
from app.motion.continuation import Continuation, Continued
from app.motion.path import Path, Vector
from app.pieces.inventory import Stage
from controller.protocol import Result

if TYPE_CHECKING:
    from app.motion.obstacles import Obstacle
    from app.motion.route import Route


class PlanRefused(UserError):
    """A plan would collide, leave the workspace or break a limit; nothing was sent."""


class InTheWay(PlanRefused):
    """A piece is where the fingers have to go.

    Attributes:
        piece: which; once it is moved away, they may.
        around: what they would be around, and where; None: they would not open.
    """

    def __init__(self, sentence: str, piece: Obstacle, around: Obstacle | None = None) -> None:
        super().__init__(sentence)
        self.piece, self.around = piece, around


@dataclass(frozen=True, slots=True)
class Motion:
    """One announced motion of the arm: a row of samples a tick apart.

    Attributes:
        label: what it does, for people.
        samples: shape (n,), dtype ``controller.protocol.SAMPLE``; read-only.
        expected: how long it should take [s]; less than n ticks where a guard ends it.
        grips: the motion must end by its grip guard, else nothing was grasped.
        touches: the motion must end by its touch guard, else nothing stands there.
        continuation: how it goes where the motion before ended elsewhere than planned; None: as planned, always.
        paths: where the tool goes, between stops.
        transfer: of the plan's transfers it belongs to: which, from 0; None where it belongs to none.
        stage: of that transfer.
        touches_at: how low the tool should be when it touches, base frame z₃ [m]; None: that is what it finds out.
    """

    label: str
    samples: NDArray[Any]
    expected: float
    grips: bool = False
    touches: bool = False
    continuation: Continuation | None = None
    paths: tuple[Path, ...] = ()
    transfer: int | None = None
    stage: Stage | None = None
    touches_at: float | None = None

    @property
    def wanted(self) -> Result:
        """How the motion must end."""
        return Result.GRIPPED if self.grips else Result.TOUCHED if self.touches else Result.DONE

    @property
    def route(self) -> Route | None:
        """What the samples follow from; None for samples of another origin."""
        return None if self.continuation is None else self.continuation.route

    def continued(self, reference: Vector) -> Motion:
        """The motion as it must be where the one before it ended.

        Args:
            reference: the arm's present one, base frame (3,) [m].
        """
        if self.continuation is None:
            return self
        planned = Continued(self.samples, self.paths, self.expected)
        done = self.continuation.at(reference, planned)
        return self if done is planned else replace(self, **done._asdict())


@dataclass(frozen=True, slots=True)
class Plan:
    """Motions that follow each other without a pause.

    Attributes:
        label: what it does, for people.
        motions: in order; each starts where the one before ends.
        lead: plant time between two motions, needed to announce the next [s].
    """

    label: str
    motions: tuple[Motion, ...]
    lead: float = 0.0

    @property
    def expected(self) -> float:
        """How long the whole should take [s]."""
        return sum(motion.expected for motion in self.motions) + self.lead * (len(self.motions) - 1)
