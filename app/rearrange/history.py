"""Taking moves back: every piece returns to where it stood, also those that were captured or promoted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import chess

from app import UserError
from app.manipulation import Inventory, Transfer
from app.rearrange.order import NOWHERE_ELSE, Point, rearrange


class NothingToTakeBack(UserError):
    """So many moves have not been played."""

    def __init__(self, plies: int, played: int) -> None:
        super().__init__(
            f"{plies} move{'s' * (plies != 1)} cannot be taken back: "
            + (f"{played} ha{'ve' if played != 1 else 's'} been played" if played else "none has been played")
        )


@dataclass(frozen=True, slots=True)
class TakeBack:
    """What taking moves back comes to.

    Attributes:
        transfers: in order of execution.
        board: the position then, with its own history.
        inventory: what stands where then.
    """

    transfers: tuple[Transfer, ...]
    board: chess.Board
    inventory: Inventory


def take_back(
    board: chess.Board,
    history: Sequence[Inventory],
    plies: int = 1,
    *,
    seen: Mapping[str, Point] = NOWHERE_ELSE,
) -> TakeBack:
    """Plan how the last moves are taken back, all at once.

    Args:
        board: the position now, with its moves; it is not changed.
        history: what stood where before each of its last moves, oldest first, and what stands where now.
        plies: how many moves, of both sides.
        seen: see :func:`rearrange`.

    Raises:
        NothingToTakeBack: fewer moves are known.
        PieceBoxed: a piece that was captured, or a pawn that was promoted, was dropped into a box.
        InventoryError: inventories and positions do not agree.
        ValueError: less than one move.
    """
    if plies < 1:
        raise ValueError(f"{plies} moves cannot be taken back: take back 1 or more")
    known = min(len(board.move_stack), len(history) - 1)
    if plies > known:
        raise NothingToTakeBack(plies, known)
    now, before, earlier = history[-1], history[-1 - plies], board.copy()
    for _ in range(plies):
        earlier.pop()
    now.check_against(board)
    before.check_against(earlier)
    return TakeBack(rearrange(now, before, seen=seen), earlier, before)
