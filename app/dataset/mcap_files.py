"""Episodes as MCAP, one file each: state, action, pictures, and the robot in 3-D in Foxglove's schemas.

Messages are JSON, their time is plant time from the episode's beginning. ``/task`` says in words what is done; which
ply of which game it is, and whether it succeeded, stands in the file's metadata ``episode`` and in ``index.jsonl``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, Final

import cv2
import numpy as np
from mcap.writer import CompressionType, Writer

from app.dataset.demonstrations import Demonstration
from app.dataset.games import RecordedPly
from app.dataset.signals import ACTION, FINGER, REFERENCE, STATE, Signal
from app.dataset.writers import Shown
from app.records.files import RecordError, recording, write_atomically
from app.records.foxglove import encoding, schemas
from app.records.foxglove.scene import FIXED_TOPIC, FRAMES_TOPIC, ROBOT_TOPIC, TABLE_TOPIC
from app.records.robot import RobotRecord
from app.scene.arm import arm_joints
from app.scene.frames import BOARD, fixed_frames, moving_frames, robot_solids, table_solids
from controller.model.constants import DeltaModel
from hardware.interfaces import Triple

INDEX_FILE: Final = "index.jsonl"
TASK_TOPIC: Final = "/task"
STATE_TOPIC: Final = "/observation/state"
REFERENCE_TOPIC: Final = "/observation/reference"
ACTION_TOPIC: Final = "/action"
_JPEG: Final = (cv2.IMWRITE_JPEG_QUALITY, 90)


def picture_topic(view: str) -> str:
    """Of the pictures of a view."""
    return f"/observation/images/{view}"


class McapWriter:
    """An ``EpisodeWriter`` of MCAP files in a folder that is there."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._index = list[dict[str, Any]]()
        self._file: _EpisodeFile | None = None
        self._episode: Demonstration | None = None

    def begin(self, episode: Demonstration, robot: RobotRecord | None) -> None:
        """See ``EpisodeWriter.begin``."""
        path = self._root / f"episode-{len(self._index):06d}.mcap"
        self._index.append({"file": path.name, "frames": len(episode), **described(episode.ply)})
        self._file, self._episode = _EpisodeFile(path), episode
        for topic, schema, stamp, message in _told(episode, robot):
            self._file.add(topic, schema, stamp, encoding.text(message))

    def show(self, frame: int, shown: Shown) -> None:
        """See ``EpisodeWriter.show``."""
        assert self._file is not None
        assert self._episode is not None
        stamp = _stamps(self._episode)[frame]
        for view, picture in shown.items():
            done, jpeg = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), _JPEG)
            assert done, "a picture of three channels can be a JPEG"
            message = encoding.image(jpeg.tobytes(), view, stamp)
            self._file.add(picture_topic(view), schemas.IMAGE, stamp, encoding.text(message))

    def end(self) -> None:
        """See ``EpisodeWriter.end``."""
        assert self._file is not None
        assert self._episode is not None
        file, self._file = self._file, None
        file.close(described(self._episode.ply))

    def close(self) -> None:
        """See ``EpisodeWriter.close``."""
        write_atomically(self._root / INDEX_FILE, "".join(json.dumps(one) + "\n" for one in self._index))

    def drop(self) -> None:
        """See ``EpisodeWriter.drop``."""
        if self._file is not None:
            self._file.drop()


def described(ply: RecordedPly) -> dict[str, Any]:
    """Which ply of which game, what it was, and whether it succeeded."""
    return {
        "task": ply.task, "game": ply.game, "seed": ply.seed, "ply": ply.number, "uci": ply.uci, "fen": ply.fen,
        "success": ply.success, "begun": ply.begun,
    }  # fmt: skip


class _EpisodeFile:
    def __init__(self, path: Path) -> None:
        self._path = path
        with recording(path):
            self._file: IO[bytes] = path.open("xb")
            self._writer: Any = Writer(self._file, compression=CompressionType.ZSTD)  # some methods are not typed
            self._writer.start(profile="", library="touchmove")
        self._channels = dict[str, int]()

    def add(self, topic: str, schema: dict[str, Any], stamp: int, data: bytes) -> None:
        with recording(self._path):
            if topic not in self._channels:
                text = json.dumps(schema, ensure_ascii=False).encode()
                number = self._writer.register_schema(schema["title"], "jsonschema", text)
                self._channels[topic] = self._writer.register_channel(topic, "json", number)
            self._writer.add_message(self._channels[topic], stamp, data, stamp)

    def close(self, metadata: dict[str, Any]) -> None:
        with recording(self._path), self._file:
            self._writer.add_metadata("episode", {name: str(value) for name, value in metadata.items()})
            self._writer.finish()

    def drop(self) -> None:
        try:
            with recording(self._path):
                self._file.close()
        except RecordError:
            return  # it is thrown away


def _stamps(episode: Demonstration) -> list[int]:
    """Of each frame, from the first [ns]."""
    times: list[int] = np.round((episode.time - episode.time[0]) * 1e9).astype(np.int64).tolist()
    return times


def _told(episode: Demonstration, robot: RobotRecord | None) -> Iterator[tuple[str, dict[str, Any], int, Any]]:
    """All messages but pictures: topic, schema, time [ns], content."""
    stamps = _stamps(episode)
    yield TASK_TOPIC, _TASK, 0, {"task": episode.ply.task}
    rows = (
        (STATE_TOPIC, "touchmove.State", STATE, episode.state),
        (REFERENCE_TOPIC, "touchmove.Reference", REFERENCE, episode.reference),
        (ACTION_TOPIC, "touchmove.Action", ACTION, episode.action),
    )
    for topic, title, signals, values in rows:
        schema = _schema(title, signals)
        for stamp, row in zip(stamps, values.tolist(), strict=True):
            yield topic, schema, stamp, dict(zip(schema["properties"], row, strict=True))
    if robot is not None:
        yield from _in_space(episode, robot, stamps)


def _in_space(
    episode: Demonstration, robot: RobotRecord, stamps: list[int]
) -> Iterator[tuple[str, dict[str, Any], int, Any]]:
    """Frames and solids of the robot, and the table."""
    table = table_solids(robot.table)
    fixed = fixed_frames(robot.table, robot.board_from_camera)
    solids = [encoding.entity(one.name, one.frame, one.solids, 0) for one in robot_solids(robot.parameters)]
    yield FIXED_TOPIC, schemas.TRANSFORMS, 0, encoding.transforms(fixed, 0)
    yield ROBOT_TOPIC, schemas.SCENE, 0, encoding.update(solids)
    yield TABLE_TOPIC, schemas.SCENE, 0, encoding.update([encoding.entity(table.name, BOARD, table.solids, 0)])
    model = DeltaModel(robot.parameters)
    for stamp, state, reference in zip(stamps, episode.state.tolist(), episode.reference.tolist(), strict=True):
        frames = moving_frames(arm_joints(model, _triple(state)), state[FINGER], _triple(reference))
        yield FRAMES_TOPIC, schemas.TRANSFORMS, stamp, encoding.transforms(frames, stamp)


def _triple(row: list[float]) -> Triple:
    return row[0], row[1], row[2]


def _schema(title: str, signals: tuple[Signal, ...]) -> dict[str, Any]:
    """Of a row; a viewer reads a dot in a name as a path, so it is written otherwise."""
    properties = {
        signal.name.replace(".", "_"): {"type": "number", "description": f"{signal.meaning} [{signal.unit}]"}
        for signal in signals
    }
    return {"title": title, "type": "object", "properties": properties}


_TASK: Final = {
    "title": "touchmove.Task",
    "type": "object",
    "properties": {"task": {"type": "string", "description": "what is done, in words"}},
}
