"""Numbers that describe a sight, square by square: what appearance and change are judged by.

Brightness is logarithmic: light that is twice as strong adds the same everywhere, and a soft shadow shifts a square
without changing what is to be seen in it.

Whether a square's content has changed is told by two measures: how much brightness and colour have changed, and how
much of the gradients has. Light, exposure and soft shadows change the first over the whole board; gradients stay where
things stay. Both are compared with the board's own median, since few squares change at a time: noise, blur and a slight
shake of the camera are in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import cv2
import numpy as np

from vision.arrays import Array, Field, Picture
from vision.loops import changes, slopes_of
from vision.reading.rectified_view import MARGIN, PLAN_PX, SQUARE_PX
from vision.reading.solids import LOGARITHM

SMOOTHING: Final = 0.75  # of what gradients are taken from: below it there is noise, and the camera's own blur [px]
BLOCKS: Final = 5  # a square is described by BLOCKS × BLOCKS blocks
EDGE: Final = 0.02  # added to the size of gradients before their logarithm, for the same reason
MIDDLE: Final = 0.8  # share of a square's side that is compared: its edges are where neighbours and a shake show
BOUND: Final = 8.0  # no square counts for more than this, in natural logarithms
WEIGHTS: Final = (1.3, 4.3, 3.0, 2.9)
OFFSET: Final = -0.1
"""Logistic regression over the measures below, fitted to photographs of six games on four boards; fitted without a game
and tried on it, the weights change little and the errors do not."""


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """A sight in logarithmic brightness, with its gradients."""

    level: Field  # natural logarithm of brightness, shape (PLAN_PX, PLAN_PX, 3)
    slopes: Field
    """Gradients of the smoothed ``level``: along columns in red, green and blue, then along rows, shape (PLAN_PX,
    PLAN_PX, 6) [1/px]."""
    size: Field  # length of the gradient over all colours, shape (PLAN_PX, PLAN_PX) [1/px]

    def brighter(self, step: Array) -> Light:
        """The same, with so much more light in each colour, shape (3,), logarithmic."""
        offset: Any = (*step.tolist(), 0.0)  # a scalar to OpenCV, of which its type stubs do not know
        brighter = cv2.add(self.level, offset)
        return replace(self, level=np.asarray(brighter, dtype=np.float32))


def light_of(plan: Picture) -> Light:
    """Logarithmic brightness and gradients of a plan."""
    level = np.asarray(cv2.LUT(plan, LOGARITHM), dtype=np.float32)
    smooth = cv2.GaussianBlur(level, (0, 0), SMOOTHING)
    return Light(level, *slopes_of(np.asarray(smooth, dtype=np.float32)))


def exposure_step(light: Light, reference: Light) -> Array:
    """By how much a whole picture is brighter than another, in each colour: shape (3,), logarithmic.

    The median over the board: what a few pieces change does not count.
    """
    inner = slice(MARGIN * SQUARE_PX + 1, PLAN_PX - MARGIN * SQUARE_PX, 3)  # every third pixel says as much
    step: Array = np.median((light.level[inner, inner] - reference.level[inner, inner]).reshape(-1, 3), axis=0)
    return step.astype(float)


def describe(light: Light, shift: tuple[int, int] = (0, 0)) -> Array:
    """What each square looks like: shape (64, n), row 0 is a1, row 63 is h8.

    Squares are taken off their places by columns and rows [px], to learn how it looks when a piece is off the middle.
    """
    start = MARGIN * SQUARE_PX
    rows = slice(start + shift[1], start + shift[1] + 8 * SQUARE_PX)
    columns = slice(start + shift[0], start + shift[0] + 8 * SQUARE_PX)
    brightness = _blocks(light.level[rows, columns], BLOCKS)
    edges = 2.0 * np.log(_blocks(light.size[rows, columns], BLOCKS) + EDGE)
    return np.concatenate([brightness, edges], axis=1)


def _blocks(picture: Field, count: int) -> Array:
    """Means over ``count`` × ``count`` blocks of each square: shape (64, n)."""
    small = np.asarray(cv2.resize(picture, (8 * count, 8 * count), interpolation=cv2.INTER_AREA), dtype=np.float32)
    by_square = small.reshape(8, count, 8, count, -1).transpose(0, 2, 1, 3, 4)[::-1]  # a1 first
    return by_square.reshape(64, -1).astype(float)


def change_measures(light: Light, reference: Light) -> Array:
    """Change of colour and of gradients from a reference, each relative to the board's median and as it is: shape
    (64, 4).

    ``light`` is as if it had the exposure of the reference.
    """
    edge = round(0.5 * (1.0 - MIDDLE) * SQUARE_PX)
    colour, moved, size = changes(
        light.level, reference.level, light.slopes, reference.slopes, light.size, reference.size,
        MARGIN * SQUARE_PX, SQUARE_PX, edge,
    ).T  # fmt: skip
    colour, turned = np.log(colour + 0.01), np.log(moved / (size + 0.01) + 0.02)
    return np.stack([colour - np.median(colour), turned - np.median(turned), colour, turned], axis=1)


def change_odds(light: Light, reference: Light) -> Array:
    """Logarithm of the odds that a square's content has changed: shape (64,), within ±``BOUND``."""
    return np.asarray(np.clip(change_measures(light, reference) @ np.array(WEIGHTS) + OFFSET, -BOUND, BOUND))
