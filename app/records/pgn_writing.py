"""The game as PGN, whole on the disk after every ply."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import chess
import chess.engine
import chess.pgn

from app.players.game_end import Result
from app.records.files import write_atomically

EVENT = "Touchmove"


class PgnMove(NamedTuple):
    """A move for PGN: UCI; what its player's clock shows after it [s]; what an engine thinks of it; a comment."""

    uci: str
    clock: float | None = None
    score: chess.engine.PovScore | None = None
    comment: str = ""


class PgnFile:
    """A PGN file that grows by plies; each change replaces the file atomically."""

    def __init__(
        self, path: Path, board: chess.Board, *, white: str, black: str, site: str, date: datetime,
        moves: Sequence[PgnMove] = (), time_control: str | None = None,
    ) -> None:  # fmt: skip
        """Write the game so far.

        Args:
            path: the file.
            board: the position at the start; FEN and SetUp (and Variant for Chess960) are written when it needs them.
            white: name of the player.
            black: name of the player.
            site: where it is played.
            date: day of the start, UTC.
            moves: made already.
            time_control: as in PGN; None: none.

        Raises:
            RecordError: it cannot be written.
        """
        self.path = path
        self.board = board.copy(stack=False)
        self._game = chess.pgn.Game()
        self._game.setup(self.board)
        values = {"Event": EVENT, "Site": site, "Date": date.strftime("%Y.%m.%d"), "White": white, "Black": black}
        if time_control is not None:
            values["TimeControl"] = time_control
        self._set(values)
        self._last: chess.pgn.GameNode = self._game
        for move in moves:
            self._push(move)
        self._write()

    def add(self, move: PgnMove) -> None:
        """Append a move and rewrite the file.

        Raises:
            ValueError: the move is not legal (of python-chess).
            RecordError: it cannot be written; the file holds the plies before.
        """
        self._push(move)
        self._write()

    def change_sides(self) -> None:
        """Who had White has Black from now on, and the game's result counts so; rewrite the file.

        Raises:
            RecordError: it cannot be written.
        """
        headers = self._game.headers
        headers["White"], headers["Black"] = headers["Black"], headers["White"]
        self._write()

    def take_back(self, plies: int) -> None:
        """Drop the last moves and rewrite the file.

        Raises:
            IndexError: there are not so many.
            RecordError: it cannot be written.
        """
        for _ in range(plies):
            self.board.pop()
            before = self._last.parent
            assert before is not None
            before.variations.clear()
            self._last = before
        self._write()

    def _push(self, move: PgnMove) -> None:
        made = self.board.parse_uci(move.uci)
        self._last = self._last.add_variation(made)
        self.board.push(made)
        self._last.comment = move.comment
        if move.clock is not None:
            self._last.set_clock(move.clock)
        if move.score is not None:
            self._last.set_eval(move.score)

    def finish(self, result: Result, reason: str) -> None:
        """Write result and termination.

        Raises:
            RecordError: it cannot be written; the file holds all plies.
        """
        self._set({"Result": result, "Termination": reason})
        self._write()

    def _set(self, values: dict[str, str]) -> None:
        for name, value in values.items():  # PGN has one line a header, and readers differ on quotes within
            self._game.headers[name] = " ".join(value.split()).replace('"', "'")

    def _write(self) -> None:
        exporter = chess.pgn.StringExporter(columns=80, headers=True, variations=False, comments=True)
        write_atomically(self.path, self._game.accept(exporter) + "\n")
