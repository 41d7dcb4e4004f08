"""After each move: does the board stand as it should, and if not, what is wrong where, in millimetres."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final

import cv2
import numpy as np

from hardware.interfaces import Frame
from hardware.piece_set import PIECE_SHAPES
from hardware.table import PieceSpec, TableSettings, square_place
from vision.arrays import Array, Mask
from vision.board.view import BoardView
from vision.pieces.centres import Centre, centres_of, on_squares
from vision.pieces.fit import Fit
from vision.pieces.surface import surface

TOLERANCE: Final = 0.005  # of a piece's centre from that of its square: the fingers close on pieces up to 8 mm off [m]
RISES: Final = 0.008  # what rises so far above the board, and is no piece that was found, lies there [m]
_CEILING: Final = max(shape.height for shape in PIECE_SHAPES.values()) + 0.02
"""What is higher lies nowhere, but is the arm, whose fingers at home hang 0.1 m or more over the first ranks of large
boards [m]."""
_AROUND: Final = 9  # depth pictures are fat at edges: so wide is left out around pieces that were found [px]
_LEAST_AREA: Final = 40  # smaller spots are noise [px]
_SURE: Final = 1.2  # colour evidence, on average over a spot, by which something lies there where there is no depth
_LEAST_COLOURED: Final = 120  # without depth, smaller spots may be shadows [px]
_DROP: Final = 0.45
"""A piece that looks so much less like itself than before, and no other does, was touched: what lies behind another
piece can look like one that stands there (measured: pieces that stand drop by 0.16 once in a thousand looks, at most by
0.42 in 8,400; of 12 that lay and still seemed to stand, 9 dropped by 0.48 or more)."""
_ASIDE: Final = 0.4  # an offset is called one towards a side when that side has at least such a share of it


class FaultKind(StrEnum):
    """What is wrong on a square."""

    OFF_CENTRE = "off centre"
    MISSING = "missing"
    FALLEN = "fallen"  # something lies where a piece should stand
    FOREIGN = "foreign"  # something is where nothing should be


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is not as it should be."""

    kind: FaultKind  # of fault
    square: int  # 0 = a1 … 63 = h8
    sentence: str  # for people
    place: tuple[float, float] | None  # of the piece or the thing, board frame [m]; None where nothing is there

    def astray(self, table: TableSettings) -> float:
        """How far off the centre of its square the piece stands [m]; infinite where something else is wrong."""
        if self.kind is not FaultKind.OFF_CENTRE or self.place is None:
            return math.inf
        return math.dist(self.place, table.xy(square_place(self.square)))


@dataclass(frozen=True, slots=True)
class Examination:
    """What a look at the board says."""

    faults: tuple[Fault, ...]  # by square
    likeness: Mapping[int, float]
    """Of each piece in sight, by square: how well it looks like itself, at most 2; to be held against the next look's.
    """
    centres: Mapping[int, tuple[float, float]]  # of the same pieces, board frame [m]


def examine_board(
    frame: Frame, view: BoardView, expected: Mapping[int, PieceSpec],
    before: Mapping[int, float] = MappingProxyType({}), *, tolerance: float = TOLERANCE,
) -> Examination:  # fmt: skip
    """Compare the board, without a hand or an arm over it, with what should stand on its squares.

    ``before``: likeness of pieces that have stood there in a look before, by this view and without a fault;
    ``tolerance``: of a centre from its square's [m].

    Returns:
        What it says; of pieces that others hide nothing.

    Raises:
        ValueError: the frame is by another camera, or the board is not in the picture.
    """
    view.require_camera(frame)
    fit = Fit(frame, view, on_squares(expected), use_depth=True)
    centres = {place.index: centre for place, centre in centres_of(fit).items()} if expected else {}
    spots = _spots(fit, centres, view)
    likeness = {square: one.support + one.agreement for square, one in centres.items() if not one.hidden}
    drops = {square: was - likeness[square] for square, was in before.items() if square in likeness}
    usual = max(0.0, float(np.median(list(drops.values())))) if drops else 0.0  # the light has changed for all
    faults = [
        fault
        for square, piece in expected.items()
        if (fault := _judge(square, piece, centres[square], spots, view, tolerance)) is not None
    ]
    taken = {fault.square for fault in faults} | set(expected)
    faults += [
        Fault(FaultKind.FOREIGN, square, f"something lies on {square_place(square)}", place)
        for square, place in spots.items()
        if square not in taken
    ]
    if not faults:  # what stands where nothing should may well hide what stands behind it
        changed = (_changed(square, expected[square], drop - usual) for square, drop in drops.items())
        faults = [fault for fault in changed if fault is not None]
    return Examination(tuple(sorted(faults, key=lambda fault: fault.square)), likeness, {
        square: (one.x, one.y) for square, one in centres.items() if square in likeness
    })  # fmt: skip


def _changed(square: int, piece: PieceSpec, drop: float) -> Fault | None:
    if drop < _DROP:
        return None
    sentence = f"the {piece.colour} {piece.kind} on {square_place(square)} does not look as it did"
    return Fault(FaultKind.FALLEN, square, sentence, None)


def _judge(
    square: int, piece: PieceSpec, centre: Centre, spots: Mapping[int, tuple[float, float]], view: BoardView,
    tolerance: float,
) -> Fault | None:  # fmt: skip
    name, where = f"{piece.colour} {piece.kind}", square_place(square)
    if centre.hidden:
        return None
    if not centre.upright:
        if square in spots:
            sentence = f"something lies on {where}, where a {name} should stand"
            return Fault(FaultKind.FALLEN, square, sentence, spots[square])
        return Fault(FaultKind.MISSING, square, f"{where} is empty, a {name} should stand there", None)
    place = centre.x, centre.y
    return None if math.dist(view.table.xy(where), place) <= tolerance else off_centre(square, piece, view.table, place)


def off_centre(square: int, piece: PieceSpec, table: TableSettings, place: tuple[float, float]) -> Fault:
    """A piece of a square stands at a place of the board frame (x, y) [m]."""
    x, y = table.xy(square_place(square))
    dx, dy = place[0] - x, place[1] - y
    name, off = f"{piece.colour} {piece.kind} on {square_place(square)}", math.hypot(dx, dy)
    sentence = f"the {name} stands {1e3 * off:.1f} mm off towards {_direction(dx, dy)}"
    return Fault(FaultKind.OFF_CENTRE, square, sentence, place)


def _direction(dx: float, dy: float) -> str:
    """Files and ranks towards which a piece stands off: h, 8, or both."""
    off = math.hypot(dx, dy)
    sides = []
    if abs(dx) >= _ASIDE * off:
        sides.append("h" if dx > 0.0 else "a")
    if abs(dy) >= _ASIDE * off:
        sides.append("8" if dy > 0.0 else "1")
    return " and ".join(sides)


def _spots(fit: Fit, centres: Mapping[int, Centre], view: BoardView) -> dict[int, tuple[float, float]]:
    """What is on the board and no piece that was found, by square: its middle in the board frame [m]."""
    found = np.array([False, *(centres[place.index].upright for place in fit.stands)])
    kept = found[fit.owner].astype(np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_AROUND, _AROUND))
    free = cv2.dilate(kept, kernel) == 0
    return _risen(fit, free, view) if fit.rises is not None else _coloured(fit, free, view)


def _risen(fit: Fit, free: Mask, view: BoardView) -> dict[int, tuple[float, float]]:
    """By depth: what stands out of the board's plane."""
    part, rises = surface(view), fit.rises
    assert rises is not None
    high = free & (rises > RISES) & (rises < _CEILING)
    # where a point above the board really is, not what it hides: along its ray, as much nearer to the camera
    share = 1.0 - rises[high] / np.maximum(part.climb[high] * part.depth[high], 1e-6)
    eye, places = view.camera_position[:2], np.zeros(part.place.shape)
    places[high] = eye + (part.place[high] - eye) * share[..., None]
    return _by_square(high, _LEAST_AREA, places, view.table.square)


def _coloured(fit: Fit, free: Mask, view: BoardView) -> dict[int, tuple[float, float]]:
    """By colour alone: what looks like pieces on the board; its foot counts, the rest leans away from the camera."""
    looks = np.maximum(*fit.maps)
    mean = np.asarray(cv2.boxFilter(looks, cv2.CV_32F, (7, 7)))
    seen = free & (mean > _SURE) & (fit.part.square >= 0)
    return _by_square(seen, _LEAST_COLOURED, fit.part.place.astype(float), view.table.square)


def _by_square(mask: Mask, least: int, places: Array, square: float) -> dict[int, tuple[float, float]]:
    """Connected spots of a mask by the square of their middle; of several on one, the largest."""
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8))
    count, numbers, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
    spots: dict[int, tuple[float, float]] = {}
    areas = np.asarray(stats)[1:count, cv2.CC_STAT_AREA]
    for number in (np.argsort(areas) + 1).tolist():
        if stats[number, cv2.CC_STAT_AREA] < least:
            continue
        x, y = np.median(places[numbers == number], axis=0).tolist()
        column, row = math.floor(x / square + 4.0), math.floor(y / square + 4.0)
        if 0 <= column < 8 and 0 <= row < 8:
            spots[column + 8 * row] = (x, y)
    return spots
