"""The telemetry of a game as MCAP, which Foxglove and PlotJuggler open: ``telemetry.mcap``.

Channels with JSON schemas: ``/controller/telemetry``, every telemetry that came, fields, units and numbers as in the
layout TELEMETRY; ``/controller/log``, a sentence for each change of state or cause and each refusal; and the robot, its
table and the camera's pictures in Foxglove's own schemas (``foxglove.scene``). The log time is plant time, from zero,
the publish time is wall time. A number that is not finite is null.
"""

from __future__ import annotations

import io
import json
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from enum import IntEnum
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, NamedTuple, Self

from mcap.exceptions import EndOfFile, McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from pydantic_core import to_json
from zstandard import ZstdError

from app import UserError
from app.records.files import RecordError, recording
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import TELEMETRY, Field, Flag, Result
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from hardware.interfaces import DriveStatus

if TYPE_CHECKING:
    from app.records.foxglove.scene import SceneMessage, SceneRecorder

TELEMETRY_FILE = "telemetry.mcap"
TOPIC = "/controller/telemetry"
LOG_TOPIC = "/controller/log"
_LOG: Final = "foxglove.Log"

_FLUSH = 1.0
"""A file that is cut off ends at most so much earlier [s, wall]."""
_WAITING = 1 << 16
"""Telemetry that may wait for the disk: a quarter of an hour of a lab's, half a minute of a quick simulation's."""
_BATCH: Final = 64
"""So much telemetry waits for its writing, if it comes quickly enough: who is woken for each finds the processor's
caches full of other things, and takes ten times as long."""
_CLOSE_TIMEOUT = 10.0
"""[s]"""
_ENUMS: Final[dict[str, type[IntEnum]]] = {"state": State, "cause": Cause, "result": Result, "reason": Cause}
_BITS: Final = {"flags": Flag, "drive_status": DriveStatus}
_TYPES: Final[dict[str, Any]] = {**_ENUMS, **_BITS}
_INFO, _WARNING, _ERROR = 2, 3, 4
_RECORD: Final = struct.Struct("<BQ")
"""How every record of MCAP begins: kind, bytes that follow."""


class _Arrival(NamedTuple):
    """Telemetry and the wall time at which it came [ns since 1970, UTC]."""

    telemetry: Telemetry
    wall: int


class TelemetryRecorder:
    """Writes telemetry in a thread of its own. Use as a context manager, or call ``close``."""

    def __init__(self, path: Path, period: float) -> None:
        """Begin a file, which must not exist; ``period`` is the length of a tick [s].

        Raises:
            RecordError: the file cannot be made, or there is one already.
        """
        self._path, self._period = path, period
        self._waiting: deque[_Arrival] = deque()
        self._woken = threading.Event()
        self._lost = 0
        self._error: RecordError | None = None
        self._last: Telemetry | None = None
        self._sequence = 0
        self._closing = False
        self._scene: SceneRecorder | None = None
        self._shows = True
        """The robot in 3-D; until something of it cannot be shown."""
        self._channels: dict[str, int] = {}
        with recording(path):
            self._file: IO[bytes] = path.open("xb")
        self._thread = threading.Thread(target=self._run, name="telemetry record", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        try:
            self.close()
        except RecordError:
            if error is None:  # else what went wrong first is what matters
                raise

    @property
    def lost(self) -> int:
        """Telemetry that came while too much waited for the disk already, and is not in the file."""
        return self._lost

    def take(self, telemetry: Telemetry) -> None:
        """Record one telemetry; returns at once. For the listener of a client or of a ``TelemetryWatch``."""
        waiting = self._waiting
        if len(waiting) >= _WAITING:
            self._lost += 1
            return
        waiting.append(_Arrival(telemetry, time.time_ns()))
        if len(waiting) == _BATCH:
            self._woken.set()

    def close(self) -> None:
        """Write what waits, and end the file; a second call does nothing.

        Raises:
            RecordError: the disk is full or slow, or the file cannot be written; what is there can be read.
        """
        if self._thread.is_alive():
            self._closing = True
            self._woken.set()
            self._thread.join(_CLOSE_TIMEOUT)
            if self._thread.is_alive():
                raise RecordError(
                    f"{self._path} was not written within {_CLOSE_TIMEOUT:.0f} s, the disk is too slow: "
                    "choose another folder with --out"
                )
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _run(self) -> None:
        """The thread. After an error it goes on taking, so that nobody has to wait for a disk that is full."""
        try:
            with recording(self._path), self._file:
                self._write()
        except RecordError as error:
            self._error = error
            while not self._closing:
                self._waiting.clear()
                self._woken.wait()
                self._woken.clear()

    def _write(self) -> None:
        writer: Any = Writer(self._file, compression=CompressionType.ZSTD)  # some of its methods are not typed
        writer.start(profile="", library="touchmove")
        channel = _register(writer, TOPIC, "controller.Telemetry", telemetry_schema())
        log = _register(writer, LOG_TOPIC, _LOG, _log_schema())
        writer.flush()
        due = time.monotonic() + _FLUSH
        while not self._closing or self._waiting:
            if not self._waiting:
                self._woken.wait(max(0.0, due - time.monotonic()))
                self._woken.clear()
            if self._waiting:
                self._add(writer, channel, log, self._waiting.popleft())
            if time.monotonic() >= due:
                writer.flush()
                due = time.monotonic() + _FLUSH
        if self._last is not None:
            stamp, wall = self._stamp(), time.time_ns()
            for level, sentence in self._show(writer, lambda scene: scene.finish(), wall):
                writer.add_message(log, stamp, _log_entry(level, sentence, stamp), wall, self._sequence)
        if self._lost:
            writer.add_metadata("touchmove", {"lost": str(self._lost)})
        writer.finish()

    def _add(self, writer: Any, channel: int, log: int, arrival: _Arrival) -> None:
        telemetry, wall = arrival
        self._sequence += 1
        before, self._last = self._last, telemetry
        stamp = self._stamp()
        writer.add_message(channel, stamp, encode_telemetry(telemetry), wall, self._sequence)
        for level, sentence in (
            *_news(before, telemetry),
            *self._show(writer, lambda scene: scene.take(telemetry, stamp), wall),
        ):
            writer.add_message(log, stamp, _log_entry(level, sentence, stamp), wall, self._sequence)

    def _stamp(self) -> int:
        """Plant time of the last telemetry [ns]."""
        return 0 if self._last is None else round(self._last.tick * self._period * 1e9)

    def _show(
        self, writer: Any, make: Callable[[SceneRecorder], Iterator[SceneMessage]], wall: int
    ) -> Iterator[tuple[int, str]]:
        """The robot in 3-D; from the first thing on that cannot be shown, nothing more of it, and the log says why."""
        if not self._shows:
            return
        try:
            messages = tuple(make(self._scene_recorder()))
        except (UserError, OSError, ValueError, LookupError, RuntimeError) as error:
            self._shows = False
            yield _WARNING, f"robot and pieces are not shown in 3-D from here on: {error}"
            return
        for message in messages:
            channel = self._channel(writer, message)
            writer.add_message(channel, message.stamp, message.data, wall, self._sequence)

    def _scene_recorder(self) -> SceneRecorder:
        if self._scene is None:
            from app.records.foxglove.scene import SceneRecorder  # loads the kinematics: not before something moves

            self._scene = SceneRecorder(self._path.parent)
        return self._scene

    def _channel(self, writer: Any, message: SceneMessage) -> int:
        if message.topic not in self._channels:
            name = message.schema["title"]
            self._channels[message.topic] = _register(writer, message.topic, name, message.schema)
        return self._channels[message.topic]


def telemetry_schema() -> dict[str, Any]:
    """The JSON schema of one telemetry, from the layout TELEMETRY; units stand in the descriptions."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "controller.Telemetry",
        "description": "What the controller of the arm reports. A number that is not finite is null.",
        "type": "object",
        "properties": {field.name: _property(field) for field in TELEMETRY.fields},
    }


def encode_telemetry(telemetry: Telemetry) -> bytes:
    """One message of the channel ``TOPIC``."""
    return to_json(telemetry._asdict(), inf_nan_mode="null")


def decode_telemetry(data: bytes) -> Telemetry:
    """The telemetry of a message; what was not finite comes back as NaN.

    Raises:
        ValueError: it is none of this version.
    """
    content = json.loads(data)
    if not isinstance(content, dict) or set(content) != set(Telemetry._fields):
        raise ValueError("this is not telemetry of this version")
    return Telemetry(*[_restore(name, content[name]) for name in Telemetry._fields])


def read_telemetry(path: Path, since: float = 0.0, until: float = float("inf")) -> Iterator[tuple[float, Telemetry]]:
    """Plant time [s] and telemetry, in the order of arrival; of a file that was cut off, all that is whole.

    Args:
        path: of the file.
        since: plant time before which nothing is wanted [s].
        until: plant time after which nothing is wanted [s].

    Raises:
        RecordError: it cannot be read, or is no such record.
    """
    try:
        with path.open("rb") as file:
            yield from _messages(file, since, until)
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror}: name a {TELEMETRY_FILE}") from error
    except (McapError, ZstdError, ValueError, OverflowError, MemoryError, struct.error) as error:
        raise RecordError(f"{path} is not telemetry ({error}): name a {TELEMETRY_FILE} of this version") from error


def _messages(file: IO[bytes], since: float, until: float) -> Iterator[tuple[float, Telemetry]]:
    wanted: set[int] = set()
    try:
        for record in StreamReader(_whole_part(file), validate_crcs=True).records:
            if isinstance(record, Channel) and record.topic == TOPIC:
                wanted.add(record.id)
            elif isinstance(record, Message) and record.channel_id in wanted:
                stamp = record.log_time * 1e-9
                if since <= stamp <= until:
                    yield stamp, decode_telemetry(record.data)
    except EndOfFile:
        return  # it was cut off: everything up to the last whole chunk was there


def _whole_part(file: IO[bytes]) -> IO[bytes]:
    """A file of MCAP without a last record that was cut off, on which the package's reader would stumble."""
    data = file.read()
    end = len(MCAP0_MAGIC)
    while end + _RECORD.size <= len(data):
        after = end + _RECORD.size + _RECORD.unpack_from(data, end)[1]
        if after > len(data):
            break
        end = after
    return io.BytesIO(data[:end])


def _register(writer: Any, topic: str, name: str, schema: dict[str, Any]) -> int:
    number = writer.register_schema(name, "jsonschema", json.dumps(schema, ensure_ascii=False).encode())
    channel: int = writer.register_channel(topic, "json", number)
    return channel


def _property(field: Field) -> dict[str, Any]:
    meaning = f"{field.meaning} [{field.unit}]" if field.unit else field.meaning
    if field.name in _ENUMS:
        choices = [{"title": member.name, "const": member.value} for member in _ENUMS[field.name]]
        return {"description": meaning, "oneOf": choices}
    if field.name in _BITS:
        bits = ", ".join(f"{member.value} {member.name}" for member in _BITS[field.name] if member.value)
        meaning = f"{meaning}, a sum of: {bits}"
    kind = "number" if field.code[-1] == "d" else "integer"
    if field.count == 1:
        return {"type": kind, "description": meaning}
    count = field.count
    return {"type": "array", "items": {"type": kind}, "minItems": count, "maxItems": count, "description": meaning}


def _log_schema() -> dict[str, Any]:
    """Foxglove's own, for its log panel."""
    levels = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")
    return {
        "title": _LOG,
        "type": "object",
        "properties": {
            "timestamp": {
                "type": "object",
                "title": "time",
                "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
                "description": "plant time",
            },
            "level": {
                "oneOf": [{"title": level, "const": number} for number, level in enumerate(levels)],
                "description": "severity",
            },
            "message": {"type": "string", "description": "state, and why the arm stopped or faulted last"},
            "name": {"type": "string", "description": "who says so"},
            "file": {"type": "string", "description": "empty"},
            "line": {"type": "integer", "description": "0"},
        },
    }


def _news(before: Telemetry | None, now: Telemetry) -> Iterator[tuple[int, str]]:
    """What the log says of new telemetry: how serious, and a sentence."""
    if before is not None and before.ended_motion != now.ended_motion and now.result is Result.REFUSED:
        yield _WARNING, f"motion {now.ended_motion} was refused: {now.explain_reason()}"
    if before is not None and (before.state, before.cause) == (now.state, now.cause):
        return
    message, level = now.state.name, _INFO
    if now.cause is not Cause.NONE:
        message, level = f"{message}: {now.explain_cause()}", _WARNING
    yield _ERROR if now.state is State.FAULT else level, message


def _log_entry(level: int, message: str, stamp: int) -> bytes:
    seconds, rest = divmod(stamp, 10**9)
    when = {"sec": seconds, "nsec": rest}
    entry = {"timestamp": when, "level": level, "message": message, "name": "controller", "file": "", "line": 0}
    return json.dumps(entry).encode()


def _restore(name: str, value: Any) -> Any:
    if isinstance(value, list):
        return tuple(float("nan") if one is None else one for one in value)
    if name in _TYPES:
        return _TYPES[name](value)
    return float("nan") if value is None else value
