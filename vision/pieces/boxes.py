"""Whether something has fallen into an open box: by depth, held against a picture from before."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np

from hardware.table import Box
from vision.board.view import BoardView
from vision.pieces.surface import heights, raised, surface
from vision.pieces.swapped import KnownPicture

_RISEN: Final = 0.006
"""What is so much higher than all that was around it has come [m]: a pawn that lies is twice as high."""
_EDGE: Final = 0.004  # so near a wall depth is the wall's [m]
_LEAST: Final = 40
"""Smaller spots are noise [px]: where nothing had come there were 30 at most in 504 looks at boxes on boards of 40, 47
and 55 mm squares; of 336 pieces laid into them at random 67 % made larger ones, the others lay mostly behind a wall."""
_UNKNOWN: Final = 1.0  # nothing comes where nothing was seen before [m]


def holds_more(before: KnownPicture, now: KnownPicture, box: Box) -> bool:
    """Whether something is in a box that was not, as far as the walls let the camera see; both frames have depth.

    Raises:
        ValueError: the pictures show the board at different places, or it is not in them.
    """
    view = now.view
    if before.view is not view:
        raise ValueError("camera or board have moved since: nobody can tell what has come into the box")
    assert before.frame.depth is not None, "without depth nobody can look into a box"
    assert now.frame.depth is not None, "without depth nobody can look into a box"
    part = surface(view, _around(view, box))
    was, here = heights(before.frame.depth, part), heights(now.frame.depth, part)
    x, y, z = np.moveaxis(raised(part, here, view), -1, 0)  # NaN where depth is unknown: in no box
    inside = (np.abs(x - box.x) < box.half_x - _EDGE) & (np.abs(y - box.y) < box.half_y - _EDGE) & (z < box.height)
    near = np.ones((3, 3), np.uint8)
    around = cv2.dilate(np.nan_to_num(was, nan=_UNKNOWN), near)
    new = (inside & (here > around + _RISEN)).astype(np.uint8)
    count, _, stats, _ = cv2.connectedComponentsWithStats(cv2.morphologyEx(new, cv2.MORPH_OPEN, near))
    return bool((np.asarray(stats)[1:count, cv2.CC_STAT_AREA] >= _LEAST).any())


def _around(view: BoardView, box: Box) -> tuple[float, float]:
    """How far the box reaches beyond the board, along x and along y [m]."""
    half = 4.0 * view.table.square
    return abs(box.x) + box.half_x + box.wall - half, max(0.0, box.half_y + box.wall - half)
