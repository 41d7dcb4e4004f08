"""The wire: golden bytes, round trips, tampering, replay, and the page that documents it."""

from __future__ import annotations

import hashlib
import math
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.offline.document import refresh
from controller.protocol import SAMPLE, SAMPLES_PER_DATAGRAM, VERSION, DatagramKind, Flag, Guard, MotionFlag, Result
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import (
    HEADER,
    HEARTBEAT,
    MAX_DATAGRAM,
    PAYLOADS,
    SAMPLE_LAYOUT,
    SAMPLES,
    TAG_SIZE,
    TELEMETRY,
    Field,
    Layout,
    layout_version,
)
from controller.protocol.envelope import Drop, Envelope, Opened, SequenceWindow
from controller.protocol.key import KeyFileError, create_key, load_key
from controller.protocol.messages import Announce, Busy, Hello, Samples, Telemetry, Welcome
from controller.protocol.states import State
from hardware.interfaces import DriveStatus

KEY = bytes(range(32))
PAGE = Path(__file__).parents[3] / "docs" / "protocol.md"
EVERY_LAYOUT = (HEADER, SAMPLE_LAYOUT, *PAYLOADS.values())

u16, u32, u64 = st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
doubles = st.floats(allow_nan=False)
triples = st.tuples(doubles, doubles, doubles)
names = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=12)


# golden bytes


def test_sizes_are_what_a_c_client_compiled_in() -> None:
    sizes = {layout.name: layout.size for layout in EVERY_LAYOUT}
    assert sizes == {
        "header": 28,
        "sample": 109,
        "HELLO": 56,
        "WATCH": 8,
        "HEARTBEAT": 4,
        "COMMAND": 2,
        "ADMIT_SPEED": 144,
        "STOP": 8,
        "RELEASE": 8,
        "ANNOUNCE": 18,
        "SAMPLES": 10,
        "CHALLENGE": 8,
        "WELCOME": 17,
        "BUSY": 62,
        "TELEMETRY": 408,
    }
    assert HEADER.size + SAMPLES.size + SAMPLES_PER_DATAGRAM * SAMPLE.itemsize + TAG_SIZE <= MAX_DATAGRAM


def test_golden_datagram() -> None:
    body = b"TMCP" + struct.pack("<IHHQQ", VERSION, 2, 48, 0x1122334455667788, 5) + bytes.fromhex("07000000")
    tag = hashlib.blake2s(body, key=KEY, digest_size=16).digest()
    assert Envelope(KEY).seal(DatagramKind.HEARTBEAT, 0x1122334455667788, 5, HEARTBEAT.struct.pack(7)) == body + tag


def test_golden_payloads() -> None:
    announce = Announce(3, 0x0102, 900, MotionFlag.FOLLOWED)
    assert announce.pack().hex() == "03000000" + "0201000000000000" + "84030000" + "0100"
    assert Hello(9, "Ada").pack().hex() == "0900000000000000" + "416461" + "00" * 45
    assert Welcome(0.5, 8192, True, 2).pack().hex() == "000000000000e03f" + "00200000" + "01" + "02000000"
    busy = Busy("Bob", "127.0.0.1", 4660, 0.5).pack()
    assert busy.hex() == "426f62" + "00" * 45 + "7f000001" + "3412" + "000000000000e03f"


def test_golden_sample() -> None:
    sample = np.zeros(1, SAMPLE)
    sample["position"], sample["velocity"], sample["acceleration"] = (1.0, 2.0, -2.0), (0.5, 0, 0), (0, 0, 0.5)
    sample["stiffness"], sample["damping"], sample["tactile_gain"] = (1, 2, 4), (0.5, 0, 0), 2
    sample["finger_velocity"], sample["guard"], sample["guard_level"] = -2, Guard.GRIP, 0.5
    wanted = struct.pack("<9d8fBf", 1, 2, -2, 0.5, 0, 0, 0, 0, 0.5, 1, 2, 4, 0.5, 0, 0, 2, -2, 1, 0.5)
    assert Samples(7, 20, sample).pack() == struct.pack("<IIH", 7, 20, 1) + wanted


def test_version_follows_the_layouts(monkeypatch: pytest.MonkeyPatch) -> None:
    assert layout_version() == VERSION
    changed = Layout("HEARTBEAT", (Field("ping", "I", "s", "the same bytes, another unit"),))
    monkeypatch.setitem(PAYLOADS, DatagramKind.HEARTBEAT, changed)
    assert layout_version() != VERSION


# round trips


@given(u32, u64, u32, u16)
def test_announce_round_trip(motion: int, first_tick: int, length: int, flags: int) -> None:
    announce = Announce(motion, first_tick, length, MotionFlag(flags))
    assert Announce.unpack(announce.pack()) == announce
    assert announce.followed == bool(flags & 1)


@given(u64, names, doubles, u32, st.booleans(), u16)
def test_handshake_round_trips(cookie: int, name: str, number: float, count: int, truth: bool, port: int) -> None:
    assert Hello.unpack(Hello(cookie, name).pack()) == Hello(cookie, name)
    welcome, busy = Welcome(number, count, truth, count), Busy(name, "10.0.255.1", port, number)
    assert Welcome.unpack(welcome.pack()) == welcome
    assert Busy.unpack(busy.pack()) == busy


@given(u32, u32, st.integers(1, SAMPLES_PER_DATAGRAM), st.randoms(use_true_random=False))
def test_samples_round_trip(motion: int, start: int, count: int, random: Any) -> None:
    rows = np.frombuffer(random.randbytes(count * SAMPLE.itemsize), SAMPLE)
    found = Samples.unpack(Samples(motion, start, rows).pack())
    assert found is not None
    assert (found.motion, found.start, found.rows.tobytes()) == (motion, start, rows.tobytes())


def test_samples_whose_count_belies_their_size_are_refused() -> None:
    payload = bytearray(Samples(1, 0, np.zeros(3, SAMPLE)).pack())
    payload[8] = 2
    assert Samples.unpack(bytes(payload)) is None


def _values(field: Field) -> st.SearchStrategy[Any]:
    enums: dict[str, Any] = {"state": State, "flags": Flag, "result": Result, "drive_status": DriveStatus}
    if field.name in enums or field.name in ("cause", "reason"):
        return st.sampled_from(list(enums.get(field.name, Cause)))
    one = {"d": doubles, "I": u32, "Q": u64}[field.code[-1]]
    return st.tuples(*[one] * field.count) if field.count > 1 else one


@given(st.tuples(*[_values(field) for field in TELEMETRY.fields]))
def test_telemetry_round_trip(values: tuple[Any, ...]) -> None:
    telemetry = Telemetry(*values)
    found = Telemetry.unpack(telemetry.pack())
    assert found == telemetry
    assert [type(value) for value in found] == [type(value) for value in telemetry]


def test_telemetry_survives_numbers_that_are_not() -> None:
    blank = Telemetry.unpack(bytes(TELEMETRY.size))
    found = Telemetry.unpack(blank._replace(angle=(math.nan, math.inf, 0.0)).pack())
    assert math.isnan(found.angle[0])


def test_fields_of_the_message_are_those_of_the_layout() -> None:
    assert Telemetry._fields == tuple(field.name for field in TELEMETRY.fields)


@pytest.mark.parametrize("layout", EVERY_LAYOUT, ids=lambda layout: layout.name)
def test_struct_and_numpy_agree_on_a_layout(layout: Layout) -> None:
    assert layout.dtype.itemsize == layout.size if not any("s" in f.code for f in layout.fields) else True
    assert sum(field.size for field in layout.fields) == layout.size


# the envelope


def _open(data: bytes, key: bytes = KEY) -> Opened | Drop:
    return Envelope(key).open(memoryview(data))


@given(u64, u64, u32)
def test_what_was_sealed_opens(session: int, sequence: int, ping: int) -> None:
    found = _open(Envelope(KEY).seal(DatagramKind.HEARTBEAT, session, sequence, HEARTBEAT.struct.pack(ping)))
    assert isinstance(found, Opened)
    assert (found.kind, found.session, found.sequence) == (DatagramKind.HEARTBEAT, session, sequence)
    assert HEARTBEAT.struct.unpack(found.payload) == (ping,)


def test_no_changed_bit_goes_unnoticed() -> None:
    datagram = Envelope(KEY).seal(DatagramKind.HEARTBEAT, 1, 1, HEARTBEAT.struct.pack(7))
    for bit in range(8 * len(datagram)):
        changed = bytearray(datagram)
        changed[bit // 8] ^= 1 << bit % 8
        assert isinstance(_open(bytes(changed)), Drop)


@given(st.binary(max_size=1600))
def test_noise_does_not_open(noise: bytes) -> None:
    assert isinstance(_open(noise), Drop)
    assert isinstance(_open(b"TMCP" + struct.pack("<IHH", VERSION, 2, len(noise) + 12) + noise), Drop)


def test_reasons_for_dropping() -> None:
    envelope, ping = Envelope(KEY), HEARTBEAT.struct.pack(7)
    good = envelope.seal(DatagramKind.HEARTBEAT, 1, 1, ping)
    assert _open(good[:-1]) is Drop.SIZE
    assert _open(good + b"\0") is Drop.SIZE
    assert _open(good[:20]) is Drop.SIZE
    assert _open(b"X" + good[1:]) is Drop.SIZE
    assert _open(good[:4] + b"\0\0\0\0" + good[8:]) is Drop.VERSION
    assert _open(good, key=bytes(32)) is Drop.TAG
    assert _open(envelope.seal(DatagramKind.HEARTBEAT, 1, 1, ping + b"\0")) is Drop.CONTENT
    assert _open(envelope.seal(DatagramKind.SAMPLES, 1, 1, bytes(SAMPLES.size))) is Drop.CONTENT
    assert _open(envelope.seal(DatagramKind.SAMPLES, 1, 1, bytes(SAMPLES.size + 100))) is Drop.CONTENT
    assert _open(envelope.seal(99, 1, 1, ping)) is Drop.CONTENT  # type: ignore[arg-type]  # a kind nobody knows


@given(st.lists(st.integers(1, 700), max_size=300))
def test_each_sequence_number_counts_once(numbers: list[int]) -> None:
    window, seen, newest = SequenceWindow(), set[int](), 0
    for number in numbers:
        assert window.accept(number) == (number not in seen and number > newest - 256)
        newest = max(newest, number)
        if number > newest - 256:
            seen.add(number)


def test_a_leap_of_the_sequence_costs_no_memory() -> None:
    window = SequenceWindow()
    assert window.accept(2**64 - 1)
    assert not window.accept(2**64 - 1)
    assert window.accept(2**64 - 2)
    assert not window.accept(5)
    assert not window.accept(0)


# the key


def test_the_key_is_for_its_owner_only(tmp_path: Path) -> None:
    path = tmp_path / "key"
    key = create_key(path)
    assert (len(key), load_key(path), path.stat().st_mode & 0o777) == (32, key, 0o600)
    with pytest.raises(KeyFileError, match="cannot be created: File exists: choose a new run directory"):
        create_key(path)
    path.chmod(0o640)
    with pytest.raises(KeyFileError, match="has mode 0640, but only its owner may read it: run chmod 600"):
        load_key(path)


def test_a_missing_or_short_key_is_named(tmp_path: Path) -> None:
    path = tmp_path / "key"
    with pytest.raises(KeyFileError, match="cannot be read: No such file or directory: start the app"):
        load_key(path)
    path.write_bytes(bytes(31))
    os.chmod(path, 0o600)  # noqa: PTH101 - the point is the mode, however it was set
    with pytest.raises(KeyFileError, match="holds 31 bytes instead of 32: delete it and start again"):
        load_key(path)


# the page


def test_the_page_is_up_to_date() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert refresh(page) == page, "run python -m controller.offline.document docs/protocol.md"


def test_the_page_has_every_layout_with_its_size() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for layout in EVERY_LAYOUT:
        part = page.split(f"<!-- generated: {layout.name} -->")[1].split("<!-- end -->")[0]
        rows = [line.split("|")[1:5] for line in part.splitlines() if line.startswith("| ") and "`" in line]
        assert len(rows) == len(layout.fields)
        offset, _, kind, _ = rows[-1]
        assert int(offset) + layout.fields[-1].size == layout.size
        assert kind.strip() == layout.fields[-1].type_name
        assert f"Size: {layout.size} bytes." in part


def test_the_example_of_the_page_opens() -> None:
    page = PAGE.read_text(encoding="utf-8")
    example = page.split("<!-- generated: example -->")[1].split("<!-- end -->")[0]
    found = _open(bytes.fromhex("".join(example.split("```")[1].split())))
    assert isinstance(found, Opened)
    assert (found.kind, found.session, found.sequence) == (DatagramKind.HEARTBEAT, 1, 2)
