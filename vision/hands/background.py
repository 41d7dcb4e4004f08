"""What changes in pictures of a table: motion from frame to frame, and what differs from a settled background.

Pictures are small RGB ones, (h, w, 3) uint8; masks are (h, w) bool. A step of the exposure scales all of a picture and
is taken out first. A shadow scales the brightness of what it falls on and leaves its colour: with a background colour b
and a colour c seen now, c = αb in a shadow, with α between that of full light and that of the deepest shadow. What lies
off that line by more than noise is something else (T. Horprasert et al., A statistical approach for real-time robust
background subtraction and shadow detection, 1999).
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]

DEEPEST_SHADOW: Final = 0.42
"""Brightness that is left in the deepest shadow that counts as one: lamps of a room fill shadows up."""
BRIGHTEST: Final = 1.25
"""A surface that is brighter than this, compared with the background, is another one."""
OFF_COLOUR: Final = 13.0
"""A colour so far off the background's line is another surface [grey levels of 255]."""
NOISE: Final = 4.0
"""Least standard deviation of a pixel's noise that is reckoned with [grey levels]."""
MOVES: Final = 3.5
"""A pixel moves where it differs by so many standard deviations of noise."""
_SPARSE: Final = 5
"""Statistics over all of a picture are taken of each so manieth pixel along both axes."""


def gain_between(now: Picture, before: Picture, where: Mask) -> float:
    """By how much a picture is brighter than another as a whole: the median of the ratio, 1 where none can be told.

    Args:
        now: the picture.
        before: the other one.
        where: pixels that count.
    """
    few = where[::_SPARSE, ::_SPARSE]
    a = now[::_SPARSE, ::_SPARSE, 1][few].astype(np.float32)
    b = before[::_SPARSE, ::_SPARSE, 1][few].astype(np.float32)
    usable = (a > 8.0) & (a < 247.0) & (b > 8.0) & (b < 247.0)
    if np.count_nonzero(usable) < 32:
        return 1.0
    return float(np.median(a[usable] / b[usable]))


def moved(now: Picture, before: Picture, where: Mask) -> Mask:
    """Pixels that differ from the frame before by more than noise and a step of the exposure."""
    gain = gain_between(now, before, where)
    before = before if abs(gain - 1.0) < 0.02 else cv2.convertScaleAbs(before, alpha=gain).astype(np.uint8)
    difference = cv2.absdiff(now, before)
    strongest = cv2.max(cv2.max(difference[..., 0], difference[..., 1]), difference[..., 2])
    few = strongest[::_SPARSE, ::_SPARSE][where[::_SPARSE, ::_SPARSE]]
    # the largest of three channels' differences has a median of 1.8 standard deviations of one picture's noise
    noise = max(NOISE, float(np.median(few)) / 1.8) if few.size else NOISE
    return np.asarray(strongest > MOVES * noise, dtype=np.bool_) & where


def differs(now: Picture, background: Picture, where: Mask) -> Mask:
    """Pixels that show another surface than the background, whatever light falls on it.

    Args:
        now: the picture.
        background: the settled board.
        where: pixels that count.
    """
    gain = gain_between(now, background, where)
    found = np.zeros(where.shape, dtype=np.bool_)
    lit = background if abs(gain - 1.0) < 0.02 else cv2.convertScaleAbs(background, alpha=gain)
    difference = cv2.absdiff(now, lit)
    strongest = cv2.max(cv2.max(difference[..., 0], difference[..., 1]), difference[..., 2])
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


def tidy(mask: Mask, closing: int = 2) -> NDArray[np.uint8]:
    """Without single pixels, and with gaps of a few pixels filled: 0 and 1."""
    small = cv2.getStructuringElement(cv2.MORPH_RECT, (3, 3))
    wide = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * closing + 1, 2 * closing + 1))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, small)
    return np.asarray(cv2.morphologyEx(opened, cv2.MORPH_CLOSE, wide), dtype=np.uint8)
