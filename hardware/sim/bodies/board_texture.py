"""Wood as a picture: the board's squares with their grain."""

from functools import cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

LIGHT: Final = (0.90, 0.82, 0.68)
DARK: Final = (0.45, 0.28, 0.16)
SQUARE: Final = 64
"""Side of a square in the picture [px]."""
GRAIN: Final = 0.04
"""Standard deviation of the brightness within a square, as part of it."""
SHADE: Final = 0.03
"""Standard deviation of the brightness from square to square."""


def board_picture() -> NDArray[np.uint8]:
    """RGB, shape (8 SQUARE, 8 SQUARE, 3). Row 0 is the eighth rank, column 0 the a-file."""
    rng = np.random.default_rng(64)
    picture = np.empty((8 * SQUARE, 8 * SQUARE, 3))
    for row in range(8):
        for column in range(8):
            colour = np.asarray(LIGHT if (row + column) % 2 == 0 else DARK)
            grain = 1.0 + rng.normal(0.0, SHADE) + GRAIN * _grain(rng)
            place = np.s_[row * SQUARE : (row + 1) * SQUARE, column * SQUARE : (column + 1) * SQUARE]
            picture[place] = grain[..., None] * colour
    return np.rint(255.0 * picture.clip(0.0, 1.0)).astype(np.uint8)


@cache
def board_png() -> bytes:
    """The picture as a PNG file, which MuJoCo takes many times more quickly than numbers."""
    done, png = cv2.imencode(".png", board_picture()[..., ::-1])
    if not done:
        raise RuntimeError("OpenCV could not encode the picture of the board")
    return bytes(png)


def _grain(rng: np.random.Generator) -> NDArray[np.float64]:
    """Fibres along the columns, shape (SQUARE, SQUARE), standard deviation 1."""
    noise = rng.standard_normal((SQUARE, SQUARE))
    fibres = np.asarray(cv2.GaussianBlur(noise, (0, 0), sigmaX=0.8, sigmaY=16.0, borderType=cv2.BORDER_REFLECT))
    grain: NDArray[np.float64] = (fibres - fibres.mean()) / fibres.std()
    return grain
