"""A board watched in colour: what moves, what differs from the settled board, and what of that must be a hand.

Pictures are small RGB ones, (h, w, 3) uint8; masks are (h, w) bool. A step of the exposure scales all of a picture and
is taken out first. A shadow scales the brightness of what it falls on and leaves its colour: with a background colour b
and a colour c seen now, c = αb in a shadow, with α between that of full light and that of the deepest shadow. What lies
off that line by more than noise is something else (T. Horprasert et al., A statistical approach for real-time robust
background subtraction and shadow detection, 1999).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from vision.arrays import Mask, Picture
from vision.hands.watched_zone import Zone

DEEPEST_SHADOW: Final = 0.42
"""Brightness that is left in the deepest shadow that counts as one: lamps of a room fill shadows up."""
BRIGHTEST: Final = 1.25  # a surface that is brighter than this, compared with the background, is another one
OFF_COLOUR: Final = 13.0  # a colour so far off the background's line is another surface [grey levels of 255]
NOISE: Final = 4.0  # least standard deviation of a pixel's noise that is reckoned with [grey levels]
MOVES: Final = 3.5  # a pixel moves where it differs by so many standard deviations of noise
REACH: Final = 0.15  # what differs, touches the rim, and covers at least so much of the board reaches in [squares] …
BODY: Final = 0.5  # … if so much is outside of the board: pieces near the edge lean out of it by less [squares];
LONE: Final = 1.2  # or if it covers so much of the board, whatever is seen of it outside [squares]
LARGE: Final = 5.0  # whatever differs and is at least so large is no piece, nor a few of them [squares]
_SPARSE: Final = 5  # statistics over all of a picture are taken of one pixel in so many along both axes
_LEARNING: Final = 0.2  # share of a settled picture in the new background
_COVERED: Final = 0.12  # a square of which a hand covers such a share lies under it
_SMALL: Final = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class ColourObservation:
    """What one picture shows."""

    moving: float  # area that moved since the last picture, over the board [squares]
    reaching: float  # area of what reaches in or is larger than pieces [squares]
    over: frozenset[int]  # squares under that


class Differences:
    """Watches a zone in colour. Not thread-safe."""

    def __init__(self, zone: Zone) -> None:
        self._zone = zone
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
        """Take a picture in; ``hidden`` is where something known, such as the arm, is before the table.

        Without ``reaching`` only motion is looked for, and not what reaches in.
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
        """A picture of the settled board, as looked at last: what is seen in it is the background from now on.

        What touches the rim and differs is not learned: it may be the tip of a hand that comes. ``moved``: pieces may
        have been moved since it was learned last; else the background changes by and by.
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

    def _hand(self, mask: Picture) -> tuple[float, Mask | None]:
        """Area of all parts that must be a hand [squares], and where they are."""
        count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        areas = statistics[:, cv2.CC_STAT_AREA] / self._zone.square_area
        at_rim = np.bincount(labels[self._zone.rim], minlength=count) > 0
        at_rim[0] = False
        self._entering = at_rim[labels]
        inside = np.bincount(labels[self._zone.board], minlength=count) / self._zone.square_area
        enters = ((inside >= REACH) & (areas - inside >= BODY)) | (inside >= LONE)
        hands = (areas >= LARGE) | (at_rim & enters)
        hands[0] = False
        if not hands.any():
            return 0.0, None
        return float(areas[hands].sum()), hands[labels]


def gain_between(now: Picture, before: Picture, where: Mask) -> float:
    """By how much one picture is brighter than another over the pixels that count: the median ratio, 1 if unclear."""
    few = where[::_SPARSE, ::_SPARSE]
    a = now[::_SPARSE, ::_SPARSE, 1][few].astype(np.float32)
    b = before[::_SPARSE, ::_SPARSE, 1][few].astype(np.float32)
    usable = (a > 8.0) & (a < 247.0) & (b > 8.0) & (b < 247.0)
    if np.count_nonzero(usable) < 32:
        return 1.0
    return float(np.median(a[usable] / b[usable]))


def moved(now: Picture, before: Picture, where: Mask) -> Mask:
    """Pixels that differ from the frame before by more than noise and a step of the exposure."""
    strongest = _strongest(now, before, gain_between(now, before, where))
    few = strongest[::_SPARSE, ::_SPARSE][where[::_SPARSE, ::_SPARSE]]
    # the largest of three channels' differences has a median of 1.8 standard deviations of one picture's noise
    noise = max(NOISE, float(np.median(few)) / 1.8) if few.size else NOISE
    return np.asarray(strongest > MOVES * noise, dtype=np.bool_) & where


def _strongest(now: Picture, before: Picture, gain: float) -> Picture:
    """The largest of three channels' differences from an earlier picture that is made brighter by a gain, (h, w)."""
    lit = before if abs(gain - 1.0) < 0.02 else cv2.convertScaleAbs(before, alpha=gain)
    difference = cv2.absdiff(now, lit)
    return np.asarray(cv2.max(cv2.max(difference[..., 0], difference[..., 1]), difference[..., 2]), dtype=np.uint8)


def differs(now: Picture, background: Picture, where: Mask) -> Mask:
    """Pixels, of those that count, that show another surface than the settled board, whatever light falls on it."""
    gain = gain_between(now, background, where)
    found = np.zeros(where.shape, dtype=np.bool_)
    strongest = _strongest(now, background, gain)
    few = np.flatnonzero(cv2.bitwise_and(strongest, strongest, mask=where.view(np.uint8)) > OFF_COLOUR)
    if not few.size:
        return found
    seen = now.reshape(-1, 3)[few].astype(np.float32)
    usual = background.reshape(-1, 3)[few].astype(np.float32) * np.float32(gain)
    alpha = (seen * usual).sum(axis=1) / ((usual * usual).sum(axis=1) + np.float32(1.0))
    off = seen - alpha[:, None] * usual
    most_seen, most_usual = seen.max(axis=1), usual.max(axis=1)
    # a dark surface shows little of how bright its light is: noise is then all of it
    dark = most_seen + np.float32(3.0 * NOISE) < DEEPEST_SHADOW * most_usual
    bright = most_seen > BRIGHTEST * most_usual + np.float32(3.0 * NOISE)
    found.ravel()[few] = ((off * off).sum(axis=1) > OFF_COLOUR**2) | dark | bright
    return found


def tidy(mask: Mask) -> Picture:
    """Without single pixels, and with gaps of a few pixels filled: 0 and 1."""
    small = cv2.getStructuringElement(cv2.MORPH_RECT, (3, 3))
    wide = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, small)
    return np.asarray(cv2.morphologyEx(opened, cv2.MORPH_CLOSE, wide), dtype=np.uint8)
