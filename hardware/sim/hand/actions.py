"""What a simulated person can be asked to do: settings of the hand and its actions, as they go over the world's socket.

Points are in the board frame, in the plane of the board (x, y) [m]. A person sees where pieces stand, so a point need
only be near the piece that is meant.
"""

import math
from typing import Annotated, Final, Literal

from pydantic import Field, NonNegativeFloat, TypeAdapter

from hardware.frozen import FrozenFinite
from hardware.piece_set import Colour

REACH: Final = 0.36
"""Furthest point from the board's centre along x and y [m]: beyond the trays, and no further."""
LONGEST: Final = 60.0
"""Longest pause in one action [s]."""

Coordinate = Annotated[float, Field(ge=-REACH, le=REACH)]
Point = tuple[Coordinate, Coordinate]
Duration = Annotated[float, Field(ge=0.0, le=LONGEST)]


class HandSettings(FrozenFinite):
    """Whose hand it is, how quick and how careful."""

    side: Colour = Colour.WHITE
    """The player it belongs to: white sits at −y, black at +y."""
    speed: Annotated[float, Field(ge=0.1, le=2.0)] = 0.8
    """Highest speed of a long reach [m/s]. People reach over a table with 0.3 to 0.8; ISO 13855 reckons with 1.6."""
    placement_sigma: NonNegativeFloat = 0.002
    """Standard deviation of where a piece is put down, in x and y [m]."""
    placement_limit: NonNegativeFloat = 0.005
    """No piece is aimed further off than this, in x and y [m]."""
    turning: Annotated[float, Field(ge=0.0, le=0.6)] = 0.25
    """A piece is turned by up to so much while it is carried [rad]."""


class Take(FrozenFinite):
    """Grasp the piece nearest to a point and lift it."""

    do: Literal["take"] = "take"
    at: Point


class Put(FrozenFinite):
    """Put down what is held, off by a human amount."""

    do: Literal["put"] = "put"
    at: Point


class Move(FrozenFinite):
    """Take and put."""

    do: Literal["move"] = "move"
    start: Point
    to: Point


class Slide(FrozenFinite):
    """Grasp a piece and slide it over the board without lifting it; what stands in the way is pushed along."""

    do: Literal["slide"] = "slide"
    start: Point
    to: Point


class Knock(FrozenFinite):
    """Sweep against the upper part of a piece so that it falls over."""

    do: Literal["knock"] = "knock"
    at: Point
    direction: Annotated[float, Field(ge=-math.pi, le=math.pi)] = math.pi / 2.0
    """Into which it is pushed, from the x axis, counter-clockwise [rad]."""


class Hover(FrozenFinite):
    """Stay over a point in the air."""

    do: Literal["hover"] = "hover"
    at: Point
    height: Annotated[float, Field(ge=0.02, le=0.2)] = 0.09
    """Of the fingertips above the board [m]."""
    duration: Duration = 1.0


class Hesitate(FrozenFinite):
    """Reach for a point, stop short above it, draw back, and reach out again, without touching anything."""

    do: Literal["hesitate"] = "hesitate"
    at: Point
    duration: Duration = 1.0


class Rest(FrozenFinite):
    """Lay the fingertips on the board or beside it and leave them there: in the way of whoever comes."""

    do: Literal["rest"] = "rest"
    at: Point
    duration: Duration = 1.0


class Withdraw(FrozenFinite):
    """Put down what is held, where there is room, and draw the hand back to where nobody sees it."""

    do: Literal["withdraw"] = "withdraw"


Action = Take | Put | Move | Slide | Knock | Hover | Hesitate | Rest | Withdraw


class Perform(FrozenFinite):
    """A request: these actions, one after the other."""

    actions: Annotated[tuple[Annotated[Action, Field(discriminator="do")], ...], Field(min_length=1, max_length=64)]


class Query(FrozenFinite):
    """A question: what the hand is doing."""

    ask: Literal["state"]


REQUEST: Final[TypeAdapter[Perform | Query]] = TypeAdapter(Perform | Query)
