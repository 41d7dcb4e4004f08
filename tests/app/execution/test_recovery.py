"""How far a ply is, told from what was begun and from where the arm is left."""

from __future__ import annotations

import chess
import numpy as np
import pytest

from app.execution.interruption import PieceLost, Progress, progress_of
from app.motion.obstacles import closed_position
from app.pieces.inventory import Inventory, Ply, Stage
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.rig.arm import ArmAtRest
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import Place, TableSettings

TABLE = TableSettings()
PARAMETERS = load_parameters()
CLOSED = closed_position(Kind.PAWN, PARAMETERS.pads)
GRIP = PIECE_SHAPES[Kind.PAWN].grip_height
MARGIN = 0.005
OPEN = CLOSED + MARGIN


def capture() -> Ply:
    """Two transfers: the pawn on d5 leaves, the pawn on e4 comes."""
    board = chess.Board("rnbqkbnr/ppp1pppp/8/3p4/4P3/8/PPPP1PPP/RNBQKBNR w KQkq - 0 2")
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    return transfers(board, chess.Move.from_uci("e4d5"), inventory)


PLY = capture()


def arm(place: Place, height: float, finger: float, felt: float) -> ArmAtRest:
    point = TABLE.base_from_board(np.array([*TABLE.xy(place), height]))
    return ArmAtRest(point, finger, 1000, felt)


def progress(transfer: int, stage: Stage, state: ArmAtRest) -> Progress:
    return progress_of(PLY.transfers, transfer, stage, state, TABLE)


@pytest.mark.parametrize("transfer", [0, 1])
def test_what_was_only_approached_stands_where_it_stood(transfer: int) -> None:
    source = PLY.transfers[transfer].source
    for height, finger in ((0.1, OPEN), (GRIP, OPEN), (0.2, 0.011)):
        assert progress(transfer, Stage.APPROACH, arm(source, height, finger, 0.0)) == Progress(transfer, False)


@pytest.mark.parametrize("transfer", [0, 1])
def test_the_pads_tell_whether_a_grasp_has_the_piece(transfer: int) -> None:
    source = PLY.transfers[transfer].source
    assert progress(transfer, Stage.GRASP, arm(source, GRIP, OPEN, 0.0)) == Progress(transfer, False)
    assert progress(transfer, Stage.GRASP, arm(source, GRIP, CLOSED, 4.0)) == Progress(transfer, True)


@pytest.mark.parametrize("transfer", [0, 1])
def test_a_carried_piece_is_in_the_fingers_or_set_down(transfer: int) -> None:
    source, target = PLY.transfers[transfer].source, PLY.transfers[transfer].target
    for place, height in ((source, GRIP), (source, 0.08), (target, 0.08), (target, GRIP)):
        assert progress(transfer, Stage.CARRY, arm(place, height, CLOSED, 4.0)) == Progress(transfer, True)
    # it slid down in the fingers, but stands
    assert progress(transfer, Stage.CARRY, arm(target, GRIP - 0.001, CLOSED, 0.0)) == Progress(transfer + 1, False)


@pytest.mark.parametrize("transfer", [0, 1])
def test_what_was_to_be_released_stands_wherever_the_arm_went_unless_it_is_still_held(transfer: int) -> None:
    source, target = PLY.transfers[transfer].source, PLY.transfers[transfer].target
    for place, height in ((target, GRIP), (target, 0.08), (source, 0.15)):
        assert progress(transfer, Stage.RELEASE, arm(place, height, OPEN, 0.0)) == Progress(transfer + 1, False)
    assert progress(transfer, Stage.RELEASE, arm(target, GRIP, CLOSED, 4.0)) == Progress(transfer, True)


def test_fingers_that_close_around_the_next_piece_do_not_hold_the_last_one() -> None:
    # at the end of a release the arm is at the next piece, and its fingers begin to close before the grasp is recorded
    following = PLY.transfers[1].source
    assert progress(0, Stage.RELEASE, arm(following, GRIP, CLOSED, 12.0)) == Progress(1, False)
    # anywhere else it is the last one, from which a hand has pushed the arm away
    for place, height in ((following, 0.08), (PLY.transfers[0].target, GRIP + 0.004)):
        assert progress(0, Stage.RELEASE, arm(place, height, CLOSED, 4.0)) == Progress(0, True)
        assert progress(1, Stage.RELEASE, arm(place, height, CLOSED, 4.0)) == Progress(1, True)


@pytest.mark.parametrize("finger", [CLOSED, CLOSED + 0.0018])  # the latter where too hard a grip was let go of
@pytest.mark.parametrize("place", ["source", "target"])
def test_fingers_that_feel_nothing_on_the_way_have_lost_it(place: str, finger: float) -> None:
    there = getattr(PLY.transfers[1], place)
    with pytest.raises(PieceLost, match="lost the white pawn on the way from e4 to d5: set it on e4 by hand"):
        progress(1, Stage.CARRY, arm(there, 0.08, finger, 0.0))


def test_a_broken_off_return_leaves_nothing_to_carry() -> None:
    state = arm(PLY.transfers[1].target, 0.1, OPEN, 0.0)
    assert progress(2, Stage.RETURN, state) == Progress(2, False)
