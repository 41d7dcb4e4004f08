"""Fingers that come quickly, in physics: what they hit on their way is no grip."""

from __future__ import annotations

import chess
import pytest

from app.measure.bench.beds.plies import Disorder, GameBed
from app.motion.obstacles import closed_position
from app.motion.settings import PROFILES, Profile
from hardware.table import TableSettings

FEN = "n3k3/8/8/2R1N2K/8/8/8/8 w - - 0 1"
ACROSS = Disorder(offset=(0.0003, 0.0041))
"""Off across the fingers, so that both meet a piece at once, and by more than the 3 mm that are seen to."""
RUBBING = 1.3
"""Friction, as a share of what is assumed of pieces, pads and board."""


@pytest.mark.slow
@pytest.mark.parametrize("profile", [Profile.DEFAULT, Profile.FAST])
def test_a_piece_counts_as_gripped_where_it_is_held_and_not_where_it_is_hit(profile: Profile) -> None:
    far = 0
    for seed in range(12):
        board = chess.Board(FEN)
        bed = GameBed(board, PROFILES[profile], TableSettings(), ACROSS, seed)
        bed.plant.model.geom_friction[:, 0] *= RUBBING
        for square in (chess.C5, chess.E5, chess.H5):
            move = next(move for move in board.legal_moves if move.from_square == square)
            ply, plan, _ = bed.planned(move)
            transfer = ply.transfers[0]
            far += abs(bed.positions()[transfer.name][1] - bed.table.xy(transfer.source)[1]) > 0.003
            for motion in plan.motions[:2]:
                bed.carry_out(motion)
            held = closed_position(transfer.kind, bed.parameters.pads)
            assert bed.supervisor.measurement.finger_position == pytest.approx(held, abs=0.0003), transfer.kind
            for motion in bed.planner().home(transfer.kind).motions:
                bed.carry_out(motion)
    assert far > 5
