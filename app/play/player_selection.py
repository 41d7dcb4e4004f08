"""Who chooses the arm's moves, as the settings say."""

from __future__ import annotations

import random
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import chess

from app import UserError
from app.game.clock import ChessClock
from app.players.players import EnginePlayer, LinePlayer, Player, Players
from app.players.tablebase import Tablebase
from app.practice.repertoire import RepertoirePlayer, load_repertoire
from app.settings.defaults import PlayerKind, Settings
from app.settings.time_control import TimeControl
from app.terminal.game_display import UserInterface
from engine.book import Book, BookSettings
from engine.draws_and_resigning import RESIGNING, DrawResignPolicy
from engine.openings import OPENING_PLIES, opening_engine, varied_opening
from engine.settings import EngineSettings
from engine.stockfish import Engine
from hardware.interfaces import Pace

MOVE_TIME: Final = 0.2
"""Of a move where neither a clock, nor a time, nor nodes say otherwise [s]."""
LONGEST_THOUGHT: Final = 3.0
"""Of an engine that plays somebody elsewhere, where nothing else is said; without a clock, of every move [s]."""


def line_players(
    board: chess.Board, line: tuple[chess.Move, ...], names: tuple[str, str] = ("line", "line")
) -> Players:
    """Both sides follow a given line.

    Args:
        board: where it begins.
        line: moves.
        names: of White and Black.
    """
    white, black = (LinePlayer(board, line, name=name) for name in names)
    return Players(white, black)


def engine_players(
    settings: Settings, board: chess.Board, seed: int, stack: ExitStack, ui: UserInterface, pace: Pace
) -> Players:
    """An engine for each side.

    Args:
        settings: of the game.
        board: where it starts.
        seed: chooses the opening of two engines.
        stack: ends them.
        ui: shown that they start.
        pace: of the rig; in pace fast nobody ponders.

    Raises:
        UserError: the settings contradict each other.
        EngineProblem: an engine is missing or refuses its settings.
    """
    if settings.two_people:
        return Players(None, None)
    sides = [settings.side(colour) for colour in chess.COLORS]
    if settings.engine.nodes is not None and any(side.elo is not None or side.skill is not None for side in sides):
        raise UserError(
            "--nodes is for repeatable games at full strength: leave it out, or the strength in Elo or skill"
        )
    human = any(side.player is PlayerKind.HUMAN for side in sides)
    books = any(_book_of(settings, colour) is not None for colour in chess.COLORS)
    chosen = human or books or settings.game.fen is not None or settings.practice.odds is not None
    repertoire = None if settings.practice.repertoire is None else load_repertoire(settings.practice.repertoire)
    opening = () if chosen else _opening(settings, board, seed, ui)
    tables = None
    if settings.engine.syzygy is not None:
        tables = stack.enter_context(Tablebase(settings.engine.syzygy))
    players = dict[chess.Color, Player]()
    for colour in chess.COLORS:
        kept = _engine_settings(settings, colour, seed, human=human)
        ui.phase(f"starting {_engine_name(kept)}")
        engine = stack.enter_context(Engine(kept))
        found = _book_of(settings, colour)
        book = None
        if found is not None:
            book = stack.enter_context(Book(BookSettings(path=found, max_plies=settings.engine.book_plies), seed))
        policy = RESIGNING if settings.engine.resigns else DrawResignPolicy()
        player: Player = EnginePlayer(engine, _name(kept), book=book, policy=policy, tablebase=tables)
        if repertoire is not None:
            player = RepertoirePlayer(repertoire, seed, player)
        players[colour] = LinePlayer(board, opening, player)
    ended = None if human or tables is None else tables
    return Players(players[chess.WHITE], players[chess.BLACK], ponders=pace is Pace.REAL, tablebase=ended)


def engine_of_both(settings: Settings, stack: ExitStack, ui: UserInterface, pace: Pace) -> Players:
    """One engine, as White's settings say, for whichever side it will play against somebody elsewhere, by the clock
    that counts there; arguments and errors as of ``engine_players``.
    """
    seed, tables = settings.rig.seed, None
    kept = _engine_settings(settings, chess.WHITE, seed, human=True)
    if settings.engine.move_time is None and settings.engine.nodes is None:
        kept = kept.model_copy(update={"move_time": LONGEST_THOUGHT, "ponder": settings.engine.ponder is not False})
    ui.phase(f"starting {_engine_name(kept)}")
    engine = stack.enter_context(Engine(kept))
    book = None
    if (found := _book_of(settings, chess.WHITE)) is not None:
        book = stack.enter_context(Book(BookSettings(path=found, max_plies=settings.engine.book_plies), seed))
    if settings.engine.syzygy is not None:
        tables = stack.enter_context(Tablebase(settings.engine.syzygy))
    resigns = RESIGNING if settings.engine.resigns else DrawResignPolicy()
    player = EnginePlayer(engine, _name(kept), book=book, policy=resigns, tablebase=tables)
    return Players(player, player, ponders=pace is Pace.REAL)


def start_clock(settings: Settings) -> ChessClock | None:
    """The clock before a game; None: it is played without.

    Raises:
        UserError: a time control means nothing.
    """
    white, black = (settings.side(colour).time or settings.clock.time for colour in (True, False))
    if white is None and black is None:
        return None
    if white is None or black is None:
        raise UserError("only one side has a time control: give both, or --clock for both")
    return ChessClock.new(TimeControl.parse(white), TimeControl.parse(black), settings.clock.arm_time)


def _engine_name(settings: EngineSettings) -> str:
    return "Stockfish" if settings.path is None else Path(settings.path).stem


def _name(settings: EngineSettings) -> str:
    name = _engine_name(settings)
    if settings.elo is not None:
        return f"{name} (Elo {settings.elo})"
    return name if settings.skill is None else f"{name} (skill {settings.skill})"


def _book_of(settings: Settings, colour: chess.Color) -> Path | None:
    return settings.side(colour).book or settings.engine.book


def _engine_settings(settings: Settings, colour: chess.Color, seed: int, *, human: bool) -> EngineSettings:
    engine, side = settings.engine, settings.side(colour)
    timed = settings.clock.time is not None or side.time is not None
    move_time = engine.move_time
    if move_time is None and engine.nodes is None and not timed:
        move_time = MOVE_TIME
    ponder = engine.ponder if engine.ponder is not None else timed and (human or settings.rig.pace is not Pace.FAST)
    return EngineSettings(
        path=side.path or engine.path, elo=side.elo, skill=side.skill, threads=engine.threads, hash_mb=engine.hash_mb,
        options=engine.options, move_time=None if engine.nodes is not None else move_time, nodes=engine.nodes,
        ponder=ponder, seed=2 * seed + colour,
    )  # fmt: skip


def _opening(settings: Settings, board: chess.Board, seed: int, ui: UserInterface) -> tuple[chess.Move, ...]:
    plain = EngineSettings(path=settings.engine.path)
    ui.phase(f"starting {_engine_name(plain)}")
    with opening_engine(plain) as engine:
        if not engine.ranks:
            ui.say(f"{_name(plain)} has no option MultiPV, so its opening is chosen by searching each move alone.")
        return varied_opening(engine, board, min(OPENING_PLIES, settings.game.plies), random.Random(seed))
