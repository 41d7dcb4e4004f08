"""Which pieces of one colour stand on the squares where that colour is seen.

Every way to give the squares to pieces that should be on the board, to pieces from elsewhere, or to none, is a
hypothesis. It costs the negative logarithm of its probability: nothing for a piece that stands where it should, and
something for one that was carried off, taken away or brought. How likely a square's kinds are counts where it is known.
The cheapest hypothesis is believed as far as none that says another kind on a square is nearly as cheap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from app.execution.repair.observed import FLUKE, Chances
from hardware.table import Colour, Kind, PieceSpec, TableSettings, square_place

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
    """Find out which piece stands on which square.

    Args:
        colour: of all of them.
        pieces: that should be on the board, each on its square.
        squares: where that colour stands.
        kinds: how likely what stands on a square is of each kind; left out: unknown.
        table: where squares are.
    """
    cost = _costs(colour, pieces, squares, kinds, table)
    rows, columns = linear_sum_assignment(cost)
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
    away = cdist(homes, there).round(6)
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
    rows, columns = linear_sum_assignment(changed)
    return float(changed[rows, columns].sum())
