"""Puzzles from a file: set up, played out, and the person told whether a move is right."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import chess

from app import UserError
from app.execution.state import LEFT
from app.players.advice import Advice, TakingBack
from app.players.game_end import GameEnd
from app.records.recorded_games import recorded_games

MOST: Final = 100_000
"""Puzzles of one file; the whole collection of Lichess, millions of them, is cut down before."""


class PuzzleError(UserError):
    """There is no puzzle in a file, or one that cannot be played."""


@dataclass(frozen=True, slots=True)
class Puzzle:
    """A position and its solution.

    Attributes:
        name: for people.
        board: what is set up.
        line: all moves from there on, of both sides.
        person: who solves it.
    """

    name: str
    board: chess.Board
    line: tuple[chess.Move, ...]
    person: chess.Color

    def concluded(self, board: chess.Board, end: GameEnd) -> GameEnd:
        """How a game of it has ended: solved, or not, and then what would have solved it.

        Args:
            board: the last position, with its moves.
            end: of the game, by the rules or by those who played; one that is left, or failed, stays as it is.
        """
        if end is LEFT or end.kept or not end.complete:
            return end
        mates = board.is_checkmate() and board.turn is not self.person
        if mates or tuple(board.move_stack[-len(self.line) :]) == self.line:
            how = f": {end.reason}" if board.is_game_over() else ""
            return replace(end, reason=f"{self.name} is solved{how}")
        right = self.board.variation_san(self.line)
        return replace(end, reason=f"{self.name} is not solved ({end.reason}): right was {right}")


class PuzzleAdviser:
    """``Adviser`` that knows the solution: a wrong move is taken back; any mate counts as right, as at Lichess."""

    def __init__(self, puzzle: Puzzle) -> None:
        self._puzzle = puzzle

    def judge(self, board: chess.Board, move: chess.Move) -> Advice | None:
        """See ``Adviser``."""
        line = self._puzzle.line
        done = board.ply() - self._puzzle.board.ply()
        right = done < len(line) and move == line[done]
        san, after = board.san(move), board.copy()
        after.push(move)
        if after.is_checkmate():
            return Advice(f"{san} is mate: solved")
        if not right:
            return Advice(f"{san} is not the solution: try again", TakingBack.NEEDED)
        return Advice(f"{san} is right" + (": solved" if done >= len(line) - 1 else "; go on"))


def puzzles_of(path: Path) -> tuple[Puzzle, ...]:
    """Read puzzles: a CSV as Lichess publishes it (columns ``FEN`` and ``Moves``, in UCI; the first move is the
    opponent's), or a PGN file, in which each game is one, with the side to move to solve it.

    Raises:
        PuzzleError: it cannot be read, holds none, or one that cannot be played.
        ReplayError: a PGN file cannot be read.
    """
    found = tuple(_of_csv(path)) if path.suffix.lower() == ".csv" else tuple(_of_pgn(path))
    if not found:
        raise PuzzleError(f"{path} contains no puzzle: give a CSV file with the columns FEN and Moves, or a PGN file")
    return found


def puzzles_from(path: Path, first: int, count: int) -> tuple[Puzzle, ...]:
    """At most so many puzzles of a file, beginning with one (from 1).

    Raises:
        PuzzleError: as ``puzzles_of``, or the file has no such puzzle.
        ReplayError: as ``puzzles_of``.
    """
    found = puzzles_of(path)
    if first > len(found):
        raise PuzzleError(f"{path} has no puzzle {first}: choose 1 to {len(found)}")
    return found[first - 1 : first - 1 + count]


def _of_pgn(path: Path) -> Iterator[Puzzle]:
    for number, game in enumerate(recorded_games(path), start=1):
        if not game.moves:
            raise PuzzleError(f"{path}, game {number}, has no moves: a puzzle needs its solution")
        yield Puzzle(f"puzzle {number}", game.board, game.moves, game.board.turn)


def _of_csv(path: Path) -> Iterator[Puzzle]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = csv.DictReader(stream)
            names = {name.lower(): name for name in rows.fieldnames or ()}
            if not {"fen", "moves"} <= set(names):
                columns = ", ".join(rows.fieldnames or ()) or "none"
                raise PuzzleError(
                    f"{path} needs the columns FEN and Moves, and has {columns}: add a line that names them"
                )
            for number, row in enumerate(rows, start=1):
                if number > MOST:
                    raise PuzzleError(f"{path} holds more than {MOST} puzzles: keep some of its lines")
                name = row.get(names.get("puzzleid", "")) or str(number)
                yield _puzzle(path, number, name, row[names["fen"]] or "", row[names["moves"]] or "")
    except OSError as error:
        raise PuzzleError(f"{path} cannot be read ({error.strerror}): give a CSV or a PGN file with puzzles") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise PuzzleError(f"{path} is not a CSV file in UTF-8 ({error}): give a CSV or a PGN file") from error


def _puzzle(path: Path, number: int, name: str, fen: str, moves: str) -> Puzzle:
    """One row: the opponent has the first move."""
    where = f"{path}, puzzle {number}"
    try:
        board = chess.Board(fen)
    except ValueError as error:
        raise PuzzleError(f"{where}, does not begin with a position ({error}): correct the file") from error
    if not board.is_valid():
        raise PuzzleError(f"{where}, does not begin with a legal position ({fen}): correct the file")
    position, line = board.copy(), list[chess.Move]()
    for uci in moves.split():
        move = _legal(position, uci)
        if move is None:
            raise PuzzleError(f"{where}, ply {len(line) + 1}, '{uci[:20]}', is not a legal move: correct the file")
        position.push(move)
        line.append(move)
    if len(line) < 2:
        raise PuzzleError(f"{where}, needs a move of the opponent and a solution: correct the file")
    return Puzzle(f"puzzle {name}", board, tuple(line), not board.turn)


def _legal(board: chess.Board, uci: str) -> chess.Move | None:
    """The move; None: it is none that is legal."""
    try:
        return board.parse_uci(uci) or None  # python-chess reads a null move, too, and that is no move here
    except ValueError:
        return None
