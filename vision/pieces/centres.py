"""Where exactly each piece stands: its outline, known from the table settings, laid over the picture.

How (``vision.pieces.fit``): colours of pieces and board are learnt from the frame itself. Each piece's silhouette is
tried at places around its square's centre, then moved until the picture's outline lies under the known one, by least
squares over many short lines across the outline. What another piece hides does not count.

Depth, where there is any, keeps pieces out of what is learnt about the board. The place itself is by colour alone:
depth pictures are fat at edges.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from hardware.interfaces import Frame
from hardware.table import PieceSpec, Place, square_place
from vision.board.view import BoardView
from vision.pieces.fit import LEAST_AGREEMENT, LEAST_SUPPORT, Fit

FLOOR: Final = 0.0002  # no place is known better than this: shapes are not exact [m]
_NEIGHBOURS: Final = 3.5
"""Edges side by side err alike, so that fewer count than there are: by so much the error is larger than their scatter
says (measured over rendered positions)."""
LEAST_SEEN: Final = 0.15  # with less of its outline in sight nobody can say whether a piece stands there


@dataclass(frozen=True, slots=True)
class Centre:
    """Where a piece's foot stands."""

    x: float  # of its centre in the board frame [m]
    y: float  # of its centre in the board frame [m]
    std: float  # expected error of either, as a standard deviation [m]
    support: float  # how much what is in sight of the silhouette looks like the piece, -1 to 1
    agreement: float  # share of the outline in sight where the picture has its edge just there
    seen: float  # share of the outline that is in sight, 0 to 1
    low: bool = False
    """By depth, nothing there is as high as the piece would be: one that lies along the view looks much like one that
    stands."""

    @property
    def hidden(self) -> bool:
        """Too little is in sight to say anything; the place is that of the square."""
        return self.seen < LEAST_SEEN

    @property
    def upright(self) -> bool:
        """Whether a standing piece of this kind explains the picture; else it is missing, fallen or hidden."""
        return not (self.hidden or self.low) and self.support > LEAST_SUPPORT and self.agreement > LEAST_AGREEMENT


def piece_centres(
    frame: Frame, view: BoardView, expected: Mapping[int, PieceSpec], *, use_depth: bool = True
) -> dict[int, Centre]:
    """Centres of all expected pieces, by square (0 = a1 … 63 = h8), without a hand or an arm over the board.

    All pieces have to be named, since they hide each other and colours are learnt from them. ``use_depth`` False: by
    colour alone, also where there is depth.

    Raises:
        ValueError: the frame is by another camera, or the board is not in the picture.
    """
    if not expected:
        return {}
    view.require_camera(frame)
    fit = Fit(frame, view, on_squares(expected), use_depth=use_depth)
    return {place.index: centre for place, centre in centres_of(fit).items()}


def on_squares(expected: Mapping[int, PieceSpec]) -> dict[Place, PieceSpec]:
    """The same by places."""
    return {square_place(square): piece for square, piece in expected.items()}


def centres_of(fit: Fit) -> dict[Place, Centre]:
    """What a fit says of each piece."""
    support, agreement = fit.support(), fit.agreement()
    each = (support, agreement, fit.in_sight(), fit.too_low(support, agreement))
    return {
        place: Centre(x, y, (FLOOR**2 + (_NEIGHBOURS * spread) ** 2) ** 0.5, *judged)
        for place, (x, y), spread, *judged in zip(
            fit.stands, fit.places.tolist(), fit.spread.tolist(), *(one.tolist() for one in each), strict=True
        )
    }
