"""Games one after the other on one rig; between them the arm sets the pieces up.

Each game, and each setting up, has a record of its own: the first game in the match's folder itself, what was set up
for the second in its ``set-up-2``, the second game in ``game-2``, and so on.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, Protocol

import chess

from app import UserError
from app.execution.state import KEPT, LEFT, WRONG
from app.execution.table import Table
from app.game import Devices, Game, GameEnd, Position
from app.game.bystander import Bystander
from app.game.clock import ChessClock
from app.game.game import leave, require_empty_fingers
from app.game.person import GameLeft, SettledHands
from app.game.remote_timing import RemoteTiming
from app.game.remote_turn import refusal
from app.game.timing import Timing, clock_of
from app.pieces.inventory import Inventory
from app.pieces.position import set_up
from app.play.session import Round
from app.play.table_setup import TableSetup
from app.players.game_end import Result
from app.players.person import Human
from app.players.players import Players
from app.players.remote import RemoteOpponent
from app.players.typed_commands import Word
from app.records import EVENTS_FILE, GameRecord, GameSetup
from app.records.history import counted_plies, persons_side
from app.settings.files import SETTINGS_FILE
from app.terminal.game_display import UserInterface
from hardware.interfaces import Pace
from hardware.piece_set import Colour

UNKNOWN: Final = "?"
"""Name of somebody elsewhere who is yet to be found, as PGN writes it."""
PERSON: Final = "Human"
"""Name of whoever plays by hand."""
SET_UP: Final = GameEnd("*", "set up", complete=True)
_NAME: Final = re.compile(r"(game|set-up)-(\d+)")


@dataclass(frozen=True, slots=True)
class Fixture:
    """A game that is to be played.

    Attributes:
        board: where it starts.
        players: makes those who choose the arm's moves; what they need is closed with the stack.
        plies: it ends after so many; 0: the position is only set up.
        human: who plays one side by hand; None: nobody.
        comments: for each ply of a game that is played again.
        result: of that game; None: it is no such game.
        clock: before the game; None: it is played without.
        opponent: who plays one side from somewhere else, found once the pieces stand; the finder returns None where
            nobody is found and no more is to be played. None: nobody plays from elsewhere.
        conclude: how it has ended, in words of its own, given the last position and how it has ended by the rules.
    """

    board: chess.Board
    players: Callable[[ExitStack], Players]
    plies: int
    human: Human | None = None
    comments: tuple[str, ...] = ()
    result: Result | None = None
    clock: ChessClock | None = None
    opponent: Callable[[], RemoteOpponent | None] | None = None
    conclude: Callable[[chess.Board, GameEnd], GameEnd] = lambda _, end: end


class Fixtures(Protocol):
    """The games of a match."""

    def __call__(self, number: int, last: GameEnd | None) -> Fixture | None:
        """The game of a number, from 1, after one that has ended so; None: there are no more."""


@dataclass(frozen=True, slots=True)
class Start:
    """How a match begins: which game it is or is for, whether it sets up; its record; where it stands."""

    number: int
    sets_up: bool
    record: GameRecord
    position: Position


class Match:
    """A ``Schedule`` of games. A context manager: at its end nobody thinks any more, and no record is open.

    Args:
        folder: of the whole.
        fixtures: the games.
        table_setup: puts a table together.
        ui: shown what happens.
        seed: for the records.
        pace: for the records.
    """

    def __init__(
        self, folder: Path, fixtures: Fixtures, table_setup: TableSetup, ui: UserInterface, seed: int, pace: Pace
    ) -> None:
        self._folder, self._fixtures, self._table_setup, self._ui = folder, fixtures, table_setup, ui
        self._seed, self._pace = seed, pace
        self._records = ExitStack()
        self._players = ExitStack()
        self._start: Start | None = None
        self._table: Table | None = None
        self._number = 0
        self._sets_up = False
        self._fixture: Fixture | None = None
        self._chosen: Players | None = None
        self._opponent: RemoteOpponent | None = None
        self._sides: Callable[[], chess.Color | None] = lambda: None

    def __enter__(self) -> Match:
        return self

    def __exit__(self, *_: object) -> None:
        self.dismiss()
        self._records.close()

    def dismiss(self) -> None:
        """Nobody thinks any more."""
        self._players.close()

    @property
    def person(self) -> chess.Color | None:
        """The colour that the person at the board has in the present game; None: nobody plays there, or none began."""
        return self._sides()

    def start(
        self, layout: Callable[[chess.Board], Inventory], standing: chess.Board | None, number: int = 1, at: float = 0.0
    ) -> chess.Board:
        """Open the first game's players and record, before any device; what stands on the board at its beginning.

        Args:
            layout: what stands where in a position.
            standing: the position that stands there, if the first one is to be set up; None: that one does.
            number: of the first game; more, where others were played in the folder.
            at: plant time [s].

        Raises:
            UserError: an engine is missing, the set cannot show the position, or the folder cannot be written.
        """
        fixture = self._take_up(number, None)
        assert fixture is not None, "a match has at least one game"
        board = fixture.board if standing is None else standing
        stands = layout(board)
        sets_up = standing is not None
        if sets_up:
            set_up(stands, fixture.board)  # whether the pieces there can show it, before anything is started
        if not sets_up and not self._find_opponent():
            raise UserError("no opponent was found: ask again, or wait longer")
        name = f"set-up-{number}" if sets_up and fixture.plies else self._name("game", number)
        record = self._record(name, board, stands, at)
        self._ui.round(record.folder, number, sets_up=sets_up)
        self._start = Start(number, sets_up, record, Position(board.copy(), stands))
        return board

    def go_on(self, start: Start) -> None:
        """Begin with what another program has left."""
        self._records.enter_context(start.record)
        fixture = self._take_up(start.number, None)
        assert fixture is not None, "what was begun is among the fixtures"
        if not start.sets_up and not self._find_opponent():
            raise UserError("the opponent of this game was not found: look at the game where it is played")
        self._ui.round(start.record.folder, start.number, sets_up=start.sets_up)
        self._start = start

    def next(self, devices: Devices, last: GameEnd | None) -> Round | None:
        """See ``Schedule.next``."""
        if last is None:
            assert self._start is not None
            self._number, self._sets_up = self._start.number, self._start.sets_up
            if not self._start.position.begun:
                require_empty_fingers(devices.arm.state().felt)
            return self._round(devices, self._start.record, self._start.position)
        assert self._table is not None
        if last is LEFT or (self._sets_up and last is not SET_UP and not last.again):  # where nobody sees what is kept
            return None
        if self._sets_up and last is SET_UP:
            assert self._fixture is not None
            if not self._fixture.plies:
                return None
            self._sets_up = False
        else:
            self._number += 1
            if self._take_up(self._number, last) is None:
                return None
            self._sets_up = not self._shows(self._table.board)
        if not self._sets_up and not self._find_opponent():
            return None
        return self._next_round(devices, self._table)

    def _find_opponent(self) -> bool:
        """Once the pieces stand, whoever plays from elsewhere, if anybody should; False: nobody was found."""
        assert self._fixture is not None
        if self._fixture.opponent is None:
            return True
        self._opponent = self._fixture.opponent()
        if self._opponent is None:
            return False
        if (human := self._fixture.human) is not None:
            colour = not self._opponent.colour
            human = replace(human, colour=colour, refusal=refusal, adviser=None, both=False)  # nobody helps
            self._fixture = replace(self._fixture, human=human)
        return True

    def _take_up(self, number: int, last: GameEnd | None) -> Fixture | None:
        self._fixture = self._fixtures(number, last)
        self._opponent = None
        if self._fixture is not None:
            self._players.close()
            self._chosen = self._fixture.players(self._players)
        return self._fixture

    def _shows(self, board: chess.Board) -> bool:
        assert self._fixture is not None
        return board.board_fen() == self._fixture.board.board_fen()

    def _next_round(self, devices: Devices, table: Table) -> Round:
        assert self._fixture is not None
        board = table.board.copy(stack=False) if self._sets_up else self._fixture.board.copy()
        name = self._name("set-up" if self._sets_up else "game", self._number)
        record = self._record(name, board, table.inventory, devices.clock.now())
        self._ui.round(record.folder, self._number, sets_up=self._sets_up)
        return self._round(devices, record, Position(board, table.inventory))

    def _round(self, devices: Devices, record: GameRecord, position: Position) -> Round:
        assert self._fixture is not None
        assert self._chosen is not None
        if position.begun:
            record.resumed(devices.clock.now())
        human, side = self._fixture.human, persons_side(record.events)
        if human is not None and side is not None:
            human = replace(human, colour=side is Colour.WHITE)
        self._sides = partial(_side_of, human, record)
        if human is not None and human.hands is not None:
            human = replace(human, hands=SettledHands(human.hands, devices.arm))
        told = () if self._opponent is None else (self._opponent.mending,)
        table = self._table = self._table_setup.table(devices, record, position, self._ui, human, *told)
        if self._sets_up:
            goal = self._fixture.board
            self._ui.clock(None)  # those of the game before are no more
            return Round(record, lambda: _set_up(table, goal), dict)
        clock = clock_of(self._fixture.clock, counted_plies(record.events))
        timing = Timing(clock, devices.clock.now, show=self._ui.clock)
        if self._opponent is not None:
            timing = RemoteTiming(self._opponent, devices.clock.now, show=self._ui.clock)
        timing.show()
        lines = self._table_setup.lines
        watched = human is None and lines is not None and self._opponent is None
        bystander = Bystander(lines, self._ui, timing) if watched and lines is not None else None
        fixture = self._fixture
        game = Game(
            table, self._chosen, self._ui, human, fixture.comments, fixture.result, timing, bystander, self._opponent,
            lines if human is None else human.lines,
        )  # fmt: skip

        def play() -> GameEnd:
            end = game.play(fixture.plies)
            return fixture.conclude(table.board, end)

        return Round(record, play, lambda: {"thinking_s": round(game.thinking, 3)})

    def _name(self, what: str, number: int) -> str:
        return "" if number == 1 and what == "game" else f"{what}-{number}"

    def _record(self, name: str, board: chess.Board, inventory: Inventory, plant_time: float) -> GameRecord:
        assert self._chosen is not None
        assert self._fixture is not None
        human, clock, opponent = self._fixture.human, self._fixture.clock, self._opponent
        names = {
            colour: PERSON
            if human is not None and (human.both or human.colour is colour)
            else self._chosen.name(colour)
            for colour in chess.COLORS
        }
        control, site = None if clock is None else clock.white.pgn, "?"
        if self._fixture.opponent is not None and opponent is None and human is not None:
            names[not human.colour] = UNKNOWN
        if opponent is not None:
            listing = opponent.listing
            here = names[not opponent.colour] if listing.here is None else listing.here
            names = {opponent.colour: opponent.name, not opponent.colour: here}
            control, site = listing.time_control, listing.site
        white, black = names[chess.WHITE], names[chess.BLACK]
        setup = GameSetup(white, black, self._seed, self._pace.value, site, control)
        record = GameRecord.begin(self._folder / name, setup, board, inventory, plant_time)
        return self._records.enter_context(record)


def _set_up(table: Table, goal: chess.Board) -> GameEnd:
    try:
        if not table.begin():
            return WRONG
        return SET_UP if table.set_up(goal) else WRONG
    except GameLeft as left:
        return leave(table, left, _set_up_left)


def _set_up_left(left: GameLeft) -> GameEnd:
    if left.wish is not None:
        return GameEnd("*", "left for another game", complete=True, again=True, wish=left.wish)
    return KEPT if left.word is Word.KEEP else LEFT


def _side_of(human: Human | None, record: GameRecord) -> chess.Color | None:
    """The colour that a person has at last in a game that they began with one."""
    side = persons_side(record.events)
    return None if human is None else human.colour if side is None else side is Colour.WHITE


def match_of(folder: Path) -> Path:
    """The folder of a match, which may itself be named, or one of its rounds'."""
    own = folder.resolve()
    is_round = _NAME.fullmatch(own.name) and not (own / SETTINGS_FILE).exists()
    return own.parent if is_round and (own.parent / SETTINGS_FILE).exists() else folder


def last_round(folder: Path) -> tuple[Path, int, bool]:
    """The last round of a match that was left: folder, number of the game that it is or is for, whether it sets up."""
    rounds = _rounds(folder)
    if not rounds:
        return folder, 1, False
    number, is_game, path = max(rounds)
    return path, number, not is_game


def next_number(folder: Path) -> int:
    """The number of a game that is begun in a match's folder after all that lie there."""
    return max((number for number, _, _ in _rounds(folder)), default=0) + 1


def _rounds(folder: Path) -> list[tuple[int, bool, Path]]:
    """Of each round in a folder the number of its game, whether it is that, and where it lies."""
    rounds = []
    for path in folder.iterdir() if folder.is_dir() else ():
        name = _NAME.fullmatch(path.name)
        if name is not None:
            rounds.append((int(name[2]), name[1] == "game", path))
    if (folder / EVENTS_FILE).exists():
        rounds.append((1, True, folder))  # comes after its own setting up
    return rounds
