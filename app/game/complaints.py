"""What is wrong on the board in a person's turn, said to them and recorded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import chess

from app.execution.table import Table
from app.terminal.game_display import UserInterface

if TYPE_CHECKING:
    from vision.pieces.placement_faults import Fault
    from vision.reading.diagnosis import Diagnosis

FORBEARANCE: Final = 2.0
"""So long after a hand has gone nobody complains of what it left, or asks: it may come again, as for the rook of a
castling or for a queen [s, wall]."""


class Complaints:
    """Says what is wrong, and how it can be put right.

    Args:
        table: where it is wrong.
        ui: told to the person there.
        watches: whether it is seen by itself when they have put it right.
    """

    def __init__(self, table: Table, ui: UserInterface, *, watches: bool) -> None:
        self._table, self._ui, self._watches = table, ui, watches

    def of_finding(self, finding: Diagnosis) -> None:
        """Of a change that is no legal move."""
        self._table.note(finding)
        self._ask_to_fix(finding.sentence, finding.squares)

    def of_disturbed(self, *, centres: bool) -> bool:
        """Of what lies, or stands off its place, where the position is the same; whether there was any."""
        faults = self._table.disturbed(centres=centres)
        if faults:
            self.of_faults(faults)
        return bool(faults)

    def of_faults(self, faults: Sequence[Fault]) -> None:
        """Of pieces that do not stand as they should."""
        self._table.note_faults(faults)
        self._ask_to_fix(" and ".join(fault.sentence for fault in faults), [fault.square for fault in faults])

    def _ask_to_fix(self, sentence: str, squares: Sequence[chess.Square]) -> None:
        look = "" if self._watches else " and say 'look'"
        lying = [(one.piece, one.target) for one in self._table.fallen()]
        what = " and ".join(f"the {piece.colour} {piece.kind} of {at} has fallen over" for piece, at in lying)
        self._ui.say(
            f"{what or sentence}. Put it right by hand{look}, or say 'fix' and the arm does it",
            [chess.square_name(square) for square in squares],
        )
