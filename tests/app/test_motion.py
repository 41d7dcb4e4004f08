"""Plans: continuous, bounded, as high as they must be, and accepted by the controller's own protection."""

from __future__ import annotations

import dataclasses
import random

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.layout import start_layout
from app.manipulation import Inventory, Ply, Transfer, transfers
from app.motion import MotionSettings, Plan, PlanRefused, plan_ply, plan_return
from app.motion.gains import scheduled
from app.motion.obstacles import Standing, blocking_neighbour, closed_position, tallest_on_way
from app.motion.reference import Bounds, line
from app.motion.settings import Gains
from controller.protocol import Guard
from controller.safety import default_limits
from controller.sample_check import SampleCheck
from hardware.parameters import load_parameters
from hardware.table import PIECE_SHAPES, Colour, Kind, Place, TableSettings, square_place

PARAMETERS = load_parameters()
TABLE = TableSettings()
MOTION = MotionSettings()
TICK = PARAMETERS.drive.tick
HOME = np.array(MOTION.home)
OPEN = 0.008

coordinate = st.floats(-0.2, 0.2)
point = st.tuples(coordinate, coordinate, st.floats(0.25, 0.47)).map(np.array)


def games(seed: int, plies: int) -> list[tuple[Ply, Inventory]]:
    rng = random.Random(seed)
    board = chess.Board()
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    done = []
    while len(done) < plies and not board.is_game_over():
        move = rng.choice(list(board.legal_moves))
        ply = transfers(board, move, inventory)
        done.append((ply, inventory))
        inventory = inventory.after(ply)
        board.push(move)
    return done


def planned(ply: Ply, inventory: Inventory) -> Plan:
    return plan_ply(ply.san, ply.transfers, inventory, HOME, OPEN, MOTION, PARAMETERS, lead_ticks=8)


@settings(max_examples=60, deadline=None)
@given(point, point, st.floats(0.02, 1.5), st.floats(1.0, 25.0), st.floats(50.0, 1500.0))
def test_a_line_is_straight_bounded_and_consistent(start, end, speed, acceleration, jerk):
    segment = line(start, end, Bounds(speed, acceleration, jerk), TICK)
    if len(segment) == 0:
        assert np.linalg.norm(end - start) < 1e-9
        return
    way = (end - start) / np.linalg.norm(end - start)
    aside = (segment.position - start) - np.outer((segment.position - start) @ way, way)
    assert np.abs(aside).max() < 1e-12
    assert np.linalg.norm(segment.velocity, axis=1).max() <= speed * (1 + 1e-9)
    assert np.linalg.norm(segment.acceleration, axis=1).max() <= acceleration * (1 + 1e-9)
    steps = np.diff(np.vstack([np.zeros(3), segment.acceleration]), axis=0)
    assert np.linalg.norm(steps, axis=1).max() <= jerk * TICK * (1 + 1e-6)
    np.testing.assert_array_equal(segment.position[-1], end)
    assert not segment.velocity[-1].any()
    # positions are the integral of velocities: trapezoid, error at most jerk·tick³/12, and at most one short last tick
    moved = np.diff(np.vstack([start, segment.position]), axis=0)
    mean = 0.5 * (segment.velocity + np.vstack([np.zeros(3), segment.velocity[:-1]])) * TICK
    assert np.linalg.norm(moved - mean, axis=1)[:-1].max(initial=0.0) <= jerk * TICK**3 / 12 + 1e-12


def test_a_line_is_time_optimal_when_long():
    """Trapezoid of acceleration: distance v·(T − v/a − a/j)."""
    segment = line(np.zeros(3), np.array([0.5, 0.0, 0.0]), Bounds(0.8, 15.0, 500.0), TICK)
    expected = 0.5 / 0.8 + 0.8 / 15.0 + 15.0 / 500.0
    assert len(segment) * TICK == pytest.approx(expected, abs=TICK)


@pytest.mark.parametrize("seed", range(6))
def test_plans_of_random_games_pass_the_controllers_protection(seed):
    check = SampleCheck(default_limits(PARAMETERS, TABLE), TICK)
    for ply, inventory in games(seed, 40):
        plan = planned(ply, inventory)
        reference = HOME
        for motion in plan.motions:
            rows = np.array([np.concatenate([np.atleast_1d(s[n]).astype(float) for n in s.dtype.names])
                             for s in motion.samples])  # fmt: skip
            check.begin(reference)
            assert check.start(rows[0]) is None
            assert check.rows(rows, None) is None
            assert check.end(rows[-1]) is None
            reference = rows[-1, :3]
        np.testing.assert_array_equal(reference, HOME)


@pytest.mark.parametrize("seed", range(4))
def test_a_carried_foot_clears_what_it_passes_over(seed):
    for ply, inventory in games(100 + seed, 30):
        now = inventory
        for transfer, carry in zip(ply.transfers, planned(ply, inventory).motions[2::3], strict=True):
            shape = PIECE_SHAPES[transfer.kind]
            tool = TABLE.board_from_base(carry.samples["position"])
            holding = carry.samples["finger_velocity"] < 0.0
            for piece in now:
                if piece.name == transfer.name:
                    continue
                x, y = TABLE.xy(piece.place)
                reach = shape.foot_radius + PIECE_SHAPES[piece.kind].foot_radius
                over = holding & (np.hypot(tool[:, 0] - x, tool[:, 1] - y) < reach)
                foot = tool[over, 2] - shape.grip_height
                assert foot.min(initial=1.0) >= PIECE_SHAPES[piece.kind].height + 0.9 * MOTION.clearance
            now = now.moved(transfer)


def test_every_transfer_is_approach_grasp_carry_and_the_last_goes_home():
    board = chess.Board("r3k2r/8/8/8/8/8/8/R3K2R w KQkq - 0 1")
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    plan = planned(transfers(board, chess.Move.from_uci("e1g1"), inventory), inventory)
    assert [m.grips for m in plan.motions] == [False, True, False] * 2
    assert [bool((m.samples["guard"] == Guard.GRIP).all()) for m in plan.motions] == [False, True, False] * 2
    assert plan.motions[2].label == "king e1 to g1"
    assert plan.motions[5].label == "rook h1 to f1, home"
    assert plan.expected == pytest.approx(sum(m.expected for m in plan.motions) + 5 * 8 * TICK)


def test_the_touch_down_is_slow_soft_and_overshoots():
    (ply, inventory) = games(3, 1)[0]
    carry = planned(ply, inventory).motions[2].samples
    transfer = ply.transfers[0]
    foot = TABLE.board_from_base(carry["position"])[:, 2] - PIECE_SHAPES[transfer.kind].grip_height
    lowest = int(foot.argmin())
    assert foot[lowest] == pytest.approx(-MOTION.touch_depth)
    near = (foot < MOTION.touch_height - 1e-9) & (np.arange(len(foot)) <= lowest) & (np.arange(len(foot)) > 200)
    assert np.abs(carry["velocity"][near, 2]).max() <= MOTION.touch_speed * (1 + 1e-9)
    np.testing.assert_allclose(carry["stiffness"][lowest], [4900.0, 4900.0, 400.0])
    opening = np.flatnonzero(carry["finger_velocity"] > 0.0)
    assert opening[0] > lowest
    assert (carry["finger_velocity"][: opening[0]] < 0.0).all(), "the grip is held until the piece stands"


def test_nothing_faster_downwards_near_the_board_than_the_contact_limit():
    for ply, inventory in games(7, 25):
        for motion in planned(ply, inventory).motions:
            low = motion.samples["position"][:, 2] > TABLE.centre_in_base[2] - TABLE.limits.near_height
            assert motion.samples["velocity"][low, 2].max(initial=0.0) <= TABLE.limits.downward_speed * (1 + 1e-9)


@given(st.lists(st.floats(-0.01, 0.08), min_size=2, max_size=20).map(sorted))
def test_gains_rise_with_height_at_the_stated_damping(heights):
    gains = Gains()
    stiffness, damping = scheduled(np.array(heights), gains)
    assert (np.diff(stiffness[:, 2]) >= 0.0).all()
    np.testing.assert_allclose(damping, 2.0 * gains.damping_ratio * np.sqrt(stiffness))
    assert (stiffness[:, :2] == gains.frequency_in_air**2).all()


def test_gains_are_continuous():
    heights = np.linspace(-0.005, 0.03, 35_001)
    stiffness, _ = scheduled(heights, Gains())
    assert np.abs(np.diff(stiffness[:, 2])).max() < 1.0


def test_return_goes_up_before_it_goes_over():
    low = TABLE.base_from_board(np.array([0.14, 0.14, 0.02]))
    (motion,) = plan_return(low, OPEN, MOTION, PARAMETERS, TABLE).motions
    path = motion.samples["position"]
    aside = np.linalg.norm(path[:, :2] - low[:2], axis=1) > 1e-9
    assert path[aside][0, 2] == pytest.approx(HOME[2], abs=1e-3)
    np.testing.assert_allclose(path[-1], HOME)


def test_a_neighbour_within_reach_of_the_open_fingers_is_refused():
    near = TABLE.model_copy(update={"square": 0.024})
    pieces = start_layout(chess.Board(), near)
    inventory = Inventory.of(pieces, near)
    transfer = Transfer("white-king", Kind.KING, Colour.WHITE, square_place(chess.E1), square_place(chess.E4))
    king = dataclasses.replace(transfer, name=inventory.at(square_place(chess.E1)).name)
    with pytest.raises(PlanRefused, match=r"at e1 the fingers, 7\.9 mm open, would touch the (queen|bishop) on [df]1"):
        plan_ply("Ke4", [king], inventory, HOME, OPEN, MOTION, PARAMETERS)


def test_a_gripper_that_cannot_open_wide_enough_is_refused():
    narrow = PARAMETERS.model_copy(update={"gripper": PARAMETERS.gripper.model_copy(update={"stroke": 0.005})})
    ply, inventory = games(1, 1)[0]
    with pytest.raises(PlanRefused, match=r"fingers \d+\.\d mm open, the gripper opens 5\.0 mm: use thinner"):
        plan_ply(ply.san, ply.transfers, inventory, HOME, OPEN, MOTION, narrow)


def test_closed_fingers_touch_the_stem():
    """In a 45° groove a stem of radius r rests with its centre r·√2 before the apex."""
    for kind in Kind:
        position = closed_position(kind, PARAMETERS.pads)
        assert position == pytest.approx(PIECE_SHAPES[kind].stem_radius * 2**0.5 - PARAMETERS.pads.half_width)
        assert position > 0.0, "else the jaws would meet before they hold it"


def test_obstacles_are_found_by_distance_to_the_way():
    king = Standing(Place("board", 0), 0.10, 0.03, Kind.KING)
    pawn = Standing(Place("board", 1), 0.10, 0.00, Kind.PAWN)
    assert tallest_on_way((0.0, 0.0), (0.2, 0.0), [king, pawn], 0.02) == PIECE_SHAPES[Kind.PAWN].height
    assert tallest_on_way((0.0, 0.0), (0.2, 0.0), [king, pawn], 0.04) == PIECE_SHAPES[Kind.KING].height
    assert tallest_on_way((0.0, 0.0), (0.05, 0.0), [king, pawn], 0.04) == 0.0


def test_neighbours_across_the_finger_axis_do_not_block():
    beside = Standing(Place("board", 0), 0.0, 0.030, Kind.KING)
    along = Standing(Place("board", 0), 0.024, 0.0, Kind.KING)
    assert blocking_neighbour(0.0, 0.0, OPEN, 0.012, [beside], PARAMETERS.pads) is None
    assert blocking_neighbour(0.0, 0.0, OPEN, 0.012, [along], PARAMETERS.pads) == along
    assert blocking_neighbour(0.0, 0.0, OPEN, 0.062, [along], PARAMETERS.pads) is None, "above it"
