"""What stands where on a table that was found, not set up: pieces of the set for what is seen on the board and beside.

Trays are seen badly: the picture's edges cut them, and pieces there hide each other. As far as what is seen allows they
are taken to hold what they would if this position had been set up. No place that may be taken counts as free.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set

import chess

from app.pieces.inventory import Inventory
from app.pieces.layout import SetPiece, physical_set, pieces_on_squares, start_layout
from hardware.piece_set import Kind, Look
from hardware.table import Captured, PieceSpec, Place, TableSettings


def found_layout(board: chess.Board, beside: Mapping[Place, Look], free: Set[Place], table: TableSettings) -> Inventory:
    """Take stock.

    Args:
        board: the position; it is not changed.
        beside: what stands on places of the trays, as far as that is known.
        free: places of the trays where nothing stands. Anything may be on the other ones.
        table: board and trays.

    Raises:
        UserError: as of ``start_layout``.
    """
    usual = [start_layout(board, table)]
    if table.captured is Captured.TRAY:  # the position may have been made with fewer pieces than a game's
        usual.append(start_layout(board, table.model_copy(update={"captured": Captured.BOX})))
    for layout in usual:
        if _agrees(layout, beside, free):
            return Inventory.of(layout, table)
    return Inventory.of(_as_seen(board, beside, free, table, usual[0]), table)


def _agrees(layout: Iterable[PieceSpec], beside: Mapping[Place, Look], free: Set[Place]) -> bool:
    trays = {piece.place: (piece.colour, piece.kind) for piece in layout if piece.place.in_tray}
    return not free & trays.keys() and all(trays.get(place) == look for place, look in beside.items())


def _as_seen(
    board: chess.Board, beside: Mapping[Place, Look], free: Set[Place], table: TableSettings, usual: Sequence[PieceSpec]
) -> list[PieceSpec]:
    """What is seen where it is seen; on the places that nobody sees what would be there, or else anything that is left:
    that they count as taken keeps other pieces away.
    """
    placed: dict[SetPiece, Place] = pieces_on_squares(board, physical_set())
    would = {piece.place: (piece.colour, piece.kind) for piece in usual}
    unseen = [place for place in table.tray_places() if place not in beside and place not in free]
    wanted = [*beside.items(), *((place, would[place]) for place in unseen if place in would)]
    for place, look in wanted:
        spare = _left(placed, look)
        if spare is not None:
            placed[spare] = place
    for place in unseen:
        if place not in placed.values() and (spare := _left(placed)) is not None:
            placed[spare] = place
    return [PieceSpec(piece.name, piece.kind, piece.colour, place) for piece, place in placed.items()]


def _left(placed: Mapping[SetPiece, Place], look: Look | None = None) -> SetPiece | None:
    """Of the set's pieces that have no place yet, one that looks so; spares first."""
    left = [piece for piece in physical_set() if piece not in placed and piece.kind is not Kind.KING]
    alike = [piece for piece in left if look is None or (piece.colour, piece.kind) == look]
    return min(alike, key=lambda piece: piece.home is not None, default=None)
