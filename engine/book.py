"""Opening books in Polyglot's format: 16 bytes an entry, sorted by the position's hash.

Format: http://hgm.nubati.net/book_format.html, read by python-chess.
"""

import random
from pathlib import Path
from typing import Final, Self

import chess
import chess.polyglot
import numpy as np
from pydantic import BaseModel, ConfigDict, PositiveInt

from engine.errors import BookBroken

_ENTRY: Final = 16
"""Size of an entry [bytes]; the first 8 are the hash, big end first."""


class BookSettings(BaseModel):
    """Which book, and how far it is followed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: Path
    max_plies: PositiveInt
    """Plies from the start of the game in which it is asked."""
    min_weight: PositiveInt = 1
    """Moves of less weight are left out; 0 marks moves that must not be played."""


class Book:
    """An open book; a context manager.

    A move is drawn by weight. The draw depends on seed and position alone, so that a game that is resumed, or a move
    that was taken back, meets the same book.
    """

    def __init__(self, settings: BookSettings, seed: int = 0) -> None:
        """Open the book; raises ``BookBroken`` if it is not there or no Polyglot book."""
        _check(settings.path)
        self._settings = settings
        self._seed = seed
        self._reader = chess.polyglot.open_reader(settings.path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._reader.close()

    def move(self, board: chess.Board) -> chess.Move | None:
        """A legal move of the book in this position; None when it has none, or the opening is over."""
        if board.ply() >= self._settings.max_plies:
            return None
        entries = list(self._reader.find_all(board, minimum_weight=self._settings.min_weight))
        if not entries:
            return None
        rng = random.Random(f"{self._seed} {chess.polyglot.zobrist_hash(board)}")
        return rng.choices(entries, [entry.weight for entry in entries])[0].move


def _check(path: Path) -> None:
    """See that the file is a book: whole entries, sorted."""
    remedy = "name a book in Polyglot's format (often .bin), or leave it out"
    try:
        size = path.stat().st_size
        if size == 0 or size % _ENTRY:
            raise BookBroken(
                f"{path} is not an opening book, its {size} bytes are not whole entries of {_ENTRY}: {remedy}"
            )
        hashes = np.memmap(path, dtype=">u8", mode="r")[::2]
    except OSError as error:
        raise BookBroken(f"opening book {path} cannot be read: {error.strerror}: {remedy}") from error
    if np.any(hashes[1:] < hashes[:-1]):
        raise BookBroken(f"{path} is not an opening book, its entries are not sorted: {remedy}")
