"""Which recorded games lie in a folder, and which of their plies can be demonstrations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import chess

from app import UserError
from app.dataset.words import task_of
from app.records.events import AnyEvent, PlyEvent, StartEvent, StepEvent, TaskDroppedEvent
from app.records.files import AGAIN, EVENTS_FILE, GAME, GAMES
from app.records.history import RecordState, read_events
from app.records.rounds import match_folder, rounds_of

_SET_UP: Final = "set-up-"


@dataclass(frozen=True, slots=True)
class RecordedPly:
    """A ply that the arm played.

    Attributes:
        game: name of the record, as it is to be known in the dataset.
        seed: of the game.
        number: of the ply in its game, from 1.
        uci: the move.
        fen: the position before it.
        task: in words.
        begun: plant time at which its first part was begun [s].
        ended: plant time at which the arm was home again [s].
        success: nothing failed, and all pieces stood where the game says, as far as a referee was there to look.
        resumed: another program finished it, or the same one, after an interruption.
        mended: something went wrong on the way, and was put right before it was done.
    """

    game: str
    seed: int
    number: int
    uci: str
    fen: str
    task: str
    begun: float
    ended: float
    success: bool
    resumed: bool
    mended: bool


@dataclass(frozen=True, slots=True)
class MatchPlies:
    """Plies of all games that were played one after the other on one rig, whose telemetry and positions lie together.

    Attributes:
        folder: of the match.
        plies: in the order in which they were played.
    """

    folder: Path
    plies: tuple[RecordedPly, ...]


def match_folders(source: Path) -> tuple[tuple[Path, tuple[Path, ...]], ...]:
    """Folders of matches in a folder, each with those of its games.

    Args:
        source: a game, a match, a campaign with games that were kept, or a folder of such.

    Raises:
        UserError: there is no recorded game.
    """
    found = tuple(_matches(source))
    if not found:
        raise UserError(f"{source} holds no recorded game: name a record, a match, or a campaign that kept its games")
    return found


def plies_of_match(folder: Path, games: tuple[Path, ...], base: Path, said: Callable[[str], None]) -> MatchPlies:
    """Plies of a match that the arm played; ``said`` is told what was left out at the end of a record.

    Args:
        folder: of the match.
        games: folders of its games.
        base: the folder that games are named from.
        said: told what was left out.

    Raises:
        RecordError: a record cannot be read, or contradicts itself.
    """
    plies = [ply for game in games for ply in _plies(game, _name(game, base), said)]
    return MatchPlies(folder, tuple(sorted(plies, key=lambda ply: ply.begun)))


def _matches(source: Path) -> Iterator[tuple[Path, tuple[Path, ...]]]:
    if (source / EVENTS_FILE).is_file():
        whole = match_folder(source)
        games = rounds_of(source) if whole == source.resolve() else (source,)
        yield whole, tuple(game for game in games if not game.name.startswith(_SET_UP))
        return
    folder = source / GAMES if (source / GAMES).is_dir() else source
    for inner in sorted(folder.iterdir(), key=_numbered) if folder.is_dir() else ():
        home = inner / GAME if (inner / GAME / EVENTS_FILE).is_file() else inner
        again = inner.name.removesuffix(AGAIN)
        if again != inner.name and (folder / again).is_dir():  # the same once more
            continue
        if games := tuple(game for game in rounds_of(home) if not game.name.startswith(_SET_UP)):
            yield home, games


def _numbered(path: Path) -> tuple[int, str]:
    """Seeds in the order of their numbers, all else by name."""
    return (int(path.name), "") if path.name.isdigit() else (0, path.name)


def _name(game: Path, base: Path) -> str:
    game, base = game.resolve(), base.resolve()
    return str(game.relative_to(base)) if game != base and game.is_relative_to(base) else game.name


def _plies(folder: Path, name: str, said: Callable[[str], None]) -> Iterator[RecordedPly]:
    path = folder / EVENTS_FILE
    events = read_events(path, said)
    start = events[0]
    assert isinstance(start, StartEvent)
    yield from _played(start, events, name)


def _played(start: StartEvent, events: tuple[AnyEvent, ...], name: str) -> Iterator[RecordedPly]:
    board = chess.Board(start.fen, chess960=start.chess960)
    state = RecordState.after((start,), board)
    begun, uci = None, ""
    for event in events[1:]:
        if isinstance(event, StepEvent) and event.uci is not None and (begun is None or event.uci != uci):
            begun, uci = event.plant_time, event.uci
        if isinstance(event, TaskDroppedEvent):  # what was begun was given up, and may be begun anew
            begun = None
        if isinstance(event, PlyEvent):
            assert state.board is not None
            if begun is not None and event.by == "arm":
                yield _ply(state.board, event, begun, begun + (event.real_s or 0.0), start.seed, name)
            begun = None
        state.take(event)


def _ply(board: chess.Board, event: PlyEvent, begun: float, ended: float, seed: int, name: str) -> RecordedPly:
    return RecordedPly(
        game=name, seed=seed, number=event.ply, uci=event.uci, fen=board.fen(),
        task=task_of(board, chess.Move.from_uci(event.uci)), begun=begun, ended=ended,
        success=event.physical_ok is not False and not event.failures, resumed=event.resumed,
        mended=event.mended or event.real_s is None,
    )  # fmt: skip
