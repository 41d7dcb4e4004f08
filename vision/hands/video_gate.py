"""Which frames of a video show a settled board without a hand: for recordings of which only the corners are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vision.hands.stillness import ColourWatch, Seen, WatchSettings

STABLE_TIME = 0.1
"""Players of a quick game leave the board alone for hardly longer between two moves [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class SettledView:
    """A picture of a settled board.

    Attributes:
        colour: RGB, shape (h, w, 3).
        stamp: of its exposure [s].
        since: the board has looked like this since then [s].
        touched: squares at which a hand was since the last settled view.
    """

    colour: NDArray[np.uint8]
    stamp: float
    since: float
    touched: frozenset[int]


class VideoGate:
    """Gates a video, frame by frame. Not thread-safe.

    Args:
        corners: outer corners of the playing area a1, h1, h8, a8 in its frames, shape (4, 2) [px].
        settings: of the watch; by default with a shorter stable time than a game at a camera has.

    Attributes:
        seen: what the last frame showed; None before the first one.
    """

    def __init__(self, corners: ArrayLike, settings: WatchSettings | None = None) -> None:
        self.seen: Seen | None = None
        self._watch = ColourWatch(corners, settings or WatchSettings(stable_time=STABLE_TIME))
        self._told = False

    def update(self, colour: NDArray[np.uint8], stamp: float) -> SettledView | None:
        """Take a frame in.

        Args:
            colour: RGB, shape (h, w, 3), all of one size.
            stamp: its time, later than those before [s].

        Returns:
            The frame if the board is settled from here on; None otherwise, and while it stays settled.

        Raises:
            ValueError: frames come in another order or size, or the corners are no board.
        """
        seen = self.seen = self._watch.update(colour, stamp)
        if not seen.settled:
            self._told = False
            return None
        if self._told or seen.stable_since is None:
            return None
        self._told = True
        return SettledView(colour, stamp, seen.stable_since, seen.touched)
