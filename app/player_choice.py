"""Who chooses the arm's moves, as the settings say."""

from __future__ import annotations

import random
from contextlib import ExitStack
from typing import Final

import chess

from app import UserError
from app.faces import Face
from app.players import EnginePlayer, LinePlayer, Player, Players
from app.settings import PlayerKind, Settings
from engine.openings import opening_engine, varied_opening
from engine.stockfish import Engine, EngineSettings
from hardware.sim.settings import Pace

OPENING_PLIES: Final = 8
HASH_MB: Final = 16


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
    settings: Settings, board: chess.Board, seed: int, stack: ExitStack, face: Face, pace: Pace, *, opened: bool
) -> Players:
    """An engine for each side.

    Args:
        settings: of the game.
        board: where it starts.
        seed: chooses the opening of two engines.
        stack: ends them.
        face: shown that they start.
        pace: of the rig; in pace fast nobody thinks ahead.
        opened: the opening is not chosen any more.

    Raises:
        UserError: the settings contradict each other.
        EngineProblem: an engine is missing or refuses its settings.
    """
    if settings.engine.nodes is not None and any(settings.side(colour).elo is not None for colour in chess.COLORS):
        raise UserError("--nodes is for repeatable games at full strength: leave the Elo out")
    face.phase("starting Stockfish")
    human = any(settings.side(colour).player is PlayerKind.HUMAN for colour in chess.COLORS)
    chosen = opened or human or settings.game.fen is not None
    opening = () if chosen else _opening(settings, board, seed)
    players = dict[chess.Color, Player]()
    for colour in chess.COLORS:
        elo = settings.side(colour).elo
        engine = stack.enter_context(Engine(_engine_settings(settings, elo)))
        name = "Stockfish" if elo is None else f"Stockfish (Elo {elo})"
        players[colour] = LinePlayer(board, opening, EnginePlayer(engine, name))
    return Players(players[chess.WHITE], players[chess.BLACK], ahead=pace is Pace.REAL)


def _engine_settings(settings: Settings, elo: int | None) -> EngineSettings:
    engine = settings.engine
    move_time = None if engine.nodes is not None else engine.move_time
    return EngineSettings(path=engine.path, elo=elo, hash_mb=HASH_MB, move_time=move_time, nodes=engine.nodes)


def _opening(settings: Settings, board: chess.Board, seed: int) -> tuple[chess.Move, ...]:
    with opening_engine(_engine_settings(settings, None)) as engine:
        return varied_opening(engine, board, min(OPENING_PLIES, settings.game.plies), random.Random(seed))
