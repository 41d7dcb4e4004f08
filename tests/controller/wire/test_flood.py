"""Strangers who send faster than anybody can read: the client is heard all the same, and reading ends in time."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.play.launch import run_games
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from controller.protocol.datagram_fields import (
    CHALLENGE,
    COMMAND,
    HEARTBEAT,
    RELEASE,
    SAMPLE,
    STOP,
    WATCH,
    CommandCode,
    DatagramKind,
)
from controller.protocol.envelope import Drop, Envelope
from controller.protocol.messages import Announce, Busy, Hello, MotionFlag, Samples, Welcome
from controller.wire.client import ControllerClient
from controller.wire.endpoint import Endpoint
from controller.wire.sockets import PortInUse, listening_socket
from hardware.interfaces import Pace

KEY = bytes(range(32))
SESSION = 7
LEASE = 1.0


class Steps:
    """A clock that a look at it moves on by one: a time in which so many datagrams can be refused."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 1.0
        return self.now


class End:
    """A socket of somebody who knows, or does not know, the key."""

    def __init__(self, door: Endpoint, session: int = SESSION, key: bytes = KEY, sequence: int = 0) -> None:
        self.envelope, self.session, self.sequence = Envelope(key), session, sequence
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(5.0)
        self.socket.connect(door.address)

    def seal(self, kind: DatagramKind, payload: bytes) -> bytes:
        """The next datagram."""
        self.sequence += 1
        return self.envelope.seal(kind, self.session, self.sequence, payload)

    def send(self, kind: DatagramKind, payload: bytes) -> bytes:
        """Send the next datagram."""
        data = self.seal(kind, payload)
        self.socket.send(data)
        return data

    def ping(self, number: int) -> None:
        """A heartbeat."""
        self.send(DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(number))

    def receive(self) -> tuple[int, bytes]:
        """DatagramKind and payload of what came."""
        opened = self.envelope.open(memoryview(self.socket.recv(2048)))
        assert not isinstance(opened, Drop)
        return opened.kind, bytes(opened.payload)


class House:
    """A door with a client inside; time passes only by refusing datagrams."""

    def __init__(self, patience: float | None = None) -> None:
        def welcome() -> bytes:
            return Welcome(0.00088, 8192, patience is not None, 0).pack()

        self.clock = Steps()
        self.door = Endpoint("127.0.0.1", 0, KEY, LEASE, welcome, self.clock, patience)
        self.pings = list[int]()
        self.ends = list[End]()
        self.client = self.end()
        self.client.send(DatagramKind.HELLO, Hello(0, "owner").pack())
        self.tick()
        (cookie,) = CHALLENGE.struct.unpack(self.client.receive()[1])
        self.client.send(DatagramKind.HELLO, Hello(cookie, "owner").pack())
        self.tick()
        assert self.client.receive()[0] == DatagramKind.WELCOME

    def end(self, **options: Any) -> End:
        """Another socket."""
        self.ends.append(End(self.door, **options))
        return self.ends[-1]

    def tick(self, budget: int = 1, now: float = 0.0) -> int:
        """One tick, in which so many datagrams can be refused; how many were."""
        before = sum(self.door.dropped)
        self.door.drain(now, self.clock.now + budget, 1, self._handle)
        return sum(self.door.dropped) - before

    def close(self) -> None:
        """All sockets."""
        self.door.close()
        for end in self.ends:
            end.socket.close()

    def _handle(self, kind: int, payload: memoryview) -> bool:
        assert kind == DatagramKind.HEARTBEAT
        self.pings.append(HEARTBEAT.struct.unpack(payload)[0])
        return True


@pytest.fixture
def house() -> Iterator[House]:
    made = House()
    yield made
    made.close()


@pytest.mark.parametrize("strangers", [1, 10, 300, 3000])
def test_the_client_is_heard_in_the_first_tick_however_many_strangers_wait(house: House, strangers: int) -> None:
    hostile = house.end(key=bytes(32), sequence=10**6)
    for _ in range(strangers):
        hostile.ping(99)
    house.client.ping(1)
    assert house.tick() == 1, "one of theirs is read before each of the client's"
    assert house.pings == [1]


@pytest.mark.parametrize("budget", [1, 7, 50])
def test_a_tick_refuses_strangers_for_its_time_and_no_longer(house: House, budget: int) -> None:
    hostile = house.end(key=bytes(32), sequence=10**6)
    for _ in range(120):
        hostile.ping(99)
    refused = [house.tick(budget) for _ in range(120 // budget + 1)]
    assert max(refused) == budget
    assert sum(refused) == 120
    assert house.pings == []


@pytest.mark.parametrize(("spoofed", "budget", "ticks"), [(0, 1, 1), (60, 61, 1), (60, 20, 4), (60, 1, 61)])
def test_what_is_sent_under_the_clients_very_address_costs_it_only_the_time_of_refusing(
    house: House, spoofed: int, budget: int, ticks: int
) -> None:
    other_key = Envelope(bytes(32))
    for number in range(spoofed):
        house.client.socket.send(
            other_key.seal(DatagramKind.HEARTBEAT, SESSION, 10**6 + number, HEARTBEAT.struct.pack(99))
        )
    house.client.ping(1)
    for _ in range(ticks):
        assert house.pings == []
        house.tick(budget)
    assert house.pings == [1]


def test_strangers_are_read_too_while_the_clients_queue_never_ends(house: House) -> None:
    stranger = house.end(session=8)
    stranger.send(DatagramKind.HELLO, Hello(0, "another").pack())
    for _ in range(50):
        house.client.socket.send(b"noise")
    assert house.tick(3) == 2, "the first of the three that there is time for is the stranger's"
    kind, payload = stranger.receive()
    assert (kind, Busy.unpack(memoryview(payload)).name) == (DatagramKind.BUSY, "owner")


def test_one_stranger_is_answered_in_a_tick(house: House) -> None:
    strangers = [house.end(session=8 + number) for number in range(5)]
    for stranger in strangers:
        stranger.send(DatagramKind.HELLO, Hello(0, "another").pack())
    assert house.tick(10) == 4
    assert strangers[0].receive()[0] == DatagramKind.BUSY
    strangers[1].send(DatagramKind.HELLO, Hello(0, "another").pack())
    assert house.tick(10) == 0
    assert strangers[1].receive()[0] == DatagramKind.BUSY


def test_a_listener_is_admitted_beside_a_flood(house: House) -> None:
    hostile, ear = house.end(key=bytes(32), sequence=10**6), house.end(session=9)
    cookie = 0
    for _ in range(2):
        for _ in range(20):
            hostile.ping(99)
        ear.send(DatagramKind.WATCH, WATCH.struct.pack(cookie))
        house.tick(30)
        house.door.relay()
        if not cookie:
            (cookie,) = CHALLENGE.struct.unpack(ear.receive()[1])
    assert house.door.listeners == 1


def test_a_client_that_comes_back_from_another_address_is_heard_there_first(house: House) -> None:
    hostile, moved = house.end(key=bytes(32), sequence=10**6), house.end(sequence=100)
    for _ in range(20):
        hostile.ping(99)
    moved.ping(1)
    house.tick(30)
    assert house.pings == [1]
    for _ in range(200):
        hostile.ping(99)
    moved.ping(2)
    assert house.tick() == 1
    assert house.pings == [1, 2]
    house.door.send(DatagramKind.TELEMETRY, b"")
    assert moved.socket.recv(2048)
    # and back again
    house.client.sequence = 200
    house.client.ping(3)
    assert [house.tick(50) for _ in range(5)] == [50, 50, 50, 49, 0], "one was refused before"
    house.client.ping(4)
    assert house.tick() == 0
    assert house.pings == [1, 2, 3, 4]


def test_where_plant_time_waits_only_a_client_with_a_closed_port_is_lost_after_its_lease() -> None:
    patience = 30.0
    with closing(House(patience)) as house:
        assert not house.door.expire(2.0 * LEASE)
        house.client.ping(1)
        house.tick(now=2.0 * LEASE)
        assert not house.door.expire(patience)
        house.client.socket.close()
        house.door.send(DatagramKind.TELEMETRY, bytes(8))
        house.tick(now=patience)  # the kernel says that nobody listens there
        assert house.door.expire(patience)
        assert house.door.lease == LEASE
    with closing(House(patience)) as house:
        assert not house.door.expire(patience)
        assert house.door.expire(patience + 0.1)


def test_strangers_keep_no_lost_client_alive(house: House) -> None:
    hostile = house.end(key=bytes(32), sequence=10**6)
    later, expired = LEASE, list[float]()
    while not expired and later < 2.0 * LEASE:
        later += 0.01
        hostile.ping(99)
        hostile.ping(99)
        if house.door.expire(later):
            expired.append(later)
        house.tick(1, later)
    assert expired
    assert not house.door.leased
    assert expired[0] == pytest.approx(LEASE + 0.12, abs=0.02)
    # its socket is gone: the next one finds an open door
    house.client.session, house.client.sequence = 8, 0
    house.client.send(DatagramKind.HELLO, Hello(0, "next").pack())
    for _ in range(100):
        house.tick(10, later)
    assert house.client.receive()[0] == DatagramKind.CHALLENGE


def test_what_waited_in_a_pause_is_read_before_the_client_is_given_up(house: House) -> None:
    house.client.ping(1)
    late = 5.0 * LEASE
    assert not house.door.expire(late)
    house.tick(1, late)
    assert (house.pings, house.door.expire(late + LEASE)) == ([1], False)


def test_a_client_that_has_closed_its_socket_is_no_trouble(house: House) -> None:
    hostile = house.end(key=bytes(32), sequence=10**6)
    house.client.socket.close()
    for _ in range(3):
        house.door.send(DatagramKind.TELEMETRY, b"")  # the kernel answers that nobody listens there
        hostile.ping(99)
        assert house.tick(5) == 1
    assert house.pings == []


def test_without_a_socket_of_its_own_the_client_is_served_by_the_open_one(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none_left(*_: Any) -> socket.socket:
        raise OSError("too many open files")

    monkeypatch.setattr("controller.wire.endpoint.client_socket", none_left)
    moved = house.end(sequence=100)
    for number in range(3):
        moved.ping(number)
        house.tick()
    assert house.pings == [0, 1, 2]


@pytest.mark.parametrize("options", [(), (socket.SO_REUSEADDR,), (socket.SO_REUSEPORT,)])
def test_nobody_joins_the_port_of_a_client_and_its_controller(house: House, options: tuple[int, ...]) -> None:
    with pytest.raises(PortInUse, match=r"UDP port \d+ at 127.0.0.1 cannot be used: Address already in use: end the"):
        listening_socket(*house.door.address)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as intruder:
        for option in options:
            intruder.setsockopt(socket.SOL_SOCKET, option, 1)
        with pytest.raises(OSError, match="Address already in use"):
            intruder.bind(house.door.address)


# what is refused


def test_no_tag_is_computed_of_what_is_refused_anyhow(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: Any) -> bytes:
        raise AssertionError("a tag was computed")

    command, ping = COMMAND.struct.pack(CommandCode.STOP), HEARTBEAT.struct.pack(1)
    house.client.sequence = 20
    house.client.send(DatagramKind.COMMAND, command)
    monkeypatch.setattr(house.door, "take", lambda handle: False)  # it stays in hand
    house.tick()
    seal, good = Envelope(KEY).seal, Envelope(KEY).seal(DatagramKind.HEARTBEAT, SESSION, 30, ping)
    refused = [
        (b"", Drop.SIZE),
        (good[:-1], Drop.SIZE),
        (b"X" + good[1:], Drop.SIZE),
        (good[:4] + bytes(4) + good[8:], Drop.VERSION),
        (seal(DatagramKind.HEARTBEAT, SESSION + 1, 30, ping), Drop.SESSION),
        (seal(DatagramKind.HEARTBEAT, 0, 30, ping), Drop.SESSION),
        (seal(DatagramKind.COMMAND, SESSION, 20, command), Drop.SEQUENCE),
        (seal(DatagramKind.COMMAND, SESSION, 19, command), Drop.SEQUENCE),
        (seal(DatagramKind.HEARTBEAT, SESSION, 2, ping), Drop.SEQUENCE),
        (seal(DatagramKind.STOP, SESSION + 1, 30, STOP.struct.pack(1)), Drop.SESSION),
        (seal(DatagramKind.STOP, 0, 30, STOP.struct.pack(1)), Drop.SESSION),
        (seal(DatagramKind.STOP, SESSION, 19, STOP.struct.pack(1)), Drop.SEQUENCE),
    ]
    asking = [
        seal(DatagramKind.HELLO, 8, 1, Hello(0, "x").pack()),
        seal(DatagramKind.WATCH, 8, 1, WATCH.struct.pack(0)),
    ]
    monkeypatch.setattr(Envelope, "_tag", none)
    for data, drop in refused:
        assert house.door._admit(memoryview(data), ("127.0.0.1", 1), 0.0) is drop
    for wanted in (good, *asking):
        with pytest.raises(AssertionError, match="a tag was computed"):
            house.door._admit(memoryview(wanted), ("127.0.0.1", 1), 0.0)


def _sent_by(client: End) -> list[bytes]:
    """One datagram of each kind that a client sends."""
    return [
        client.seal(kind, payload)
        for kind, payload in (
            (DatagramKind.HELLO, Hello(5, "owner").pack()),
            (DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(3)),
            (DatagramKind.COMMAND, COMMAND.struct.pack(CommandCode.HOLD)),
            (DatagramKind.ANNOUNCE, Announce(1, 1000, 10, MotionFlag.NONE).pack()),
            (DatagramKind.SAMPLES, Samples(1, 0, np.zeros(10, SAMPLE)).pack()),
            (DatagramKind.WATCH, WATCH.struct.pack(9)),
            (DatagramKind.STOP, STOP.struct.pack(0)),
            (DatagramKind.RELEASE, RELEASE.struct.pack(1)),
        )
    ]


def _state(door: Endpoint) -> tuple[Any, ...]:
    """All that a datagram could change, counters of refused ones left out."""
    window = door._window
    return (
        door._session, door._spent, door._client, door._cookie, door._heard, door._last_order, door.last_command,
        window._newest, window._seen, door._own and door._own.fileno(), door._admitted, door._sent, door.listeners,
        door._pressed,
    )  # fmt: skip


@given(
    which=st.integers(0, 7),
    edits=st.lists(
        st.tuples(st.integers(0, 1399), st.integers(1, 255)), min_size=1, max_size=4, unique_by=lambda e: e[0]
    ),
    cut=st.integers(0, 60) | st.none(),
    address=st.sampled_from([None, ("127.0.0.9", 5)]),
)
def test_a_changed_datagram_is_counted_and_changes_nothing(
    changing: House, which: int, edits: list[tuple[int, int]], cut: int | None, address: tuple[str, int] | None
) -> None:
    data = bytearray(_FRESH[which])
    for place, change in edits:
        data[place % len(data)] ^= change
    if cut is not None:
        data = data[: len(data) - cut]
    if bytes(data) == _FRESH[which]:  # two edits of one byte that undo each other
        return
    before = _state(changing.door)
    drop = changing.door._admit(memoryview(bytes(data)), address or changing.client.socket.getsockname(), 5.0)
    assert isinstance(drop, Drop)
    assert _state(changing.door) == before


_FRESH = list[bytes]()
"""What the client would have sent next."""


@pytest.fixture(scope="module")
def changing() -> Iterator[House]:
    made = House()
    _FRESH[:] = _sent_by(made.client)
    yield made
    made.close()


# a whole game

FLOOD = """
import random, socket, sys, time
port, rng = int(sys.argv[1]), random.Random(5)
example = bytes.fromhex(sys.argv[2])
ends = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(4)]
for number, end in enumerate(ends):
    end.bind((f"127.0.0.{number + 1}", 0))
batch = [rng.randbytes(rng.randrange(1, 1400)) for _ in range(100)]
for _ in range(100):
    changed = bytearray(example)
    changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    batch.append(bytes(changed))
print("on", flush=True)
while True:
    for number, data in enumerate(batch):
        ends[number % 4].sendto(data, ("127.0.0.1", port))
    time.sleep(0.04)
"""


@pytest.mark.real_time
@pytest.mark.slow
def test_a_game_in_real_time_goes_on_beside_a_flood(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some 5,000 datagrams a second at most, three times what can be read where each takes the turn of a tick."""
    floods = list[subprocess.Popen[str]]()

    def beside_a_flood(host: str, port: int, key: bytes, **options: Any) -> ControllerClient:
        example = Envelope(key).seal(DatagramKind.COMMAND, 1, 1, COMMAND.struct.pack(CommandCode.SHUTDOWN))
        command = [sys.executable, "-ISc", FLOOD, str(port), example.hex()]
        floods.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        assert floods[-1].stdout is not None
        assert floods[-1].stdout.readline() == "on\n"
        return ControllerClient(host, port, key, **options)

    monkeypatch.setattr("app.rig.remote.ControllerClient", beside_a_flood)
    settings = settings_of(
        {
            "rig.pace": Pace.REAL, "rig.seed": 3, "rig.video": False, "rig.cameras": False, "rig.linger": 5.0,
            "game.plies": 2, "game.moves": "e4 d5", "out": tmp_path / "game",
        }
    )  # fmt: skip
    try:
        done = run_games(settings, UserInterface())
        assert [flood.poll() for flood in floods] == [None], "the flood lasted to the end"
    finally:
        for flood in floods:
            flood.kill()
            flood.communicate()
    assert done.holds, done.report.failures
    assert done.report.plies == 2
