"""Plans: continuous, bounded, as high as they must be, and accepted by the controller's own protection."""

from __future__ import annotations

import dataclasses
import math
import random

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.motion import PROFILES, MotionSettings, Plan, Planner, PlanRefused, Profile, contact_speeds
from app.motion.gain_schedule import Softness, scheduled
from app.motion.obstacles import Crowd, Moving, Obstacle, blocking_neighbour, closed_position, needed_heights
from app.motion.off_centre import DRAWN_IN, aside, either_side
from app.motion.path import Vector
from app.motion.settings import Gains
from app.pieces.inventory import Inventory, Ply, Stage, Transfer
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.rig.arm import ASIDE
from app.rig.simulation.nominal_view import nominal_view
from controller.model.constants import DeltaModel
from controller.model.workspace import seated
from controller.protection.limits import default_limits, joint_middle
from controller.protection.reference_check import SampleCheck
from controller.protocol import Guard
from hardware.contact_speeds import ContactSpeeds
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_PROFILES, PIECE_SHAPES, Colour, Kind
from hardware.sim.render.d435 import colour_intrinsics
from hardware.table import Captured, Place, TableSettings, square_place
from hardware.turned_shapes import KNIGHT_HEAD

PARAMETERS = load_parameters()
TABLE = TableSettings()
MOTION = MotionSettings()
TICK = PARAMETERS.drive.tick
HOME = np.array(MOTION.home)
OPEN = 0.008
MAX_OPEN = max(closed_position(kind, PARAMETERS.pads) for kind in Kind) + MOTION.grip.opening_margin


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


def planned(ply: Ply, inventory: Inventory, motion: MotionSettings = MOTION) -> Plan:
    return Planner.of(motion, PARAMETERS, inventory.table, HOME, OPEN, 8).ply(ply.san, ply.transfers, inventory)


@pytest.mark.parametrize(("seed", "board_at"), [(0, 10), (1, 120), (2, 260), (3, 350)])
def test_plans_of_random_games_pass_the_controllers_protection(seed, board_at):
    check = SampleCheck(default_limits(PARAMETERS, TABLE), TICK)
    for ply, inventory in games(seed, 10):
        plan = planned(ply, inventory)
        reference = HOME
        for each in plan.motions:
            motion = each.continued(reference)
            rows = np.array([np.concatenate([np.atleast_1d(s[n]).astype(float) for n in s.dtype.names])
                             for s in motion.samples])  # fmt: skip
            check.begin(reference)
            assert check.start(rows[0]) is None
            assert check.rows(rows, None) is None
            assert check.end(rows[-1]) is None
            reference = rows[-1, :3]
            if motion.touches:  # wherever the board is
                reference = rows[np.flatnonzero(motion.samples["guard"] == Guard.TOUCH)[0] + board_at, :3]
        np.testing.assert_allclose(reference, HOME, atol=1e-12)


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


@settings(max_examples=6)
@given(square=st.floats(0.030, 0.0565), captured=st.sampled_from(Captured))
def test_where_a_board_is_said_to_fit_every_outermost_place_can_be_served(square: float, captured: Captured) -> None:
    heaviest = DeltaModel(PARAMETERS, max(shape.mass for shape in PIECE_SHAPES.values()))
    table = seated(heaviest, TableSettings(square=square, captured=captured))
    limits, inventory = default_limits(PARAMETERS, table), Inventory.of(start_layout(chess.Board(), table), table)
    motion = MOTION.at(table)
    planner = Planner.of(motion, PARAMETERS, table, np.array(motion.home), OPEN, 8)
    beside = table.drop_points() or [place for place in table.tray_places() if not inventory.at(place)]
    for place in sorted(beside, key=lambda place: float(np.hypot(*table.xy(place))))[-4:]:
        pawn = inventory.at(square_place(chess.D7))
        assert pawn is not None
        for motion in planner.ply("captured", (Transfer.of(pawn, place),), inventory).motions:
            positions = motion.samples["position"]
            assert np.hypot(positions[:, 0], positions[:, 1]).max() <= limits.reach
            assert (np.abs(positions - limits.centre) <= limits.half_size).all()
            angles = [joint_middle(PARAMETERS, (x, y, z)) for x, y, z in positions[::50].tolist()]
            assert np.abs(np.array(angles) - limits.joint_middle).max() < limits.joint_range - 0.15


def test_a_ply_of_two_transfers_flows_from_one_to_the_next_without_going_home():
    board = chess.Board("r3k2r/8/8/8/8/8/8/R3K2R w KQkq - 0 1")
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    plan = planned(transfers(board, chess.Move.from_uci("e1g1"), inventory), inventory)
    assert [m.label for m in plan.motions] == [
        "to e1", "grasp king on e1", "king e1 to g1", "release king, to h1",
        "grasp rook on h1", "rook h1 to f1", "release rook, home",
    ]  # fmt: skip
    assert [m.stage for m in plan.motions] == [Stage.APPROACH] + [Stage.GRASP, Stage.CARRY, Stage.RELEASE] * 2
    assert [m.grips for m in plan.motions] == [False, True, False, False, True, False, False]
    for motion in plan.motions:
        sure = motion.samples["guard"] == Guard.GRIP
        assert sure.any() == motion.grips
        if motion.grips:  # believed from where the fingers may be 1 mm off the stem on, 2 mm after they begin
            assert sure.argmax() == pytest.approx(0.002 / 0.030 / TICK, abs=2)
            assert sure[sure.argmax() :].all()
    assert [bool((m.samples["guard"] == Guard.TOUCH).any()) for m in plan.motions] == [m.touches for m in plan.motions]
    assert plan.expected == pytest.approx(sum(m.expected for m in plan.motions) + 6 * 8 * TICK)


def test_the_touch_down_is_slow_soft_and_overshoots():
    (ply, inventory) = games(3, 1)[0]
    carry = planned(ply, inventory).motions[2].samples
    foot = TABLE.board_from_base(carry["position"])[:, 2] - PIECE_SHAPES[ply.transfers[0].kind].grip_height
    guarded = carry["guard"] == Guard.TOUCH
    assert foot[-1] == pytest.approx(-MOTION.touch_depth)
    assert foot[guarded][0] == pytest.approx(MOTION.touch_height, abs=1e-4)
    assert (carry["guard_level"][guarded] == np.float32(MOTION.touch_force)).all()
    assert (carry["guard"][~guarded] == Guard.HELD).all(), "until then a piece that is lost stops the arm"
    assert (carry["guard_level"][~guarded] == np.float32(MOTION.grip.held_force)).all()
    assert np.diff(np.flatnonzero(guarded)).max() == 1
    assert np.abs(carry["velocity"][guarded, 2]).max() <= MOTION.touch_speed * (1 + 1e-9)
    np.testing.assert_allclose(carry["stiffness"][guarded][-1], [4900.0, 4900.0, 400.0])
    assert (carry["finger_velocity"] < 0.0).all(), "the grip is held until the piece stands"


def test_fingers_yield_while_they_close_and_open_and_are_firm_in_the_air():
    (ply, inventory) = games(3, 1)[0]
    approach, grasp, carry, release = (motion.samples for motion in planned(ply, inventory).motions)
    along = "stiffness", 0
    assert approach[along[0]][:, 0].min() == 4900.0
    for before, after in ((approach, grasp), (grasp, carry)):
        np.testing.assert_allclose(after["stiffness"][0], before["stiffness"][-1], rtol=2e-3, atol=1e-9)
    soft = grasp["stiffness"][:, 0] == 0.0
    assert np.flatnonzero(soft)[0] * TICK == pytest.approx(MOTION.gains.yielding, abs=2 * TICK)
    assert (grasp["tactile_gain"][soft] == np.float32(MOTION.gains.tactile_gain)).all()
    opening = release["finger_velocity"] > 0.0
    assert release["stiffness"][np.flatnonzero(opening)[0], 0] == 0.0
    for motion in (approach, grasp, carry, release):
        for gains in (motion["stiffness"], motion["damping"]):
            assert np.abs(np.diff(gains, axis=0)).max() < 0.12 * gains.max(), "no jumps"


@pytest.mark.parametrize("profile", [Profile.DEFAULT, Profile.FAST, Profile.GENTLE])
def test_fingers_arrive_beside_the_piece_and_go_on_closing_slowly(profile: Profile) -> None:
    """The last sample's velocity lasts until the grasp begins; a piece 3 mm off is not touched before."""
    motion = PROFILES[profile]
    ply, inventory = games(3, 1)[0]
    approach, grasp, *_ = planned(ply, inventory, motion).motions
    stem = closed_position(ply.transfers[0].kind, PARAMETERS.pads)
    assert approach.samples["finger_velocity"][-1] == pytest.approx(-motion.grip.closing_speed)
    assert grasp.route.finger - stem == pytest.approx(motion.grip.beside, abs=2e-4)


@pytest.mark.parametrize("kind", list(Kind))
def test_no_piece_is_wider_than_its_stem_where_the_fingers_close_to_beside_it(kind: Kind) -> None:
    shape, pads = PIECE_SHAPES[kind], PARAMETERS.pads
    lowest, highest = shape.grip_height - pads.half_height, shape.grip_height + MOTION.grip.beside_way
    assert highest - pads.half_height < shape.height - shape.stem_radius, "the pads are around it, not above it"
    assert lowest > shape.foot_height
    profile = np.array(KNIGHT_HEAD if kind is Kind.KNIGHT else PIECE_PROFILES[kind])  # in radii of the stem
    assert np.abs(profile[profile[:, 1] * shape.height > lowest, 0]).max() <= 1.0


def test_fingers_end_where_they_were_planned_to():
    for ply, inventory in games(11, 20):
        finger = OPEN
        for motion in planned(ply, inventory).motions:
            assert motion.route.finger == pytest.approx(finger, abs=1e-8)
            velocity = motion.samples["finger_velocity"].astype(float)
            if motion.stage in (Stage.GRASP, Stage.CARRY):  # pressing on the stem
                finger = closed_position(ply.transfers[motion.transfer].kind, PARAMETERS.pads)
                continue
            begin = np.flatnonzero(velocity > 0.0)[0] if motion.stage is Stage.RELEASE else 0
            finger += float(velocity[begin:].sum()) * TICK
            assert 0.0 < finger < PARAMETERS.gripper.stroke


def test_a_way_is_as_high_as_what_it_passes_over_and_no_higher():
    empty = chess.Board("4k3/8/8/8/8/8/P7/4K3 w - - 0 1")
    inventory = Inventory.of(start_layout(empty, TABLE), TABLE)
    quiet = planned(transfers(empty, chess.Move.from_uci("a2a4"), inventory), inventory).motions[2]
    foot = TABLE.board_from_base(quiet.samples["position"])[:, 2] - PIECE_SHAPES[Kind.PAWN].grip_height
    assert foot.max() < MOTION.lift + MOTION.touch_height + 1e-9
    full = chess.Board()
    inventory = Inventory.of(start_layout(full, TABLE), TABLE)
    over = planned(transfers(full, chess.Move.from_uci("b1c3"), inventory), inventory).motions[2]
    tool = TABLE.board_from_base(over.samples["position"])[:, 2]
    pawn = PIECE_SHAPES[Kind.PAWN].height + MOTION.clearance
    assert pawn + 0.018 < tool.max() < pawn + PIECE_SHAPES[Kind.KNIGHT].grip_height + 0.035


@pytest.mark.parametrize("height", [-0.004, 0.0, 0.002, 0.0032, 0.02, 0.09])
@pytest.mark.parametrize("aside", [0.0, 0.0006, 0.0012, 0.003, 0.05])
def test_a_piece_held_anywhere_on_its_way_is_set_down_from_above(height, aside):
    """Also where the arm was stopped just over its square, or on it."""
    (ply, inventory) = games(3, 1)[0]
    transfer = ply.transfers[0]
    grip = PIECE_SHAPES[transfer.kind].grip_height
    x, y = TABLE.xy(transfer.target)
    start = TABLE.base_from_board(np.array([x + aside, y, grip + height]))
    plan = Planner.of(MOTION, PARAMETERS, inventory.table, start, 0.002).ply(
        ply.san, [transfer], inventory, holding=True, low=True
    )
    carry, release = plan.motions
    assert (carry.stage, release.stage) == (Stage.CARRY, Stage.RELEASE)
    guarded = carry.samples["guard"] == Guard.TOUCH
    assert (carry.samples["velocity"][guarded][:-1, 2] > 0.0).all(), "downwards"
    end = TABLE.board_from_base(carry.samples["position"][-1])
    np.testing.assert_allclose(end, [x, y, grip - MOTION.touch_depth], atol=1e-9)
    np.testing.assert_allclose(carry.samples["position"][0], start, atol=1e-12)


@pytest.mark.parametrize("height", [0.0, 0.002, 0.02, 0.09])
@pytest.mark.parametrize("aside", [0.0, 0.0006, 0.0012, 0.003, 0.05])
@pytest.mark.parametrize("low", [False, True])
def test_an_arm_that_stopped_anywhere_near_its_piece_goes_to_it(height, aside, low):
    (ply, inventory) = games(3, 1)[0]
    transfer = ply.transfers[0]
    x, y = TABLE.xy(transfer.source)
    grip = PIECE_SHAPES[transfer.kind].grip_height
    start = TABLE.base_from_board(np.array([x + aside, y, grip + height]))
    approach = (
        Planner.of(MOTION, PARAMETERS, inventory.table, start, 0.002)
        .ply(ply.san, [transfer], inventory, low=low)
        .motions[0]
    )
    np.testing.assert_allclose(TABLE.board_from_base(approach.samples["position"][-1]), [x, y, grip], atol=1e-9)
    assert not approach.samples["velocity"][-1].any()


@pytest.mark.parametrize("profile", Profile)
def test_a_profile_keeps_to_its_own_speeds_at_a_table_that_admits_more(profile: Profile) -> None:
    # a lab's rig file has limits of its own, whichever profile its arm is asked for
    table = TABLE.model_copy(update={"limits": ContactSpeeds(tool_speed=2.0, downward_speed=1.0)})
    settings, near = PROFILES[profile], table.centre_in_base[2] - table.limits.near_height
    board = chess.Board("4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1")
    inventory = Inventory.of(start_layout(board, table), table)
    planner = Planner.of(settings, PARAMETERS, table, np.array(settings.home), 0.01)
    own = contact_speeds(profile)
    ply = transfers(board, chess.Move.from_uci("e4d5"), inventory)
    for motion in planner.ply(ply.san, ply.transfers, inventory).motions:
        velocity, low = motion.samples["velocity"], motion.samples["position"][:, 2] >= near
        assert velocity[low, 2].max(initial=0.0) <= own.downward_speed * (1.0 + 1e-6)
        assert np.linalg.norm(velocity, axis=1).max() <= own.tool_speed * (1.0 + 1e-6)


def test_nothing_faster_downwards_near_the_board_than_the_contact_limit():
    for ply, inventory in games(7, 25):
        for motion in planned(ply, inventory).motions:
            low = motion.samples["position"][:, 2] > TABLE.centre_in_base[2] - TABLE.limits.near_height
            assert motion.samples["velocity"][low, 2].max(initial=0.0) <= TABLE.limits.downward_speed * (1 + 1e-9)


@pytest.mark.parametrize("profile", Profile)
def test_an_arm_that_weighs_more_than_is_known_seems_not_to_be_held(profile: Profile) -> None:
    """It sags by 2 mm where it is soft, lags where it is accelerated, and comes back as its gains let it.

    As in a game of a campaign, whose arm of 6 % more weight was stopped eight times as it rose from a piece.
    """
    sag, weight, most = 0.8, 0.06, default_limits(PARAMETERS, TABLE).tracking_acceleration
    ((ply, inventory),) = games(3, 1)
    pulls = []
    for motion in planned(ply, inventory, PROFILES[profile]).motions:
        stiffness, damping = motion.samples["stiffness"][:, 2], motion.samples["damping"][:, 2]
        error, rate = sag / stiffness[0], 0.0
        for k_p, k_v, acceleration in zip(stiffness, damping, motion.samples["acceleration"][:, 2], strict=True):
            rate += TICK * (sag - weight * acceleration - k_v * rate - k_p * error)
            error += TICK * rate
            pulls.append(k_p * abs(error))
    assert max(pulls) < 0.6 * most


@given(st.lists(st.floats(-0.01, 0.08), min_size=2, max_size=20).map(sorted), st.sampled_from(Softness))
def test_gains_rise_with_height_at_the_stated_damping(heights, softness):
    gains, none = Gains(), np.zeros(len(heights))
    series = scheduled(np.array(heights), none, none + 1.0, none + 1.0, softness, gains)
    stiffness, damping = series[:, :3], series[:, 3:]
    assert (np.diff(stiffness[:, 2]) >= 0.0).all()
    np.testing.assert_allclose(damping[:, 1:], 2.0 * gains.damping_ratio * np.sqrt(stiffness[:, 1:]))
    assert (damping[:, 0] >= 2.0 * gains.damping_ratio * np.sqrt(stiffness[:, 0]) - 1e-9).all()
    assert (stiffness[:, 1] == gains.frequency_in_air**2).all()
    if softness is Softness.STIFF:
        assert (stiffness[:, 0] == gains.frequency_in_air**2).all()


@pytest.mark.parametrize("softness", Softness)
def test_gains_are_continuous(softness):
    heights, none = np.linspace(-0.005, 0.03, 35_001), np.zeros(35_001)
    for series in (
        scheduled(heights, none, none + 1.0, none + 1.0, softness, Gains()),
        scheduled(none, none, none - 1.0, np.linspace(0.0, 0.1, 35_001), softness, Gains()),
        scheduled(none + 1.0, none, np.linspace(-0.1, 0.2, 35_001), none + 1.0, softness, Gains()),
        scheduled(none, np.linspace(0.0, 1.0, 35_001), none + 1.0, none + 1.0, softness, Gains()),
    ):
        assert np.abs(np.diff(series[:, :3], axis=0)).max() < 2.0


def test_return_goes_up_before_it_goes_over():
    low = TABLE.base_from_board(np.array([0.14, 0.14, 0.02]))
    (motion,) = Planner.of(MOTION, PARAMETERS, TABLE, low, OPEN).home().motions
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
        Planner.of(MOTION, PARAMETERS, inventory.table, HOME, OPEN).ply("Ke4", [king], inventory)


def test_home_from_where_no_drive_holds_the_arm_is_refused():
    away = np.array([0.052, 0.394, 0.287])  # dragged there by the sleeve
    with pytest.raises(PlanRefused, match="holding still takes 5"):
        Planner.of(MOTION, PARAMETERS, TABLE, away, OPEN).home()


def test_a_gripper_that_cannot_open_wide_enough_is_refused():
    narrow = PARAMETERS.model_copy(update={"gripper": PARAMETERS.gripper.model_copy(update={"stroke": 0.005})})
    ply, inventory = games(1, 1)[0]
    with pytest.raises(PlanRefused, match=r"fingers \d+\.\d mm open, the gripper opens 5\.0 mm: use thinner"):
        Planner.of(MOTION, narrow, inventory.table, HOME, OPEN).ply(ply.san, ply.transfers, inventory)


@given(st.sampled_from([*Kind]), st.floats(0.35, 0.99))
def test_how_far_aside_a_stem_stands_follows_from_how_far_the_pads_edges_close(kind, oblique):
    """An edge meets the stem where its circle is that wide: obliquely, else the stem would slide into the groove."""
    pads, radius = PARAMETERS.pads, PIECE_SHAPES[kind].stem_radius
    off = pads.half_width - radius * math.sqrt(1.0 - oblique**2)
    assert aside(kind, pads, oblique * radius) == pytest.approx(off, abs=1e-9)
    assert aside(kind, pads, 2.0 * radius) == pads.half_width, "no stem is that wide"
    self_locking = math.cos(math.atan(1.3 * pads.friction)) * radius  # with as much friction as is ever drawn
    assert self_locking - closed_position(kind, pads) > 2.0 * ASIDE, "which tells it from a stem in the middle"


@given(st.sampled_from([*Kind]), st.floats(0.35, 1.5))
def test_either_side_is_far_enough_for_the_grooves_and_no_further(kind, oblique):
    _, inventory = games(1, 1)[0]
    transfer = Transfer.of(next(piece for piece in inventory if piece.kind is kind), Place.parse("e4"))
    pads, finger = PARAMETERS.pads, oblique * PIECE_SHAPES[kind].stem_radius
    sides = either_side(transfer, finger, pads, TABLE)
    if oblique > 1.0:
        assert not sides, "something else is between the fingers"
        return
    middle = TABLE.base_from_board(np.array([*transfer.grasped_at(TABLE), 0.0]))
    seen = [TABLE.base_from_board(np.array([*side.seen, 0.0])) - middle for side in sides]
    off = aside(kind, pads, finger) - DRAWN_IN
    assert np.array(seen) == pytest.approx(np.array([[0.0, off, 0.0], [0.0, -off, 0.0]]), abs=1e-9)


def test_closed_fingers_touch_the_stem():
    """In a 45° groove a stem of radius r rests with its centre r·√2 before the apex."""
    for kind in Kind:
        position = closed_position(kind, PARAMETERS.pads)
        assert position == pytest.approx(PIECE_SHAPES[kind].stem_radius * 2**0.5 - PARAMETERS.pads.half_width)
        assert position > 0.0, "else the jaws would meet before they hold it"


def test_what_is_passed_over_is_seen_by_its_distance_from_what_moves():
    pads = PARAMETERS.pads
    king = Obstacle("king", Place("board", 0), 0.10, 0.03, Kind.KING)
    pawn = Obstacle("pawn", Place("board", 1), 0.10, 0.00, Kind.PAWN)
    both, moving = Crowd.of([king, pawn]), Moving.of(pads, OPEN)

    def needed(moving: Moving, others: Crowd, beside: float) -> Vector:
        return needed_heights(np.linspace(0.0, 1.0, 201), (0.0, 0.0), (0.2, 0.0), moving, others, beside, 0.006)

    narrow = needed(moving, both, 0.0)
    assert narrow.max() == pytest.approx(PIECE_SHAPES[Kind.PAWN].height + pads.half_height + 0.006)
    wide = needed(moving, both, 0.01)
    assert wide.max() == pytest.approx(PIECE_SHAPES[Kind.KING].height + pads.half_height + 0.006)
    under = np.flatnonzero(wide > 0.0) * 0.001
    outer = OPEN + pads.half_width + pads.back + PIECE_SHAPES[Kind.KING].foot_radius + 0.01
    assert under[0] == pytest.approx(0.10 - outer, abs=0.0011)
    carrying = needed(moving._replace(carried=PIECE_SHAPES[Kind.ROOK]), both.without("king"), 0.0)
    assert carrying[100] == pytest.approx(PIECE_SHAPES[Kind.PAWN].height + PIECE_SHAPES[Kind.ROOK].grip_height + 0.006)
    assert not needed(moving, Crowd.of([]), 0.0).any()


def test_a_crowd_without_a_piece_or_with_it_elsewhere_is_what_it_says():
    pieces = [Obstacle.at(f"pawn {i}", square_place(8 + i), Kind.PAWN, TABLE) for i in range(8)]
    crowd, there = Crowd.of(pieces), Obstacle.at("pawn 3", square_place(27), Kind.PAWN, TABLE)
    for found, expected in (
        (crowd.without("pawn 3"), pieces[:3] + pieces[4:]),
        (crowd.without("queen"), pieces),
        (crowd.with_moved(there), [*pieces[:3], there, *pieces[4:]]),
    ):
        assert found.pieces == tuple(expected)
        np.testing.assert_array_equal(found.table, Crowd.of(expected).table)


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_no_way_of_a_random_position_leads_through_a_piece(seed):
    """Fingers and carried piece, as solids, against every piece that stands, all along every motion."""
    rng = random.Random(seed)
    ply, inventory = games(seed, rng.randrange(1, 40))[-1]
    pads, now = PARAMETERS.pads, inventory
    for motion in planned(ply, inventory).motions:
        transfer = ply.transfers[motion.transfer]
        if motion.stage is Stage.RELEASE:
            now = now.moved(transfer)
        carried = PIECE_SHAPES[transfer.kind] if motion.stage is Stage.CARRY else None
        tool = TABLE.board_from_base(motion.samples["position"])[::4]
        outer = MAX_OPEN + pads.half_width + pads.back if carried is None else OPEN + pads.half_width + pads.back
        for piece in now:
            if carried is not None and piece.name == transfer.name:
                continue
            shape = PIECE_SHAPES[piece.kind]
            x, y = np.abs(tool[:, :2] - TABLE.xy(piece.place)).T
            tip = tool[:, 2] - pads.half_height
            straddled = (x < 0.0012) & (y < 0.0012)
            hit = (x < outer + shape.stem_radius) & (y < pads.half_width + pads.back + shape.stem_radius)
            assert not (hit & ~straddled & (tip < shape.height)).any(), (motion.label, piece.place)
            if carried is not None:
                foot = tool[:, 2] - carried.grip_height
                reach = np.where(foot < shape.foot_height, shape.foot_radius, shape.stem_radius) + carried.foot_radius
                assert not ((np.hypot(x, y) < reach) & (foot < shape.height)).any(), (motion.label, piece.place)


def test_neighbours_across_the_finger_axis_do_not_block():
    beside = Obstacle("b", Place("board", 0), 0.0, 0.030, Kind.KING)
    along = Obstacle("a", Place("board", 0), 0.024, 0.0, Kind.KING)
    assert blocking_neighbour(0.0, 0.0, OPEN, 0.012, Crowd.of([beside]), PARAMETERS.pads) is None
    assert blocking_neighbour(0.0, 0.0, OPEN, 0.012, Crowd.of([along]), PARAMETERS.pads) == along
    assert blocking_neighbour(0.0, 0.0, OPEN, 0.062, Crowd.of([along]), PARAMETERS.pads) is None, "above it"


@given(square=st.floats(0.030, 0.0565), captured=st.sampled_from(Captured))
def test_at_home_the_arm_hides_no_piece_of_the_first_rank(square: float, captured: Captured) -> None:
    heaviest = DeltaModel(PARAMETERS, max(shape.mass for shape in PIECE_SHAPES.values()))
    table = seated(heaviest, TableSettings(square=square, captured=captured))
    view = nominal_view(colour_intrinsics(640, 480), table)
    x, y, height = table.board_from_base(np.array(MOTION.at(table).home)).tolist()
    corners = [(x + i * 0.020, y + j * 0.008, height - 0.012) for i in (-1, 1) for j in (-1, 1)]
    lowest = view.project(corners)[:, 1].max()
    crowns = [(file * square, -3.5 * square, PIECE_SHAPES[Kind.KING].height) for file in (-1.5, -0.5, 0.5, 1.5)]
    assert view.project(crowns)[:, 1].min() - lowest > 12.0
