"""Games from their settings: the demo of two engines, a game against a person, and going on with either."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import chess

from app import UserError
from app.faces import Face
from app.game import GameEnd, Position
from app.game.human import Human
from app.game.seating import Seating
from app.layout import start_layout
from app.lines import parse_line
from app.manipulation import Inventory
from app.match import Fixture, Match, Start, last_round
from app.player_choice import engine_players, line_players
from app.players import Players
from app.processes import GAMES
from app.records import EVENTS_FILE, GameRecord, new_folder, read_history, utc_now
from app.session import Filming, SessionResult, run_session
from app.settings import PlayerKind, Settings
from app.settings_file import keep_settings, kept_settings
from app.sim_hands import SimHands
from app.typed_lines import TypedLines
from app.venue import Venue, start_board, venue_of
from app.watch_view import nominal_view
from hardware.interfaces import Intrinsics
from hardware.table import Colour
from vision.board import BoardView


def run_games(settings: Settings, face: Face, typed: TextIO | None = None) -> SessionResult:
    """Play as the settings say.

    Args:
        settings: of rig, games and players.
        face: shown what happens.
        typed: what the person at the board types; needed where one plays.

    Raises:
        UserError: bad settings, something missing on this machine, or no space for the record.
        EngineProblem: Stockfish is missing or fails for good.
    """
    venue = venue_of(settings.rig)
    settings = _completed(settings, venue)
    folder = settings.out if settings.out is not None else new_folder(GAMES, utc_now())
    with ExitStack() as stack:
        games = _Games(settings, venue, folder, face, _human(settings, venue, folder, typed, stack))
        match = stack.enter_context(_match(games, folder))
        inventory = match.start(lambda board: Inventory.of(start_layout(board, venue.table), venue.table))
        keep_settings(folder, settings)
        world = venue.world(inventory, _person(settings)) if venue.own else None
        return run_session(
            folder,
            lambda listener: venue.open(folder, world, face.phase, listener),
            match, venue.parameters.drive.tick, _filming(venue, folder), face,
        )  # fmt: skip


def resume_games(folder: Path, face: Face, typed: TextIO | None = None) -> SessionResult:
    """Go on with what was interrupted, or whose program or controller died: first with the ply under way.

    Raises:
        UserError: the folder holds no such game, or the game is over; or as ``run_games``.
        EngineProblem: as ``run_games``.
    """
    settings = kept_settings(folder)
    venue = venue_of(settings.rig)
    path, number, sets_up = last_round(folder)
    history = read_history(path / EVENTS_FILE, venue.table)
    if any(event.physical_ok is False for event in history.plies):
        raise UserError(f"a ply of the game in {path} left the board wrong, see its report: start a new one")
    with ExitStack() as stack:
        games = _Games(settings, venue, folder, face, _human(settings, venue, folder, typed, stack), history.board)
        over = not sets_up and (len(history.plies) >= games.most() or history.board.is_game_over(claim_draw=True))
        if over and (number >= settings.game.games or history.unfinished is not None):
            raise UserError(f"the game in {path} is over, after {len(history.plies)} plies: start a new one")
        match = stack.enter_context(_match(games, folder))
        match.go_on(Start(number, sets_up, GameRecord.go_on(path, history), Position.of(history)))
        return run_session(
            folder,
            lambda listener: venue.open(folder, None, face.phase, listener),
            match, venue.parameters.drive.tick, None, face,
        )  # fmt: skip


@dataclass(slots=True)
class _Games:
    """``Fixtures`` of the settings."""

    settings: Settings
    venue: Venue
    folder: Path
    face: Face
    human: Human | None
    opened: chess.Board | None = None
    """What was played already of the first one."""

    def __call__(self, number: int, last: GameEnd | None) -> Fixture | None:
        again = last is not None and last.again
        if number > self.settings.game.games and not again:
            return None
        opened, self.opened = self.opened, None
        board = self.start()

        def players(stack: ExitStack) -> Players:
            if (line := self.line(board)) is not None:
                return stack.enter_context(line_players(board, line))
            seed = self.settings.rig.seed + number - 1
            begun = opened is not None and bool(opened.move_stack)
            chosen = engine_players(self.settings, board, seed, stack, self.face, self.venue.pace, opened=begun)
            return stack.enter_context(chosen)

        return Fixture(board, players, self.most(), self.human)

    def start(self) -> chess.Board:
        return start_board(self.settings.game.fen, chess960=self.settings.game.chess960)

    def line(self, board: chess.Board) -> tuple[chess.Move, ...] | None:
        moves = self.settings.game.moves
        return None if moves is None else parse_line(moves, board)

    def most(self) -> int:
        line = self.line(self.start())
        plies = self.settings.game.plies
        return plies if line is None else min(plies, len(line))


def _match(games: _Games, folder: Path) -> Match:
    settings, venue = games.settings, games.venue
    looks = settings.vision.verify
    if looks is None:
        looks = games.human is not None or not venue.simulated

    def view(intrinsics: Intrinsics) -> BoardView | None:
        return nominal_view(intrinsics, venue.table) if venue.simulated else None

    seating = Seating(venue.motion, venue.parameters, looks, view)
    return Match(folder, games, seating, games.face, settings.rig.seed, venue.pace)


def _completed(settings: Settings, venue: Venue) -> Settings:
    """With what the rig says, and with paths that hold for any working directory."""
    if settings.game.fen is None and venue.fen is not None:
        settings = settings.with_changes({"game.fen": venue.fen})
    if venue.file is not None:
        settings = settings.with_changes({"rig.name": str(Path(settings.rig.name).absolute())})
    return settings


def _person(settings: Settings) -> Colour | None:
    """The side that a person plays."""
    humans = [colour for colour in Colour if settings.side(colour is Colour.WHITE).player is PlayerKind.HUMAN]
    if len(humans) > 1:
        raise UserError("two humans need no robot: let an engine play one side")
    return humans[0] if humans else None


def _human(settings: Settings, venue: Venue, folder: Path, typed: TextIO | None, stack: ExitStack) -> Human | None:
    colour = _person(settings)
    if colour is None:
        return None
    assert typed is not None, "a person types"
    hands = None
    if venue.own:
        hands = SimHands(venue.run_dir(folder))
        stack.callback(hands.close)
    return Human(colour is Colour.WHITE, TypedLines(typed), hands)


def _filming(venue: Venue, folder: Path) -> Filming | None:
    section = venue.section
    if not (section.video and venue.simulated):
        return None
    return Filming(venue.run_dir(folder), folder / "game.webm", section.video_length, venue.pace)
