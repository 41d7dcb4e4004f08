"""How a motion goes that begins elsewhere than planned, as a guard ended the one before it wherever the board is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.motion.path import Path, Vector
from app.motion.route import Route, timed
from app.motion.settings import MotionSettings
from hardware.table import TableSettings

SAME: Final = 1e-9
"""A reference this close to where a motion begins is the same [m]."""
FURTHEST: Final = 0.020
"""By no more are samples moved up or down, to where a touch ended the motion before [m]."""


class Continued(NamedTuple):
    """What is new of a motion: samples, where the tool goes between stops, how long it should take [s]."""

    samples: NDArray[Any]
    paths: tuple[Path, ...]
    expected: float


@dataclass(frozen=True, slots=True)
class Continuation:
    """Planned with a motion and handed over with it: all that its samples follow from.

    Attributes:
        settings: speeds, gains, heights.
        table: board and trays.
        tick: of the samples [s].
        route: where it goes; None: its samples do not follow from a route.
    """

    settings: MotionSettings
    table: TableSettings
    tick: float
    route: Route | None = None

    def at(self, reference: Vector, planned: Continued) -> Continued:
        """The motion from where the arm is: timed again from there, or, where it has no route, its samples moved up or
        down by as much. Where that is too far the planned ones stay, and the controller refuses them.

        Args:
            reference: the arm's present one, base frame (3,) [m].
            planned: what is asked for where that is where the motion was planned to begin.
        """
        off = reference - planned.samples["position"][0]
        if np.abs(off).max() < SAME:
            return planned
        if self.route is not None:
            done = timed(self.route.from_point(reference), self.settings, self.table, self.tick)
            return Continued(done.samples, done.paths, done.expected)
        if np.abs(off[:2]).max() > 1e-6 or abs(off[2]) > FURTHEST:
            return planned
        samples = planned.samples.copy()
        samples["position"] += off
        samples.flags.writeable = False
        return planned._replace(samples=samples)
