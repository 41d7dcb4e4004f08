"""Rows of ``touchmove bench vision``: games of rendered pictures, in good light and bad, and what people do wrong.

Positions are rendered one by one; nobody plays them. The board is found in the first picture of each game, as in a lab.
Truth is the game that the pictures were made from.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

import chess
import numpy as np

from app.bench.positions import Table
from app.bench.report import Row, row
from app.bench.vision_calibration import OFF, random_looks, random_mount
from app.layout import start_layout
from app.motion import MotionSettings
from hardware.interfaces import Frame
from hardware.sim.looks import Looks, MountSettings
from hardware.sim.table_studio import Pose, TableStudio
from hardware.table import TableSettings
from vision.anchor import Anchor
from vision.board import BoardView
from vision.evidence import codes_of, states_of
from vision.find import find_board
from vision.moves import Decision
from vision.observer import Look, Observer
from vision.orientation import orient
from vision.sight import Sight, sight_of_frame
from vision.verdict import Verdict

Progress = Callable[[str], None]

PLIES: Final = {True: 16, False: 2000}
"""By ``quick``."""
A_GAME: Final = 80
"""Plies of a game at most: then light, camera and set-up are drawn anew."""
TROUBLED: Final = {True: 6, False: 300}
SLOWEST_MS: Final = 25.0
ASKED_LIMIT: Final = 0.01
SQUARE_LIMIT: Final = 0.0005
"""Share of squares that may be read wrong."""


@dataclass(slots=True)
class Tally:
    """What came of looks."""

    plies: int = 0
    wrong: list[float] = field(default_factory=list)
    asked: list[float] = field(default_factory=list)
    squares: list[float] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    promotions: int = 0


class Eye:
    """Looks at a rendered board like the app: finds it, follows it, reads it.

    Args:
        frame: shows ``board``.
        board: what stands there.
        table: size of the squares.

    Attributes:
        observer: reads.
        view: of the board, as found.
    """

    def __init__(self, frame: Frame, board: chess.Board, table: TableSettings) -> None:
        self._table = table
        found = orient(frame.colour, find_board(frame.colour).corners, board)
        if not found.sure:
            raise RuntimeError("the start position does not tell which side is White's: this bench cannot begin")
        self._hold(frame, found.corners)
        self.observer = Observer(board, self.sight(frame))

    def sight(self, frame: Frame) -> Sight:
        """The board in a frame of the same camera."""
        check = self._anchor.follow(frame.colour)
        if check.moved:
            self._hold(frame, check.corners)
        return sight_of_frame(frame, self.view)

    def _hold(self, frame: Frame, corners: np.ndarray) -> None:
        self._anchor = Anchor(frame.colour, corners)
        self.view = BoardView.from_corners(frame.intrinsics, corners, self._table)

    def read(self, frame: Frame, tally: Tally) -> tuple[Look, Decision]:
        """What a frame tells; its time is taken down."""
        since = time.perf_counter()
        look = self.observer.look(self.sight(frame))
        decision = self.observer.decide(look)
        tally.times.append(1e3 * (time.perf_counter() - since))
        return look, decision


class Scene:
    """A table that is set up and photographed, in light and with a camera of its own.

    Args:
        studio: draws.
        table: board and trays.
        seed: decides how pieces are put down, light, camera and noise.

    Attributes:
        looks: light, exposure and how the camera hangs, in the next picture.
        table: how the pieces stand.
    """

    def __init__(self, studio: TableStudio, table: TableSettings, seed: int) -> None:
        self.rng = np.random.default_rng([seed, 5])
        self.looks: Looks = random_looks(self.rng, random_mount(self.rng))
        self.table = Table(table, OFF * table.square, seed)
        self._studio, self._seed = studio, seed

    def picture(self, board: chess.Board | None = None) -> Frame:
        """Of a position, or of what stands there."""
        if board is not None:
            self.table.set(board)
        return self.photograph(self.table.poses)

    def photograph(self, poses: Mapping[str, Pose]) -> Frame:
        """Of pieces that stand so, by name."""
        return self._studio.frame(poses.values(), self.looks, self._seed)


def open_studio(table: TableSettings) -> TableStudio:
    """With the whole set on board and trays.

    Raises:
        HardwareError: there is no OpenGL here.
    """
    return TableStudio(start_layout(chess.Board(), table), table, MotionSettings().home)


def random_game(seed: int, plies: int) -> Iterator[chess.Move]:
    """Moves of a game that captures, castles and promotes more often than people do."""
    rng, board = np.random.default_rng([seed, 6]), chess.Board()
    for _ in range(plies):
        moves = [move for move in board.legal_moves if move.promotion in (None, chess.QUEEN)]
        if not moves or board.is_insufficient_material():
            return
        rare = [board.is_capture(move) or board.is_castling(move) or bool(move.promotion) for move in moves]
        weight = np.where(rare, 3.0, 1.0)
        move = moves[rng.choice(len(moves), p=weight / weight.sum())]
        board.push(move)
        yield move


def game_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """Games in random light, with a random camera, pieces up to a fifth of a square off and a noisy sensor."""
    table, tally = TableSettings(), Tally()
    with open_studio(table) as studio:
        for seed in range(1000):
            if tally.plies >= PLIES[quick]:
                break
            _follow(Scene(studio, table, seed), seed, min(A_GAME, PLIES[quick] - tally.plies), tally, progress, _steady)
    return {
        "game wrong": row(tally.wrong, "1", 0.0, "max"),
        "game asked": row(tally.asked, "1", ASKED_LIMIT, "mean"),
        "game squares": row(tally.squares, "1", SQUARE_LIMIT, "mean"),
        "look": row(tally.times, "ms", SLOWEST_MS, "p50"),
    }


def trouble_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """The same in light that changes from picture to picture, and with a camera that is knocked."""
    table, tally = TableSettings(), Tally()
    with open_studio(table) as studio:
        for seed in range(1000, 2000):
            if tally.plies >= TROUBLED[quick]:
                break
            rest = TROUBLED[quick] - tally.plies
            _follow(Scene(studio, table, seed), seed, min(A_GAME, rest), tally, progress, _troubled)
    return {"trouble wrong": row(tally.wrong, "1", 0.0, "max"), "trouble asked": row(tally.asked, "1")}


def _steady(scene: Scene) -> Looks:
    return scene.looks


def _troubled(scene: Scene) -> Looks:
    """Light from elsewhere, an exposure step, a camera knocked by up to half a square: each in a third of pictures."""
    looks, rng = scene.looks, scene.rng
    if rng.random() < 0.33:
        looks = looks.model_copy(update={"light": random_looks(rng, looks.mount).light})
    if rng.random() < 0.33:
        factor = float(rng.uniform(0.5, 1.7))
        exposure = looks.exposure.model_copy(update={"time": looks.exposure.time * factor})
        looks = looks.model_copy(update={"exposure": exposure})
    if rng.random() < 0.33:
        x, y = (np.array(looks.mount.shift[:2]) + rng.uniform(-0.02, 0.02, 2)).tolist()
        mount = MountSettings(shift=(x, y, looks.mount.shift[2]), turn=looks.mount.turn)
        looks = looks.model_copy(update={"mount": mount})
    return looks


def _follow(
    scene: Scene, seed: int, plies: int, tally: Tally, progress: Progress, change: Callable[[Scene], Looks]
) -> None:
    """Follow one game; where it is in doubt, the truth is the answer."""
    board = chess.Board()
    eye = Eye(scene.picture(board), board, TableSettings())
    for move in random_game(seed, plies):
        board.push(move)
        start = scene.looks
        scene.looks = change(scene)
        look, decision = eye.read(scene.picture(board), tally)
        scene.looks = replace_mount(start, scene.looks.mount)
        tally.plies += 1
        asked = decision.verdict is Verdict.DOUBT or (decision.promotion_unsure and bool(move.promotion))
        tally.asked.append(float(asked))
        tally.wrong.append(float(not asked and decision.moves != (move,)))
        read = look.evidence.read(codes_of(eye.observer.board))
        tally.squares.append(float((read != states_of(codes_of(board))).mean()))
        progress(
            f"game {seed}, ply {len(board.move_stack)}: {move.uci()}"
            + (f", asked ({decision.margin:.1f})" if asked else "")
            + (f", WRONG: {decision}" if tally.wrong[-1] else "")
        )
        eye.observer.confirm(look, board)


def replace_mount(looks: Looks, mount: MountSettings) -> Looks:
    """Light and exposure as they were; a camera that was knocked stays where it is now."""
    return looks.model_copy(update={"mount": mount})
