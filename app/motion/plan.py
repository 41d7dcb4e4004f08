"""A plan is data: motions made of timed samples, ready to be streamed, stored, drawn or replayed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app import UserError
from app.motion.path import Path, Vector
from app.motion.route import Route, timed
from app.motion.settings import MotionSettings
from app.pieces.manipulation import Stage
from controller.protocol import Result
from hardware.table import TableSettings

if TYPE_CHECKING:
    from app.motion.obstacles import Obstacle


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
        route: what the samples follow from; None for samples of another origin.
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
    route: Route | None = None
    paths: tuple[Path, ...] = ()
    transfer: int | None = None
    stage: Stage | None = None
    touches_at: float | None = None

    @property
    def wanted(self) -> Result:
        """How the motion must end."""
        return Result.GRIPPED if self.grips else Result.TOUCHED if self.touches else Result.DONE


class Style(NamedTuple):
    """How routes are timed."""

    settings: MotionSettings
    table: TableSettings
    tick: float


SAME: Final = 1e-9
"""A reference this close to where a motion begins is the same [m]."""
FURTHEST: Final = 0.020
"""By no more are samples moved up or down, to where a touch ended the motion before [m]."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Motions that follow each other without a pause.

    Attributes:
        label: what it does, for people.
        motions: in order; each starts where the one before ends.
        lead: plant time between two motions, needed to announce the next [s].
        style: how its routes were timed; None where there are none.
    """

    label: str
    motions: tuple[Motion, ...]
    lead: float = 0.0
    style: Style | None = None

    def continued(self, index: int, reference: Vector) -> Motion:
        """A motion as it must be where the one before ended elsewhere than planned: timed again from there, or, where
        it has no route, its samples moved up or down by as much. Other samples stay, and the controller refuses them.

        Args:
            index: of the motion.
            reference: the arm's present one, base frame (3,) [m].
        """
        motion = self.motions[index]
        if self.style is None or np.abs(reference - motion.samples["position"][0]).max() < SAME:
            return motion
        if motion.route is None:
            return _lifted(motion, reference - motion.samples["position"][0])
        done = timed(motion.route.from_point(reference), *self.style)
        return replace(motion, samples=done.samples, paths=done.paths, expected=done.expected)

    @property
    def expected(self) -> float:
        """How long the whole should take [s]."""
        return sum(motion.expected for motion in self.motions) + self.lead * (len(self.motions) - 1)


def _lifted(motion: Motion, by: Vector) -> Motion:
    """The motion moved by a vector (3,), if that is a short one along the vertical [m]."""
    if np.abs(by[:2]).max() > 1e-6 or abs(by[2]) > FURTHEST:
        return motion
    samples = motion.samples.copy()
    samples["position"] += by
    samples.flags.writeable = False
    return replace(motion, samples=samples)
