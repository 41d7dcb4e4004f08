"""Openings by name: of a position, however it came about."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import chess

TABLE: Final = Path(__file__).with_name("openings.tsv")


class Opening(NamedTuple):
    """An opening's code in the Encyclopaedia of Chess Openings, and its name."""

    eco: str
    name: str


@cache
def openings() -> Mapping[str, Opening]:
    """All openings with a name, by the EPD of the position that they lead to."""
    found = {}
    for line in TABLE.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            position, eco, name = line.split("\t")
            found[position] = Opening(eco, name)
    return found


def opening_of(board: chess.Board) -> Opening | None:
    """Name of a position; None: it has none of its own."""
    return openings().get(board.epd())


def opening_of_game(board: chess.Board) -> tuple[Opening, int] | None:
    """Of a game: the last of its positions that has a name, and after how many plies it stood; None: none has one.

    ``board`` is the position at the end with the moves that led to it, and is left as it is.
    """
    board = board.copy()
    while True:
        if (found := opening_of(board)) is not None:
            return found, len(board.move_stack)
        if not board.move_stack:
            return None
        board.pop()
