"""What a simulated person does at the board for a move of chess; pure functions.

The order is that of :mod:`app.pieces.manipulation`: a captured piece first, then a promoted pawn and its spare; in
castling the king first. The hand is told points, near which it takes what it sees there.
"""

from __future__ import annotations

from collections.abc import Iterable

from app import UserError
from app.pieces.inventory import Transfer
from hardware.sim.hand.actions import Move
from hardware.table import TableSettings


class HandDropsNothing(UserError):
    """The simulated hand sets pieces down where they stand; into a box they would have to fall."""

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(
            f"the simulated hand cannot drop the {transfer.colour} {transfer.kind} from {transfer.source} into a box: "
            'play against it with captured = "tray"'
        )


def hand_transfers(moved: Iterable[Transfer], table: TableSettings) -> tuple[Move, ...]:
    """Any transfers, also such as no rule allows, one after the other; the hand is not drawn back.

    Args:
        moved: in their order.
        table: board and trays.

    Raises:
        ValueError: the table has no such place.
        HandDropsNothing: a piece would have to go into a box.
    """
    actions = []
    for transfer in moved:
        if transfer.target.in_box:
            raise HandDropsNothing(transfer)
        actions.append(Move(start=transfer.grasped_at(table), to=table.xy(transfer.target)))
    return tuple(actions)
