"""What a person's move has set down, as it is seen: whether it stands as after that move."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import chess

from app.pieces.judging import most_off_centre
from app.pieces.manipulation import NoSpare, transfers

if TYPE_CHECKING:
    from app.execution.table import Table
    from hardware.table import TableSettings
    from vision.pieces.placement_faults import Fault


def badly_set(table: Table, moves: Sequence[chess.Move], *, said: bool) -> tuple[Fault, ...]:
    """What the newest frame shows to be wrong with the pieces that one of these moves would have set down.

    A piece that was knocked over and lies on another square looks like a move; with depth it does not stand. One that
    was left half way to the next square often looks like one, too: unless they ``said`` that it is theirs.

    Args:
        table: as it stood before the move; where nobody looks at it, nothing is seen to be wrong.
        moves: what may have been played, the likeliest first: of a promotion perhaps one with each piece. The one
            that fits best counts.
        said: whether somebody has said that it was that.

    Raises:
        NoSpare: the pawn can have become none of these pieces, as none of them is left beside the board.
        HardwareError: the camera failed.
    """
    if table.observer is None:
        return ()
    settings, inventory = table.inventory.table, table.inventory
    beyond = math.inf if said else most_off_centre(settings)
    best: tuple[Fault, ...] | None = None
    spent: NoSpare | None = None
    for move in moves:
        try:
            ply = transfers(table.board, move, inventory)
        except NoSpare as none:
            spent = spent or none
            continue
        squares = {one.target.index for one in ply.transfers if one.target.on_board}
        seen = table.observer.faults(inventory.after(ply), beyond=beyond, exchanges=False)
        faults = tuple(fault for fault in seen if fault.square in squares)
        if best is None or _astray(faults, settings) < _astray(best, settings):
            best = faults
        if not faults:
            break
    if best is None:
        assert spent is not None, "there is a move at least"
        raise spent
    return best


def _astray(faults: Sequence[Fault], settings: TableSettings) -> float:
    """How far off its place the piece is that is farthest off [m]; infinite where something else is wrong."""
    return max((fault.astray(settings) for fault in faults), default=0.0)


def shows_after(table: Table, move: chess.Move) -> bool:
    """Whether depth shows every piece of the board where it stands after a move, however little squares tell."""
    if table.observer is None or not table.observer.deep:
        return False
    after = table.inventory.after(transfers(table.board, move, table.inventory))
    found = table.observer.whereabouts(after)
    if found is None or found.missing or found.lying:
        return False
    beside = {name for name, at in found.standing.items() if max(map(abs, at)) > 4.0 * after.table.square}
    return all(name in beside and after.find(name).place.in_tray for name in found.moved)
