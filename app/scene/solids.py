"""Round bars and blocks: the shapes that all of the robot and its table is drawn with."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from hardware.interfaces import Triple


class Finish(StrEnum):
    """What a surface looks like; whoever draws chooses the colours."""

    METAL = "metal"
    ALUMINIUM = "aluminium"
    CARBON = "carbon"
    PLASTIC = "plastic"
    PAD = "pad"
    WOOD = "wood"
    LIGHT_SQUARE = "light square"
    DARK_SQUARE = "dark square"
    WHITE_PIECE = "white piece"
    BLACK_PIECE = "black piece"


@dataclass(frozen=True, slots=True)
class RoundBar:
    """A cylinder, or a cone's frustum, with flat ends."""

    start: Triple
    """The middle of one end [m]."""
    end: Triple
    """The middle of the other [m]."""
    radius: float
    """At the start [m]."""
    finish: Finish
    """Of its surface."""
    end_radius: float | None = None
    """At the end [m]; None: the same."""


@dataclass(frozen=True, slots=True)
class Cuboid:
    """A block along the axes of the frame it is given in."""

    centre: Triple
    """Of it [m]."""
    size: Triple
    """Its whole extent along x, y and z [m]."""
    finish: Finish
    """Of its surface."""


Solid = RoundBar | Cuboid
