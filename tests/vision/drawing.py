"""Boards drawn with known corners, for tests of finding them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

CORNERS = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]])
START = "rnbqkbnr/pppppppp/8/8/8/8/PPPPPPPP/RNBQKBNR"


@dataclass(frozen=True)
class Drawing:
    """How a board is drawn; colours are RGB."""

    size: tuple[int, int] = (640, 480)
    light: tuple[int, int, int] = (222, 200, 165)
    dark: tuple[int, int, int] = (120, 75, 45)
    frame: tuple[int, int, int] = (150, 110, 70)
    table: tuple[int, int, int] = (90, 95, 100)
    white: tuple[int, int, int] = (240, 232, 214)
    black: tuple[int, int, int] = (48, 40, 36)
    squares: int = 8
    border: float = 0.7
    noise: float = 3.0
    line: tuple[float, float] | None = None
    """A dark line around the playing area: how far outside of it, and how wide [sides of a square]."""
    bow: tuple[float, float] = (0.0, 0.0)
    """How far the middles of the left and right, and of the lower and upper border are moved [sides of a square]."""


def pose(
    tilt: float, turn: float, fill: float, size: tuple[int, int], shift: tuple[float, float] = (0.0, 0.0)
) -> NDArray[np.float64]:
    """Homography from places, a1 at (0, 0) and h8 at (8, 8), to pixels, for a board seen by a pinhole.

    Args:
        tilt: of the view from straight above [rad].
        turn: of the board about its normal [rad].
        fill: side of the board as part of the picture's height, if seen from above.
        size: of the picture [px].
        shift: of its middle from the picture's, as part of the picture.
    """
    width, height = size
    focal = 1.2 * width
    centre = np.array([[1.0, 0.0, -4.0], [0.0, 1.0, -4.0], [0.0, 0.0, 1.0]])
    c, s = np.cos(turn), np.sin(turn)
    spin = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    distance = focal * 8.0 / (fill * height)
    # v points down, the ranks up; the far side is the upper one
    view = np.array([[1.0, 0.0, 0.0], [0.0, -np.cos(tilt), 0.0], [0.0, np.sin(tilt), distance]])
    pinhole = np.array(
        [[focal, 0.0, (0.5 + shift[0]) * width - 0.5], [0.0, focal, (0.5 + shift[1]) * height - 0.5], [0.0, 0.0, 1.0]]
    )
    return pinhole @ view @ spin @ centre


def corners_of(homography: NDArray[np.float64], squares: int = 8) -> NDArray[np.float64]:
    """Where a1, h1, h8, a8 are, shape (4, 2) [px]."""
    raised = np.hstack([CORNERS * squares / 8.0, np.ones((4, 1))]) @ homography.T
    return np.asarray(raised[:, :2] / raised[:, 2:])


def draw(homography: NDArray[np.float64], placement: str | None, drawing: Drawing, seed: int = 0) -> NDArray[np.uint8]:
    """A board with discs for pieces, ``placement`` as in a FEN, seen through a homography."""
    rng = np.random.default_rng(seed)
    unit, count = 40, drawing.squares  # pixels a square of the flat picture
    rim = round(drawing.border * unit)
    flat = np.empty((count * unit + 2 * rim, count * unit + 2 * rim, 3), np.uint8)
    flat[:] = drawing.frame
    if drawing.line is not None:
        gap, width = (round(one * unit) for one in drawing.line)
        outer, inner = rim - gap - width, rim - gap
        flat[outer : len(flat) - outer, outer : len(flat) - outer] = (25, 25, 25)
        flat[inner : len(flat) - inner, inner : len(flat) - inner] = drawing.frame
    for i in range(count):
        for j in range(count):
            y, x = rim + (count - 1 - j) * unit, rim + i * unit
            flat[y : y + unit, x : x + unit] = drawing.light if (i + j) % 2 else drawing.dark
    for row, rank in enumerate((placement or "8/8/8/8/8/8/8/8").split("/")):
        column = 0
        for letter in rank:
            if letter.isdigit():
                column += int(letter)
                continue
            middle = (
                rim + column * unit + unit // 2 + int(rng.integers(-3, 4)),
                rim + row * unit + unit // 2 + int(rng.integers(-3, 4)),
            )
            colour = drawing.white if letter.isupper() else drawing.black
            cv2.circle(flat, middle, 13, tuple(int(0.7 * one) for one in colour), -1, cv2.LINE_AA)
            cv2.circle(flat, middle, 10, colour, -1, cv2.LINE_AA)
            column += 1
    if any(drawing.bow):
        flat = _bent(flat, drawing.bow, unit, rim)
    place_of_pixel = np.array([
        [1.0 / unit, 0.0, (0.5 - rim) / unit], [0.0, -1.0 / unit, count + (rim - 0.5) / unit], [0.0, 0.0, 1.0]
    ])  # fmt: skip
    # drawn at twice the size, so that edges are as soft as a lens makes them
    double = np.array([[2.0, 0.0, 0.5], [0.0, 2.0, 0.5], [0.0, 0.0, 1.0]])
    big = (2 * drawing.size[0], 2 * drawing.size[1])
    table = np.empty((big[1], big[0], 3), np.uint8)
    table[:] = drawing.table
    warped = cv2.warpPerspective(
        flat,
        double @ homography @ place_of_pixel,
        big,
        dst=table,
        flags=cv2.INTER_AREA,
        borderMode=cv2.BORDER_TRANSPARENT,
    )
    picture = cv2.resize(warped, drawing.size, interpolation=cv2.INTER_AREA).astype(float)
    picture += rng.normal(0.0, drawing.noise, picture.shape)
    return np.clip(picture + 0.5, 0, 255).astype(np.uint8)


def _bent(flat: NDArray[np.uint8], bow: tuple[float, float], unit: int, rim: int) -> NDArray[np.uint8]:
    """The flat picture with its lines bent as parabolas; the corners stay where they are."""
    y, x = (one.astype(np.float32) for one in np.indices(flat.shape[:2]))
    a, b = ((one - rim) / (4.0 * unit) - 1.0 for one in (x, y))
    across = (x - unit * bow[0] * (1.0 - b * b)).astype(np.float32)
    down = (y - unit * bow[1] * (1.0 - a * a)).astype(np.float32)
    return np.asarray(cv2.remap(flat, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), dtype=np.uint8)
