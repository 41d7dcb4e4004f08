"""What speaks against a kind: how high a piece looks, and how broad its top is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from hardware.table import Kind
from vision.standing.sightings import Sighting

TOPS: Final[Mapping[Kind, float]] = MappingProxyType({
    Kind.PAWN: 0.0355, Kind.ROOK: 0.0398, Kind.KNIGHT: 0.0420, Kind.BISHOP: 0.0464, Kind.QUEEN: 0.0537,
    Kind.KING: 0.0578,
})  # fmt: skip
"""How high the kinds of our set look to a D435 from above [m]: thin points are lost, broad ones bleed (measured over
600 pieces in 24 lights)."""
SPREADS: Final[Mapping[Kind, float]] = MappingProxyType({
    Kind.PAWN: 0.0009, Kind.ROOK: 0.0008, Kind.KNIGHT: 0.0012, Kind.BISHOP: 0.0010, Kind.QUEEN: 0.0010,
    Kind.KING: 0.0010,
})  # fmt: skip
"""Standard deviations of heights of one kind in one picture [m] (measured over 900 pieces in 40 lights: 0.6 to 0.8, but
1.04 for knights, whose heads look in all directions; and 0.2 more)."""
_FLUKE: Final = 6.0  # heights further off count no more; standard deviations
_BREADTHS: Final[Mapping[Kind, float]] = MappingProxyType({
    Kind.PAWN: 0.00245, Kind.ROOK: 0.00415, Kind.KNIGHT: 0.0017, Kind.BISHOP: 0.0018, Kind.QUEEN: 0.0035,
    Kind.KING: 0.0023,
})  # fmt: skip
"""How broad tops look, see ``Sighting.breadth`` [m] (measured over 935 pieces in 12 lights)."""
_BREADTH_SPREAD: Final = 0.0006  # … and their standard deviation [m]: 0.45 measured, and what another camera may add
_BREADTH_FLUKE: Final = 3.5  # breadths further off count no more; standard deviations


def kind_cost(kind: Kind, one: Sighting, top: float) -> float:
    """What it costs that a piece which is seen is of a kind: how unlikely that is, as a logarithm, least for the kind
    that it looks like; ``top`` is how high the kind looks in this picture [m].
    """
    spread = SPREADS[kind]
    off = min(abs(one.height - top) / spread, _FLUKE)
    return 0.5 * off**2 + _by_breadth(kind, one) + math.log(spread / SPREADS[Kind.ROOK])


def _by_breadth(kind: Kind, one: Sighting) -> float:
    off = abs(one.breadth - _BREADTHS[kind]) / _BREADTH_SPREAD
    return 0.0 if math.isnan(off) else 0.5 * min(off, _BREADTH_FLUKE) ** 2
