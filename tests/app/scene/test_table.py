"""Board and pieces as solids: each square where the table has it, pieces as tall and as broad as they are."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from app.scene.solids import Finish
from app.scene.table import COARSE, board_solids, piece_outline, piece_solids
from hardware.piece_set import PIECE_SHAPES, Colour, Kind, piece_profile
from hardware.table import TableSettings, square_place


@pytest.mark.parametrize("side", [0.040, 0.050])
def test_squares_lie_where_the_table_has_them(side: float) -> None:
    table = TableSettings(square=side)
    *squares, beneath = board_solids(table)
    assert len(squares) == 64
    for number, square in enumerate(squares):
        assert square.centre[:2] == table.xy(square_place(number))
        assert square.centre[2] + square.size[2] / 2.0 == pytest.approx(0.0)
        assert square.size[:2] == (side, side)
    assert squares[0].finish is Finish.DARK_SQUARE, "a1 is dark"
    assert squares[7].finish is Finish.LIGHT_SQUARE, "h1 is light"
    assert squares[63].finish is Finish.DARK_SQUARE
    assert beneath.size[0] >= 2.0 * table.half_play[0], "the trays stand on the table"
    assert beneath.centre[2] + beneath.size[2] / 2.0 < 0.0


@pytest.mark.parametrize("kind", Kind)
def test_a_coarse_outline_keeps_to_the_fine_one(kind: Kind) -> None:
    coarse = piece_outline(kind)
    assert len(coarse) < len(piece_profile(kind))
    rows = np.array(coarse)
    corners = np.array(piece_profile(kind))
    on_coarse = np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(rows)])
    for corner in corners[:-1]:
        assert np.hypot(*(on_coarse - corner).T).min() <= COARSE + 1e-4, "no corner is farther off than the tolerance"
    assert rows[:, 1].max() == pytest.approx(PIECE_SHAPES[kind].height, abs=0.1 * PIECE_SHAPES[kind].height)
    assert rows[0, 1] == 0.0


@pytest.mark.parametrize("kind", Kind)
def test_a_piece_is_a_stack_without_gaps_as_broad_as_its_foot(kind: Kind) -> None:
    shape = PIECE_SHAPES[kind]
    parts = piece_solids(kind, Colour.BLACK, 0.1)
    for below, on_top in pairwise(parts):
        assert on_top.start[2] == pytest.approx(below.end[2], abs=COARSE)
    radii = [part.radius for part in parts] + [part.end_radius or 0.0 for part in parts]
    assert max(radii) == pytest.approx(shape.foot_radius, abs=COARSE)
    assert parts[0].start[2] == pytest.approx(0.1)
    assert {part.finish for part in parts} == {Finish.BLACK_PIECE}
    assert {part.finish for part in piece_solids(kind, Colour.WHITE)} == {Finish.WHITE_PIECE}
