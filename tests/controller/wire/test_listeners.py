"""Listeners: they hear everything, command nothing, and cost little; recorded datagrams open nothing.

That they may stop the arm is in ``test_stop``.
"""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest
from numpy.typing import NDArray

from controller.protocol import CommandCode, DatagramKind, Result
from controller.protocol.datagram_fields import ANNOUNCE, CHALLENGE, COMMAND, HEARTBEAT, PAYLOADS, WATCH
from controller.protocol.envelope import Drop, Envelope, Opened
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from controller.wire.address import find_controller
from controller.wire.errors import ControllerLost, ControllerUnavailable
from controller.wire.listener import TelemetryWatch
from controller.wire.subscribers import MAX_LISTENERS, SILENCE, Subscribers
from tests.controllers import free_port
from tests.waiting import PATIENCE

HOME, AWAY = (0.0, 0.0, 0.35), (0.10, 0.05, 0.40)
HERE, THERE = ("127.0.0.1", 1), ("127.0.0.1", 2)
Launch = Callable[..., Any]
Line = Callable[..., NDArray[Any]]
Until = Callable[..., None]


# the audience by itself


class House:
    """An audience, and what it sent."""

    def __init__(self) -> None:
        self.sent: list[tuple[Any, DatagramKind, int, bytes]] = []
        self.audience = Subscribers(lambda *datagram: self.sent.append(datagram))

    def watch(
        self, session: int, sequence: int, cookie: int, address: Any = HERE, now: float = 0.0, new_turn: bool = True
    ) -> Drop | None:
        if new_turn:
            self.audience.relay()
        payload = memoryview(WATCH.struct.pack(cookie))
        return self.audience.admit(Opened(DatagramKind.WATCH, session, sequence, payload), address, now)

    def cookie(self, session: int, address: Any = HERE, now: float = 0.0) -> int:
        """Ask with cookie 0 and return the one of the answer."""
        assert self.watch(session, 1, 0, address, now) is None
        to, kind, session_again, payload = self.sent.pop()
        assert (to, kind, session_again) == (address, DatagramKind.CHALLENGE, session)
        (cookie,) = CHALLENGE.struct.unpack(payload)
        return int(cookie)

    def enter(self, session: int, address: Any = HERE, now: float = 0.0) -> int:
        """Become a listener; the cookie."""
        cookie = self.cookie(session, address, now)
        assert self.watch(session, 2, cookie, address, now) is None
        return cookie

    def round(self, payload: bytes, now: float = 0.0) -> list[int]:
        """Publish, and the sessions that got it, in the order of sending."""
        self.audience.publish(payload, now)
        while self.audience.relay():
            pass
        got = [
            session for _, kind, session, content in self.sent if kind is DatagramKind.TELEMETRY and content == payload
        ]
        self.sent.clear()
        return got


def test_a_challenge_is_no_longer_than_what_asks_for_it() -> None:
    assert CHALLENGE.size <= WATCH.size


def test_the_right_cookie_makes_a_listener() -> None:
    house = House()
    assert house.round(b"early") == []
    house.enter(7)
    assert (len(house.audience), house.sent) == (1, [])
    assert house.round(b"news") == [7]


def test_a_cookie_serves_one_session_at_one_address_once() -> None:
    house = House()
    cookie = house.cookie(7)
    for session, address in ((8, HERE), (7, THERE), (7, ("127.0.0.2", 1))):
        assert house.watch(session, 2, cookie, address) is None
        assert house.sent.pop()[:2] == (address, DatagramKind.CHALLENGE)
    assert len(house.audience) == 0
    assert house.watch(7, 2, cookie) is None
    assert len(house.audience) == 1


def test_a_replayed_watch_gets_nothing() -> None:
    house = House()
    cookie = house.enter(7)
    assert house.watch(7, 2, cookie) is Drop.SEQUENCE
    # from an address that somebody made up: a challenge, no telemetry, and the listener stays where it is
    assert house.watch(7, 2, cookie, THERE) is None
    assert [(to, kind) for to, kind, _, _ in house.sent] == [(THERE, DatagramKind.CHALLENGE)]
    house.sent.clear()
    house.audience.publish(b"news", 0.0)
    house.audience.relay()
    assert [(to, kind) for to, kind, _, _ in house.sent] == [(HERE, DatagramKind.TELEMETRY)]
    # once forgotten, the recording does not open either
    house.sent.clear()
    late = 2 * SILENCE
    assert house.round(b"more", late) == []
    assert house.watch(7, 2, cookie, now=late) is None
    assert (house.sent.pop()[1], len(house.audience)) == (DatagramKind.CHALLENGE, 0)


def test_a_refused_watch_is_spent_too() -> None:
    house = House()
    for session in range(1, MAX_LISTENERS + 1):
        house.enter(session)
    cookie = house.cookie(99)
    assert house.watch(99, 2, cookie) is Drop.SESSION
    late = 2 * SILENCE
    assert house.watch(99, 2, cookie, now=late) is None
    assert house.sent.pop()[1] is DatagramKind.CHALLENGE


def test_a_listener_that_moves_is_challenged_and_keeps_its_numbers() -> None:
    house = House()
    cookie = house.enter(7)
    assert house.watch(7, 9, cookie) is None
    moved = house.cookie(7, THERE)
    assert house.watch(7, 9, moved, THERE) is Drop.SEQUENCE
    moved = house.cookie(7, THERE)
    assert house.watch(7, 10, moved, THERE) is None
    house.audience.publish(b"news", 0.0)
    house.audience.relay()
    assert house.sent[0][0] == THERE
    assert len(house.audience) == 1


def test_one_challenge_a_turn() -> None:
    house = House()
    answers = []
    for _ in range(3):
        answers += [house.watch(session, 1, 0, new_turn=False) for session in range(1, 5)]
        house.audience.relay()
    assert answers == [None, *[Drop.SESSION] * 3] * 3
    assert [kind for _, kind, _, _ in house.sent] == [DatagramKind.CHALLENGE] * 3


def test_session_zero_is_nobody() -> None:
    house = House()
    assert house.watch(0, 1, 0) is Drop.SESSION
    assert house.sent == []


def test_eight_are_served_and_a_silent_one_makes_room() -> None:
    house = House()
    for session in range(1, MAX_LISTENERS + 1):
        house.enter(session, ("127.0.0.1", session))
    assert house.watch(99, 2, house.cookie(99)) is Drop.SESSION
    assert len(house.audience) == MAX_LISTENERS
    assert sorted(house.round(b"news")) == list(range(1, 9))
    later = 1.5 * SILENCE
    house.enter(99, now=later)
    assert house.round(b"more", later) == [99]


def test_one_copy_at_a_time_in_turn_and_never_an_old_one() -> None:
    house = House()
    for session in range(1, 5):
        house.enter(session, ("127.0.0.1", session))
    heard: dict[int, list[bytes]] = {session: [] for session in range(1, 5)}
    for k in range(100):
        house.audience.publish(bytes([k]), 0.0)
        # fewer turns than listeners: nobody starves
        for _ in range(3):
            assert house.audience.relay()
            assert len(house.sent) == 1
            _, _, session, payload = house.sent.pop()
            assert payload == bytes([k])
            heard[session].append(payload)
    assert {len(copies) for copies in heard.values()} == {75}
    assert house.audience.relay()
    assert not house.audience.relay()


# over the socket


class Ear:
    """Speaks WATCH by hand."""

    def __init__(self, running: Any, session: int) -> None:
        self.envelope, self.session, self.sequence, self.cookie = Envelope(running.key), session, 0, 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE)
        self.socket.connect(("127.0.0.1", running.port))

    def send(self, kind: DatagramKind, payload: bytes) -> bytes:
        self.sequence += 1
        data = self.envelope.seal(kind, self.session, self.sequence, payload)
        self.socket.send(data)
        return data

    def watch(self) -> bytes:
        return self.send(DatagramKind.WATCH, WATCH.struct.pack(self.cookie))

    def receive(self) -> Opened:
        opened = self.envelope.open(memoryview(self.socket.recv(2048)))
        assert isinstance(opened, Opened)
        return opened

    def enter(self) -> bytes:
        """Become a listener; the datagram that did it."""
        self.watch()
        opened = self.receive()
        assert (opened.kind, opened.session) == (DatagramKind.CHALLENGE, self.session)
        (self.cookie,) = CHALLENGE.struct.unpack(opened.payload)
        data = self.watch()
        assert self.receive().kind == DatagramKind.TELEMETRY
        return data


@pytest.fixture
def ear() -> Iterator[Callable[..., Ear]]:
    """Makes ears of a controller; closes them all."""
    ears: list[Ear] = []

    def make(running: Any, session: int) -> Ear:
        ears.append(Ear(running, session))
        return ears[-1]

    yield make
    for one in ears:
        one.socket.close()


def test_a_watch_hears_what_the_client_hears(launch: Launch, line: Line, until: Until) -> None:
    running, own, heard = launch(), list[Telemetry](), list[Telemetry]()
    with TelemetryWatch(*find_controller(running.directory), heard.append) as watch:
        assert watch.telemetry.state is State.HOLD
        with running.client(listener=own.append) as client:
            outcome = client.execute(line(HOME, AWAY, 640))
            client.shutdown()
        running.join()
        until(lambda: heard[-1].state is State.OFF)
    during = {t.tick for t in heard if outcome.first_tick <= t.tick <= outcome.end_tick}
    assert len(during) >= 30
    assert {t for t in heard if t.tick in during} <= set(own)
    assert (outcome.result, heard[-1].state) == (Result.DONE, State.OFF)
    assert [t.tick for t in heard] == sorted(t.tick for t in heard)


def test_a_listener_cannot_command(launch: Launch, ear: Callable[..., Ear], until: Until) -> None:
    running = launch(lease=1.0, linger=2.0)
    hand = ear(running, 77)
    hand.enter()
    before = running.bus.log[-1][0].tick
    for kind, layout in PAYLOADS.items():
        if kind not in (DatagramKind.WATCH, DatagramKind.HELLO):
            hand.send(kind, bytes(layout.size))
    for code in CommandCode:
        hand.send(DatagramKind.COMMAND, COMMAND.struct.pack(code))
    hand.send(DatagramKind.ANNOUNCE, ANNOUNCE.struct.pack(1, before + 20, 100, 0))
    hand.send(DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(5))
    with running.client() as client:
        telemetry = client.wait_standing()
        assert (telemetry.state, telemetry.command, telemetry.ended_motion) == (State.HOLD, 0, 0)
        assert telemetry.admitting
        # nor is any of it taken for the client's, whose session is another
        assert telemetry.bad_session >= len(CommandCode) + 2
    # a listener is no client: without one the controller ends
    assert running.bus.log[-1][0].tick == before
    until(lambda: running.status == 0 or not _still(hand))


def _still(hand: Ear) -> bool:
    """Stay a listener; true."""
    with suppress(ConnectionRefusedError):  # the controller has closed its socket, and is about to end
        hand.watch()
    time.sleep(0.05)
    return True


def test_a_clients_session_is_not_for_listening(launch: Launch, ear: Callable[..., Ear]) -> None:
    running = launch()
    with running.client() as client:
        hand = ear(running, client._connected._session)
        hand.socket.settimeout(0.1)
        before = client.wait_standing().bad_session  # of a client that a busy controller let ask twice
        hand.watch()
        with pytest.raises(TimeoutError):
            hand.receive()
        assert client.wait_standing().bad_session == before + 1


def test_a_recorded_watch_gets_no_telemetry(launch: Launch, ear: Callable[..., Ear]) -> None:
    running = launch()
    hand, other = ear(running, 77), ear(running, 0)
    recorded = hand.enter()
    other.socket.send(recorded)
    assert other.receive().kind == DatagramKind.CHALLENGE
    other.socket.settimeout(0.1)
    with pytest.raises(TimeoutError):
        other.receive()
    # and the listener goes on hearing
    assert hand.receive().kind == DatagramKind.TELEMETRY


def test_a_wrong_key_gets_nothing(launch: Launch, ear: Callable[..., Ear]) -> None:
    running = launch()
    hand = ear(running, 77)
    hand.envelope = Envelope(bytes(32))
    hand.socket.settimeout(0.1)
    hand.watch()
    with pytest.raises(TimeoutError):
        hand.socket.recv(2048)


def test_a_flood_of_watches_changes_nothing_of_the_motion(launch: Launch, line: Line) -> None:
    quiet = launch()
    with quiet.client() as client:
        client.execute(line(HOME, AWAY, 1200))
    noisy = launch()
    flooded, ended, sent = threading.Event(), threading.Event(), 0
    envelope = Envelope(noisy.key)

    def play() -> None:
        # how many arrive while the arm moves is the machine's affair: so many wait already when it starts
        flooded.wait()
        client.execute(line(HOME, AWAY, 1200))
        ended.set()

    with noisy.client() as client, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as noise:
        noise.connect(("127.0.0.1", noisy.port))
        player = threading.Thread(target=play)
        player.start()
        while not ended.is_set():
            sent += 1
            noise.send(envelope.seal(DatagramKind.WATCH, sent % 50 + 1, sent, WATCH.struct.pack(sent % 3)))
            if sent == 100:
                flooded.set()
            time.sleep(0.0)
        player.join()
        client.wait_standing()
    moved = [[(m.tick, m.angle, c.torque) for m, c in r.bus.log if c.busy] for r in (quiet, noisy)]
    assert moved[0] == moved[1]


def test_many_watches_at_once_and_one_too_many(launch: Launch, until: Until, monkeypatch: pytest.MonkeyPatch) -> None:
    running = launch()
    watches = [TelemetryWatch(*find_controller(running.directory)) for _ in range(MAX_LISTENERS + 1)]
    for watch in watches[:-1]:
        watch.connect()
    until(
        lambda: re.match(r"127.0.0.1:\d+ answers but admits no more listeners: end another", _turned_away(watches[-1]))
    )
    watches[0].close()
    monkeypatch.setattr("controller.wire.subscribers.SILENCE", SILENCE)  # until here none was forgotten, however slow
    watches[-1].connect()
    assert watches[-1].telemetry.state is State.HOLD
    for watch in watches:
        watch.close()


def _turned_away(watch: TelemetryWatch) -> str:
    """What a listener is told that is not admitted."""
    with pytest.raises(ControllerUnavailable) as told:
        watch.connect(timeout=0.5)
    return str(told.value)


def test_a_watch_finds_a_new_controller_at_the_old_address(
    launch: Launch, until: Until, monkeypatch: pytest.MonkeyPatch
) -> None:
    port, heard = free_port(), list[Telemetry]()
    running = launch(port=port)
    key = running.key
    monkeypatch.setattr("controller.wire.listener.SILENCE", 1.0)
    with TelemetryWatch("127.0.0.1", port, key, heard.append) as watch:
        running.kill()
        until(lambda: _lost(watch))
        monkeypatch.setattr("controller.loop.server.load_key", lambda path: key)
        again = launch(port=port)
        count = len(heard)
        until(lambda: len(heard) > count)
        assert heard[-1].state is State.HOLD
        assert again.status is None


def _lost(watch: TelemetryWatch) -> bool:
    try:
        watch.telemetry  # noqa: B018
    except ControllerLost:
        return True
    return False


def test_what_keeps_a_watch_from_listening_is_said(tmp_path: Any) -> None:
    with pytest.raises(ControllerUnavailable, match=r"controller.json cannot be used .*: is the controller running\?"):
        TelemetryWatch(*find_controller(tmp_path))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        watch = TelemetryWatch("127.0.0.1", taken.getsockname()[1], bytes(32))
        with pytest.raises(
            ControllerUnavailable, match=r"no answer from 127.0.0.1:\d+ within 0.1 s: is the controller"
        ):
            watch.connect(timeout=0.1)
    with pytest.raises(ControllerLost, match=r"no telemetry from 127.0.0.1:\d+ for \d.\d\d s: is the controller"):
        watch.telemetry  # noqa: B018
    watch.close()
