"""The verdict on a board: within a quarter square, upright, on the surface, nothing missing, nothing strange."""

from __future__ import annotations

import dataclasses
import math
import re

import chess
import pytest

from app.pieces.inventory import Inventory
from app.pieces.judging import judge
from app.pieces.layout import start_layout
from hardware.referee import PiecePose, Truth
from hardware.table import TableSettings, square_place

TABLE = TableSettings()
INVENTORY = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
PAWN = INVENTORY.at(square_place(chess.E2)).name


def truth(**changes: PiecePose) -> Truth:
    poses = {}
    for piece in INVENTORY:
        x, y = TABLE.xy(piece.place)
        poses[piece.name] = PiecePose(piece.name, x, y, 0.0, 0.0)
    poses.update(changes)
    return Truth(0, tuple(poses.values()), 0.0, 0.0, 0.0, "")


def moved(**by: float) -> Truth:
    pose = next(p for p in truth().pieces if p.name == PAWN)
    values = {name: getattr(pose, name) + value for name, value in by.items()}
    return truth(**{PAWN: dataclasses.replace(pose, **values)})


def test_the_set_up_board_is_right():
    verdict = judge(truth(), INVENTORY)
    assert verdict.ok
    assert set(verdict.errors.values()) == {0.0}


@pytest.mark.parametrize("x", [-0.0099, 0.0, 0.0099])
def test_a_quarter_square_is_allowed(x):
    verdict = judge(moved(x=x), INVENTORY)
    assert verdict.ok
    assert verdict.errors[PAWN] == pytest.approx(abs(x))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"x": 0.0101}, r"is 10\.1 mm from the centre of e2, at most 10 mm are allowed"),
        ({"x": 0.0072, "y": -0.0072}, r"is 10\.2 mm from the centre of e2"),
        ({"y": 0.08}, r"is 80\.0 mm from the centre of e2"),
        ({"tilt": math.pi / 2}, r"on e2 leans by 90°"),
        ({"tilt": math.radians(5.1)}, r"on e2 leans by 5°"),
        ({"z": 0.0021}, r"on e2 stands 2\.1 mm above the board"),
        ({"z": -0.5}, r"on e2 stands -500\.0 mm above the board"),
    ],
)
def test_one_wrong_piece_is_named(change, sentence):
    verdict = judge(moved(**change), INVENTORY)
    assert len(verdict.failures) == 1
    assert verdict.failures[0].startswith(PAWN)

    assert re.search(sentence, verdict.failures[0])


def exchanged(*squares: int) -> Truth:
    """Each of these stands where the next one should."""
    pieces = [INVENTORY.at(square_place(square)) for square in squares]
    changes = {}
    for piece, other in zip(pieces, pieces[1:] + pieces[:1], strict=True):
        assert piece is not None
        assert other is not None
        x, y = TABLE.xy(other.place)
        changes[piece.name] = PiecePose(piece.name, x + 0.003, y, 0.0, 0.0)
    return truth(**changes)


def test_pieces_alike_may_have_changed_places():
    for squares in ((chess.E2, chess.F2), (chess.B1, chess.G1), (chess.A7, chess.C7, chess.H7)):
        verdict = judge(exchanged(*squares), INVENTORY)
        assert verdict.ok
        assert verdict.errors[INVENTORY.at(square_place(squares[0])).name] == pytest.approx(0.003)
    for squares in ((chess.E2, chess.E7), (chess.B1, chess.C1), (chess.A2, chess.B2, chess.A1)):
        assert not judge(exchanged(*squares), INVENTORY).ok


def test_a_pawn_on_anothers_square_leaves_its_own_empty():
    x, y = TABLE.xy(square_place(chess.E4))
    verdict = judge(truth(**{PAWN: PiecePose(PAWN, x, y, 0.0, 0.0)}), INVENTORY)
    assert len(verdict.failures) == 1
    assert verdict.failures[0].startswith(f"{PAWN} is 80.0 mm from the centre of e2")


def test_a_piece_that_should_not_be_there_or_is_missing_is_named():
    stranger = PiecePose("thimble", 0.0, 0.0, 0.0, 0.0)
    assert judge(truth(thimble=stranger), INVENTORY).failures == ("thimble is unknown to the game",)
    without = Truth(0, tuple(p for p in truth().pieces if p.name != PAWN), 0.0, 0.0, 0.0, "")
    assert judge(without, INVENTORY).failures == (f"{PAWN} should be on e2 but does not exist",)


def test_a_fallen_piece_in_a_tray_is_named_too():
    spare = next(piece for piece in INVENTORY if not piece.place.on_board)
    x, y = TABLE.xy(spare.place)
    verdict = judge(truth(**{spare.name: PiecePose(spare.name, x, y, 0.0, 1.0)}), INVENTORY)
    assert verdict.failures == (f"{spare.name} on {spare.place} leans by 57°",)
