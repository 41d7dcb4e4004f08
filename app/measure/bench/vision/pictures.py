"""Bench ``pictures``: what a picture of the simulation costs each of its uses, and what a look at the board comes to.

The renderer's own process draws the start position; times are from asking to the answer, as a world has them in pace
``fast``, where plant time waits meanwhile.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from typing import Final

import chess

from app.measure.bench.report import BenchReport, Progress, Row, row
from app.measure.bench.vision.games import open_studio
from app.pieces.layout import start_layout
from hardware.sim.process.table_studio import PlacedPiece, TableStudio
from hardware.sim.render.settings import SceneState
from hardware.table import TableSettings
from vision.board.find import find_board
from vision.board.moved import Anchor
from vision.board.orientation import orient
from vision.board.view import BoardView, playing_area
from vision.pieces.placement_faults import examine_board
from vision.reading.observer import Observer
from vision.reading.rectified_view import sight_of_frame

SEED: Final = 1
PICTURES: Final = {True: 20, False: 200}  # by ``quick``
COLOUR_LIMIT, FILM_LIMIT, GUARD_LIMIT = 45.0, 20.0, 12.0  # [ms]


def pictures_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick``: 20 pictures of each kind instead of 200.

    Raises:
        HardwareError: there is no OpenGL here.
    """
    table, count, seeds = TableSettings(), PICTURES[quick], itertools.count(SEED)
    poses = [PlacedPiece(piece.name, *table.xy(piece.place)) for piece in start_layout(chess.Board(), table)]
    with open_studio(table) as studio:
        kinds: dict[str, tuple[Callable[[], object], float | None]] = {
            "colour_for_a_look": (lambda: studio.colour(poses, next(seeds)), COLOUR_LIMIT),
            "colour_for_a_film": (lambda: studio.film(poses), FILM_LIMIT),
            "depth_for_the_guard": (lambda: studio.glance(poses, next(seeds)), GUARD_LIMIT),
            "frame_for_a_look": (lambda: studio.frame(poses, SceneState(), next(seeds)), None),
            "look": (_looking(studio, table, poses), None),
        }
        rows = dict[str, Row]()
        for kind, (act, limit) in kinds.items():
            progress(f"{count} times {kind.replace('_', ' ')}")
            rows[kind] = row(_timed(act, count), "ms", limit)
    return BenchReport.of("pictures", SEED, rows)


def _looking(studio: TableStudio, table: TableSettings, poses: list[PlacedPiece]) -> Callable[[], None]:
    """A look as after a ply of the arm: a frame, the board followed in it, each piece held against its place, and what
    the squares look like learnt again.
    """
    board, seeds = chess.Board(), itertools.count(SEED)
    expected = {piece.place.index: piece for piece in start_layout(board, table) if piece.place.on_board}
    first = studio.frame(poses, SceneState(), next(seeds))
    view = BoardView.from_corners(
        first.intrinsics, orient(first.colour, find_board(first.colour).corners, board).corners, table
    )
    anchor = Anchor(first.colour, view.project(playing_area(table)))
    observer = Observer(board, sight_of_frame(first, view))
    before = examine_board(first, view, expected).likeness

    def look() -> None:
        frame = studio.frame(poses, SceneState(), next(seeds))
        anchor.follow(frame.colour)
        examine_board(frame, view, expected, before)
        observer.confirm(observer.look(sight_of_frame(frame, view)), board)

    return look


def _timed(act: Callable[[], object], count: int) -> list[float]:
    """How long each of so many takes, after one that does not count [ms]."""
    act()
    took = []
    for _ in range(count):
        since = time.perf_counter()
        act()
        took.append(1e3 * (time.perf_counter() - since))
    return took
