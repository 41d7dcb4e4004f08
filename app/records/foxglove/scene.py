"""The robot and its board in 3-D beside the telemetry: frames, solids, the path of each motion, pictures.

All of it is derived in the recorder's thread from the telemetry, from the record's own files and from the kinematics of
the model; neither the controller nor the game does anything for it. What never moves is said once, on channels of its
own, so that a viewer that jumps to any moment finds it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.records.events import PlyEvent, StartEvent
from app.records.foxglove import encoding, schemas
from app.records.foxglove.pieces import PieceFollower, ShownPiece
from app.records.foxglove.tail import RecordTail
from app.records.frames import frame_file
from app.records.robot import RobotRecord, kept_robot
from app.records.rounds import rounds_of
from app.scene.arm import arm_joints
from app.scene.frames import (
    BASE,
    BOARD,
    CAMERA,
    REFERENCE,
    TOOL,
    UPSIDE_DOWN,
    FramePose,
    fixed_frames,
    moving_frames,
    robot_solids,
    table_solids,
)
from app.scene.table import piece_solids
from controller.model.constants import DeltaModel
from controller.model.reach import PoseError
from controller.protocol.messages import Telemetry
from hardware.interfaces import Triple
from hardware.piece_set import PIECE_SHAPES

FRAMES_TOPIC: Final = "/tf"
FIXED_TOPIC: Final = "/tf_static"
ROBOT_TOPIC: Final = "/scene/robot"
TABLE_TOPIC: Final = "/scene/table"
PIECES_TOPIC: Final = "/scene/pieces"
PATH_TOPIC: Final = "/scene/path"
PICTURE_TOPIC: Final = "/camera/board"
TRACKING_TOPIC: Final = "/controller/tracking"
SCHEMAS: Final[dict[str, schemas.Schema]] = {
    FRAMES_TOPIC: schemas.TRANSFORMS, FIXED_TOPIC: schemas.TRANSFORMS, ROBOT_TOPIC: schemas.SCENE,
    TABLE_TOPIC: schemas.SCENE, PIECES_TOPIC: schemas.SCENE, PATH_TOPIC: schemas.SCENE,
    PICTURE_TOPIC: schemas.IMAGE, TRACKING_TOPIC: schemas.TRACKING,
}  # fmt: skip

RATE: Final = 20.0
"""Of frames [1/s, plant time]."""
_AT_REST: Final = 10**9
"""While nothing moves, frames are told so often [ns]."""
_NEAR: Final = 1e-5
"""What moves by less does not move: as fine as it is written [m]."""
_PATH_OFF: Final = 0.001
"""The path of a motion is drawn with as few points as stay so near to it [m]."""
_REFERENCE_DIAMETER: Final = 0.008
_PATH_THICKNESS: Final = 0.002


class SceneMessage(NamedTuple):
    """A message of a channel: which, its plant time [ns], and its content."""

    topic: str
    stamp: int
    data: bytes

    @property
    def schema(self) -> schemas.Schema:
        """Of its channel."""
        return SCHEMAS[self.topic]


class SceneRecorder:
    """Makes messages of what the telemetry and the record in a folder tell."""

    def __init__(self, folder: Path) -> None:
        """Of the folder of a match, in which there may be nothing yet."""
        self._folder = folder
        self._tail = RecordTail(folder)
        self._robot: RobotRecord | None = None
        self._frames: _MovingFrames | None = None
        self._path = _PathOfMotion()
        self._worst = _Worst()
        self._pieces = _PieceEntities()
        self._follower: PieceFollower | None = None
        self._pictured = False
        self._due = 0

    def take(self, told: Telemetry, stamp: int) -> Iterator[SceneMessage]:
        """What one telemetry, of a plant time [ns], and what was written until then, come to.

        Raises:
            RecordError: a file of the record is not of this version.
            ValueError: the record contradicts itself.
        """
        self._worst.take(told)
        path = tuple(self._path.take(told, stamp))
        if self._robot is not None:
            yield from path
        if stamp < self._due:
            return
        self._due = stamp + round(1e9 / RATE)
        first = self._robot is None
        if first:
            yield from self._begin(stamp)
        if self._robot is None or self._frames is None:
            return
        yield from self._events(self._robot, stamp, first)
        yield from self._frames.take(told, stamp)
        yield self._worst.message(stamp)

    def finish(self) -> Iterator[SceneMessage]:
        """What is left when no telemetry comes any more; raises as ``take``."""
        if self._robot is not None:
            yield from self._path.finish()
            yield from self._events(self._robot, math.inf, False)

    def _begin(self, stamp: int) -> Iterator[SceneMessage]:
        """What never changes, once the record says which robot plays."""
        found = (kept_robot(folder) for folder in reversed((self._folder, *rounds_of(self._folder))))
        robot = next((one for one in found if one is not None), None)
        if robot is None:
            return
        self._robot = robot
        self._frames = _MovingFrames(DeltaModel(robot.parameters))
        entities = [encoding.entity(p.name, p.frame, p.solids, stamp) for p in robot_solids(robot.parameters)]
        entities.append(encoding.marker(REFERENCE, REFERENCE, _REFERENCE_DIAMETER, stamp))
        table = table_solids(robot.table)
        for topic, message in (
            (FIXED_TOPIC, encoding.transforms(fixed_frames(robot.table, robot.board_from_camera), stamp)),
            (ROBOT_TOPIC, encoding.update(entities)),
            (TABLE_TOPIC, encoding.update([encoding.entity(table.name, table.frame, table.solids, stamp)])),
        ):
            yield SceneMessage(topic, stamp, encoding.text(message))

    def _events(self, robot: RobotRecord, until: float, first: bool) -> Iterator[SceneMessage]:
        """What was recorded until a plant time [ns]; of all that was before the first telemetry, how it ended."""
        changed = None
        for folder, event in self._tail.due(until * 1e-9):
            when = round(until if first else event.plant_time * 1e9)
            if isinstance(event, StartEvent):
                self._follower = PieceFollower(event, robot.table)
                self._pictured = False
            elif self._follower is not None:
                self._follower.take(event)
                if not first:
                    yield from self._pictures(folder, event, when)
            changed = when
            if not first:
                yield from self._shown(when)
        if first and changed is not None:
            yield from self._shown(changed)

    def _shown(self, stamp: int) -> Iterator[SceneMessage]:
        if self._follower is not None and self._pieces.take(self._follower.pieces(), stamp):
            yield SceneMessage(PIECES_TOPIC, stamp, self._pieces.message())

    def _pictures(self, folder: Path, event: Any, stamp: int) -> Iterator[SceneMessage]:
        """The picture of a ply that was done; that of the start before the first step."""
        names = []
        if not self._pictured:
            self._pictured = True
            names.append((frame_file(folder, 0, None), stamp))
        if isinstance(event, PlyEvent) and event.frame is not None:
            names.append((frame_file(folder, event.ply, event.frame), stamp))
        for path, when in names:
            if path is not None:
                message = encoding.image(path.read_bytes(), CAMERA, when)
                yield SceneMessage(PICTURE_TOPIC, when, encoding.text(message))


class _MovingFrames:
    """Frames at a rate while something moves, and seldom at rest.

    A viewer goes evenly from one message to the next. So before the first one after a rest the last pose of that rest
    is told, or links would creep all the time towards a pose that they took at once.
    """

    def __init__(self, model: DeltaModel) -> None:
        self._model = model
        self._told: tuple[FramePose, ...] = ()
        self._last = -_AT_REST
        self._rested: tuple[tuple[FramePose, ...], int] | None = None

    def take(self, told: Telemetry, stamp: int) -> Iterator[SceneMessage]:
        try:
            joints = arm_joints(self._model, told.angle)
        except PoseError:
            return  # before the first measurement, or with a broken encoder, there is no pose to show
        frames = moving_frames(joints, told.finger_position, told.reference)
        alike = _alike(frames, self._told)
        if alike and stamp - self._last < _AT_REST:
            self._rested = self._told, stamp
            return
        if self._rested is not None and not alike:
            yield self._message(*self._rested)
        self._told, self._last, self._rested = frames, stamp, None
        yield self._message(frames, stamp)

    def _message(self, frames: tuple[FramePose, ...], stamp: int) -> SceneMessage:
        return SceneMessage(FRAMES_TOPIC, stamp, encoding.text(encoding.transforms(frames, stamp)))


def _alike(one: tuple[FramePose, ...], other: tuple[FramePose, ...]) -> bool:
    if len(one) != len(other):
        return False
    return all(
        math.dist(a.at, b.at) < _NEAR and math.dist(a.turned, b.turned) < _NEAR for a, b in zip(one, other, strict=True)
    )


class _PieceEntities:
    """All pieces as one message; only those are written anew that are elsewhere than before."""

    def __init__(self) -> None:
        self._known: dict[str, ShownPiece] = {}
        self._texts: dict[str, bytes] = {}

    def take(self, pieces: tuple[ShownPiece, ...], stamp: int) -> bool:
        """Whether a piece is elsewhere."""
        changed = {piece.name: piece for piece in pieces if self._known.get(piece.name) != piece}
        for name, piece in changed.items():
            self._known[name] = piece
            self._texts[name] = encoding.text(_entity_of(piece, stamp))
        return bool(changed)

    def message(self) -> bytes:
        return b'{"deletions":[],"entities":[' + b",".join(self._texts.values()) + b"]}"


def _entity_of(piece: ShownPiece, stamp: int) -> dict[str, Any]:
    solids = piece_solids(piece.kind, piece.colour)
    if not piece.held:
        return encoding.entity(piece.name, BOARD, solids, stamp, (*piece.at, 0.0))
    below = PIECE_SHAPES[piece.kind].grip_height + piece.raised
    return encoding.entity(piece.name, TOOL, solids, stamp, (0.0, 0.0, below), UPSIDE_DOWN)


class _PathOfMotion:
    """The reference's path of each motion, told when the motion is over, for the time when it began.

    A player sorts messages by their time, so it shows the whole path while the tool goes along it.
    """

    def __init__(self) -> None:
        self._motion = 0
        self._began = 0
        self._points: list[Triple] = []

    def take(self, told: Telemetry, stamp: int) -> Iterator[SceneMessage]:
        if told.motion != self._motion:
            yield from self.finish()
            self._motion, self._began, self._points = told.motion, stamp, []
        if told.motion and all(map(math.isfinite, told.reference)):
            self._points.append(told.reference)

    def finish(self) -> Iterator[SceneMessage]:
        points = thinned(self._points)
        if self._motion and len(points) > 1:
            entity = encoding.line("path", BASE, points, _PATH_THICKNESS, self._began)
            yield SceneMessage(PATH_TOPIC, self._began, encoding.text(encoding.update([entity])))


def thinned(points: list[Triple], off: float = _PATH_OFF) -> list[Triple]:
    """Some of the points of a path, its ends among them, such that no other lies farther than ``off`` from the line
    through them [m].
    """
    if len(points) < 3:
        return points
    start, end = points[0], points[-1]
    far, at = max((_aside(point, start, end), place) for place, point in enumerate(points[1:-1], start=1))
    if far <= off:
        return [start, end]
    return thinned(points[: at + 1], off)[:-1] + thinned(points[at:], off)


def _aside(point: Triple, start: Triple, end: Triple) -> float:
    """How far a point is from a segment [m]."""
    way = [b - a for a, b in zip(start, end, strict=True)]
    to = [b - a for a, b in zip(start, point, strict=True)]
    square = sum(w * w for w in way)
    share = 0.0 if square == 0.0 else min(1.0, max(0.0, sum(w * t for w, t in zip(way, to, strict=True)) / square))
    return math.dist(to, [share * w for w in way])


class _Worst:
    """The worst values since the last message."""

    def __init__(self) -> None:
        self._values: dict[str, float] = {}

    def take(self, told: Telemetry) -> None:
        error = math.dist(told.position, told.reference) if told.motion else 0.0
        values = {
            "error": error, "force": math.hypot(*told.force), "tactile": max(told.tactile),
            "torque": max(map(abs, told.torque)), "lateness": told.lateness,
        }  # fmt: skip
        for name, value in values.items():
            if math.isfinite(value):
                self._values[name] = max(self._values.get(name, 0.0), value)

    def message(self, stamp: int) -> SceneMessage:
        rounded = {name: round(value, 6) for name, value in self._values.items()}
        self._values = {}
        return SceneMessage(TRACKING_TOPIC, stamp, encoding.text(rounded))
