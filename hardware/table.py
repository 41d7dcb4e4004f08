"""What stands on the table: board, pieces, trays, and the limits for touching people and things.

Board frame: origin at the centre of the playing surface, x along the files a→h, y along the ranks 1→8, z up [m].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, PositiveFloat, PositiveInt

_AXES = np.array([1.0, -1.0, -1.0])
"""The base frame's axes in the board frame: x = z₁, y = −z₂, z = −z₃."""


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


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """Somewhere a piece can stand: a square (0 = a1 … 63 = h8) or a numbered place of a tray.

    Trays: ``L`` beside the a-file, ``R`` beside the h-file.
    """

    zone: str
    """``"board"``, ``"L"`` or ``"R"``."""
    index: int

    @property
    def on_board(self) -> bool:
        """True for a square."""
        return self.zone == "board"

    def __str__(self) -> str:
        if self.on_board:
            return "abcdefgh"[self.index % 8] + str(self.index // 8 + 1)
        return f"{self.zone}{self.index + 1}"

    @classmethod
    def parse(cls, text: str) -> Place:
        """The place that is written so: inverse of ``str``.

        Raises:
            ValueError: no place is written so.
        """
        number = text[1:]
        if text[:1] in ("L", "R") and number.isdecimal() and not number.startswith("0"):
            return cls(text[0], int(number) - 1)
        if len(text) == 2 and text[0] in "abcdefgh" and text[1] in "12345678":
            return square_place("abcdefgh".index(text[0]) + 8 * (int(text[1]) - 1))
        raise ValueError(f"'{text}' is no place: e4, L3 and R24 are")


def square_place(square: int) -> Place:
    """The place of a square, 0 = a1 … 63 = h8."""
    if not 0 <= square < 64:
        raise ValueError(f"square {square} is not on the board: 0 (a1) to 63 (h8)")
    return Place("board", square)


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ContactLimits(_Frozen):
    """How fast the tool may move where it can meet a hand or a piece.

    Source: force measurements with the full arm against a 75 N/mm, 0.6 kg finger; ISO/TS 15066 allows 140 N
    quasi-static. Speed decides the peak: 0.45 m/s clamps with 138 N, 0.23 m/s with 70 N.
    """

    tool_speed: PositiveFloat = 0.8
    downward_speed: PositiveFloat = 0.45
    """Within ``near_height`` of the playing surface [m/s]."""
    near_height: PositiveFloat = 0.090
    holding_force: PositiveFloat = 8.0
    """Largest normal grip force [N]."""


CONTACT_PROFILES: Final[Mapping[str, ContactLimits]] = MappingProxyType({
    "default": ContactLimits(),
    "gentle": ContactLimits(tool_speed=0.4, downward_speed=0.22),
    "fast": ContactLimits(tool_speed=1.5),
})  # fmt: skip
"""By how the arm moves: ``gentle`` with children in reach (70 N), ``fast`` with nobody (263 N on a free finger)."""


class TableSettings(_Frozen):
    """Board, trays and how they stand before the robot."""

    square: PositiveFloat = 0.040
    """Side of a square [m]."""
    centre_in_base: tuple[float, float, float] = (0.0, 0.0, 0.47)
    """Centre of the playing surface in the robot's base frame [m]."""
    tray_rows: PositiveInt = 12
    tray_columns: PositiveInt = 2
    tray_row_pitch: PositiveFloat = 0.030
    """Along y; rows are across the finger axis, so feet need no room for fingers between them [m]."""
    tray_column_pitch: PositiveFloat = 0.038
    tray_gap: PositiveFloat = 0.030
    """From the playing area's edge to the centres of the first column [m]."""
    limits: ContactLimits = ContactLimits()

    @property
    def tray_size(self) -> int:
        """Number of places in one tray."""
        return self.tray_rows * self.tray_columns

    def tray_places(self) -> tuple[Place, ...]:
        """All numbered places of both trays, left one first; a column is filled before the next one outwards."""
        return tuple(Place(zone, i) for zone in ("L", "R") for i in range(self.tray_size))

    def xy(self, place: Place) -> tuple[float, float]:
        """Centre of a place in the board frame (x, y) [m].

        Raises:
            ValueError: there is no such place.
        """
        index = place.index
        if place.zone == "board":
            if not 0 <= index < 64:
                square_place(index)  # says what is wrong
            return (index % 8 - 3.5) * self.square, (index // 8 - 3.5) * self.square
        if place.zone not in ("L", "R") or not 0 <= place.index < self.tray_size:
            last = self.tray_size
            raise ValueError(f"there is no place {place}: trays are L1 to L{last} and R1 to R{last}")
        column, row = divmod(place.index, self.tray_rows)
        x = 4.0 * self.square + self.tray_gap + column * self.tray_column_pitch
        y = (row - (self.tray_rows - 1) / 2.0) * self.tray_row_pitch
        return (x if place.zone == "R" else -x), y

    def base_from_board(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 3) from the board frame into the base frame [m]: x = z₁, y = −z₂, z = −z₃."""
        base: NDArray[np.float64] = np.asarray(self.centre_in_base) + np.asarray(point) * _AXES
        return base

    def board_from_base(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 3) from the base frame into the board frame [m]."""
        board: NDArray[np.float64] = (np.asarray(point) - np.asarray(self.centre_in_base)) * _AXES
        return board


@dataclass(frozen=True, slots=True)
class PieceSpec:
    """One physical piece: a name that stays with it, its kind and colour, and where it stands at the start."""

    name: str
    kind: Kind
    colour: Colour
    place: Place
