"""The board from four ArUco markers beside it, for boards whose squares are hard to see or always covered.

Markers 0, 1, 2, 3 of ``DICT_4X4_50`` lie flat, at the board's height, outside of the corners a1, h1, h8 and a8, all
with their upper edge towards rank 8. They tell the orientation too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from hardware.table import TableSettings
from vision.board.find import FoundBoard
from vision.board.grid import CORNERS, fit_grid
from vision.board.view import CORNER_NAMES, BoardNotFound

Array = NDArray[np.float64]

LEAST_MARKERS: Final = 3
"""Markers that must be seen; the fourth may be covered."""
MOST_RESIDUAL: Final = 0.06
"""Markers whose corners fit worse were put elsewhere [sides of a square]: with intrinsics unknown, that shows in their
shapes alone, so what is off by less than about a square may pass. Measure their places well."""
MODULES: Final = 6
"""Black and white fields along a side of a marker, its black rim included."""
PAGE: Final = (210.0, 297.0)
"""A4 [mm]."""
RULER: Final = 100.0
"""Length of the line by which a print is checked [mm]."""


@dataclass(frozen=True, slots=True)
class MarkerSettings:
    """Where the markers are.

    Attributes:
        side: of a marker's black square [m].
        centres: of markers 0 to 3 in the board frame, x and y [m].
    """

    side: float
    centres: tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]

    def __post_init__(self) -> None:
        """Check the sizes.

        Raises:
            ValueError: a side that is not positive, or places that are not finite or lie on one another.
        """
        if not (math.isfinite(self.side) and self.side > 0.0):
            raise ValueError(f"a marker of {self.side} m is impossible: give the side of its black square, as 0.03")
        places = np.array(self.centres, dtype=float)
        if places.shape != (4, 2) or not np.isfinite(places).all():
            raise ValueError("give the centres of four markers, x and y in metres each")
        gaps = np.abs(places[:, None] - places[None]).max(axis=2) + 2.0 * self.side * np.eye(4)
        if gaps.min() < self.side:
            raise ValueError("two markers lie on one another: give centres that are at least a side apart")

    @classmethod
    def beside(cls, table: TableSettings, side: float = 0.03, gap: float = 0.03) -> MarkerSettings:
        """Markers diagonally outside of the corners.

        Args:
            table: size of the squares.
            side: of a marker's black square [m].
            gap: from the corner of the playing area to the marker's, along files and ranks [m].
        """
        far = 4.0 * table.square + gap + 0.5 * side
        return cls(side, ((-far, -far), (far, -far), (far, far), (-far, far)))

    def corners(self, marker: int) -> Array:
        """Corners of a marker as OpenCV gives them: upper left, upper right, lower right, lower left; (4, 2) [m]."""
        half = 0.5 * self.side
        return np.array(self.centres[marker]) + half * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])


def find_markers(colour: NDArray[np.uint8], settings: MarkerSettings, table: TableSettings) -> FoundBoard:
    """The board from its markers.

    Args:
        colour: RGB, shape (h, w, 3).
        settings: where the markers are.
        table: size of the squares.

    Raises:
        BoardNotFound: fewer than three markers are seen, or they are not where the settings say.
    """
    detections = _detect(colour)
    if len(detections) < LEAST_MARKERS:
        names = ", ".join(f"{one} ({CORNER_NAMES[one]})" for one in range(4) if one not in detections)
        raise BoardNotFound(
            f"{len(detections)} of the four markers are seen, at least {LEAST_MARKERS} are needed: uncover {names}"
        )
    places = np.concatenate([settings.corners(one) for one in detections]) / table.square + 4.0
    points = np.concatenate(list(detections.values()))
    fit = fit_grid(places, points, (colour.shape[1], colour.shape[0]), scatter=0.01)
    worst = float(np.linalg.norm(fit.off, axis=1).max())
    if worst > MOST_RESIDUAL:
        raise BoardNotFound(
            f"the markers are up to {worst:.2f} squares from where the settings have them, at most {MOST_RESIDUAL:.2f} "
            "are accepted: check their places, their size and which way they are turned"
        )
    return FoundBoard(fit.grid.project(CORNERS), True, float(np.hypot(2.0 * fit.spread.max(), 0.5 * worst)))


def _detect(colour: NDArray[np.uint8]) -> dict[int, Array]:
    """Corners of each marker that is seen exactly once, in the order of ``MarkerSettings.corners`` [px]."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(_dictionary(), parameters)
    corners, numbers, _ = detector.detectMarkers(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY))
    seen = [] if numbers is None else [int(one) for one in np.ravel(numbers)]
    return {
        one: np.asarray(corners[seen.index(one)], dtype=float).reshape(4, 2) for one in range(4) if seen.count(one) == 1
    }


def _dictionary() -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)


def write_sheet(path: Path, settings: MarkerSettings) -> None:
    """Write the four markers to cut out, on a page of A4 at true size.

    Args:
        path: of an SVG file; browsers print it. Print at 100 %, and check with the line of 100 mm at its foot.
        settings: size and places of the markers.

    Raises:
        ValueError: another suffix, or markers too large for the page.
    """
    if path.suffix.lower() != ".svg":
        raise ValueError(f"a sheet named '{path.name}' cannot be written: give a name that ends in .svg")
    side = 1000.0 * settings.side
    pitch = side * (1.0 + 2.0 / MODULES) + 12.0
    if 2.0 * pitch > PAGE[0] - 20.0:
        raise ValueError(f"four markers of {side:.0f} mm do not fit on a page of A4: take at most 65 mm")
    body = [_marker(one, 10.0 + (one % 2) * pitch, 10.0 + (one // 2) * pitch, side) for one in range(4)]
    foot = PAGE[1] - 15.0
    body.append(f'<path d="M10 {foot}h{RULER}m0 -2v4m-{RULER} 0v-4" stroke="black" stroke-width="0.3" fill="none"/>')
    body.append(
        f'<text x="10" y="{foot - 4.0}" font-size="4">{RULER:.0f} mm; markers {side:g} mm, upper edge to rank 8</text>'
    )
    width, height = PAGE
    size = f'width="{width:g}mm" height="{height:g}mm" viewBox="0 0 {width:g} {height:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>'
    path.write_text("\n".join([head, '<rect width="100%" height="100%" fill="white"/>', *body, "</svg>"]) + "\n")


def _marker(number: int, x: float, y: float, side: float) -> str:
    """One marker with a white rim of a module, upper left corner of the rim at (x, y) [mm]."""
    module = side / MODULES
    fields = np.asarray(cv2.aruco.generateImageMarker(_dictionary(), number, MODULES))
    left, top = x + module, y + module
    white = "".join(
        f"M{left + column * module:.4f} {top + row * module:.4f}h{module:.4f}v{module:.4f}h-{module:.4f}z"
        for row, column in zip(*np.nonzero(fields), strict=True)
    )
    rim = side + 2.0 * module
    return (
        f'<rect x="{x:.4f}" y="{y:.4f}" width="{rim:.4f}" height="{rim:.4f}" fill="none" stroke="silver" '
        f'stroke-width="0.2"/><rect x="{left:.4f}" y="{top:.4f}" width="{side:.4f}" height="{side:.4f}" fill="black"/>'
        f'<path d="{white}" fill="white"/>'
        f'<text x="{x:.4f}" y="{y + rim + 5.0:.4f}" font-size="4">{number}: {CORNER_NAMES[number]}</text>'
    )
