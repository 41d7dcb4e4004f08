"""Pieces that were seen off the centre of their place: grasped where they stand, and kept clear of until then."""

from __future__ import annotations

import math

import chess
import numpy as np
import pytest

from app.measure.bench.beds.bed import LEAD, Bed
from app.motion import MotionSettings, Plan, Planner, PlanRefused
from app.pieces.inventory import Inventory, InventoryError, Transfer
from app.pieces.layout import start_layout
from app.play.hand_moves import hand_transfers
from controller.protocol import Guard
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings, square_place

TABLE, PARAMETERS, MOTION = TableSettings(), load_parameters(), MotionSettings()
HOME = np.array(MOTION.home)
BOARD = chess.Board("4k3/8/8/3p4/3N4/8/4P3/R3K3 w - - 0 1")


def stock(board: chess.Board = BOARD) -> Inventory:
    return Inventory.of(start_layout(board, TABLE), TABLE)


def moved(now: Inventory, source: chess.Square, target: chess.Square, off: tuple[float, float]) -> Transfer:
    """Of the piece on a square, seen so far off its centre."""
    piece = now.at(square_place(source))
    assert piece is not None
    x, y = TABLE.xy(piece.place)
    return Transfer.of(piece, square_place(target), (x + off[0], y + off[1]))


def planned(now: Inventory, *plan: Transfer) -> Plan:
    return Planner.of(MOTION, PARAMETERS, now.table, HOME, 0.01, LEAD).ply("seen", plan, now)


def end(plan: Plan, motion: int) -> list[float]:
    place: list[float] = TABLE.board_from_base(plan.motions[motion].samples["position"][-1]).tolist()
    return place


def test_a_piece_is_set_right_on_its_own_place_only_where_it_was_seen_elsewhere() -> None:
    now = stock()
    right = moved(now, chess.D4, chess.D4, (0.008, 0.0))
    assert now.moved(right) == now
    with pytest.raises(InventoryError, match="cannot go to d4"):
        now.moved(Transfer(right.name, right.kind, right.colour, right.source, right.target))
    with pytest.raises(InventoryError, match="should stand on d3"):
        now.moved(Transfer(right.name, right.kind, right.colour, square_place(chess.D3), right.target, right.seen))


@pytest.mark.parametrize("angle", [0.0, 0.8, 0.5 * math.pi, 3.5])
@pytest.mark.parametrize("off", [0.0004, 0.0012, 0.020])
def test_fingers_go_to_where_a_piece_was_seen_and_the_piece_to_the_centre(off: float, angle: float) -> None:
    now = stock()
    for target in (chess.D4, chess.F6):
        transfer = moved(now, chess.D4, target, (off * math.cos(angle), off * math.sin(angle)))
        plan = planned(now, transfer)
        grip = PIECE_SHAPES[transfer.kind].grip_height
        assert transfer.seen is not None
        np.testing.assert_allclose(end(plan, 0), [*transfer.seen, grip], atol=1e-9)
        np.testing.assert_allclose(end(plan, 2)[:2], TABLE.xy(transfer.target), atol=1e-9)
        guarded = plan.motions[2].samples["guard"] == Guard.TOUCH
        assert (plan.motions[2].samples["velocity"][guarded][:-1, 2] > 0.0).all(), "down on to the board"


def test_the_next_piece_of_a_plan_is_fetched_from_where_it_was_seen() -> None:
    now = stock()
    first, second = moved(now, chess.A1, chess.A1, (0.0, 0.007)), moved(now, chess.D4, chess.C6, (-0.009, 0.004))
    plan = planned(now, first, second)
    assert second.seen is not None
    np.testing.assert_allclose(end(plan, 3), [*second.seen, PIECE_SHAPES[second.kind].grip_height], atol=1e-9)


def test_a_piece_that_leans_towards_a_neighbour_is_in_its_way_until_it_is_set_right() -> None:
    """Two rooks' feet, 25 mm from centre to centre: no room for a finger between them."""
    board = chess.Board("4k3/8/8/8/3RR3/8/8/4K3 w - - 0 1")
    now = stock(board)
    towards = moved(now, chess.D4, chess.D4, (0.015, 0.0))
    away = moved(now, chess.E4, chess.E8 - 8, (0.0, 0.0))
    planned(now, away)
    planned(now, towards, away)
    with pytest.raises(PlanRefused, match=r"at e4 the fingers, 7\.6 mm open, would touch the rook on d4"):
        planned(now, away, moved(now, chess.D4, chess.D4, (0.017, 0.0)))
    with pytest.raises(PlanRefused, match=r"at d4 the fingers, 7\.6 mm open, would touch the rook on e4"):
        planned(now, moved(now, chess.D4, chess.D4, (0.017, 0.0)), away)


def test_what_is_carried_passes_over_a_piece_where_it_was_seen() -> None:
    """A king half way between two empty squares is in the way of what is carried past, and was not on its square."""
    board = chess.Board("8/8/8/4k3/8/8/8/3RK3 w - - 0 1")
    now = stock(board)
    king, rook = moved(now, chess.E5, chess.E5, (-0.02, 0.0)), moved(now, chess.D1, chess.D1, (0.0, 0.0))
    past = Transfer(rook.name, rook.kind, rook.colour, rook.source, square_place(chess.D8))
    assert king.seen is not None
    x, y = king.seen
    reach = PIECE_SHAPES[king.kind].foot_radius + PIECE_SHAPES[rook.kind].foot_radius

    def height(plan: Plan) -> float:
        way = TABLE.board_from_base(plan.motions[2].samples["position"])
        near = np.hypot(way[:, 0] - x, way[:, 1] - y) < reach
        return float(way[near, 2].min(initial=1.0)) - PIECE_SHAPES[rook.kind].grip_height

    needed = PIECE_SHAPES[king.kind].height + 0.9 * MOTION.clearance
    assert height(planned(now, past, king)) >= needed
    assert height(planned(now, past)) < needed


def test_a_hand_takes_a_piece_where_it_was_seen() -> None:
    transfer = moved(stock(), chess.D4, chess.C6, (0.01, -0.003))
    (action,) = hand_transfers([transfer], TABLE)
    assert action.start == transfer.seen
    assert action.to == TABLE.xy(transfer.target)


@pytest.mark.slow
@pytest.mark.parametrize("off", [(0.012, 0.0), (-0.008, 0.011)])
def test_the_arm_sets_pieces_right(off: tuple[float, float]) -> None:
    """In the simulated world: farther off than fingers that go to the centre could close on."""
    now = stock()
    plan = [moved(now, square, square, off) for square in (chess.D4, chess.E1)]
    plan.append(moved(now, chess.D5, chess.G6, off))
    seen = {transfer.name: transfer.seen for transfer in plan}
    standing = [StandingPiece(p, *(seen.get(p.name) or TABLE.xy(p.place)), 0.3) for p in now]
    plant = Plant(build_model(PARAMETERS, TABLE, standing, HOME), PARAMETERS, tuple(p.name for p in now))
    bed = Bed(plant, TABLE, MOTION)
    arm = bed.planner().ply("set right", plan, now)
    bed.execute_plan(arm, joined=True)
    goals = {piece.name: piece.place for piece in now} | {transfer.name: transfer.target for transfer in plan}
    for pose in plant.truth(reset_peak=False).pieces:
        x, y = TABLE.xy(goals[pose.name])
        assert math.hypot(pose.x - x, pose.y - y) < 0.001, pose
        assert pose.tilt < 0.01
