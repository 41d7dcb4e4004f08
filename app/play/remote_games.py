"""Games against opponents who sit somewhere else, one after the other on one rig.

The rig is open and the pieces stand before an opponent is looked for: elsewhere a clock may run from the first instant.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Final, Protocol

import chess

from app.execution.state import Devices
from app.game import GameEnd
from app.play.match import Fixture, Match
from app.play.session import Round
from app.players.person import Human
from app.players.players import Players
from app.players.remote import RemoteOpponent
from app.players.typed_commands import Word
from app.terminal.game_display import Together, UserInterface
from app.terminal.shown import RemoteShown, SessionShown
from hardware.piece_set import Colour

ENDLESS: Final = 1 << 30
"""Plies of a game that ends by nothing else than its rules and its players."""


NOBODY_YET: Final = RemoteShown(None, None, (Word.QUIT,))
"""While somebody to play against is looked for."""


class OpponentSource(Protocol):
    """Where opponents come from."""

    def find(self) -> RemoteOpponent | None:
        """The opponent of the next game, or of one that goes on; waits for one. None: no game is to be played."""

    def again(self, end: GameEnd) -> bool:
        """Whether another game is wanted after one that has ended so."""


class SeatedInterface(Together):
    """A user interface that can be told late which colour the person has: only the opponent's game says so."""

    def __init__(self, ui: UserInterface) -> None:
        super().__init__(ui)
        self._shown: SessionShown | None = None
        self._remote: RemoteShown | None = None

    def session(self, shown: SessionShown) -> None:
        """See ``UserInterface.session``."""
        self._shown = shown
        super().session(shown)

    def remote(self, shown: RemoteShown) -> None:
        """See ``UserInterface.remote``."""
        self._remote = shown
        super().remote(shown)

    def wait(self) -> None:
        """Nobody is found yet: one can only leave."""
        if self._remote != NOBODY_YET:
            self.remote(NOBODY_YET)

    def seat(self, person: Colour) -> None:
        """The person has this colour."""
        if self._shown is not None and self._shown.person is not person:
            self.session(replace(self._shown, person=person))


class RemoteSeries:
    """``Fixtures`` against opponents elsewhere.

    Args:
        source: of opponents.
        board: where all games begin.
        human: who plays here; None: an engine does.
        players: makes the engine that plays here, whichever colour it will have; nobody where a person plays.
        seat: told the colour of the person who plays here, once it is known.
        wait: told whenever somebody is looked for.
        plies: each game ends after so many in any case.
    """

    def __init__(
        self, source: OpponentSource, board: chess.Board, human: Human | None,
        players: Callable[[ExitStack], Players], seat: Callable[[Colour], None] = lambda _: None,
        wait: Callable[[], None] = lambda: None, plies: int = ENDLESS,
    ) -> None:  # fmt: skip
        self._source, self._board, self._human, self._players = source, board, human, players
        self._seat, self._wait, self._plies = seat, wait, plies

    def __call__(self, number: int, last: GameEnd | None) -> Fixture | None:
        """See ``Fixtures``."""
        if last is not None and not self._source.again(last):
            return None
        return Fixture(self._board.copy(), self._players, self._plies, self._human, opponent=self._find)

    def _find(self) -> RemoteOpponent | None:
        self._wait()
        opponent = self._source.find()
        if opponent is not None and self._human is not None:
            self._seat(Colour.BLACK if opponent.colour else Colour.WHITE)
        return opponent


@dataclass(frozen=True, slots=True)
class RemoteSchedule:
    """A ``Schedule`` that begins a match once the rig is open.

    Attributes:
        match: of a ``RemoteSeries``.
        begin: opens its first game, given the plant time [s].
    """

    match: Match
    begin: Callable[[float], None]

    def next(self, devices: Devices, last: GameEnd | None) -> Round | None:
        """See ``Schedule.next``.

        Raises:
            UserError: no opponent was found for the first game.
        """
        if last is None:
            self.begin(devices.clock.now())
        return self.match.next(devices, last)
