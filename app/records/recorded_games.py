"""Games that were played before, read so that the arm can play them again: PGN files, and folders of our own."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Final, TextIO

import chess
import chess.pgn

from app import UserError
from app.players.game_end import Result
from app.records.game import PGN_FILE

RESULTS: Final[tuple[Result, ...]] = ("1-0", "0-1", "1/2-1/2", "*")


class ReplayError(UserError):
    """Nothing there can be played again."""


@dataclass(frozen=True, slots=True)
class RecordedGame:
    """The main line of a game.

    Attributes:
        board: where it starts.
        moves: of both sides.
        comments: after each move; what a clock or an engine noted in them is left in.
        white: name.
        black: name.
        title: of players and event, for people.
        result: as the file has it.
        headers: all of the file's, by name.
        cut: what there is to say of a game that has no end in the file; None: it has one.
    """

    board: chess.Board
    moves: tuple[chess.Move, ...]
    comments: tuple[str, ...]
    white: str
    black: str
    title: str
    result: Result
    headers: Mapping[str, str] = field(default_factory=dict)
    cut: str | None = None

    def from_ply(self, ply: int) -> RecordedGame:
        """The rest of it, beginning with a ply (from 1).

        Raises:
            ReplayError: it has no such ply.
        """
        if not 1 <= ply <= max(1, len(self.moves)):
            raise ReplayError(
                f"--from-ply {ply}: the game {self.title} has {len(self.moves)} plies: choose 1 to {len(self.moves)}"
            )
        board = self.board.copy()
        for move in self.moves[: ply - 1]:
            board.push(move)
        return replace(
            self, board=board.copy(stack=False), moves=self.moves[ply - 1 :], comments=self.comments[ply - 1 :]
        )


def recorded_games(path: Path, number: int | None = None, instead: str = "") -> tuple[RecordedGame, ...]:
    """Read what is to be played again.

    Args:
        path: a PGN file, also one with several games; or a folder of a game of ours.
        number: of one game in the file, from 1; None: all.
        instead: what else may be done where a game cannot be played, beginning with a comma; "": nothing.

    Raises:
        ReplayError: it cannot be read, holds no game or not so many, or one that is no legal game of chess.
    """
    file = path / PGN_FILE if path.is_dir() else path
    try:
        with file.open(encoding="utf-8-sig", errors="replace") as stream:
            games = tuple(_read(stream, file, number, instead))
            stream.seek(0)
            there = 0 if games or number is None else sum(1 for _ in iter(partial(chess.pgn.skip_game, stream), False))
    except OSError as error:
        raise ReplayError(
            f"{file} cannot be read ({error.strerror}): give a PGN file or the folder of a game"
        ) from error
    if not games:
        if not there:
            raise ReplayError(f"{file} contains no game: give a PGN file or the folder of a game")
        only = "it has only one: leave --game out" if there == 1 else f"choose --game 1 to {there}"
        raise ReplayError(f"{file} has no game {number}: {only}")
    return games


def _read(stream: TextIO, file: Path, number: int | None, instead: str) -> Iterator[RecordedGame]:
    count = 0
    while True:
        if number is not None and count < number - 1:
            if not chess.pgn.skip_game(stream):
                return
            count += 1
            continue
        try:
            game = chess.pgn.read_game(stream, Visitor=_Builder)
        except (IndexError, ValueError) as error:  # python-chess's own, over text that is far from any PGN
            raise ReplayError(f"{file}, game {count + 1}, is not readable PGN: correct the file") from error
        if game is None:
            return
        count += 1
        yield _recorded(game, file, count, instead)
        if number is not None:
            return


logging.getLogger(chess.pgn.__name__).addHandler(logging.NullHandler())  # what it would print, errors tell
_UNSAID: Final = frozenset({"?", "????.??.??", "*"})
"""Headers of a game that has none."""


class _Game(chess.pgn.Game):
    """Remembers whether a result stood behind the moves, as PGN demands: without, the text may have been cut off."""

    ended = False


class _Builder(chess.pgn.GameBuilder[_Game]):
    """Of such games."""

    def __init__(self) -> None:
        super().__init__(Game=_Game)

    def visit_result(self, result: str) -> None:
        """The moves are over."""
        self.game.ended = True
        super().visit_result(result)


def _recorded(game: _Game, file: Path, count: int, instead: str) -> RecordedGame:
    moves = tuple(node.move for node in game.mainline())
    if not game.errors and not game.variations and all(value in _UNSAID for value in game.headers.values()):
        raise ReplayError(f"{file} contains no game: give a PGN file or the folder of a game")
    after = f"after {len(moves)} plies" if moves else "at its beginning"
    if wrong := _unplayable(game, moves, after):
        raise ReplayError(f"{file}, game {count}, {wrong}{instead}")
    headers = game.headers
    title = f"{headers.get('White', '?')} - {headers.get('Black', '?')}, {headers.get('Event', '?')}"
    cut = None if game.ended else f"{file}, game {count}, ends without a result {after}: it may have been cut off there"
    return RecordedGame(
        game.board(), moves, tuple(node.comment for node in game.mainline()),
        headers.get("White", "?"), headers.get("Black", "?"), title, _result(headers.get("Result", "*")),
        dict(headers), cut,
    )  # fmt: skip


def _unplayable(game: chess.pgn.Game, moves: tuple[chess.Move, ...], after: str) -> str | None:
    """Why the arm cannot play a game, with what to do; None: it can."""
    variant = game.headers.get("Variant", "")
    with contextlib.suppress(ValueError):  # of a variant that nobody knows
        if game.headers.variant() is chess.Board:
            variant = ""
    if variant:
        return f"is of the variant {variant}: only chess and Chess960 are supported: give such a game"
    if chess.Move.null() in moves:
        passed = moves.index(chess.Move.null()) + 1
        return f"ply {passed} passes, which chess does not allow: correct the file"
    if game.errors:
        return f"{after}: {game.errors[0]}: correct the file"
    if not game.board().is_valid():
        return f"does not begin with a legal position ({game.board().fen()}): correct the file"
    return None


def _result(text: str) -> Result:
    return next((one for one in RESULTS if one == text), "*")
