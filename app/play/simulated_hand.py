"""The hand of a simulated person, told what to do by the one at the keyboard."""

from __future__ import annotations

from pathlib import Path

from app.pieces.inventory import Inventory, Ply
from app.play.hand_moves import hand_transfers
from app.players.typed_commands import HandVerb, MoveHand
from hardware.interfaces import HandRefused
from hardware.sim.clients.hand import SimHand
from hardware.sim.hand.actions import Action, Hover, Knock, Move, Rest, Withdraw


class SimHands:
    """``Hands`` of the world of a run directory; connects when it is first needed."""

    def __init__(self, run_dir: Path) -> None:
        self._run_dir = run_dir
        self._hand: SimHand | None = None
        self._out = False
        """It could not do the last thing it was told, and may still be over the board."""

    def play(self, ply: Ply, inventory: Inventory) -> None:
        """See ``Hands.play``."""
        self._perform(*hand_transfers(ply.transfers, inventory.table), Withdraw())

    def do(self, command: MoveHand, inventory: Inventory) -> None:
        """See ``Hands.do``."""
        table = inventory.table
        try:
            points = [table.xy(place) for place in command.places]
        except ValueError as error:  # no such place on this table
            raise HandRefused(str(error)) from error
        actions: dict[HandVerb, type[Knock] | type[Hover] | type[Rest]] = {
            HandVerb.KNOCK: Knock, HandVerb.HOVER: Hover, HandVerb.REST: Rest,
        }  # fmt: skip
        first: Action
        if command.verb is HandVerb.MOVE:
            first = Move(start=points[0], to=points[1])
        else:
            first = actions[command.verb](at=points[0])
        try:
            self._perform(first, Withdraw())
        except HandRefused as refused:  # it knows nothing of squares
            sentence = str(refused)
            for (x, y), place in zip(points, command.places, strict=True):
                sentence = sentence.replace(f"({x:.3f}, {y:.3f}) m", str(place))
            raise HandRefused(sentence) from refused

    def withdraw(self) -> None:
        """See ``Hands.withdraw``."""
        if self._out:
            self._perform(Withdraw())

    def close(self) -> None:
        """Let the world go."""
        if self._hand is not None:
            self._hand.close()

    def _perform(self, *actions: Action) -> None:
        if self._hand is None:
            self._hand = SimHand(self._run_dir)
        self._out = True
        self._hand.do(*actions)
        self._out = False
