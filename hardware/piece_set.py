"""The chess set: kinds, colours, sizes, masses and profiles of the pieces."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final


class Colour(StrEnum):
    """Side of a piece."""

    WHITE = "white"
    BLACK = "black"


class Kind(StrEnum):
    """Kind of a piece."""

    PAWN = "pawn"
    KNIGHT = "knight"
    BISHOP = "bishop"
    ROOK = "rook"
    QUEEN = "queen"
    KING = "king"


Look = tuple[Colour, Kind]
"""What a piece is to the eye."""


@dataclass(frozen=True, slots=True)
class PieceShape:
    """Size and weight of one kind: lengths [m], mass [kg].

    The stem is what the gripper holds; nothing above the foot is wider than it, so that the pads pass on their way
    down. ``grip_height`` is the pads' centre above the playing surface.
    """

    height: float
    foot_radius: float
    foot_height: float
    stem_radius: float
    grip_height: float
    mass: float


PIECE_SHAPES: dict[Kind, PieceShape] = {
    # a turned wooden set with a 60 mm king and felt feet; masses of beech with a small weight in the foot (assumed)
    Kind.KING: PieceShape(0.060, 0.0125, 0.008, 0.0070, 0.034, 0.032),
    Kind.QUEEN: PieceShape(0.054, 0.0120, 0.008, 0.0068, 0.032, 0.028),
    Kind.BISHOP: PieceShape(0.047, 0.0110, 0.007, 0.0062, 0.028, 0.020),
    Kind.KNIGHT: PieceShape(0.043, 0.0110, 0.007, 0.0066, 0.026, 0.020),
    Kind.ROOK: PieceShape(0.038, 0.0110, 0.007, 0.0068, 0.022, 0.020),
    Kind.PAWN: PieceShape(0.034, 0.0100, 0.006, 0.0058, 0.019, 0.012),
}

FELT_HEIGHT: Final = 0.0012
"""Of the felt under the foot [m]."""
FELT_RADIUS: Final = 0.96
"""Of the felt, in radii of the foot."""

PIECE_PROFILES: dict[Kind, tuple[tuple[float, float], ...]] = {
    Kind.PAWN: (
        (0.95, 0.05), (0.72, 0.18), (0.6, 0.36), (0.56, 0.5), (0.62, 0.535), (0.97, 0.555), (0.97, 0.585), (0.58, 0.61),
        (0.82, 0.67), (0.97, 0.75), (1.0, 0.82), (0.9, 0.91), (0.6, 0.975), (0.25, 0.998),
    ),
    Kind.ROOK: (
        (1.0, 0.05), (0.82, 0.2), (0.74, 0.45), (0.74, 0.62), (0.8, 0.66), (1.0, 0.7), (1.0, 0.76), (0.94, 0.78),
        (1.0, 1.0), (0.7, 1.0), (0.66, 0.86),
    ),
    Kind.KNIGHT: ((1.0, 0.05), (0.95, 0.1), (0.98, 0.14), (0.9, 0.18), (0.7, 0.2)),
    Kind.BISHOP: (
        (1.0, 0.04), (0.74, 0.16), (0.58, 0.34), (0.54, 0.54), (0.6, 0.57), (0.97, 0.585), (0.97, 0.615), (0.6, 0.63),
        (0.62, 0.65), (0.84, 0.71), (0.88, 0.77), (0.74, 0.86), (0.42, 0.935), (0.2, 0.95), (0.3, 0.97), (0.2, 0.995),
    ),
    Kind.QUEEN: (
        (1.0, 0.04), (0.74, 0.14), (0.6, 0.32), (0.55, 0.56), (0.62, 0.6), (1.0, 0.615), (1.0, 0.645), (0.62, 0.66),
        (0.56, 0.7), (0.7, 0.8), (1.0, 0.93), (0.78, 0.925), (0.5, 0.94), (0.2, 0.945), (0.3, 0.965), (0.2, 0.993),
    ),
    Kind.KING: (
        (1.0, 0.04), (0.76, 0.13), (0.62, 0.3), (0.56, 0.53), (0.64, 0.57), (1.0, 0.585), (1.0, 0.615), (0.64, 0.63),
        (0.58, 0.67), (0.72, 0.76), (0.97, 0.855), (0.9, 0.87), (0.5, 0.895), (0.22, 0.905), (0.16, 0.91),
    ),
}  # fmt: skip
"""What a camera sees of each kind above its foot: (radius in stem radii, height as a fraction from the foot's top to
the piece's top). The knight's ends where its head, which is not turned, begins."""


def piece_profile(kind: Kind) -> tuple[tuple[float, float], ...]:
    """Outline of a turned piece from the board up, felt and foot included: (radius, height) [m].

    Carving (battlements, a cross, a knight's head) is left out.
    """
    shape = PIECE_SHAPES[kind]
    radius, height = shape.foot_radius, shape.foot_height
    foot = (
        (FELT_RADIUS * radius, 0.0), (FELT_RADIUS * radius, FELT_HEIGHT), (0.98 * radius, FELT_HEIGHT),
        (radius, 0.25 * height), (radius, 0.45 * height), (0.95 * radius, 0.58 * height),
        (0.86 * radius, 0.66 * height), (0.84 * radius, 0.74 * height), (0.72 * radius, height),
    )  # fmt: skip
    span = shape.height - height
    body = tuple((r * shape.stem_radius, height + f * span) for r, f in PIECE_PROFILES[kind])
    return (*foot, *body, (0.0, body[-1][1]))
