"""The telemetry on disk: what was sent is what is read, a file that was cut off too, and nobody waits for the disk."""

from __future__ import annotations

import json
import math
import queue
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from app.records import RecordError
from app.records import telemetry as module
from app.records.telemetry import (
    LOG_TOPIC,
    TELEMETRY_FILE,
    TOPIC,
    TelemetryRecorder,
    decode_telemetry,
    encode_telemetry,
    read_telemetry,
    telemetry_schema,
)
from controller.protocol import Flag, Result
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import TELEMETRY
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from hardware.interfaces import DriveStatus
from tests.waiting import PATIENCE, until

PERIOD = 0.00088
BLANK = Telemetry.unpack(bytes(TELEMETRY.size))
FULL = r"no space left on the device \(the disk at /\S*\): free some space or choose another folder with --out"


def telemetry(tick: int, **changes: Any) -> Telemetry:
    """Telemetry whose numbers differ from each other and from those of other ticks."""
    flat = iter(range(1000))
    values: dict[str, Any] = {}
    for field in TELEMETRY.fields:
        if field.code[-1] == "d":
            numbers = tuple(math.sin(tick + 0.37 * next(flat)) for _ in range(field.count))
            values[field.name] = numbers if field.count > 1 else numbers[0]
        elif field.code[-1] != "H":
            values[field.name] = tick * 1000 + next(flat)
    values |= {"state": State.TRACK, "flags": Flag.LOCKSTEP | Flag.BUSY, "result": Result.GRIPPED, "tick": tick}
    values |= {"drive_status": DriveStatus.ENABLED | DriveStatus.SATURATED}
    return BLANK._replace(**values)._replace(**changes)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / TELEMETRY_FILE


@pytest.fixture
def recorder(path: Path) -> Iterator[TelemetryRecorder]:
    with TelemetryRecorder(path, PERIOD) as one:
        yield one


# what is in it


def test_what_is_read_is_what_was_sent(path: Path) -> None:
    sent = [telemetry(16 * k) for k in range(200)]
    before = time.time_ns()
    with TelemetryRecorder(path, PERIOD) as recorder:
        for one in sent:
            recorder.take(one)
    assert recorder.lost == 0
    # by the reader of the package, with its summary and its checks
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        found = list(reader.iter_messages(topics=[TOPIC], log_time_order=False))
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.chunk_count >= 1
    assert [decode_telemetry(message.data) for _, _, message in found] == sent
    assert [message.log_time for _, _, message in found] == [round(16 * k * 880_000) for k in range(200)]
    assert [message.sequence for _, _, message in found] == list(range(1, 201))
    walls = [message.publish_time for _, _, message in found]
    assert before <= walls[0] <= walls[-1] <= time.time_ns()
    schema, channel, _ = found[0]
    assert schema is not None
    assert (schema.encoding, schema.name, channel.message_encoding) == ("jsonschema", "controller.Telemetry", "json")
    assert json.loads(schema.data) == telemetry_schema()
    # and by our own
    assert [one for _, one in read_telemetry(path)] == sent
    assert [stamp for stamp, _ in read_telemetry(path)] == pytest.approx([16 * k * PERIOD for k in range(200)])


def test_types_come_back_too() -> None:
    one = telemetry(5)
    again = decode_telemetry(encode_telemetry(one))
    assert [type(value) for value in again] == [type(value) for value in one]


def test_numbers_that_are_not_stay_json() -> None:
    one = telemetry(5, cause_value=math.nan, angle=(math.inf, 1.0, -math.inf))
    content = json.loads(encode_telemetry(one), parse_constant=lambda text: pytest.fail(f"{text} is no JSON"))
    assert (content["cause_value"], content["angle"]) == (None, [None, 1.0, None])
    again = decode_telemetry(encode_telemetry(one))
    assert math.isnan(again.cause_value)
    assert math.isnan(again.angle[0])


def test_the_schema_is_that_of_the_layout() -> None:
    """In the part of JSON schema that Foxglove reads: objects, arrays of one type, plain types, numbered choices."""
    schema = telemetry_schema()
    content = json.loads(encode_telemetry(telemetry(5)))
    assert list(schema["properties"]) == list(content) == [field.name for field in TELEMETRY.fields]
    for field in TELEMETRY.fields:
        entry, value = schema["properties"][field.name], content[field.name]
        assert field.meaning in entry["description"]
        assert not field.unit or f"[{field.unit}]" in entry["description"]
        if "oneOf" in entry:
            assert value in [choice["const"] for choice in entry["oneOf"]]
        elif field.count > 1:
            assert (entry["type"], entry["items"], len(value)) == ("array", {"type": "number"}, field.count)
        else:
            assert type(value) is {"number": float, "integer": int}[entry["type"]]
    assert {"title": "TRACK", "const": 2} in schema["properties"]["state"]["oneOf"]
    assert "4 SATURATED" in schema["properties"]["drive_status"]["description"]


def test_the_log_tells_each_change_once(path: Path) -> None:
    hold = {"state": State.HOLD, "cause": Cause.NONE}
    fault = {"state": State.FAULT, "cause": Cause.TRACKING, "cause_value": 0.02, "cause_limit": 0.015}
    lost = {"state": State.STOPPING, "cause": Cause.CLIENT_LOST, "cause_value": 1.2, "cause_limit": 1.0}
    with TelemetryRecorder(path, PERIOD) as recorder:
        for tick, changes in enumerate((hold, hold, lost, lost, fault)):
            recorder.take(telemetry(tick, ended_motion=3, **changes))
        refused = {"ended_motion": 4, "result": Result.REFUSED, "reason": Cause.NOT_ADMITTED}
        recorder.take(telemetry(5, **fault, **refused))
    with path.open("rb") as file:
        entries = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages(topics=[LOG_TOPIC])]
    assert [(entry["level"], entry["message"]) for entry in entries] == [
        (2, "HOLD"),
        (3, "STOPPING: the client was silent for 1.20 s, at most 1.00 s is accepted: connect again"),
        (4, f"FAULT: {telemetry(4, **fault).explain_cause()}"),
        (3, "motion 4 was refused: a hold is in force: send resume before the next motion"),
    ]
    assert entries[2]["timestamp"] == {"sec": 0, "nsec": 4 * 880_000}


def test_an_empty_record_is_one(path: Path, recorder: TelemetryRecorder) -> None:
    recorder.close()
    assert list(read_telemetry(path)) == []
    recorder.close()


# a file that was cut off


def test_what_came_a_second_ago_is_on_the_disk(
    path: Path, recorder: TelemetryRecorder, monkeypatch: pytest.MonkeyPatch
) -> None:
    for k in range(50):
        recorder.take(telemetry(k))
    # what a killed program would leave: the file as it lies there
    until(lambda: len(list(read_telemetry(path))) == 50)


def test_wherever_a_file_is_cut_the_rest_is_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_FLUSH", 0.0)
    sent = [telemetry(k) for k in range(6)]
    with TelemetryRecorder(path, PERIOD) as recorder:
        for one in sent:
            recorder.take(one)
    whole = path.read_bytes()
    counts = []
    for size in range(8, len(whole), 37):
        path.write_bytes(whole[:size])
        found = [one for _, one in read_telemetry(path)]
        assert found == sent[: len(found)]
        counts.append(len(found))
    assert counts == sorted(counts)
    assert set(counts) == set(range(7))


def test_a_damaged_record_is_a_sentence_or_read_up_to_there(path: Path) -> None:
    sent = [telemetry(k) for k in range(6)]
    with TelemetryRecorder(path, PERIOD) as recorder:
        for one in sent:
            recorder.take(one)
    whole, refused = path.read_bytes(), 0
    for place in range(0, len(whole), 41):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x10]) + whole[place + 1 :])
        try:
            found = [one for _, one in read_telemetry(path)]
        except RecordError:
            refused += 1
        else:
            assert found == sent[: len(found)]
    assert refused


def test_what_is_no_record_is_said(path: Path) -> None:
    with pytest.raises(
        RecordError, match=r"telemetry.mcap cannot be read: No such file or directory: name a telemetry"
    ):
        list(read_telemetry(path))
    path.write_bytes(b"no such thing at all")
    with pytest.raises(
        RecordError,
        match=r"telemetry.mcap is not telemetry \(.*\): name a telemetry.mcap of this "
        r"vers",
    ):
        list(read_telemetry(path))
    with pytest.raises(ValueError, match="this is not telemetry of this version"):
        decode_telemetry(b'{"tick": 1}')


# nobody waits


def test_a_slow_disk_delays_nobody(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gate = threading.Event()
    add = TelemetryRecorder._add

    def slowly(*arguments: Any) -> None:
        assert gate.wait(PATIENCE)
        add(*arguments)

    monkeypatch.setattr(TelemetryRecorder, "_add", slowly)
    monkeypatch.setattr(module, "_WAITING", 100)
    with TelemetryRecorder(path, PERIOD) as recorder:
        for k in range(150):  # else the disk would wait for the end of this, and this for the disk
            recorder.take(telemetry(k))
        assert 49 <= recorder.lost <= 50
        gate.set()
    with path.open("rb") as file:
        (metadata,) = make_reader(file).iter_metadata()
    assert metadata.metadata == {"lost": str(recorder.lost)}
    assert len(list(read_telemetry(path))) == 150 - recorder.lost


def test_a_disk_too_slow_to_end_is_said(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gate = threading.Event()
    monkeypatch.setattr(TelemetryRecorder, "_add", lambda *arguments: gate.wait(PATIENCE))
    monkeypatch.setattr(module, "_CLOSE_TIMEOUT", 0.05)
    recorder = TelemetryRecorder(path, PERIOD)
    recorder.take(telemetry(1))
    with pytest.raises(RecordError, match=r"was not written within 0 s, the disk is too slow: choose another folder"):
        recorder.close()
    gate.set()
    recorder._thread.join(PATIENCE)


@pytest.mark.parametrize("count", [0, 5000])
def test_a_full_disk_is_said_at_the_end(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    real = Path.open
    monkeypatch.setattr(Path, "open", lambda self, mode="r", **rest: real(self, "wb" if mode == "xb" else mode, **rest))
    recorder = TelemetryRecorder(Path("/dev/full"), PERIOD)
    for k in range(count):
        recorder.take(telemetry(k))
    with pytest.raises(RecordError, match=f"/dev/full: {FULL}"):
        recorder.close()
    recorder.close()


def test_an_error_of_the_game_comes_before_that_of_its_record(monkeypatch: pytest.MonkeyPatch) -> None:
    real = Path.open
    monkeypatch.setattr(Path, "open", lambda self, mode="r", **rest: real(self, "wb" if mode == "xb" else mode, **rest))
    with pytest.raises(queue.Empty), TelemetryRecorder(Path("/dev/full"), PERIOD):
        raise queue.Empty


def test_another_record_is_not_overwritten(path: Path) -> None:
    path.write_bytes(b"precious")
    with pytest.raises(RecordError, match=r"telemetry.mcap: File exists: choose another folder with --out"):
        TelemetryRecorder(path, PERIOD)
    assert path.read_bytes() == b"precious"
