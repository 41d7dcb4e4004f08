"""Which pieces of one colour stand on the squares where that colour is seen.

Every way to give the squares to pieces that should be on the board, to pieces from elsewhere, or to none, is a
hypothesis. It costs the negative logarithm of its probability: nothing for a piece that stands where it should, and
something for one that was carried off, taken away or brought. How likely a square's kinds are counts where it is known.
The cheapest hypothesis is believed as far as none that says another kind on a square is nearly as cheap.

Two moves can look like one piece carried off, where the first one's square is taken again by the second: a pawn goes
from e2 to e4, then the queen from d1 to e2: d1 is empty, and something white stands on e4, as if the queen had been
carried there. Colours alone do not tell.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import chess
import numpy as np
from numpy.typing import NDArray

from app.execution.repair.observed import FLUKE, Chances
from app.pieces.layout import kind_of
from hardware.piece_set import Colour, Kind
from hardware.table import PieceSpec, TableSettings, square_place
from vision.arrays import cheapest_pairs

Array = NDArray[np.float64]

_CARRIED: Final = 3.0
"""Of a piece on another square: one in twenty, as something is known to be wrong."""
_FARTHER: Final = 0.5
"""Of each metre it was carried: of two alike pieces, each went to the nearer square [1/m]."""
_GONE: Final = 3.0
"""Of a piece that is no longer on the board."""
_BROUGHT: Final = 4.5
"""Of a piece that should not be on the board."""
SURE: Final = 2.9
"""What is believed is so much likelier than anything else, as a logarithm: 18 times. One more carried piece costs
more, so that by colours alone the simplest explanation is believed."""
_EXCHANGED: Final = 0.5
"""Of a piece on the last rank: a pawn that was carried there is exchanged by most people, allowed or not."""
_NEVER: Final = 1e6
_PROMOTED: Final = (Kind.QUEEN, Kind.ROOK, Kind.BISHOP, Kind.KNIGHT)


@dataclass(frozen=True, slots=True)
class Belief:
    """What stands where, of one colour.

    Attributes:
        standing: square of each piece that is on the board, by name.
        gone: pieces that are not.
        extra: squares with pieces that should not be on the board.
        doubtful: squares of which it is not clear what kind stands there.
    """

    standing: Mapping[str, int]
    gone: tuple[PieceSpec, ...]
    extra: tuple[int, ...]
    doubtful: tuple[int, ...]


def believe(
    colour: Colour, pieces: Sequence[PieceSpec], squares: Sequence[int], kinds: Mapping[int, Chances],
    table: TableSettings,
) -> Belief:  # fmt: skip
    """Find out which piece of a colour stands on which of the squares where that colour is seen.

    ``pieces`` should be on the board, each on its square; ``kinds`` says how likely what stands on a square is of each
    kind; left out: unknown.
    """
    cost = _costs(colour, pieces, squares, kinds, table)
    rows, columns = cheapest_pairs(cost)
    cheapest = float(cost[rows, columns].sum())
    on = {int(column): int(row) for row, column in zip(rows, columns, strict=True) if column < len(squares)}
    standing = {pieces[row].name: squares[column] for column, row in on.items() if row < len(pieces)}
    others = [_cheapest_other(cost, pieces, column, row) - cheapest for column, row in sorted(on.items())]
    return Belief(
        standing,
        tuple(piece for piece in pieces if piece.name not in standing),
        tuple(squares[column] for column, row in sorted(on.items()) if row >= len(pieces)),
        tuple(square for square, margin in zip(squares, others, strict=True) if margin < SURE),
    )


def _costs(
    colour: Colour, pieces: Sequence[PieceSpec], squares: Sequence[int], kinds: Mapping[int, Chances],
    table: TableSettings,
) -> Array:  # fmt: skip
    """Rows: the pieces, then one from elsewhere for each square. Columns: the squares, then "gone" for each piece."""
    number, seen = len(pieces), len(squares)
    cost = np.zeros((number + seen, seen + number))
    cost[:number, seen:] = _GONE
    if not seen:
        return cost
    last_rank = 7 if colour is Colour.WHITE else 0
    for j, square in enumerate(squares):
        promoting = square // 8 == last_rank
        chances = [_chance(kinds.get(square), kind) for kind in (_PROMOTED if promoting else Kind)]
        cost[number:, j] = (_EXCHANGED if promoting else _BROUGHT) - np.log(np.mean(chances))
    if not number:
        return cost
    homes = np.array([table.xy(piece.place) for piece in pieces])
    there = np.array([table.xy(square_place(square)) for square in squares])
    away = np.linalg.norm(homes[:, None] - there, axis=2).round(6)
    cost[:number, :seen] = np.where(away > 0.0, _CARRIED + _FARTHER * away, 0.0)
    cost[:number, :seen] -= np.log([[_chance(kinds.get(square), p.kind) for square in squares] for p in pieces])
    return cost


def _chance(chances: Chances | None, kind: Kind) -> float:
    return 1.0 / len(Kind) if chances is None else max(chances.get(kind, 0.0), FLUKE)


def _cheapest_other(cost: Array, pieces: Sequence[PieceSpec], column: int, row: int) -> float:
    """What it costs if something else stands on a square than what a row stands for."""
    alike = [i for i, piece in enumerate(pieces) if row < len(pieces) and piece.kind is pieces[row].kind]
    changed = cost.copy()
    changed[alike or slice(len(pieces), None), column] = _NEVER
    rows, columns = cheapest_pairs(changed)
    return float(changed[rows, columns].sum())


def doubted(
    board: chess.Board, looks: Mapping[int, Colour | None], believed: Mapping[int, Kind], kinds: Mapping[int, Chances]
) -> frozenset[int]:
    """Squares on which other kinds than believed may stand, since two moves in a row would look the same.

    ``board`` should be there, and is not changed; ``looks`` has the colour of what stands on each of the 64 squares,
    ``believed`` the kind; ``kinds`` is as of `believe`.
    """
    white, black = (sum(1 << square for square, look in looks.items() if look is colour) for colour in Colour)
    squares = set[int]()
    for after in _after_two(board, white, black):
        placed = {square: kind_of(piece) for square, piece in after.items()}
        other = {square for square, kind in believed.items() if placed[square] is not kind}
        margin = math.fsum(
            math.log(_likely(kinds, square, believed[square])) - math.log(_likely(kinds, square, placed[square]))
            for square in other
        )
        if margin < SURE:
            squares |= other
    return frozenset(squares)


def _likely(kinds: Mapping[int, Chances], square: int, kind: Kind) -> float:
    return max(kinds[square].get(kind, 0.0), FLUKE) if square in kinds else 1.0 / len(Kind)


def _after_two(board: chess.Board, white: int, black: int) -> Iterator[Mapping[int, chess.Piece]]:
    """Positions after two legal moves, by both sides or by the one to move, in which each side has these squares."""
    now = board.copy(stack=False)
    for first in list(now.legal_moves):
        now.push(first)
        for own in (False, True):
            after = now if not own else _passed(now)
            mine = white if after.turn else black
            for second in after.generate_legal_moves(~mine, mine | after.occupied_co[after.turn]):
                if not (mine >> second.to_square & 1 or after.is_castling(second)):
                    continue
                after.push(second)
                if after.occupied_co[chess.WHITE] == white and after.occupied_co[chess.BLACK] == black:
                    yield after.piece_map()
                after.pop()
        now.pop()


def _passed(board: chess.Board) -> chess.Board:
    """The same position with the other side to move."""
    passed = board.copy(stack=False)
    passed.turn, passed.ep_square = not board.turn, None
    return passed
