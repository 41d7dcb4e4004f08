"""Games with boxes for captured pieces: inventory, plans, verdicts, what is refused, what is kept of the options."""

from __future__ import annotations

import dataclasses
import random
from pathlib import Path

import chess
import numpy as np
import pytest

from app import UserError
from app.execution.interruption import PieceLost, Progress, progress_of
from app.motion import MotionSettings, Plan, Planner, PlanRefused
from app.motion.arcs import Workcell
from app.motion.planner import fall_time
from app.pieces.inventory import Inventory, InventoryError, PieceBoxed, Ply, Stage, Transfer
from app.pieces.judging import judge
from app.pieces.layout import BoxesTooSmall, TraysTooSmall, physical_set, start_layout
from app.pieces.manipulation import NoSpare, transfers
from app.play.game_setup import rig_setup_of
from app.play.hand_moves import HandDropsNothing, hand_transfers
from app.play.launch import run_games
from app.rig.arm import FELT, ArmAtRest
from app.rig.rig_file import load_rig
from app.settings.defaults import Settings
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from controller.protection.limits import default_limits
from controller.protection.reference_check import SampleCheck
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.referee import PiecePose, Truth
from hardware.table import Captured, Place, TableSettings, square_place

PARAMETERS = load_parameters()
TABLE = TableSettings(captured=Captured.BOX)
MOTION = MotionSettings()
HOME = np.array(MOTION.home)
TICK = PARAMETERS.drive.tick
PAD = PARAMETERS.pads.half_height


def set_up(fen: str = chess.STARTING_FEN, table: TableSettings = TABLE) -> tuple[chess.Board, Inventory]:
    board = chess.Board(fen)
    return board, Inventory.of(start_layout(board, table), table)


def games(seed: int, plies: int) -> list[tuple[Ply, Inventory]]:
    """Plies of a random game that captures wherever it can."""
    rng, (board, inventory) = random.Random(seed), set_up()
    done: list[tuple[Ply, Inventory]] = []
    while len(done) < plies and not board.is_game_over():
        legal = list(board.legal_moves)
        move = rng.choice([m for m in legal if board.is_capture(m)] or legal)
        ply = transfers(board, move, inventory)
        done.append((ply, inventory))
        inventory = inventory.after(ply)
        board.push(move)
    return done


def planned(ply: Ply, inventory: Inventory) -> Plan:
    return Planner.of(MOTION, PARAMETERS, inventory.table, HOME, 0.008, 8).ply(ply.san, ply.transfers, inventory)


# inventory


def test_at_the_start_only_spares_stand_in_the_trays() -> None:
    _, inventory = set_up()
    assert len(list(inventory)) == len(physical_set())
    assert {p.name for p in inventory if not p.place.on_board} == {p.name for p in physical_set() if p.home is None}
    _, few = set_up("4k3/8/8/8/8/8/4P3/4K3 w - - 0 1")
    assert len(list(few)) == 3 + 18, "what the position lacks is not on the table"


@pytest.mark.parametrize("seed", range(4))
def test_what_leaves_the_board_goes_to_the_nearest_point_that_was_used_least(seed: int) -> None:
    for ply, before in games(seed, 200):
        inventory = before
        for transfer in ply.transfers:
            target = transfer.target
            if not target.on_board:
                assert target.in_box
                used = {p.place for p in inventory if p.place.in_box}
                free = [place for place in TABLE.box_places() if place not in used]
                assert TABLE.box_round(target) == min(map(TABLE.box_round, free))
                same = [place for place in free if TABLE.box_round(place) == TABLE.box_round(target)]
                way = inventory.travel(transfer.source, target)
                assert way == min(inventory.travel(transfer.source, p) for p in same)
            inventory = inventory.moved(transfer)
    boxed = [sum(p.place.zone == zone for p in inventory) for zone in ("BL", "BR")]
    assert sum(boxed) > 20
    assert abs(boxed[0] - boxed[1]) <= TABLE.box_points, "neither box is left empty while the other one is heaped"


def test_a_boxed_piece_never_serves_again() -> None:
    board, inventory = set_up("1q5k/P7/8/8/8/8/8/K7 w - - 0 1")
    after = inventory.after(transfers(board, chess.Move.from_uci("a7b8q"), inventory))
    queen = after.find("black-queen")
    assert queen.place.in_box
    assert after.find("white-pawn-a").place.in_box
    assert queen not in after.spares(Kind.QUEEN, Colour.BLACK)
    with pytest.raises(
        PieceBoxed, match=r"^black-queen was dropped into the box \(B[LR]\d+\) and lies there in an unknown position: "
    ):
        after.moved(Transfer(queen.name, queen.kind, queen.colour, queen.place, square_place(chess.E4)))


def test_without_spares_a_promotion_is_refused_though_a_queen_lies_in_the_box() -> None:
    board, inventory = set_up("1q5k/P1P5/8/8/8/8/8/K7 w - - 0 1")
    spares = {p.name for p in inventory.spares(Kind.QUEEN, Colour.WHITE)}
    inventory = Inventory.of([p for p in inventory if p.name not in spares], TABLE)
    with pytest.raises(NoSpare, match=r"^no spare white queen is left for the promotion on c8: promote to a rook or"):
        transfers(board, chess.Move.from_uci("c7c8q"), inventory)


def test_full_boxes_and_tables_without_enough_room_are_refused() -> None:
    with pytest.raises(BoxesTooSmall, match=r"^the boxes have room for 16 pieces, 48 are needed"):
        set_up(table=TABLE.model_copy(update={"box_rounds": 1}))
    with pytest.raises(TraysTooSmall, match=r"^the trays have 16 places, 18 are needed for the spares: enlarge"):
        set_up(table=TABLE.model_copy(update={"tray_rows": 8}))
    small = TABLE.model_copy(update={"box_points": 1, "box_rounds": 1})
    pieces = [p for p in start_layout(chess.Board(), TABLE) if p.place.on_board][:3]
    boxed = [dataclasses.replace(p, place=place) for p, place in zip(pieces, small.box_places(), strict=False)]
    with pytest.raises(InventoryError, match=r"^the boxes are full with 2 pieces$"):
        Inventory.of([*boxed, pieces[2]], small).nearest_free(pieces[2].place)


# plans


@pytest.mark.parametrize("seed", range(2))
def test_plans_pass_the_controllers_protection_and_flow_without_a_touch_at_the_box(seed: int) -> None:
    check = SampleCheck(default_limits(PARAMETERS, TABLE), TICK)
    captures = [(ply, before) for ply, before in games(seed, 60) if ply.transfers[0].target.in_box]
    for ply, inventory in captures[:12:4]:
        plan, reference = planned(ply, inventory), HOME
        for each in plan.motions:
            motion = each.continued(reference)
            rows = np.array([np.concatenate([np.atleast_1d(s[n]).astype(float) for n in s.dtype.names])
                             for s in motion.samples])  # fmt: skip
            check.begin(reference)
            assert check.start(rows[0]) is None
            assert check.rows(rows, None) is None
            assert check.end(rows[-1]) is None
            reference = rows[-1, :3]
            if motion.stage is Stage.CARRY:
                assert motion.transfer is not None
                assert motion.touches is not ply.transfers[motion.transfer].target.in_box
        np.testing.assert_allclose(reference, HOME, atol=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_nothing_of_the_arm_or_of_what_it_carries_comes_between_the_walls(seed: int) -> None:
    """Over a box, pads and carried foot stay above whatever may lie in it."""
    over = 0
    for ply, inventory in games(10 + seed, 30):
        for motion in planned(ply, inventory).motions:
            assert motion.transfer is not None
            shape = PIECE_SHAPES[ply.transfers[motion.transfer].kind]
            tool = TABLE.board_from_base(motion.samples["position"])
            lowest = tool[:, 2] - (shape.grip_height if motion.stage is Stage.CARRY else PAD)
            for box in TABLE.boxes():
                inside = np.abs(tool[:, 0] - box.x) < box.half_x + box.wall
                inside &= np.abs(tool[:, 1]) < box.half_y + box.wall
                over += int(inside.sum())
                assert lowest[inside].min(initial=1.0) >= TABLE.box_fill + 0.9 * MOTION.clearance
    assert over > 1000


def test_a_piece_is_let_go_at_rest_over_its_point_and_has_fallen_before_the_arm_leaves() -> None:
    board, inventory = set_up("4k3/8/8/3q4/4P3/8/8/4K3 w - - 0 1")
    ply = transfers(board, chess.Move.from_uci("e4d5"), inventory)
    drop = ply.transfers[0].target
    carry, release = planned(ply, inventory).motions[2:4]
    height = Workcell.of(MOTION, PARAMETERS, TABLE).height(Kind.QUEEN, drop)
    end = TABLE.board_from_base(carry.samples["position"][-1])
    np.testing.assert_allclose(end, [*TABLE.xy(drop), height], atol=1e-9)
    still = int(np.argmax(np.abs(release.samples["position"] - release.samples["position"][0]).max(axis=1) > 1e-6))
    opened = np.cumsum(release.samples["finger_velocity"]) * TICK
    freed = int(np.argmax(opened - opened.min() > MOTION.grip.freed))
    assert (still - freed) * TICK > fall_time(Kind.QUEEN, PARAMETERS.pads) - 2 * TICK
    shape = PIECE_SHAPES[Kind.QUEEN]
    fallen = 9.81 * fall_time(Kind.QUEEN, PARAMETERS.pads) ** 2 / 2.0
    assert fallen == pytest.approx(shape.height - shape.grip_height + PAD), "its top is below the pads"


def test_taking_a_piece_out_of_a_box_is_refused_before_anything_moves() -> None:
    board, inventory = set_up("4k3/8/8/3q4/4P3/8/8/4K3 w - - 0 1")
    after = inventory.after(transfers(board, chess.Move.from_uci("e4d5"), inventory))
    queen = after.find("black-queen")
    back = Transfer(queen.name, queen.kind, queen.colour, queen.place, square_place(chess.A1))
    with pytest.raises(PieceBoxed, match=r"take it out by hand"):
        Planner.of(MOTION, PARAMETERS, after.table, HOME, 0.008).ply("back", [back], after)


def test_a_box_too_near_to_the_tray_is_refused() -> None:
    narrow = TABLE.model_copy(update={"box_gap": 0.015})
    board, inventory = set_up("8/P6k/8/8/8/8/8/K7 w - - 0 1", narrow)
    ply = transfers(board, chess.Move.from_uci("a7a8q"), inventory)
    with pytest.raises(PlanRefused, match=r"would touch a box: enlarge box_gap of the table$"):
        planned(ply, inventory)


# what is lost half way


def rests(x: float, y: float, height: float, felt: float) -> ArmAtRest:
    return ArmAtRest(TABLE.base_from_board(np.array([x, y, height])), 0.008, 0, felt)


def test_a_piece_that_fell_over_its_box_is_where_it_belongs_and_one_beside_is_lost() -> None:
    board, inventory = set_up("4k3/8/8/3q4/4P3/8/8/4K3 w - - 0 1")
    ply = transfers(board, chess.Move.from_uci("e4d5"), inventory)
    box = TABLE.box_of(ply.transfers[0].target)
    over = rests(box.x + 0.01, box.y + 0.05, 0.12, 0.0)
    assert progress_of(ply.transfers, 0, Stage.CARRY, over, TABLE) == Progress(1, holding=False)
    assert progress_of(ply.transfers, 0, Stage.CARRY, rests(box.x, 0.0, 0.12, 2 * FELT), TABLE) == Progress(
        0, holding=True
    )
    with pytest.raises(PieceLost):
        progress_of(ply.transfers, 0, Stage.CARRY, rests(0.0, 0.0, 0.12, 0.0), TABLE)


def test_a_piece_still_held_over_its_box_is_dropped_from_there() -> None:
    board, inventory = set_up("4k3/8/8/3q4/4P3/8/8/4K3 w - - 0 1")
    ply = transfers(board, chess.Move.from_uci("e4d5"), inventory)
    drop = ply.transfers[0].target
    there = TABLE.base_from_board(
        np.array([*TABLE.xy(drop), Workcell.of(MOTION, PARAMETERS, TABLE).height(Kind.QUEEN, drop)])
    )
    plan = Planner.of(MOTION, PARAMETERS, inventory.table, there, 0.003, 8).ply(
        "rest", ply.transfers, inventory, holding=True, low=True
    )
    carry = plan.motions[0]
    np.testing.assert_allclose(carry.samples["position"], np.broadcast_to(there, (len(carry.samples), 3)), atol=1e-9)
    assert [m.stage for m in plan.motions[:3]] == [Stage.CARRY, Stage.RELEASE, Stage.GRASP]


# verdicts


def boxed_truth(**changes: object) -> tuple[Truth, Inventory, Place]:
    board, inventory = set_up("4k3/8/8/3q4/4P3/8/8/4K3 w - - 0 1")
    after = inventory.after(transfers(board, chess.Move.from_uci("e4d5"), inventory))
    place = after.find("black-queen").place
    poses = [PiecePose(p.name, *TABLE.xy(p.place), 0.0, 0.0) for p in after]
    poses = [dataclasses.replace(pose, **changes) if pose.name == "black-queen" else pose for pose in poses]  # type: ignore[arg-type]
    return Truth(0, tuple(poses), 0.0, 0.0, 0.0, ""), after, place


@pytest.mark.parametrize(("dx", "dy", "z", "tilt"), [(0, 0, 0, 0), (0.027, -0.02, 0.01, 1.6), (-0.027, 0.01, 0.055, 3)])
def test_a_piece_lies_right_anyhow_within_the_walls_and_is_no_placement(
    dx: float, dy: float, z: float, tilt: float
) -> None:
    _, inventory, place = boxed_truth()
    x, y = TABLE.xy(place)
    truth, _, _ = boxed_truth(x=x + dx, y=y + dy, z=z, tilt=tilt)
    verdict = judge(truth, inventory)
    assert verdict.ok
    assert "black-queen" not in verdict.errors
    assert "white-pawn-e" in verdict.errors


@pytest.mark.parametrize("change", [{"x": 0.0}, {"y": 0.2}, {"z": 0.07}, {"z": -0.1}])
def test_a_piece_beside_or_above_its_box_is_named(change: dict[str, float]) -> None:
    truth, inventory, place = boxed_truth(**change)
    (failure,) = judge(truth, inventory).failures
    assert failure.startswith(f"black-queen was dropped into the box ({place}) and lies outside: (")
    assert failure.endswith("its inside ends at ±28 and ±166 mm, its walls at 60 mm")


# people and records


def test_the_simulated_hand_says_that_it_drops_nothing() -> None:
    board, inventory = set_up("4k3/8/8/3q4/4P3/8/8/4K3 w - - 0 1")
    with pytest.raises(HandDropsNothing, match=r"^the simulated hand cannot drop the black queen from d5 into a box: "):
        hand_transfers(transfers(board, chess.Move.from_uci("e4d5"), inventory).transfers, inventory.table)


def test_the_options_of_a_game_keep_where_captured_pieces_go() -> None:
    kept = Settings.model_validate_json(settings_of({"rig.captured": Captured.BOX}).model_dump_json())
    assert rig_setup_of(kept.rig).table.captured is Captured.BOX
    assert rig_setup_of(Settings().rig).table.captured is Captured.TRAY
    assert rig_setup_of(kept.with_changes({"rig.square": 50.0}).rig).table.boxes()


def test_a_rig_file_says_where_captured_pieces_go_and_an_option_cannot_say_otherwise(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text('[controller]\nport = 47100\n[table]\ncaptured = "box"\n', encoding="utf-8")
    assert load_rig(file).table.boxes()
    with pytest.raises(UserError, match=r"captured pieces go to a box: leave --captured out, or change its file$"):
        run_games(settings_of({"rig.name": str(file), "rig.captured": Captured.TRAY}), UserInterface())
    file.write_text('[controller]\nport = 47100\n[table]\ncaptured = "bag"\n', encoding="utf-8")
    with pytest.raises(UserError, match=r"table\.captured: choose tray or box, not 'bag'$"):
        load_rig(file)
