"""What makes way for a piece that is to be stood up, and where it goes."""

from __future__ import annotations

import math

import chess
import numpy as np
import pytest

from app.execution.recovery_plans import in_order, plan_making_way
from app.motion import MotionSettings, Planner
from app.motion.plan import Plan, PlanRefused
from app.pieces.inventory import Inventory, Transfer
from app.pieces.layout import start_layout
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES
from hardware.table import Place, TableSettings
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.poses import Pose

TABLE = TableSettings()
INVENTORY = Inventory.of(start_layout(chess.Board("4k3/8/8/8/3P4/4N3/8/4K3 w - - 0 1"), TABLE), TABLE)


def stray(square: str, at: str, yaw: float | None, off: tuple[float, float] = (0.0, 0.0)) -> MisplacedPiece:
    """The piece of a square, seen elsewhere."""
    piece = INVENTORY.at(Place.parse(square))
    assert piece is not None
    x, y = TABLE.xy(Place.parse(at))
    return MisplacedPiece(piece, piece.place, Pose(x + off[0], y + off[1], yaw))


def way(blocks: str, *misplaced: MisplacedPiece) -> tuple[Transfer, Plan]:
    home = np.array(MotionSettings().home)
    return plan_making_way(
        Planner.of(MotionSettings(), load_parameters(), INVENTORY.table, home, 0.02), blocks, misplaced, INVENTORY
    )


KNIGHT = next(piece.name for piece in INVENTORY if str(piece.place) == "e3")
LIES = stray("d4", "g6", 0.4)


def test_pieces_that_lie_come_first() -> None:
    stands = stray("e3", "c6", None)
    assert in_order([stands, LIES]) == [LIES, stands]


def test_a_piece_on_its_square_goes_to_a_free_one_clear_of_what_lies() -> None:
    transfer, plan = way(KNIGHT, LIES)
    assert (str(transfer.source), transfer.seen) == ("e3", None)
    assert INVENTORY.at(transfer.target) is None
    assert math.dist(TABLE.xy(transfer.target), (LIES.pose.x, LIES.pose.y)) > 0.1
    assert plan.motions


def test_a_piece_that_strayed_itself_goes_where_it_belongs_from_where_it_is_seen() -> None:
    knight = stray("e3", "b6", None, (0.004, -0.006))
    transfer, _ = way(KNIGHT, LIES, knight)
    assert (str(transfer.target), transfer.seen) == ("e3", (knight.pose.x, knight.pose.y))


def test_where_something_lies_near_its_square_it_goes_elsewhere() -> None:
    near, knight = stray("d4", "e4", 1.0), stray("e3", "b6", None)
    transfer, _ = way(KNIGHT, near, knight)
    assert str(transfer.target) != "e3"
    assert transfer.seen == (knight.pose.x, knight.pose.y)
    assert math.dist(TABLE.xy(transfer.target), (near.pose.x, near.pose.y)) > 0.1


def test_a_piece_that_lies_makes_no_way() -> None:
    with pytest.raises(
        PlanRefused, match=f"^{KNIGHT}, which is in the way, has fallen over too: take it off the board$"
    ):
        way(KNIGHT, LIES, stray("e3", "c6", 0.0))


def test_over_something_that_lies_beside_it_a_piece_is_taken_higher() -> None:
    """The king's foot is lower than the fingers get there on the bishop beside it, if they take that by its head."""
    board = chess.Board("4k3/8/8/8/8/8/8/2B1K3 w - - 0 1")
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    king, bishop = (inventory.at(Place.parse(square)) for square in ("e1", "c1"))
    assert king is not None
    assert bishop is not None
    x, y = TABLE.xy(bishop.place)
    lies = MisplacedPiece(king, king.place, Pose(x + 0.022, y, 0.0))
    home = np.array(MotionSettings().home)
    transfer, plan = plan_making_way(
        Planner.of(MotionSettings(), load_parameters(), inventory.table, home, 0.02), bishop.name, [lies], inventory
    )
    shape = PIECE_SHAPES[bishop.kind]
    assert 0.0 < transfer.raised < shape.height - shape.grip_height
    grasp = plan.motions[1].samples["position"][-1]
    usual = Transfer.of(bishop, transfer.target)
    lower = Planner.of(MotionSettings(), load_parameters(), inventory.table, home, 0.02).ply("", [usual], inventory)
    assert lower.motions[1].samples["position"][-1][2] - grasp[2] == pytest.approx(transfer.raised, abs=1e-6)
