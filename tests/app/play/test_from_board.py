"""Games that a person begins by keeping what stands on the board, in the middle of another one."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import chess
import pytest

from app.execution.state import Devices
from app.game import GameEnd
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.play.from_board import FromBoard
from app.play.game_setup import RigSetup, rig_setup_of
from app.play.games import GameSeries
from app.play.launch import _from_board, _match, completed, decided, human_of
from app.play.match import Match
from app.players.typed_commands import NewGame
from app.records.events import StartEvent
from app.rig.board import BoardRig
from app.settings.files import keep_settings, kept_settings, settings_of
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines
from hardware.piece_set import Colour

FOUND = "8/8/8/4k3/8/8/3QK3/8 w - - 0 1"
PUZZLE = "PuzzleId,FEN,Moves\nA1,6k1/5ppp/8/8/8/8/5PPP/3R2K1 b - - 0 1,g8f8 d1d8\n"
FOR_BLACK = "PuzzleId,FEN,Moves\nB1,3r2k1/5ppp/8/8/8/8/5PPP/6K1 w - - 0 1,g1f1 d8d1\n"


@dataclass
class Table:
    """A match on the rig ``board``, and what follows where a person keeps what stands there."""

    folder: Path
    rig_setup: RigSetup
    games: GameSeries
    match: Match
    kept: FromBoard

    def devices(self) -> Devices:
        rig = BoardRig(self.rig_setup.motion.home, self.rig_setup.parameters)
        return Devices(rig.arm, rig.clock, None, None, None)

    def keep(self, fen: str = FOUND) -> Match:
        board = chess.Board(fen)
        return self.kept.begin(
            board, Inventory.of(start_layout(board, self.rig_setup.table), self.rig_setup.table), 1.0
        )


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def table_of(folder: Path, stack: ExitStack, **changes: Any) -> Table:
    named = {name.replace("__", "."): value for name, value in changes.items()}
    settings = decided(settings_of({"rig.name": "board", "white.player": "human", "out": folder, **named}))
    rig_setup, ui = rig_setup_of(settings.rig), UserInterface()
    settings = completed(settings, rig_setup)
    human = human_of(settings, rig_setup, folder, TypedLines(io.StringIO("")), stack)
    assert human is not None
    games = GameSeries(settings, rig_setup, ui, human, folder)
    match = stack.enter_context(_match(settings, rig_setup, games, folder, ui, human.lines))
    match.start(lambda board: Inventory.of(start_layout(board, rig_setup.table), rig_setup.table), None)
    keep_settings(folder, settings)
    kept = _from_board(settings, rig_setup, folder, ui, human, stack, match, games)
    return Table(folder, rig_setup, games, match, kept)


def start_of(match: Match, devices: Devices) -> StartEvent:
    following = match.next(devices, None)
    assert following is not None
    start = following.record.events[0]
    assert isinstance(start, StartEvent)
    return start


def test_what_is_kept_of_a_game_at_odds_or_of_a_puzzle_begins_a_game(tmp_path: Path, stack: ExitStack) -> None:
    puzzles = tmp_path / "puzzles.csv"
    puzzles.write_text(PUZZLE, encoding="utf-8")
    for name, changes in (("odds", {"practice__odds": "queen"}), ("puzzle", {"practice__puzzles": puzzles})):
        table = table_of(tmp_path / name, stack, **changes)
        assert start_of(table.keep(), table.devices()).fen == FOUND
        again = kept_settings(table.folder)  # 'resume' goes on with it
        assert (again.game.fen, again.practice.odds, again.practice.puzzles) == (FOUND, None, None)


def test_a_game_that_is_kept_is_as_the_one_before_was_wished(tmp_path: Path, stack: ExitStack) -> None:
    table = table_of(tmp_path / "game", stack)
    wish = NewGame(person=chess.BLACK, elo=1500, clock="10+5")
    table.games(2, GameEnd("*", "given up for a new game", complete=True, again=True, wish=wish))
    found = table.keep()
    start = start_of(found, table.devices())
    assert (start.white, start.black, start.time_control) == ("Stockfish (Elo 1500)", "Human", "600+5")
    assert found.person is chess.BLACK


@pytest.mark.parametrize("changes_sides", [False, True])
def test_who_keeps_the_board_keeps_their_side(changes_sides: bool, tmp_path: Path, stack: ExitStack) -> None:
    puzzles = tmp_path / "puzzles.csv"
    puzzles.write_text(FOR_BLACK, encoding="utf-8")
    table = table_of(tmp_path / "game", stack, **({} if changes_sides else {"practice__puzzles": puzzles}))
    begun = table.match.next(table.devices(), None)
    assert begun is not None
    if changes_sides:
        begun.record.sides_changed(Colour.BLACK, 0.0)
    found = table.keep()
    start_of(found, table.devices())
    assert found.person is chess.BLACK


def test_each_game_that_is_kept_has_a_folder_of_its_own(tmp_path: Path, stack: ExitStack) -> None:
    table = table_of(tmp_path / "game", stack)
    (table.folder / "game-2").mkdir()  # begun by 'new'
    for number in (3, 4):
        table.keep()
        assert (table.folder / f"game-{number}" / "events.jsonl").exists()
