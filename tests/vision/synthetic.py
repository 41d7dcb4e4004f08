"""A drawn board: flat squares under a camera from straight above or obliquely, pieces as upright cylinders with heads.

Enough of a picture to try laws of vision on, in a millisecond or two; what real pictures look like is left to rendered
ones and photographs.
"""

from __future__ import annotations

import chess
import cv2
import numpy as np
from numpy.typing import NDArray

SIZE = (640, 480)
FOCAL = 600.0
LIGHT, DARK = (205, 190, 160), (110, 75, 50)
WHITE, BLACK = (235, 225, 205), (38, 32, 30)
HEIGHT = {1: 0.85, 2: 1.05, 3: 1.15, 4: 0.95, 5: 1.35, 6: 1.5}
"""By kind, in squares."""


def camera_matrix(tilt: float, distance: float = 13.0, turn: float = 0.0) -> NDArray[np.float64]:
    """Projection (3, 4) of the plan frame, in squares: ``tilt`` from straight above, ``turn`` about the vertical."""
    c, s = np.cos(turn), np.sin(turn)
    around = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    down = np.diag([1.0, -1.0, -1.0])
    c, s = np.cos(tilt), np.sin(tilt)
    lean = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    rotation = lean @ down @ around
    shift = np.array([0.0, 0.0, distance]) - rotation @ np.array([4.0, 4.0, 0.0])
    k = np.array([[FOCAL, 0, (SIZE[0] - 1) / 2], [0, FOCAL, (SIZE[1] - 1) / 2], [0, 0, 1.0]])
    return k @ np.column_stack([rotation, shift])


def project(matrix: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels of points (n, 3)."""
    seen = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return seen[:, :2] / seen[:, 2:]


def corners_of(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the playing area, (4, 2)."""
    return project(matrix, np.array([[0, 0, 0], [8, 0, 0], [8, 8, 0], [0, 8, 0.0]]))


def draw(
    board: chess.BaseBoard,
    matrix: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    offsets: NDArray[np.float64] | None = None,
    brightness: float = 1.0,
    noise: float = 3.0,
) -> NDArray[np.uint8]:
    """A picture, RGB. ``offsets`` (64, 2) in squares: where in its square each piece stands."""
    offsets = np.zeros((64, 2)) if offsets is None else offsets
    picture = np.full((SIZE[1], SIZE[0], 3), (90, 95, 100), np.uint8)
    for square in range(64):
        x, y = square % 8, square // 8
        area = project(matrix, np.array([[x, y, 0], [x + 1, y, 0], [x + 1, y + 1, 0], [x, y + 1, 0.0]]))
        colour = LIGHT if (x + y) % 2 else DARK
        cv2.fillConvexPoly(picture, np.round(area * 16).astype(np.int32), colour, cv2.LINE_AA, 4)
    eye = -np.linalg.solve(matrix[:, :3], matrix[:, 3])
    around = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)

    def distance(item: tuple[int, chess.Piece]) -> float:
        return -float(np.hypot(item[0] % 8 + 0.5 - eye[0], item[0] // 8 + 0.5 - eye[1]))

    for square, piece in sorted(board.piece_map().items(), key=distance):
        centre = np.array([square % 8 + 0.5, square // 8 + 0.5]) + offsets[square]
        shade = WHITE if piece.color else BLACK
        for low, high, radius in ((0.0, 0.25, 0.3), (0.25, 0.8, 0.2), (0.8, 1.0, 0.24)):
            tall = HEIGHT[piece.piece_type]
            rings = [np.column_stack([centre + radius * circle, np.full(24, z * tall)]) for z in (low, high)]
            hull = cv2.convexHull(project(matrix, np.concatenate(rings)).astype(np.float32))
            fill = tuple(int(band * (0.8 + 0.25 * high)) for band in shade)
            outline = np.round(hull * 16).astype(np.int32)
            cv2.fillConvexPoly(picture, outline, np.minimum(fill, 255).tolist(), cv2.LINE_AA, 4)
            # a round body is darker where it turns away
            cv2.polylines(picture, [outline], True, [0.6 * band for band in shade], 1, cv2.LINE_AA, 4)
    lit = cv2.GaussianBlur(picture, (0, 0), 0.7).astype(float) * brightness
    return (lit + rng.normal(0.0, noise, lit.shape)).clip(0, 255).astype(np.uint8)
