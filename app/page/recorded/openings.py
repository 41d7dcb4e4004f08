"""Openings by name: of a position, however it came about."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import chess

TABLE: Final = Path(__file__).parents[1] / "openings" / "openings.tsv"


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
