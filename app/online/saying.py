"""What is to be said to the server, and is said again until it is known to have come."""

from __future__ import annotations

from dataclasses import dataclass

import chess

from app.players.remote import Offer


@dataclass(frozen=True, slots=True)
class Saying:
    """Something to be said.

    Attributes:
        what: as in the path of the request.
        ply: of a move, from 0; None: it is none.
        move: that move.
        answers: the offer of the opponent that this answers, for as long as it stands: said twice, a "yes" would be an
            offer of our own.
    """

    what: str
    ply: int | None = None
    move: chess.Move | None = None
    answers: Offer | None = None
