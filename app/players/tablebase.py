"""Endgames by Syzygy's tables: how a position with few men ends, and what to play in it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Final, Literal, Self

import chess
import chess.syzygy

from app import UserError

FIFTY_MOVES: Final = 100
"""Plies without capture or move of a pawn, after which a draw can be claimed."""
_WIN: Final = 2
"""Of python-chess: a win that the fifty-move rule does not spoil."""


TableResult = Literal["1-0", "0-1", "1/2-1/2"]
"""As in PGN."""


class TablebaseError(UserError):
    """A folder that holds no tables, or files that are none."""


class Tablebase:
    """Tables in a folder. A context manager.

    Only positions whose table is there are known, and none in which a side may castle.
    """

    def __init__(self, folder: Path) -> None:
        """Open the tables; raises ``TablebaseError`` if there are none."""
        self._folder = folder
        self._tables = chess.syzygy.Tablebase()
        try:
            found = self._tables.add_directory(str(folder))
        except OSError as error:
            raise TablebaseError(
                f"{folder} cannot be read ({error.strerror}): name the folder of the tables"
            ) from error
        if not found:
            raise TablebaseError(f"{folder} contains no Syzygy tables (*.rtbw, *.rtbz): name the folder that does")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._tables.close()

    def result(self, board: chess.Board) -> TableResult | None:
        """How the game ends if both sides play their best; None: the tables do not know, or the fifty-move rule may
        come before a win.

        Raises:
            TablebaseError: a file cannot be read.
        """
        with suppress(KeyError):  # a table is missing
            wdl = self._wdl(board)
            if abs(wdl) < _WIN:
                return "1/2-1/2"
            if abs(self._dtz(board)) + board.halfmove_clock <= FIFTY_MOVES:
                return "1-0" if (wdl > 0) is board.turn else "0-1"
        return None

    def best(self, board: chess.Board) -> chess.Move | None:
        """What to play: keeps what can be had, and wins without delay, or loses as late as can be; None: unknown.

        Raises:
            TablebaseError: a file cannot be read.
        """
        with suppress(KeyError):  # a table is missing
            return max(board.legal_moves, key=lambda move: self._worth(board, move), default=None)
        return None

    def _worth(self, board: chess.Board, move: chess.Move) -> tuple[int, bool, int]:
        after = board.copy()
        after.push(move)
        if after.is_checkmate():
            return _WIN + 1, True, 0
        wdl = -self._wdl(after)
        if after.halfmove_clock == 0:  # a capture or a pawn's move begins the count of the rule anew
            return wdl, wdl > 0, 0
        dtz = abs(self._dtz(after)) if wdl else 0
        return wdl, False, -dtz if wdl > 0 else dtz

    def _wdl(self, board: chess.Board) -> int:
        try:
            return self._tables.probe_wdl(board)
        except OSError as error:
            raise TablebaseError(f"a table in {self._folder} is damaged ({error}): fetch it again") from error

    def _dtz(self, board: chess.Board) -> int:
        try:
            return self._tables.probe_dtz(board)
        except OSError as error:
            raise TablebaseError(f"a table in {self._folder} is damaged ({error}): fetch it again") from error
