"""A plan is data: motions made of timed samples, ready to be streamed, stored, drawn or replayed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from app import UserError
from app.manipulation import Stage


class PlanRefused(UserError):
    """A plan would collide, leave the workspace or break a limit; nothing was sent."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One announced motion of the arm: a row of samples a tick apart.

    Attributes:
        label: what it does, for people.
        samples: shape (n,), dtype ``controller.protocol.SAMPLE``; read-only.
        expected: how long it should take [s]; less than n ticks where a guard ends it.
        grips: the motion must end by its grip guard, else nothing was grasped.
        transfer: of the plan's transfers it belongs to: which, from 0; None where it belongs to none.
        stage: of that transfer.
    """

    label: str
    samples: NDArray[Any]
    expected: float
    grips: bool = False
    transfer: int | None = None
    stage: Stage | None = None


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
