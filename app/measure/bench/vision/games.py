"""Rows of ``touchmove bench vision``: games of rendered pictures, in good light and bad, and what people do wrong.

Positions are rendered one by one, without an arm. The board is found in the first picture of each game, as in a lab.
Truth is the game that the pictures were made from.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping
from typing import Final

import chess
import numpy as np

from app.campaign.tasks.lines import random_game
from app.measure.bench.report import Progress, Row, Tally, row
from app.measure.bench.vision.calibration import OFF, random_looks, random_mount
from app.motion import MotionSettings
from app.pieces.layout import start_layout
from hardware.interfaces import Frame
from hardware.piece_set import Colour
from hardware.sim.bodies.hand import HandPose
from hardware.sim.process.table_studio import PlacedPiece, TableStudio
from hardware.sim.render.settings import ExposureSettings, LightSettings, MountSettings, SceneState
from hardware.table import Place, TableSettings, square_place
from vision.board.find import find_board
from vision.board.moved import Anchor
from vision.board.orientation import orient
from vision.board.view import BoardView
from vision.hands.hand_and_motion import Watch
from vision.reading.evidence import codes_of, states_of
from vision.reading.moves import MoveReading
from vision.reading.observer import Observation, Observer
from vision.reading.outcome import LOOKS, ReadingOutcome
from vision.reading.rectified_view import RectifiedView, sight_of_frame

PLIES: Final = {True: 16, False: 2000}  # by ``quick``
A_GAME: Final = 80  # plies of a game at most: then light, camera and set-up are drawn anew
TROUBLED: Final = {True: 6, False: 300}
TROUBLED_FIRST: Final = 1000
"""Seed of the first game in trouble."""
KNOCKED: Final = 0.06
"""A camera that is knocked again and again stays within this of where it should hang, along both axes [m]."""


class BoardReader:
    """Looks at a rendered board like the app: finds it in a frame that shows a known position, follows it, reads it.

    Attributes:
        observer: reads.
        view: of the board, as found.
    """

    def __init__(self, frame: Frame, board: chess.Board, table: TableSettings) -> None:
        self._table = table
        found = orient(frame.colour, find_board(frame.colour).corners, board)
        if not found.sure:
            raise RuntimeError("the start position does not tell which side is White's: this bench cannot begin")
        self._watch = Watch()
        self._hold(frame, found.corners)
        self._watch.update(frame, self.view)
        self.observer = Observer(board, self.rectified(frame))

    def rectified(self, frame: Frame) -> RectifiedView:
        """The board in a frame of the same camera."""
        check = self._anchor.follow(frame.colour)
        if check.moved:
            self._hold(frame, check.corners)
        return sight_of_frame(frame, self.view)

    def _hold(self, frame: Frame, corners: np.ndarray) -> None:
        self._anchor = Anchor(frame.colour, corners)
        self.view = BoardView.from_corners(frame.intrinsics, corners, self._table)

    def read(self, frame: Frame, tally: Tally | None = None) -> tuple[Observation, MoveReading]:
        """What a settled frame tells.

        Its time [ms] is that for watching, as for every frame, and with finding the board again, laying out, looking,
        deciding; the processor's in all threads, so that of one core, however busy the machine is.
        """
        since = time.process_time()
        self._watch.update(frame, self.view)
        watched = time.process_time()
        look = self.observer.look(self.rectified(frame))
        decision = self.observer.decide(look)
        if tally is not None:
            tally["frame pair watched"].append(1e3 * (watched - since))
            tally["frame pair"].append(1e3 * (time.process_time() - since))
        return look, decision


class RandomTable:
    """A set of pieces on board and trays, each off its place and turned, as a person would put it down.

    They are off by up to ``off`` along both axes [m]; the seed decides how.
    """

    def __init__(self, table: TableSettings, off: float, seed: int) -> None:
        self.poses: Mapping[str, PlacedPiece] = {}  # how each piece stands, by name
        self._places: Mapping[str, Place] = {}
        self._table, self._off = table, off
        self._rng = np.random.default_rng([seed, 77])

    def set(self, board: chess.Board) -> None:
        """Set up a position: what stands on its place stays untouched, everything else is put down anew."""
        specs = start_layout(board, self._table)
        self.poses = {
            piece.name: self.poses[piece.name]
            if self._places.get(piece.name) == piece.place
            else self.put_down(piece.name, piece.place)
            for piece in specs
        }
        self._places = {piece.name: piece.place for piece in specs}

    def put_down(self, name: str, place: Place) -> PlacedPiece:
        """A piece as a person puts it on a place."""
        x, y = self._table.xy(place)
        dx, dy = self._rng.uniform(-self._off, self._off, 2).tolist()
        return PlacedPiece(name, x + dx, y + dy, yaw=float(self._rng.uniform(-math.pi, math.pi)))

    def standing_on(self, square: chess.Square) -> str:
        """Name of the piece on a square."""
        place = square_place(square)
        return next(name for name, where in self._places.items() if where == place)


class Scene:
    """A table that is set up and photographed, in light and with a camera of its own, all decided by a seed.

    Attributes:
        looks: light, exposure and how the camera hangs, in the next picture.
        hand: where a hand is, in the next picture; None: nowhere.
        square: side of one [m].
        table: how the pieces stand.
    """

    def __init__(self, studio: TableStudio, table: TableSettings, seed: int) -> None:
        self.rng = np.random.default_rng([seed, 5])
        self.looks: SceneState = random_looks(self.rng, random_mount(self.rng))
        self.hand: HandPose | None = None
        self.square = table.square
        self.table = RandomTable(table, OFF * table.square, seed)
        self._studio, self._seed = studio, seed

    def relook(self, **changed: LightSettings | ExposureSettings | MountSettings) -> None:
        """Change light, exposure or mount from the next picture on."""
        self.looks = self.looks.model_copy(update=changed)

    def picture(self, board: chess.Board | None = None) -> Frame:
        """Of a position, or of what stands there."""
        if board is not None:
            self.table.set(board)
        return self.photograph(self.table.poses)

    def photograph(self, poses: Mapping[str, PlacedPiece]) -> Frame:
        """Of pieces that stand so, by name."""
        return self._studio.frame(poses.values(), self.looks, self._seed, self.hand)


def open_studio(table: TableSettings, hand: Colour | None = None) -> TableStudio:
    """With the whole set on board and trays, and one side's hand if it is asked for.

    Raises:
        HardwareError: there is no OpenGL here.
    """
    return TableStudio(start_layout(chess.Board(), table), table, MotionSettings().home, hand=hand)


def game_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """Games in random light, with a random camera, pieces up to a fifth of a square off and a noisy sensor."""
    tally = follow_games(PLIES[quick], 0, lambda _: None, progress)
    return {
        "game wrong": row(tally["wrong"], "1", 0.0, "max"),
        "game asked": row(tally["asked"], "1", 0.01, "mean"),
        "game squares": row(tally["squares"], "1", 0.0005, "mean"),
        "frame pair": row(tally["frame pair"], "ms", 25.0, "p50"),
        "frame pair watched": row(tally["frame pair watched"], "ms"),
    }


def trouble_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """The same while light, camera and hands make trouble, drawn anew for each picture; see ``TROUBLES``."""
    tally = follow_games(TROUBLED[quick], TROUBLED_FIRST, _troubled, progress)
    return {"trouble wrong": row(tally["wrong"], "1", 0.0, "max"), "trouble asked": row(tally["asked"], "1")}


def follow_games(plies: int, first: int, change: Callable[[Scene], None], progress: Progress) -> Tally:
    """Follow so many plies of games with the seeds ``first``, ``first`` + 1 and so on.

    ``change`` happens to the scene before each picture.
    """
    table, tally = TableSettings(), Tally(list)
    with open_studio(table, hand=Colour.WHITE) as studio:
        for seed in itertools.count(first):
            _follow(Scene(studio, table, seed), seed, min(A_GAME, plies - len(tally["wrong"])), tally, progress, change)
            if len(tally["wrong"]) >= plies:
                return tally
    raise AssertionError("seeds never end")


def _troubled(scene: Scene) -> None:
    """Each sort of trouble in a third of pictures, independently of the others."""
    for trouble in TROUBLES.values():
        if scene.rng.random() < 1.0 / 3.0:
            trouble(scene)


def _shadows(scene: Scene) -> None:
    """Light from elsewhere: every shadow on the board is another one."""
    scene.relook(light=random_looks(scene.rng, scene.looks.mount).light)


def _glare(scene: Scene) -> None:
    """A strong lamp across the board from the camera, so that the board throws it into the picture."""
    x, y = scene.rng.uniform(-0.3, 0.3, 2).tolist()
    lamp = {"direction": (x, y - 0.8, 0.8), "brightness": float(scene.rng.uniform(0.9, 1.5)), "radius": 0.0}
    scene.relook(light=scene.looks.light.model_copy(update=lamp))


def _exposure_step(scene: Scene) -> None:
    exposure = scene.looks.exposure
    factor = float(scene.rng.choice([scene.rng.uniform(0.5, 0.75), scene.rng.uniform(1.35, 1.7)]))
    scene.relook(exposure=exposure.model_copy(update={"time": exposure.time * factor}))


def _knock(scene: Scene) -> None:
    """The camera is knocked by up to half a square, and stays so."""
    mount = scene.looks.mount
    x, y = (np.array(mount.shift[:2]) + scene.rng.uniform(-0.5, 0.5, 2) * scene.square).clip(-KNOCKED, KNOCKED).tolist()
    scene.relook(mount=MountSettings(shift=(x, y, mount.shift[2]), turn=mount.turn))


def _resting_hand(scene: Scene) -> None:
    """White's hand rests on the border, fingertips down to some millimetres before the first rank."""
    rng, edge = scene.rng, 4.0 * scene.square
    scene.hand = HandPose(
        float(rng.uniform(-edge, edge)), -edge - float(rng.uniform(0.008, 0.04)), float(rng.uniform(0.008, 0.03)),
        float(rng.uniform(-0.5, 0.5)), float(rng.uniform(0.0, 0.02)),
    )  # fmt: skip


TROUBLES: Final[dict[str, Callable[[Scene], None]]] = {
    "shadows": _shadows, "glare": _glare, "exposure step": _exposure_step, "knocked camera": _knock,
    "resting hand": _resting_hand,
}  # fmt: skip


def _follow(
    scene: Scene, seed: int, plies: int, tally: Tally, progress: Progress, change: Callable[[Scene], None]
) -> None:
    """Follow one game; where it is in doubt, the truth is the answer."""
    board = chess.Board()
    reader = BoardReader(scene.picture(board), board, TableSettings())
    for move in random_game(seed, plies):
        board.push(move)
        start = scene.looks
        change(scene)
        look, decision = reader.read(scene.picture(board), tally)
        for _ in range(LOOKS - 1):  # as in a game
            if decision.verdict is not ReadingOutcome.DOUBT:
                break
            look, decision = reader.read(scene.picture(), tally)
        # light and exposure are as they were; a camera that was knocked stays where it is now
        scene.looks, scene.hand = start.model_copy(update={"mount": scene.looks.mount}), None
        asked = decision.verdict is ReadingOutcome.DOUBT or (decision.promotion_unsure and bool(move.promotion))
        tally["asked"].append(float(asked))
        tally["wrong"].append(float(not asked and decision.moves != (move,)))
        read = look.evidence.read(codes_of(reader.observer.board))
        tally["squares"].append(float((read != states_of(codes_of(board))).mean()))
        progress(
            f"game {seed}, ply {len(board.move_stack)}: {move.uci()}"
            + (f", asked ({decision.margin:.1f})" if asked else "")
            + (f", WRONG: {decision}" if tally["wrong"][-1] else "")
        )
        reader.observer.confirm(look, board)
