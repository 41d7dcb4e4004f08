"""The games of a match, as its settings say, and as a person at the board wants them to be from one to the next."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import chess

from app.game import GameEnd
from app.game.person import GameLeft, ask
from app.pieces.layout import start_layout
from app.play.game_setup import RigSetup, start_board
from app.play.match import Fixture
from app.play.player_selection import engine_players, line_players, start_clock
from app.players.given_line import given_line
from app.players.person import Human, PersonGone
from app.players.players import Players
from app.players.typed_commands import NewGame, Word
from app.practice.odds import at_odds
from app.practice.puzzles import Puzzle, PuzzleAdviser, puzzles_from
from app.records.recorded_games import RecordedGame, recorded_games
from app.settings.defaults import PlayerKind, Settings
from app.settings.files import keep_settings
from app.terminal.game_display import UserInterface

NOBODY = "-"
"""Plays where a position is only set up."""


class GameSeries:
    """``Fixtures`` of the settings.

    Args:
        settings: of the match.
        rig_setup: where it is played.
        ui: shown what happens.
        human: who plays one side by hand; None: nobody.
        folder: of the match, which keeps the settings.
        begun: number of the game that was begun last.
    """

    def __init__(
        self, settings: Settings, rig_setup: RigSetup, ui: UserInterface, human: Human | None, folder: Path, *,
        begun: int = 1,
    ) -> None:  # fmt: skip
        self._settings, self._rig_setup, self._ui, self._begun = settings, rig_setup, ui, begun
        self._folder = folder
        self.human = None if human is None else replace(human, require=self._require)
        game = settings.game
        self._replayed: tuple[RecordedGame, ...] = ()
        if game.replay is not None:
            found = recorded_games(game.replay, game.replay_game, ", or choose another --game")
            self._replayed = tuple(one.from_ply(game.from_ply) for one in found) if game.from_ply > 1 else found
            for cut in [one.cut for one in found if one.cut is not None]:
                ui.say(cut)
        puzzles = settings.practice.puzzles
        self._puzzles = () if puzzles is None else puzzles_from(puzzles, settings.practice.puzzle, game.games)
        if puzzles is not None and len(self._puzzles) < game.games:
            asked = f"{game.games} puzzles that were asked for, from number {settings.practice.puzzle} on"
            ui.say(f"{puzzles} has only {len(self._puzzles)} of the {asked}")
        self._board = first_board(settings)
        self._line = None if game.moves is None else given_line(game.moves, self._board)

    @property
    def settings(self) -> Settings:
        """With what a person has wished since."""
        return self._settings

    def __call__(self, number: int, last: GameEnd | None) -> Fixture | None:
        """See ``Fixtures``."""
        again = last is not None and (last.again or self._wanted(number, last))
        if last is not None and last.wish is not None:
            self._grant(last.wish)
        plies = self._settings.game.plies
        if self._puzzles and again and number > len(self._puzzles):
            self._take(self._settings)  # whoever wants another game after the last one plays against the engine
        if self._puzzles:
            return _puzzle(self._puzzles[number - 1], self.human) if number <= len(self._puzzles) else None
        if self._replayed:
            if number > len(self._replayed):
                return None
            one = self._replayed[number - 1]
            names = (one.white, one.black)
            most = min(plies, len(one.moves))
            result = one.result if most == len(one.moves) else "*"
            return Fixture(one.board.copy(), _follow(one.board, one.moves, names), most, None, one.comments, result)
        if number > self._most and not again:
            return None
        if self._line is not None:
            most = min(plies, len(self._line))
            players = _follow(self._board, self._line, ("line", "line"))
            return Fixture(self._board.copy(), players, most, result="*")
        clock = start_clock(self._settings)
        return Fixture(self._board.copy(), self._engines(number), plies, self.human, clock=clock)

    @property
    def _most(self) -> int:
        """The number of the last game, unless a person wants another one."""
        return max(self._settings.game.games, self._begun)

    def _wanted(self, number: int, last: GameEnd) -> bool:
        """Whether the person, who goes on watching after the last game, wants another one; as which is granted."""
        human = self.human
        if human is None or last.kept or number <= self._most or not human.lines.accompanied:
            return False
        question = f"{last.reason}, result {last.result}: another game?"
        words = (Word.NEW, Word.QUIT)
        try:
            return ask(human, self._ui, question, words, lambda _: False, leaves=words) == Word.NEW
        except GameLeft as left:
            if left.wish is not None:
                self._grant(left.wish)
            return left.word is Word.NEW
        except PersonGone:
            return False

    def _require(self, wish: NewGame) -> None:
        """Make sure that there can be such a game.

        Raises:
            UserError: there cannot, and why.
            EngineProblem: no engine plays like that.
        """
        settings = wished(self._settings, wish)
        board = first_board(settings)
        start_layout(board, self._rig_setup.table)
        start_clock(settings)
        with ExitStack() as stack:
            engine_players(settings, board, settings.rig.seed, stack, self._ui, self._rig_setup.pace)

    def _grant(self, wish: NewGame) -> None:
        self._take(wished(self._settings, wish))
        self._board, self._line = first_board(self._settings), None
        if self.human is not None and wish.person is not None:
            self.human = replace(self.human, colour=wish.person)

    def _take(self, settings: Settings) -> None:
        """Play by other settings, without puzzles, also if the match goes on later."""
        practice = settings.practice.model_copy(update={"puzzles": None})
        self._settings, self._puzzles = settings.model_copy(update={"practice": practice}), ()
        keep_settings(self._folder, self._settings)

    def most(self, number: int) -> int:
        """Plies of a game after which it is over in any case."""
        fixture = self(number, None)
        return 0 if fixture is None else fixture.plies

    def _engines(self, number: int) -> Callable[[ExitStack], Players]:
        settings, seed = self._settings, self._settings.rig.seed + number - 1
        if not settings.game.plies:
            return _follow(self._board, (), (NOBODY, NOBODY))

        def make(stack: ExitStack) -> Players:
            return stack.enter_context(
                engine_players(settings, self._board, seed, stack, self._ui, self._rig_setup.pace)
            )

        return make


def first_board(settings: Settings) -> chess.Board:
    """The position that a game begins with, a piece left out where odds are given.

    Raises:
        UserError: it is no legal position, or odds are not given from it.
    """
    game = settings.game
    giver = settings.white.player is not PlayerKind.HUMAN  # the robot; of two engines, White
    return at_odds(start_board(game.fen, chess960=game.chess960), settings.practice.odds, giver)


def _puzzle(puzzle: Puzzle, human: Human | None) -> Fixture:
    """The opponent follows the solution; the person is told whether they do."""
    solver = None if human is None else replace(human, colour=puzzle.person, adviser=PuzzleAdviser(puzzle))
    players = _follow(puzzle.board, puzzle.line, (puzzle.name, puzzle.name))
    return Fixture(puzzle.board.copy(), players, len(puzzle.line), solver, conclude=puzzle.concluded)


def wished(settings: Settings, wish: NewGame) -> Settings:
    """The settings of a game against a person with what they want to be otherwise."""
    person, robot = settings.white, settings.black
    if person.player is not PlayerKind.HUMAN:
        person, robot = robot, person
    if wish.elo is not None:
        robot = robot.model_copy(update={"elo": wish.elo or None, "skill": None})
    clock, game = settings.clock, settings.game
    if wish.clock is not None:
        clock = clock.model_copy(update={"time": wish.clock or None})
        person, robot = (side.model_copy(update={"time": None}) for side in (person, robot))
    if wish.fen is not None:
        game = game.model_copy(update={"fen": wish.fen or None, "moves": None, "standing": None})
    plays_white = wish.person if wish.person is not None else settings.white.player is PlayerKind.HUMAN
    white, black = (person, robot) if plays_white else (robot, person)
    return settings.model_copy(update={"white": white, "black": black, "clock": clock, "game": game})


def from_found(settings: Settings, board: chess.Board, person: chess.Color | None) -> Settings:
    """The settings of games from a position that was found on the board, which nothing else is to begin: neither odds
    nor a puzzle. ``person`` has that colour against the robot; None: as before.
    """
    if person is not None and not settings.two_people:
        settings = wished(settings, NewGame(person=person))
    game = settings.game.model_copy(update={"fen": board.fen(), "from_board": False, "moves": None})
    practice = settings.practice.model_copy(update={"odds": None, "puzzles": None})
    return settings.model_copy(update={"game": game, "practice": practice})


def _follow(
    board: chess.Board, moves: tuple[chess.Move, ...], names: tuple[str, str]
) -> Callable[[ExitStack], Players]:
    return lambda stack: stack.enter_context(line_players(board, moves, names))
