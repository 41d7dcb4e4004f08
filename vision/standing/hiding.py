"""Places that look empty, where something may stand behind another piece."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from hardware.piece_set import Colour, Kind
from hardware.table import Place
from vision.arrays import Array, Mask, Whole
from vision.board.view import BoardView
from vision.pieces.fit import Fit
from vision.pieces.outline import Shapes, Silhouettes

_HIDDEN: Final = 0.15  # where a pawn would be hidden but for this share, anything may stand
_HALF_HIDDEN: Final = 0.7  # where less than this of it, and of what is around it, would be in sight …
_AROUND: Final = 9  # … by half so many pixels [px] …
_PEEPS: Final = 12  # … a spot of so many that are nobody's and have colours of a piece may belong to one [px] …
_HOT: Final = 1.2
"""… if each has them so clearly (see ``Fit.maps``). Of 3,549 empty squares 16 look so; and all of
four pieces that stood right behind others, where depth had not seen them."""
_LOOKS_LIKE_ONE: Final = 0.8  # evidence for a piece, pixel by pixel on average, that no empty square shows
_SIDES: Final = (Colour.WHITE, Colour.BLACK)  # in the order of ``Fit.maps``


def hiding_places(empty: Sequence[Place], fit: Fit, view: BoardView) -> dict[Place, Colour | None]:
    """Those of some places that look empty where a pawn might stand all the same, and of which side: it looks so past
    what hides it; None: nothing of it would be seen. ``fit`` is of all pieces that are seen.
    """
    found = dict[Place, Colour | None]()
    pawns = pawns_at(empty, view, fit)
    nobodys = cv2.dilate((fit.owner > 0).astype(np.uint8), np.ones((3, 3), np.uint8)) == 0
    like_a_piece = {
        colour: (nobodys & (rather > _HOT)).astype(np.uint8) for colour, rather in zip(_SIDES, fit.maps, strict=True)
    }
    for place, inside, contour in zip(empty, pawns.inside, pawns.contour, strict=True):
        pixels, within = pixels_of(inside, fit)
        mine = pixels[within & (fit.owner.ravel()[pixels] == 0)]
        spot = np.zeros(fit.owner.shape, dtype=np.uint8)
        cv2.fillPoly(spot, [np.rint(contour).astype(np.int32)], 1)
        around = cv2.dilate(spot, np.ones((_AROUND, _AROUND), np.uint8))
        free = fit.owner[around > 0] == 0
        in_sight = float(free.mean()) if free.size else 0.0  # a tray's place may be beside the picture
        looks = [float(rather.ravel()[mine].mean()) if mine.size else 0.0 for rather in fit.maps]
        peeps = dict[Colour, int]()  # area of the largest spot [px]
        for colour, hot in like_a_piece.items():
            statistics = cv2.connectedComponentsWithStats(around & hot, connectivity=4)[2]
            peeps[colour] = int(statistics[1:, cv2.CC_STAT_AREA].max(initial=0))
        if in_sight < _HALF_HIDDEN and max(peeps.values()) >= _PEEPS:
            found[place] = max(peeps, key=peeps.__getitem__)
        elif max(looks) > _LOOKS_LIKE_ONE and place.on_board:  # in some lights marks of a tray's places look so, too
            found[place] = _SIDES[int(np.argmax(looks))]
        elif mine.size < _HIDDEN * pixels.size:
            found[place] = None
    return found


def pawns_at(
    places: Sequence[Place], view: BoardView, fit: Fit, shift: tuple[float, float] = (0.0, 0.0)
) -> Silhouettes:
    """As pawns would be seen in the middle of some places, or so far from there, along x and y [m]."""
    at = np.array([view.table.xy(place) for place in places]).reshape(-1, 2) + shift
    return Shapes(view, [Kind.PAWN] * len(places), at, fit.part).at(at)


def pixels_of(points: Array, fit: Fit) -> tuple[Whole, Mask]:
    """Points of the window (..., 2) as pixels, counted row by row, and which are within it."""
    u, v = np.moveaxis(np.rint(points).astype(np.int32), -1, 0)
    h, w = fit.part.ground.shape
    within: Mask = (u >= 0) & (u < w) & (v >= 0) & (v < h)
    return np.where(within, v * w + u, 0), within
