"""The printed marker on the tool in a picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import cv2
import numpy as np

from vision.arrays import Array, Picture

LEAST_SIDE: Final = 14.0  # a marker with a shorter side is too small to be measured [px]


@dataclass(frozen=True, slots=True, eq=False)
class SeenMarker:
    """A marker in a picture."""

    centre: Array  # picture of the centre of the black square, (2,) [px]
    corners: Array  # of the black square, (4, 2) [px]


@cache
def _detector() -> Any:
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    settings.relativeCornerRefinmentWinSize = 0.6
    settings.cornerRefinementWinSize = 4
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), settings)


def find_marker(colour: Picture, number: int) -> SeenMarker | None:
    """The marker of a number (4×4 bits, dictionary of 50) in a picture (h, w, 3); None where it is not all in sight."""
    corners, numbers, _ = _detector().detectMarkers(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY))
    if numbers is None:
        return None
    for found, one in zip(corners, np.ravel(numbers).tolist(), strict=True):
        four = np.asarray(found, dtype=float).reshape(4, 2)
        sides = np.linalg.norm(np.roll(four, -1, axis=0) - four, axis=1)
        if one == number and float(sides.min()) >= LEAST_SIDE:
            return SeenMarker(_crossing(four), four)
    return None


def _crossing(corners: Array) -> Array:
    """Where the diagonals cross: the picture of the centre, whichever way the marker faces."""
    first, second = corners[2] - corners[0], corners[3] - corners[1]
    share = np.linalg.solve(np.column_stack([first, -second]), corners[1] - corners[0])
    return np.asarray(corners[0] + share[0] * first)
