"""What a simulated person does at the board for a move of chess; pure functions.

The order is that of :mod:`app.pieces.manipulation`: a captured piece first, then a promoted pawn and its spare; in
castling the king first. The hand is told points, near which it takes what it sees there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final

from app import UserError
from app.pieces.manipulation import Transfer
from hardware.sim.hand.actions import Move
from hardware.table import Place, TableSettings


class HandDropsNothing(UserError):
    """The simulated hand sets pieces down where they stand; into a box they would have to fall."""

    def __init__(self, transfer: Transfer) -> None:
        super().__init__(
            f"the simulated hand cannot drop the {transfer.colour} {transfer.kind} from {transfer.source} into a box: "
            'play against it with captured = "tray"'
        )


NOWHERE_ELSE: Final[Mapping[Place, tuple[float, float]]] = MappingProxyType({})


def hand_transfers(
    moved: Iterable[Transfer], table: TableSettings, seen: Mapping[Place, tuple[float, float]] = NOWHERE_ELSE
) -> tuple[Move, ...]:
    """Any transfers, also such as no rule allows, one after the other; the hand is not drawn back.

    Args:
        moved: in their order.
        table: board and trays.
        seen: see :func:`hand_move`; holds until the first transfer to such a place.

    Raises:
        ValueError: the table has no such place.
        HandDropsNothing: a piece would have to go into a box.
    """
    where, actions = dict(seen), []
    for transfer in moved:
        if transfer.target.in_box:
            raise HandDropsNothing(transfer)
        start = where.pop(transfer.source, transfer.grasped_at(table))
        where.pop(transfer.target, None)
        actions.append(Move(start=start, to=table.xy(transfer.target)))
    return tuple(actions)
