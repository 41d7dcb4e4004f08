"""Games to analyse: of PGN files, and of recorded games with the times that their events tell."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import chess.pgn

from app.analysis.game_analysis import AnalysedGame
from app.records.events import StartEvent, unsaid
from app.records.files import EVENTS_FILE
from app.records.history import counted_plies, read_events
from app.records.recorded_games import RecordedGame, recorded_games


def games_of_pgn(path: Path, told: Callable[[str], None] = unsaid) -> tuple[AnalysedGame, ...]:
    """All games of a PGN file; ``told`` hears of those that may have been cut off.

    Raises:
        ReplayError: it cannot be read, or holds no game.
    """
    games = recorded_games(path)
    for game in games:
        if game.cut is not None:
            told(game.cut)
    return tuple(map(_of_pgn, games))


def game_of_record(folder: Path, told: Callable[[str], None] = unsaid) -> AnalysedGame | None:
    """The game of a record; None: it has no moves, such as one in which pieces were only set up.

    Raises:
        ReplayError: its PGN cannot be read.
        RecordError: its events cannot.
    """
    events = read_events(folder / EVENTS_FILE, told)
    plies = counted_plies(events)
    if not plies or not isinstance(events[0], StartEvent):
        return None
    (game,) = recorded_games(folder, 1)
    found = _of_pgn(game)
    ends = [events[0].plant_time, *(ply.plant_time for ply in plies)]
    elapsed = tuple(max(0.0, after - before) for before, after in itertools.pairwise(ends))
    if len(elapsed) != len(found.moves):
        return found  # the PGN is a ply behind the events: the program was killed between the two
    return AnalysedGame(
        found.board, found.moves, found.white, found.black, found.result, found.clocks, elapsed, found.comments,
        found.headers,
    )  # fmt: skip


def _of_pgn(game: RecordedGame) -> AnalysedGame:
    clocks, elapsed, comments = list[float | None](), list[float | None](), list[str]()
    for comment in game.comments:
        node = chess.pgn.Game()
        node.comment = comment
        clocks.append(node.clock())
        elapsed.append(node.emt())
        node.set_clock(None)
        node.set_emt(None)
        node.set_eval(None)
        comments.append(node.comment.strip())
    return AnalysedGame(
        game.board, game.moves, game.white, game.black, game.result, tuple(clocks), tuple(elapsed), tuple(comments),
        game.headers,
    )  # fmt: skip
