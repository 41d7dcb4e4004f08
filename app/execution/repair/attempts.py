"""How often the arm has tried to put the board right, and when more of the same does not help."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from app import UserError
from app.execution.repair.diagnosis import Ask
from app.execution.repair.observed import sentence_of
from app.pieces.inventory import Transfer
from app.pieces.order import Point
from hardware.table import TableSettings, square_place
from vision.pieces.placement_faults import Fault, FaultKind

MOST_ROUNDS: Final = 40
"""Of the arm, two or three for a piece that has fallen, and some more for each that is in its way; what is
not right then, it will not get right."""
_ALIKE: Final = 0.002
"""A piece that was set down twice stands as it did, to within this [m]: looks err by 0.4 mm, the arm by less."""


class Attempts:
    """Of one recovery.

    Attributes:
        rounds: of the arm.
    """

    def __init__(self) -> None:
        self.rounds = 0
        self._set_down = set[int]()
        """Squares on whose middles the arm has set pieces down since the last look …"""
        self._off = dict[int, Point]()
        """… and how far off these stood [m], when it was looked at."""

    def one_more(self, faults: Sequence[Fault]) -> None:
        """Raises ``UserError`` where it was tried too often."""
        if self.rounds >= MOST_ROUNDS:
            raise UserError(
                f"the board is still not right after {MOST_ROUNDS} attempts ({sentence_of(faults)}): put it right by "
                "hand, then continue with 'touchmove resume'"
            )
        self.rounds += 1

    def set_down(self, transfers: Iterable[Transfer]) -> None:
        """The arm has."""
        self._set_down |= {transfer.target.index for transfer in transfers if transfer.target.on_board}

    def in_vain(self, faults: Sequence[Fault], table: TableSettings) -> Ask | None:
        """What to ask, in a look, where the arm has set a piece down in the middle of its square twice, and it stands
        off it as before: not the piece is wrong, but where board and arm are believed to be.
        """
        set_down, self._set_down = self._set_down, set()
        for fault in faults:
            if fault.kind is not FaultKind.OFF_CENTRE or fault.place is None or fault.square not in set_down:
                continue
            x, y = table.xy(square_place(fault.square))
            off, before = (fault.place[0] - x, fault.place[1] - y), self._off.get(fault.square)
            self._off[fault.square] = off
            if before is not None and math.dist(off, before) <= _ALIKE:
                return Ask(
                    f"{fault.sentence}, each time that the arm sets it down: the board does not lie where the arm "
                    "believes it, and 'touchmove calibrate' finds out where it does; set the piece right on "
                    f"{square_place(fault.square)}",
                    (fault.square,),
                )
        return None
