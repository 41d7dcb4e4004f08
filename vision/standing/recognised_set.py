"""What stands on a table by what is seen alone. Apart from ``recognise``, for whoever only talks about it."""

from __future__ import annotations

from dataclasses import dataclass

from hardware.table import Look, Place


@dataclass(frozen=True, slots=True)
class RecognisedPiece:
    """A piece that stands.

    Attributes:
        place: nearest to it.
        at: where it stands, board frame [m].
        look: which it is.
        instead: what else it may be; None: that is out of the question.
    """

    place: Place
    at: tuple[float, float]
    look: Look
    instead: Look | None = None


@dataclass(frozen=True, slots=True)
class RecognisedSet:
    """What stands on the table.

    Attributes:
        pieces: on the board and in the trays, one on each place.
        lying: places where something is that does not stand, or is no piece, or more than one thing is.
        between: squares whose piece may be meant for another one.
        uncertain: squares that look empty, where a piece may stand all the same, behind another one.
        free: places of the trays where nothing is. Of the other ones nobody knows.
    """

    pieces: tuple[RecognisedPiece, ...]
    lying: frozenset[Place]
    between: frozenset[Place]
    uncertain: frozenset[Place]
    free: frozenset[Place]
