"""What stands on the table: board, pieces, trays, and the limits for touching people and things.

Board frame: origin at the centre of the playing surface, x along the files a→h, y along the ranks 1→8, z up [m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from hardware.contact_speeds import ContactSpeeds
from hardware.frozen import FrozenFinite
from hardware.piece_set import Colour, Kind

_AXES = np.array([1.0, -1.0, -1.0])
"""The base frame's axes in the board frame: x = z₁, y = −z₂, z = −z₃."""
MOST_YAW: Final = 0.04
"""A board may be turned by so much [rad]: fingers do not turn with it, and neighbours come 1.6 mm nearer to them."""


class Captured(StrEnum):
    """Where captured pieces and promoted pawns go."""

    TRAY = "tray"
    """To numbered places, from which they can serve as spares."""
    BOX = "box"
    """Dropped into a plain box at either side, as in the paper; they stay there."""


TRAY_ZONES: Final = ("L", "R")
BOX_ZONES: Final = ("BL", "BR")


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """Somewhere a piece can be: a square (0 = a1 … 63 = h8), a numbered place of a tray, or a drop into a box.

    Trays: ``L`` beside the a-file, ``R`` beside the h-file. Boxes: ``BL`` and ``BR`` likewise; their numbers count what
    was dropped, since who lies in a box lies anywhere in it.
    """

    zone: str
    """``"board"``, ``"L"``, ``"R"``, ``"BL"`` or ``"BR"``."""
    index: int

    @property
    def on_board(self) -> bool:
        """True for a square."""
        return self.zone == "board"

    @property
    def in_tray(self) -> bool:
        """True for a numbered place of a tray."""
        return self.zone in TRAY_ZONES

    @property
    def in_box(self) -> bool:
        """True for a box: nothing is ever taken from there."""
        return self.zone in BOX_ZONES

    def __str__(self) -> str:
        if self.on_board:
            return "abcdefgh"[self.index % 8] + str(self.index // 8 + 1)
        return f"{self.zone}{self.index + 1}"

    @classmethod
    def parse(cls, text: str) -> Place:
        """The place that is written so: inverse of ``str``; raises ``ValueError`` if no place is written so."""
        zone = text[:2] if text[:2] in BOX_ZONES else text[:1]
        number = text[len(zone) :]
        if zone in (*TRAY_ZONES, *BOX_ZONES) and number.isdecimal() and not number.startswith("0"):
            return cls(zone, int(number) - 1)
        if len(text) == 2 and text[0] in "abcdefgh" and text[1] in "12345678":
            return square_place("abcdefgh".index(text[0]) + 8 * (int(text[1]) - 1))
        raise ValueError(f"'{text}' is not a place; places are e4, L3, R24 or BL7")


def square_place(square: int) -> Place:
    """The place of a square, 0 = a1 … 63 = h8."""
    if not 0 <= square < 64:
        raise ValueError(f"square {square} is not on the board: 0 (a1) to 63 (h8)")
    return Place("board", square)


class Box(NamedTuple):
    """An open box on the table: the middle of its inside, half its inside along x and y, board frame; its walls [m]."""

    zone: str
    x: float
    y: float
    half_x: float
    half_y: float
    height: float
    wall: float  # how thick they are

    def holds(self, x: float, y: float) -> bool:
        """Whether a point lies within the walls [m]."""
        return abs(x - self.x) <= self.half_x and abs(y - self.y) <= self.half_y


class TableSettings(FrozenFinite):
    """Board, trays, boxes and how they stand before the robot."""

    square: PositiveFloat = 0.040
    """Side of a square [m]."""
    centre_in_base: tuple[float, float, float] = (0.0, 0.0, 0.47)
    """Centre of the playing surface in the robot's base frame [m]."""
    yaw_in_base: Annotated[float, Field(ge=-MOST_YAW, le=MOST_YAW)] = 0.0
    """Turn of the board about its own z axis, against one that lies along the base's axes [rad]."""
    tray_rows: PositiveInt = 12
    tray_columns: PositiveInt = 2
    """With boxes, each takes the place of the outermost column of its tray."""
    tray_row_pitch: PositiveFloat = 0.030
    """Along y; rows are across the finger axis, so feet need no room for fingers between them [m]."""
    tray_column_pitch: PositiveFloat = 0.038
    tray_gap: PositiveFloat = 0.030
    """From the playing area's edge to the centres of the first column [m]."""
    captured: Captured = Captured.TRAY
    box_points: PositiveInt = 8
    """Pieces are dropped over so many points in a row along y, one after the other; then over those between them."""
    box_rounds: PositiveInt = 3
    """So often that happens: points times rounds is what a box holds. Both hold 48, as two trays do."""
    box_pitch: PositiveFloat = 0.037
    """Between two points, and from the last one to the end of the box [m]."""
    box_width: PositiveFloat = 0.056
    """Inside, along x: a queen can lie across [m]."""
    box_height: PositiveFloat = 0.060
    """Of its walls [m]."""
    box_fill: PositiveFloat = 0.075
    """Nothing in it reaches higher, be it a piece that leans on others: the arm stays above [m]."""
    box_wall: PositiveFloat = 0.003
    box_gap: PositiveFloat = 0.026
    """From the centres of the column beside it to its wall: open fingers, and a piece 3 mm off, fit between [m]."""
    limits: ContactSpeeds = ContactSpeeds()

    @model_validator(mode="after")
    def _boxes_leave_trays(self) -> Self:
        if self.captured is Captured.BOX and self.tray_columns < 2:
            raise ValueError("boxes take the place of a column, and spares need one: make tray_columns 2 or more")
        return self

    @property
    def tray_size(self) -> int:
        """Number of places in one tray."""
        return self.tray_rows * self._columns

    @property
    def _columns(self) -> int:
        return self.tray_columns - (self.captured is Captured.BOX)

    @property
    def half_width(self) -> float:
        """Of all that belongs to the table, along x from the board's centre to the edge [m]."""
        if boxes := self.boxes():
            return boxes[-1].x + boxes[-1].half_x + self.box_wall
        return self._column_x(self.tray_columns - 1) + 0.028

    @property
    def half_play(self) -> tuple[float, float]:
        """Of what a game is played on, along x and y from the board's centre: to the board's edge or the middle of the
        trays' outermost places, whichever is farther [m].
        """
        board = 4.0 * self.square
        return self._column_x(self.tray_columns - 1), max(board, 0.5 * (self.tray_rows - 1) * self.tray_row_pitch)

    def _column_x(self, column: int) -> float:
        return 4.0 * self.square + self.tray_gap + column * self.tray_column_pitch

    def boxes(self) -> tuple[Box, ...]:
        """The boxes for captured pieces, left one first; none where trays take those."""
        if self.captured is Captured.TRAY:
            return ()
        half_x, half_y = self.box_width / 2.0, (self.box_points + 1) * self.box_pitch / 2.0
        x = self._column_x(self._columns - 1) + self.box_gap + self.box_wall + half_x
        return tuple(
            Box(zone, side * x, 0.0, half_x, half_y, self.box_height, self.box_wall)
            for zone, side in zip(BOX_ZONES, (-1.0, 1.0), strict=True)
        )

    def box_of(self, place: Place) -> Box:
        """The box that a place belongs to; raises ``ValueError`` if it belongs to none."""
        self.xy(place)
        for box in self.boxes():
            if box.zone == place.zone:
                return box
        raise ValueError(f"{place} is not in a box")

    def box_places(self) -> tuple[Place, ...]:
        """What the boxes hold, in the order in which they are filled: all points of both before any again."""
        if self.captured is Captured.TRAY:
            return ()
        return tuple(
            Place(zone, turn * self.box_points + point)
            for turn in range(self.box_rounds)
            for zone in BOX_ZONES
            for point in range(self.box_points)
        )

    def box_round(self, place: Place) -> int:
        """How many rounds of drops come before the one that a place of a box belongs to."""
        return place.index // self.box_points

    def drop_points(self) -> tuple[Place, ...]:
        """One place for each point over which pieces are dropped; from the third round on they repeat."""
        return tuple(place for place in self.box_places() if self.box_round(place) < 2)

    def tray_places(self) -> tuple[Place, ...]:
        """All numbered places of both trays, left one first; a column is filled before the next one outwards."""
        return tuple(Place(zone, i) for zone in ("L", "R") for i in range(self.tray_size))

    def xy(self, place: Place) -> tuple[float, float]:
        """Centre of a place in the board frame (x, y) [m]; raises ``ValueError`` if there is no such place."""
        index = place.index
        if place.zone == "board":
            if not 0 <= index < 64:
                square_place(index)  # says what is wrong
            return (index % 8 - 3.5) * self.square, (index // 8 - 3.5) * self.square
        for box in self.boxes():
            if place.zone == box.zone and 0 <= index < self.box_points * self.box_rounds:
                # every second round between the pieces of the one before, many of which stand where they fell
                point = index % self.box_points + (0.25 if self.box_round(place) % 2 else -0.25)
                return box.x, (point - (self.box_points - 1) / 2.0) * self.box_pitch
        if place.zone not in TRAY_ZONES or not 0 <= index < self.tray_size:
            raise ValueError(f"there is no place {place}: {self._beside_the_board()}")
        column, row = divmod(index, self.tray_rows)
        x, y = self._column_x(column), (row - (self.tray_rows - 1) / 2.0) * self.tray_row_pitch
        return (x if place.zone == "R" else -x), y

    def _beside_the_board(self) -> str:
        last = self.tray_size
        trays = f"trays are L1 to L{last} and R1 to R{last}"
        if self.captured is Captured.TRAY:
            return trays
        last = self.box_points * self.box_rounds
        return f"{trays}, boxes BL1 to BL{last} and BR1 to BR{last}"

    def base_from_board(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 3) from the board frame into the base frame [m]; not turned: x = z₁, y = −z₂, z = −z₃."""
        turned = np.asarray(point) if self.yaw_in_base == 0.0 else np.asarray(point) @ _about_z(self.yaw_in_base).T
        base: NDArray[np.float64] = np.asarray(self.centre_in_base) + turned * _AXES
        return base

    def board_from_base(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map points (..., 3) from the base frame into the board frame [m]."""
        board: NDArray[np.float64] = (np.asarray(point) - np.asarray(self.centre_in_base)) * _AXES
        return board if self.yaw_in_base == 0.0 else board @ _about_z(self.yaw_in_base)

    def pose_in_base(self) -> NDArray[np.float64]:
        """Takes points of the board frame into the base frame, shape (4, 4)."""
        pose = np.eye(4)
        pose[:3, :3] = _AXES[:, None] * _about_z(self.yaw_in_base)
        pose[:3, 3] = self.centre_in_base
        return pose


def _about_z(angle: float) -> NDArray[np.float64]:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class PieceSpec:
    """One physical piece: a name that stays with it, its kind and colour, and where it stands at the start."""

    name: str
    kind: Kind
    colour: Colour
    place: Place
