"""What stands where on a table that was found: what is seen there, no place twice, nothing free that may be taken."""

from __future__ import annotations

import chess
import numpy as np
import pytest

from app.measure.bench.vision.positions import random_board
from app.pieces.found_layout import found_layout
from app.pieces.layout import start_layout
from hardware.piece_set import Colour, Kind
from hardware.table import Captured, Place, TableSettings

TABLE = TableSettings()


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("captured", Captured)
def test_a_table_that_was_set_up_is_found_as_it_is_however_little_is_seen(seed: int, captured: Captured) -> None:
    table = TABLE.model_copy(update={"captured": captured})
    board = random_board(seed)
    stands = start_layout(board, table)
    rng = np.random.default_rng(seed)
    trays = {piece.place: (piece.colour, piece.kind) for piece in stands if piece.place.in_tray}
    seen = {place: look for place, look in trays.items() if rng.random() < 0.6}
    free = {place for place in table.tray_places() if place not in trays and rng.random() < 0.6}
    found = found_layout(board, seen, free, table)
    found.check_against(board)
    assert {piece.name: piece.place for piece in found} == {piece.name: piece.place for piece in stands}


@pytest.mark.parametrize("seed", range(20))
def test_trays_filled_anyhow_are_taken_as_they_are_seen(seed: int) -> None:
    rng, board = np.random.default_rng(seed), random_board(seed)
    places = list(TABLE.tray_places())
    off = [piece for piece in start_layout(board, TABLE) if piece.place.in_tray and rng.random() < 0.7]
    chosen = rng.permutation(len(places))[: len(off)]
    really = {places[i]: (piece.colour, piece.kind) for i, piece in zip(chosen.tolist(), off, strict=True)}
    seen = {place: look for place, look in really.items() if rng.random() < 0.7}
    free = {place for place in places if place not in really and rng.random() < 0.7}
    found = found_layout(board, seen, free, TABLE)
    found.check_against(board)
    for place, (colour, kind) in seen.items():
        piece = found.at(place)
        assert piece is not None
        assert (piece.colour, piece.kind) == (colour, kind)
    assert all(found.at(place) is None for place in free)
    if len(list(found)) < 50:  # all of the set has a place, or no place is left that nobody sees
        assert all(found.at(place) is not None for place in places if place not in free)


def test_more_of_a_kind_than_there_are_is_refused_by_name() -> None:
    board = chess.Board("4k3/8/8/8/8/QQQ5/QQ6/4K3 w - - 0 1")
    with pytest.raises(Exception, match="5 white queens"):
        found_layout(board, {}, frozenset(), TABLE)


def test_what_is_in_doubt_is_not_lost() -> None:
    seen = {Place.parse("L1"): (Colour.WHITE, Kind.QUEEN), Place.parse("R24"): (Colour.BLACK, Kind.PAWN)}
    found = found_layout(chess.Board("4k3/8/8/8/8/8/8/4K3 w - - 0 1"), seen, frozenset(), TABLE)
    assert {str(place): (found.at(place).colour, found.at(place).kind) for place in seen} == {  # type: ignore[union-attr]
        "L1": (Colour.WHITE, Kind.QUEEN), "R24": (Colour.BLACK, Kind.PAWN),
    }  # fmt: skip
