"""Rows of ``touchmove bench vision``: any position, told from what stands there alone.

Positions are from random games of up to 160 plies; light, camera and how the pieces stand are drawn anew for each, the
pieces up to a fifth of a square off and turned anyhow. The board is found where a calibrated camera believes it to be.
"""

from __future__ import annotations

from collections import Counter
from typing import Final

import chess
import numpy as np

from app.campaign.tasks.lines import random_game
from app.measure.bench.report import Progress, Row, Tally, row
from app.measure.bench.vision.games import Scene, open_studio
from app.pieces.layout import colour_of, kind_of, physical_set
from app.rig.simulation.nominal_view import nominal_view
from hardware.interfaces import Frame
from hardware.table import TableSettings, square_place
from vision.board.find import find_board
from vision.board.view import BoardView, playing_area
from vision.reading.outcome import LOOKS
from vision.standing.recognise import recognise
from vision.standing.recognised_set import RecognisedSet

POSITIONS: Final = {True: 6, False: 200}  # by ``quick``
FIRST: Final = 20_000  # seed of the first
LATEST: Final = 160  # plies played before


def position_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """What is told of each piece, and of each square that is empty."""
    tally, table = Tally(list), TableSettings()
    with open_studio(table) as studio:
        for seed in range(FIRST, FIRST + POSITIONS[quick]):
            board = random_board(seed)
            scene = Scene(studio, table, seed)
            frames = [scene.picture(board), *(scene.picture() for _ in range(LOOKS - 1))]
            _compare(recognised(frames, table), board, tally)
            progress(f"position {seed}: {board.board_fen()}, {int(sum(tally['asked']))} asked so far")
    return {
        "position wrong": row(tally["wrong"], "1", 0.0, "max"),
        "position asked": row(tally["asked"], "1", 0.005, "mean"),
        "position empty asked": row(tally["empty asked"], "1"),
    }


def random_board(seed: int) -> chess.Board:
    """A position from some game."""
    rng, board = np.random.default_rng([seed, 99]), chess.Board()
    for move in random_game(int(rng.integers(1 << 31)), int(rng.integers(0, LATEST))):
        board.push(move)
    return board


def recognised(frames: list[Frame], table: TableSettings) -> RecognisedSet:
    """As the app does it with a calibrated camera."""
    first = frames[0]
    near = nominal_view(first.intrinsics, table).project(playing_area(table))
    view = BoardView.from_corners(first.intrinsics, find_board(first.colour, near=near).corners, table)
    return recognise(frames, view, Counter((piece.colour, piece.kind) for piece in physical_set()))


def _compare(found: RecognisedSet, board: chess.Board, tally: Tally) -> None:
    """Wrong is what is said and is not so; asked, what is not said."""
    seen = {one.place: one for one in found.pieces}
    for square in chess.SQUARES:
        place, piece = square_place(square), board.piece_at(square)
        asked = place in found.lying | found.between | found.uncertain
        one = seen.get(place)
        if piece is None:
            tally["empty asked"].append(float(asked))
            tally["wrong"].append(float(one is not None and not asked and one.instead is None))
            continue
        asked |= one is not None and one.instead is not None
        right = one is not None and one.look == (colour_of(piece.color), kind_of(piece))
        tally["asked"].append(float(asked))
        tally["wrong"].append(float(not asked and not right))
