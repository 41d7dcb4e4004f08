"""A board watched in colour: what moves, what differs from the settled board, and what of that must be a hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.hands.background import Mask, Picture, differs, gain_between, moved, tidy
from vision.hands.watched_zone import Zone

_LEARNING: Final = 0.2
"""Share of a settled picture in the new background."""
_COVERED: Final = 0.12
"""A square of which a hand covers such a share lies under it."""
_SMALL: Final = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class ColourObservation:
    """What one picture shows.

    Attributes:
        moving: area that moved since the last picture, over the board [squares].
        reaching: area of what reaches in or is larger than pieces [squares].
        over: squares under that.
    """

    moving: float
    reaching: float
    over: frozenset[int]


class Differences:
    """Watches in colour. Not thread-safe.

    Args:
        zone: what is watched.
        reach: what differs, touches the rim, and covers at least so much of the board reaches in [squares] …
        body: … if it is so large outside of the board: pieces near the edge that lean out of it are smaller [squares].
        lone: or if it covers so much of the board, whatever is seen of it outside [squares].
        large: whatever differs and is at least so large is no piece, nor a few of them [squares].
    """

    def __init__(
        self, zone: Zone, reach: float = 0.15, body: float = 0.5, lone: float = 1.2, large: float = 5.0
    ) -> None:
        self._zone = zone
        self._reach = reach
        self._body = body
        self._lone = lone
        self._large = large
        self._before: Picture | None = None
        self._hidden: Mask | None = None
        self._background: Picture | None = None
        self._known = np.zeros(zone.board.shape, dtype=np.bool_)
        self._entering = self._known

    @property
    def knows_the_board(self) -> bool:
        """Whether a settled board was seen already."""
        return self._background is not None

    def look(self, small: Picture, hidden: Mask | None, *, reaching: bool = True) -> ColourObservation:
        """Take a picture in.

        Args:
            small: the picture.
            hidden: where something known, such as the arm, is before the table.
            reaching: whether to look for what reaches in; else only for motion.
        """
        moving = self._motion(small, hidden)
        if self._background is None or not reaching:
            return ColourObservation(moving, 0.0, frozenset())
        where = self._zone.around & self._known
        where = where if hidden is None else where & ~hidden
        area, mask = self._hand(tidy(differs(small, self._background, where)))
        over = frozenset[int]() if mask is None else self._zone.squares_in(mask, _COVERED)
        return ColourObservation(moving, area, over)

    def learn(self, small: Picture, hidden: Mask | None, *, moved: bool) -> None:
        """A picture of the settled board: what is seen in it is the background from now on.

        What touches the rim and differs is not learned: it may be the tip of a hand that comes.

        Args:
            small: the picture that was looked at last.
            hidden: as then.
            moved: pieces may have been moved since it was learned last; else the background changes by and by.
        """
        seen = ~self._entering if hidden is None else ~(self._entering | hidden)
        if self._background is None:
            self._background, self._known = small.copy(), seen
            return
        blended = small
        if not moved:
            gain = gain_between(small, self._background, self._zone.around & seen & self._known)
            mixed = cv2.addWeighted(self._background, gain * (1.0 - _LEARNING), small, _LEARNING, 0.0)
            blended = np.asarray(mixed, dtype=np.uint8)
        fresh = seen & self._known if not moved else seen
        self._background[fresh] = blended[fresh]
        new = seen & ~self._known
        self._background[new] = small[new]
        self._known = self._known | seen

    def forget(self) -> None:
        """The background is no longer what the settled board looks like."""
        self._background = None
        self._known = np.zeros_like(self._known)
        self._entering = self._known

    def _motion(self, small: Picture, hidden: Mask | None) -> float:
        """Area that moved over the board since the last picture [squares]; infinite for the first one."""
        zone, before = self._zone, self._before
        where = zone.board
        for mask in (hidden, self._hidden):
            where = where if mask is None else where & ~mask
        self._before, self._hidden = small, hidden
        if before is None:
            return float("inf")
        moving = cv2.morphologyEx(moved(small, before, where).astype(np.uint8), cv2.MORPH_OPEN, _SMALL)
        return float(np.count_nonzero(moving)) / zone.square_area

    def _hand(self, mask: NDArray[np.uint8]) -> tuple[float, Mask | None]:
        """Area of all parts that must be a hand [squares], and where they are."""
        count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        areas = statistics[:, cv2.CC_STAT_AREA] / self._zone.square_area
        at_rim = np.bincount(labels[self._zone.rim], minlength=count) > 0
        at_rim[0] = False
        self._entering = at_rim[labels]
        inside = np.bincount(labels[self._zone.board], minlength=count) / self._zone.square_area
        enters = ((inside >= self._reach) & (areas - inside >= self._body)) | (inside >= self._lone)
        hands = (areas >= self._large) | (at_rim & enters)
        hands[0] = False
        if not hands.any():
            return 0.0, None
        return float(areas[hands].sum()), hands[labels]
