"""How far a standing piece is pushed before both fingers hold it, with and without tactile feedback."""

from __future__ import annotations

import random
from typing import Final

import chess
import numpy as np

from app.measure.bench.beds.plies import Disorder, GameBed, positions
from app.measure.bench.report import Progress
from app.motion import MotionSettings
from app.pieces.inventory import MoveKind
from hardware.parameters import RobotParameters
from hardware.table import TableSettings

GRASPS_A_WORLD: Final = 10
OFF: Final = Disorder(offset=(0.003, 0.0))
"""Pieces stand off along the fingers' axis."""


def slides(
    count: int,
    settings: MotionSettings,
    parameters: RobotParameters,
    table: TableSettings,
    seed: int,
    progress: Progress,
) -> list[float]:
    """How far each of so many pieces was pushed, from where it stood to where it was gripped, seen from above [m].

    Raises:
        RuntimeError: a piece was not gripped.
    """  # fmt: skip
    rng, found = random.Random(seed), list[float]()
    for number, board in enumerate(positions(seed)):
        bed = GameBed(board, settings, parameters, table, OFF, seed + number)
        for move in _one_a_piece(board, rng)[:GRASPS_A_WORLD]:
            found.append(_slide(bed, move))
            if len(found) == count:
                return found
        if number % 10 == 0:
            progress(f"{len(found)} of {count} grasps, k* = {settings.gains.tactile_gain:g}")
    raise AssertionError("positions never end")


def _one_a_piece(board: chess.Board, rng: random.Random) -> list[chess.Move]:
    """A quiet move of every piece that has one."""
    moves = [move for move in board.legal_moves if not board.is_capture(move) and not board.is_castling(move)]
    rng.shuffle(moves)
    return list({move.from_square: move for move in moves if move.promotion is None}.values())


def _slide(bed: GameBed, move: chess.Move) -> float:
    """Grasp the piece of a move where it stands, let go of it again, and go home."""
    ply, plan, _ = bed.planned(move)
    assert ply.kind is MoveKind.QUIET
    name, kind = ply.transfers[0].name, ply.transfers[0].kind
    before = bed.positions()[name]
    for motion in plan.motions[:2]:
        bed.carry_out(motion)
    pushed = float(np.hypot(*(bed.positions()[name] - before)[:2]))
    for motion in bed.planner(bed.settings, bed.table).home(kind).motions:
        bed.carry_out(motion)
    return pushed
