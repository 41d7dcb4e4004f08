"""How pieces stand in pictures for benches: each off its place and turned, as a person would put it down."""

from __future__ import annotations

import math
from collections.abc import Mapping

import chess
import numpy as np

from app.pieces.layout import start_layout
from hardware.sim.process.table_studio import PlacedPiece
from hardware.table import Place, TableSettings


class RandomTable:
    """A set of pieces on board and trays, set up by hand.

    Args:
        table: board and trays.
        off: pieces are put down up to so far off along both axes [m].
        seed: decides how each piece is put down.

    Attributes:
        poses: how each piece stands, by name.
    """

    def __init__(self, table: TableSettings, off: float, seed: int) -> None:
        self.poses: Mapping[str, PlacedPiece] = {}
        self._places: Mapping[str, Place] = {}
        self._table, self._off = table, off
        self._rng = np.random.default_rng([seed, 77])

    def set(self, board: chess.Board) -> None:
        """Set up a position: what stands on its place stays untouched, everything else is put down anew."""
        specs = start_layout(board, self._table)
        self.poses = {
            piece.name: self.poses[piece.name]
            if self._places.get(piece.name) == piece.place
            else self.put_down(piece.name, piece.place)
            for piece in specs
        }
        self._places = {piece.name: piece.place for piece in specs}

    def put_down(self, name: str, place: Place) -> PlacedPiece:
        """A piece as somebody puts it on a place."""
        x, y = self._table.xy(place)
        dx, dy = self._rng.uniform(-self._off, self._off, 2).tolist()
        return PlacedPiece(name, x + dx, y + dy, yaw=float(self._rng.uniform(-math.pi, math.pi)))

    def standing_on(self, square: chess.Square) -> str | None:
        """Name of the piece on a square."""
        place = Place("board", square)
        return next((name for name, where in self._places.items() if where == place), None)
