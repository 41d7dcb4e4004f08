"""Whether another piece of the same side stands where one stood: what colours cannot tell.

A hand puts a piece down some millimetres from where the one before it stood, and another kind has another outline. So
two pictures are compared, one of before and one of now, in which the same pieces are expected but for one that is gone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import chess

from hardware.interfaces import Frame
from hardware.table import PieceSpec
from vision.board.view import BoardView
from vision.pieces.centres import piece_centres
from vision.reading.diagnosis import Diagnosis, States, explain
from vision.reading.outcome import Situation

SHIFTED: Final = 0.0017
"""A piece that nobody has touched is seen no further than this from where it was, with its neighbours' light [m]."""
UNLIKE: Final = 0.30  # … and looks no more than this less like itself (both: see ``replaced``)


class KnownPicture(NamedTuple):
    """A picture, and where the board is in it."""

    frame: Frame
    view: BoardView


def looked_closer(
    finding: Diagnosis, seen: States, board: chess.Board, before: KnownPicture, now: KnownPicture,
    expected: Mapping[int, PieceSpec],
) -> Diagnosis:  # fmt: skip
    """Where all that is known is that one piece is missing: it may stand in the place of one of its own side.

    ``finding`` was found without that, from the states of squares as they are seen, (64,). The pictures ``before`` and
    ``now`` show the last known position and what is seen; ``expected`` are its pieces by square.
    """
    if finding.situation is not Situation.MISSING or len(finding.squares) != 1:
        return finding
    squares = replaced(before, now, expected, finding.squares[0])
    return explain(seen, board, squares) if squares else finding


def replaced(before: KnownPicture, now: KnownPicture, expected: Mapping[int, PieceSpec], gone: int) -> tuple[int, ...]:
    """Squares on which another piece of the gone one's side may stand, the likeliest first; pieces were expected by
    square.

    Measured over rendered positions, 979 looks at pieces that nobody had touched: of a thousand one shifts by 1.5 mm or
    more, none loses 0.25; of 36 that were put in another's place all but one shifted by 1.8 mm or more.

    Raises:
        ValueError: a frame is by another camera than its view.
    """
    was = piece_centres(before.frame, before.view, expected)
    here = piece_centres(now.frame, now.view, {square: piece for square, piece in expected.items() if square != gone})
    change = dict[int, float]()
    for square, one in here.items():
        first = was[square]
        if expected[square].colour is not expected[gone].colour or one.hidden or first.hidden or not first.upright:
            continue
        shift = math.dist((one.x, one.y), (first.x, first.y)) / SHIFTED
        loss = (first.support + first.agreement - one.support - one.agreement) / UNLIKE
        change[square] = max(shift, loss)
    return tuple(sorted((square for square, much in change.items() if much > 1.0), key=lambda square: -change[square]))
