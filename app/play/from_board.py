"""Games from whatever position stands on the board: it is found out which, then they are played.

A person may have put it there before anything began, or want to go on with what has become of a game.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import chess

from app.execution.state import Devices
from app.game import GameEnd
from app.game.person import GameLeft, SettledHands
from app.game.position_dialogue import PositionDialogue
from app.pieces.found_layout import found_layout
from app.pieces.inventory import Inventory
from app.pieces.layout import physical_set
from app.play.match import Match
from app.play.session import Round
from app.play.table_setup import TableSetup
from app.players.person import Human
from app.terminal.game_display import UserInterface
from hardware.table import TableSettings


@dataclass(slots=True)
class FromBoard:
    """A ``Schedule`` that looks at a board of which nothing is known, first or when a person keeps it.

    Attributes:
        human: knows whose move it is.
        ui: shown what is seen.
        table_setup: of the games.
        table: board and trays.
        begin: makes the games that follow, from the position and what stands where, at a plant time [s].
        match: what is played before; None: it begins with a look.
    """

    human: Human
    ui: UserInterface
    table_setup: TableSetup
    table: TableSettings
    begin: Callable[[chess.Board, Inventory, float], Match]
    match: Match | None = None

    def next(self, devices: Devices, last: GameEnd | None) -> Round | None:
        """See ``Schedule.next``.

        Raises:
            GameLeft: nothing was played, and the person leaves before it is known what stands there.
        """
        if self.match is not None and not (last is not None and last.kept):
            return self.match.next(devices, last)
        if self.match is not None:
            self.match.dismiss()
        try:
            board, inventory = self._find_out(devices)
        except GameLeft:
            if self.match is None:
                raise
            return None
        self.match = self.begin(board, inventory, devices.clock.now())
        return self.match.next(devices, None)

    def _find_out(self, devices: Devices) -> tuple[chess.Board, Inventory]:
        hands = self.human.hands
        human = self.human if hands is None else replace(self.human, hands=SettledHands(hands, devices.arm))
        observer = self.table_setup.observer(devices, self.table, self.ui)
        held = Counter((piece.colour, piece.kind) for piece in physical_set())
        dialogue = PositionDialogue(human, self.ui, lambda: observer.recognise(held), self.table)
        board, found = dialogue.ask()
        beside = {one.place: one.look for one in found.pieces if one.place.in_tray and one.instead is None}
        return board, found_layout(board, beside, found.free, self.table)
