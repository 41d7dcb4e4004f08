"""What stands on a table by what is seen alone. Apart from ``recognise``, for whoever only talks about it."""

from __future__ import annotations

from dataclasses import dataclass

from hardware.piece_set import Look
from hardware.table import Place


@dataclass(frozen=True, slots=True)
class RecognisedPiece:
    """A piece that stands."""

    place: Place  # nearest to it
    at: tuple[float, float]  # where it stands, board frame [m]
    look: Look  # which it is
    instead: Look | None = None  # what else it may be; None: that is out of the question


@dataclass(frozen=True, slots=True)
class RecognisedSet:
    """What stands on the table."""

    pieces: tuple[RecognisedPiece, ...]  # on the board and in the trays, one on each place
    lying: frozenset[Place]  # places where something is that does not stand, or is no piece, or more than one thing is
    between: frozenset[Place]  # squares whose piece may be meant for another one
    uncertain: frozenset[Place]  # squares that look empty, where a piece may stand all the same, behind another one
    free: frozenset[Place]  # places of the trays where nothing is. Of the other ones nobody knows.
