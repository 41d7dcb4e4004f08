"""The chessboard in a picture of which nothing else is known.

Saddle points (``vision.board.saddles``) grow into lattices (``vision.board.lattice``), the squares that alternate tell
which eight rows and columns are the board (``vision.board.window``), all crossings that can be seen give its corners to
a fraction of a pixel (``vision.board.crossings``) and with the sides of squares say how far off they may be
(``vision.board.joint_fit``), and pieces in the start position tell where a1 is (``vision.board.orientation``). Where it
is not certain which squares are the board there
is none: a wrong one is worse than none. Where only its corners are less exact than they should be, that is said.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from vision.arrays import Array, Field, Picture
from vision.board.alternation import channel_weights, compare_sides, look_into
from vision.board.crossings import refine_grid, working_scale
from vision.board.grid import Grid, fit_grid
from vision.board.joint_fit import JointFit, fit_jointly
from vision.board.lattice import Lattice, grow_lattices
from vision.board.orientation import orient
from vision.board.saddles import find_saddles, levels
from vision.board.view import BoardNotFound
from vision.board.window import Window, best_window, judge

PASSES: Final = ((640, 0.0), (1280, 0.0), (400, 0.0), (640, 3.0))
"""Longer side and blur of the pictures that are searched one after another [px]: boards near, small, out of focus, and
with lines drawn between the squares."""
NEAR_SIDE: Final = 32.0  # side of a square in the picture that is searched for a board near a known place [px]
NEAR_MARGIN: Final = 2.0  # how far around the known place is searched [sides of a square]
MOST_SADDLES: Final = 500  # of one picture; a board has 49
LEAST_CROSSINGS, ENOUGH_CROSSINGS = 10, 30  # a lattice below the first is chance; beyond the second no other is sought
MOST_SEEDS: Final = 150  # beginnings of lattices that are tried in a picture
MOST_LATTICES: Final = 4  # how many are judged in a picture, the largest first
SURE_ERROR: Final = 0.15  # corners that are less certain than this are given with a doubt [sides of a square]
MOST_ERROR: Final = 0.3  # and those less certain than this not at all [sides of a square]


@dataclass(frozen=True, slots=True, eq=False)
class FoundBoard:
    """A board in a picture."""

    corners: Array  # of the playing area, outer: a1, h1, h8, a8, counter-clockwise seen from above, (4, 2) [px]
    oriented: bool  # False where a1 may be the opposite corner: all that is known then is that a1 is dark
    error: float  # of the worst corner, to be expected; exceeded by one board in twenty [sides of a square]
    doubt: str | None = None  # what is wrong and what to do, a sentence, where ``error`` is above ``SURE_ERROR``


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """Corners in the picture of full size [px], how exact they are, and the side of the smallest square [px]."""

    corners: Array
    error: float
    side: float

    def board(self, corners: Array, oriented: bool) -> FoundBoard:
        return FoundBoard(corners, oriented, self.error, self._doubt())

    def _doubt(self) -> str | None:
        if self.error <= SURE_ERROR:
            return None
        return (
            f"the board's corners may be off by {self.error:.2f} squares, {SURE_ERROR:.2f} would be sure, and its "
            f"smallest squares are {self.side:.0f} pixels wide: move the camera nearer or higher above the board"
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A board as a resized picture shows it."""

    grid: Grid  # place (0, 0) is one of the board's corners
    weights: Array  # of the channels, so that light less dark squares is about 1
    dark: int  # 1 where the square at place (0, 0) is dark, otherwise -1


def find_board(colour: Picture, *, near: ArrayLike | None = None) -> FoundBoard:
    """Find the board in a picture, RGB (h, w, 3): it lies within but for a part of its border, and shows at least a
    quarter of its crossings.

    With ``near``, corners a1, h1, h8, a8 as they were before, (4, 2) [px], it is looked for around there first, and a1
    is the corner closest to where it was. Without, a1 is told from pieces in the start position.

    Raises:
        BoardNotFound: there is none for certain; says what was missing.
    """
    doubts: list[str] = []
    found = None
    if near is not None:
        found = _find_near(colour, np.asarray(near, dtype=float), doubts)
    for longest, blur in PASSES:
        if found is None:
            found = _find_at(colour, longest / max(colour.shape[:2]), blur, doubts)
    if found is None:
        reason = doubts[-1] if doubts else "no squares were found that form a board"
        raise BoardNotFound(
            f"no chessboard was found with certainty in this picture: {reason}; show all of it in even light"
        )
    corners = found.corners
    if near is not None:
        before = np.asarray(near, dtype=float)
        turns = [np.roll(corners, -turn, axis=0) for turn in range(4)]
        return found.board(min(turns, key=lambda one: float(np.linalg.norm(one - before))), True)
    oriented = orient(colour, corners)
    return found.board(oriented.corners, oriented.sure)


def _find_at(colour: Picture, factor: float, blur: float, doubts: list[str]) -> _Measured | None:
    """Corners, dark a1 first; searched in a picture resized by a factor, then blurred [px]."""
    picture = levels(_resize(colour, factor))
    if blur > 0.0:
        picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), blur), dtype=np.float32)
    saddles = find_saddles(picture, MOST_SADDLES)
    for lattice in grow_lattices(saddles, LEAST_CROSSINGS, ENOUGH_CROSSINGS, MOST_SEEDS)[:MOST_LATTICES]:
        candidate = _place(picture, lattice, doubts)
        if candidate is None:
            continue
        size = (colour.shape[1], colour.shape[0])
        found = _measure(colour, candidate.grid.scaled(1.0 / factor, size), candidate, doubts)
        if found is not None:
            return found
    return None


def _find_near(colour: Picture, near: Array, doubts: list[str]) -> _Measured | None:
    side = float(np.linalg.norm(np.roll(near, -1, axis=0) - near, axis=1).max()) / 8.0
    low = np.maximum(np.floor(near.min(axis=0) - NEAR_MARGIN * side), 0).astype(int)
    high = np.minimum(np.ceil(near.max(axis=0) + NEAR_MARGIN * side) + 1, colour.shape[1::-1]).astype(int)
    if (high - low < 16).any():
        doubts.append("the place to look at lies outside of the picture")
        return None
    part = np.ascontiguousarray(colour[low[1] : high[1], low[0] : high[0]])
    factor = min(2.0, max(NEAR_SIDE / side, 320.0 / max(part.shape[:2])))
    found = _find_at(part, factor, 0.0, doubts)
    return None if found is None else replace(found, corners=found.corners + low)


def _place(picture: Field, lattice: Lattice, doubts: list[str]) -> _Candidate | None:
    """The board of a lattice, if it has one."""
    places = lattice.places.astype(float)
    grid = fit_grid(places, lattice.points, (picture.shape[1], picture.shape[0]))
    weights = channel_weights(picture, grid, lattice.bright, places)
    low, high = lattice.places.min(axis=0) - 9, lattice.places.max(axis=0) + 9
    look = look_into(picture, weights)
    window = best_window(compare_sides(look, grid, lattice.bright, (low[0], low[1]), (high[0], high[1])))
    if window is None or not _believed(window, doubts):
        return None
    i, j = window.origin
    dark = -lattice.bright * (1 - 2 * ((i + j) % 2))
    return _Candidate(grid.moved(np.array([[1.0, 0.0, i], [0.0, 1.0, j], [0.0, 0.0, 1.0]])), weights, dark)


def _believed(window: Window, doubts: list[str]) -> bool:
    doubt = window.doubt
    if doubt is not None:
        doubts.append(f"what looks like one is doubtful, as {doubt}")
    return doubt is None


def _measure(colour: Picture, grid: Grid, candidate: _Candidate, doubts: list[str]) -> _Measured | None:
    """Corners from a dark a1 on, in the picture of full size; None if they are too uncertain."""
    factor = working_scale(grid)
    picture = levels(_resize(colour, factor) if factor != 1.0 else colour)
    smooth = cv2.GaussianBlur(picture, (0, 0), 0.8)  # noise of single pixels and of the resizing taken off
    look = look_into(np.asarray(smooth, dtype=np.float32), candidate.weights)
    fit = refine_grid(look, grid.scaled(factor, (picture.shape[1], picture.shape[0])), candidate.dark)
    joint = None if fit is None else fit_jointly(look, fit, candidate.dark)
    if fit is None or joint is None:
        doubts.append("too few crossings of its lines can be seen")
        return None
    found = _in_full(joint, picture, colour)
    if found.error > MOST_ERROR:
        doubts.append(f"its corners are uncertain by {found.error:.2f} squares, at most {MOST_ERROR:.2f} are accepted")
        return None
    window = judge(compare_sides(look, fit, -candidate.dark, (-1, -1), (9, 9)), 1, 1)
    if not _believed(window, doubts):
        return None
    return found if candidate.dark > 0 else replace(found, corners=np.roll(found.corners, -1, axis=0))


def _in_full(fit: JointFit, resized: Field, colour: Picture) -> _Measured:
    """From a resized picture; its size is in whole pixels, so its factor is not quite the one that was asked for."""
    factor = np.array(resized.shape[1::-1]) / np.array(colour.shape[1::-1])
    scale = float(factor.mean())
    return _Measured((fit.corners + 0.5) / factor - 0.5, fit.error(scale), float(fit.sides.min()) / scale)


def _resize(colour: Picture, factor: float) -> Picture:
    size = (round(colour.shape[1] * factor), round(colour.shape[0] * factor))
    resized = cv2.resize(colour, size, interpolation=cv2.INTER_AREA if factor < 1.0 else cv2.INTER_CUBIC)
    return np.asarray(resized, dtype=np.uint8)
