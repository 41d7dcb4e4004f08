"""STOP over the wire: every listener may press it, at any time; repeated it does no harm, and it starts nothing."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from controller.protocol import CommandCode, DatagramKind, Flag, Result
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import (
    ANNOUNCE,
    CHALLENGE,
    COMMAND,
    HEARTBEAT,
    PAYLOADS,
    RELEASE,
    SAMPLE,
    STOP,
    WATCH,
)
from controller.protocol.envelope import Drop, Envelope
from controller.protocol.messages import Hello, Welcome
from controller.protocol.states import State
from controller.wire.endpoint import Endpoint
from controller.wire.errors import ControllerLost, MotionRefused, MotionStopped, StopUnanswered
from controller.wire.listener import TelemetryWatch
from controller.wire.subscribers import SILENCE
from tests.controllers import connects

KEY = bytes(range(32))
HOME, AWAY = (0.0, 0.0, 0.35), (0.10, 0.05, 0.40)
CLIENT, EAR, STRANGER = ("127.0.0.1", 4000), ("127.0.0.1", 4001), ("127.0.0.1", 4002)
SESSION, LISTENER = 7, 77
REST = 0.3 / 0.00088
"""So many ticks after STOP the arm rests."""
Launch = Callable[..., Any]
Line = Callable[..., NDArray[Any]]
Until = Callable[..., None]


# the endpoint by itself


class House:
    """An endpoint with a client and a listener, and what it let through."""

    def __init__(self) -> None:
        self.envelope = Envelope(KEY)
        self.door = Endpoint("127.0.0.1", 0, KEY, 1e9, lambda: Welcome(0.00088, 8192, True, 0).pack())
        self.sent: list[tuple[DatagramKind, int, bytes]] = []
        self.door._subscribers._send = lambda _, kind, session, payload: self.sent.append((kind, session, payload))
        self.heard: list[int] = []
        self.numbers = {SESSION: 0, LISTENER: 0}
        self.put(DatagramKind.HELLO, Hello(0, "owner").pack(), SESSION, CLIENT)
        self.put(DatagramKind.HELLO, Hello(self.door._cookie, "owner").pack(), SESSION, CLIENT)
        assert self.door.leased
        self.cookie = self.admit_listener()
        self.heard.clear()

    def admit_listener(self, address: tuple[str, int] = EAR) -> int:
        """Make the listener one, anew if need be; its cookie."""
        self.door.relay()
        self.put(DatagramKind.WATCH, WATCH.struct.pack(0), LISTENER, address)
        kind, session, payload = self.sent.pop()
        assert (kind, session) == (DatagramKind.CHALLENGE, LISTENER)
        (cookie,) = CHALLENGE.struct.unpack(payload)
        assert self.put(DatagramKind.WATCH, WATCH.struct.pack(cookie), LISTENER, address) is None
        assert self.door.listeners == 1
        return int(cookie)

    def seal(self, kind: DatagramKind, payload: bytes, session: int = LISTENER) -> bytes:
        """The next datagram of a session."""
        self.numbers[session] = self.numbers.get(session, 0) + 1
        return self.envelope.seal(kind, session, self.numbers[session], payload)

    def put(
        self, kind: DatagramKind, payload: bytes, session: int = LISTENER, address: tuple[str, int] = EAR
    ) -> Drop | None:
        """Send the next datagram of a session."""
        return self.take(self.seal(kind, payload, session), address)

    def stop(self) -> bytes:
        """The listener's next STOP."""
        return self.seal(DatagramKind.STOP, STOP.struct.pack(self.cookie))

    def take(self, data: bytes, address: tuple[str, int] = EAR, now: float = 0.0) -> Drop | None:
        """Put a datagram before the door."""
        drop = self.door._admit(memoryview(data), address, now)
        self.door.take(self._handle)
        return drop

    def _handle(self, kind: int, payload: memoryview) -> bool:
        self.heard.append(kind)
        return True


@pytest.fixture
def house() -> Iterator[House]:
    made = House()
    yield made
    made.door.close()


def test_a_listeners_stop_counts_once_for_each_number(house: House) -> None:
    stop = house.stop()
    assert house.take(stop) is None
    assert house.door.pressed()
    assert not house.door.pressed()
    assert house.take(stop) is Drop.SEQUENCE
    assert not house.door.pressed()
    assert house.take(house.stop()) is None
    assert house.door.pressed()
    assert house.heard == [], "it is no order of the client's"


def test_a_stop_of_anybody_else_counts_for_nothing(house: House) -> None:
    stop = house.stop()
    assert house.take(stop, STRANGER) is Drop.SESSION, "from an address that is not the listener's"
    assert house.take(house.seal(DatagramKind.STOP, STOP.struct.pack(house.cookie), 78), STRANGER) is Drop.SESSION
    assert house.take(house.seal(DatagramKind.STOP, STOP.struct.pack(house.cookie), 0)) is Drop.SESSION
    assert house.take(house.seal(DatagramKind.STOP, STOP.struct.pack(house.cookie ^ 1))) is Drop.SESSION
    assert house.take(house.seal(DatagramKind.STOP, STOP.struct.pack(0))) is Drop.SESSION
    assert house.take(Envelope(bytes(32)).seal(DatagramKind.STOP, LISTENER, 900, STOP.struct.pack(9))) is Drop.TAG
    assert not house.door.pressed()
    assert house.take(stop) is None, "none of them has used its number up"


def test_a_recorded_stop_is_worthless_after_its_listener_was_admitted_again(house: House) -> None:
    early, late = house.stop(), house.stop()
    assert house.take(early) is None
    assert house.door.pressed()
    house.door.publish(b"", 2.0 * SILENCE)
    assert house.door.listeners == 0
    assert house.take(late) is Drop.SESSION
    house.cookie = house.admit_listener()
    for recorded in (early, late):
        assert house.take(recorded) is Drop.SESSION, "another cookie"
    assert not house.door.pressed()
    assert house.take(house.stop()) is None


def test_no_tag_is_computed_of_a_stop_that_is_refused_anyhow(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    used = house.stop()
    house.take(used)

    def none(*_: Any) -> bytes:
        raise AssertionError("a tag was computed")

    fresh, nobodys = house.stop(), house.seal(DatagramKind.STOP, STOP.struct.pack(house.cookie), 78)
    monkeypatch.setattr(Envelope, "_tag", none)
    assert house.take(used) is Drop.SEQUENCE
    assert house.take(nobodys) is Drop.SESSION
    assert house.take(fresh, STRANGER) is Drop.SESSION
    with pytest.raises(AssertionError, match="a tag was computed"):
        house.take(fresh)


@given(
    edits=st.lists(st.tuples(st.integers(0, 51), st.integers(1, 255)), max_size=3, unique_by=lambda e: e[0]),
    cut=st.integers(0, 20),
)
def test_a_changed_stop_changes_nothing(changing: House, edits: list[tuple[int, int]], cut: int) -> None:
    good = changing.envelope.seal(DatagramKind.STOP, LISTENER, 1000, STOP.struct.pack(changing.cookie))
    data = bytearray(good)
    for place, change in edits:
        data[place] ^= change
    if (found := bytes(data[: len(data) - cut])) == good:
        return
    assert isinstance(changing.take(found), Drop)
    assert not changing.door.pressed()
    assert changing.heard == []
    assert changing.door._subscribers._listeners[0].window.is_new(1000)


KINDS = st.sampled_from([kind for kind in PAYLOADS if kind is not DatagramKind.HELLO])
"""A HELLO asks for the lease, which is another matter."""


@given(kind=KINDS, noise=st.binary(min_size=1400, max_size=1400), own=st.booleans(), rows=st.integers(0, 3))
def test_nothing_that_a_listener_sends_does_more_than_stop(
    changing: House, kind: DatagramKind, noise: bytes, own: bool, rows: int
) -> None:
    size = PAYLOADS[kind].size + (SAMPLE.itemsize * rows if kind is DatagramKind.SAMPLES else 0)
    payload = STOP.struct.pack(changing.cookie) if own and size == STOP.size else noise[:size]
    changing.door.relay()  # a challenge may be sent again
    changing.put(kind, payload)
    assert changing.heard == []
    assert changing.door._session == SESSION
    assert changing.door.last_command == 0
    assert changing.door.pressed() is (kind is DatagramKind.STOP and payload == STOP.struct.pack(changing.cookie))


@pytest.fixture(scope="module")
def changing() -> Iterator[House]:
    made = House()
    yield made
    made.door.close()


def test_the_clients_own_stop_and_release_come_in_their_order(house: House) -> None:
    stop = house.seal(DatagramKind.STOP, STOP.struct.pack(0), SESSION)
    release = house.seal(DatagramKind.RELEASE, RELEASE.struct.pack(1), SESSION)
    assert house.take(release, CLIENT) is None
    assert house.take(stop, CLIENT) is Drop.SEQUENCE, "it was overtaken: it would stop the arm that was let go"
    assert house.put(DatagramKind.STOP, STOP.struct.pack(0), SESSION, CLIENT) is None
    assert house.heard == [DatagramKind.RELEASE, DatagramKind.STOP]
    assert house.door.last_command == house.numbers[SESSION]
    assert not house.door.pressed(), "it is the client's"


@pytest.mark.parametrize("busy", [0, 1, 400])
def test_a_client_that_sends_without_end_keeps_no_stop_away(busy: int) -> None:
    """Sockets as they are: in each tick one datagram of the client is carried out, and more come than that."""
    door = Endpoint("127.0.0.1", 0, KEY, 1e9, lambda: Welcome(0.00088, 8192, False, 0).pack())
    envelope, heard = Envelope(KEY), list[int]()
    client, ear = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))

    def hear(kind: int, _: memoryview) -> bool:
        heard.append(kind)
        return True

    def tick() -> None:
        door.drain(0.0, 0.0, 1, hear)
        door.relay()

    try:
        for end in (client, ear):
            end.settimeout(5.0)
            end.connect(door.address)
        client.send(envelope.seal(DatagramKind.HELLO, SESSION, 1, Hello(door._cookie, "mad").pack()))
        ear.send(envelope.seal(DatagramKind.WATCH, LISTENER, 1, WATCH.struct.pack(0)))
        for _ in range(4):
            tick()
        opened = envelope.open(memoryview(ear.recv(2048)))
        assert not isinstance(opened, Drop)
        for number in range(busy):
            client.send(envelope.seal(DatagramKind.HEARTBEAT, SESSION, 2 + number, HEARTBEAT.struct.pack(number)))
        ear.send(envelope.seal(DatagramKind.WATCH, LISTENER, 2, bytes(opened.payload)))
        ear.send(envelope.seal(DatagramKind.STOP, LISTENER, 3, bytes(opened.payload)))
        for _ in range(2):
            tick()
        assert door.pressed()
    finally:
        for end in (client, ear):
            end.close()
        door.close()


# with a controller


@pytest.mark.parametrize("lockstep", [True, pytest.param(False, marks=pytest.mark.real_time)])
def test_stop_ends_a_motion_and_only_the_clients_release_lets_another_begin(
    launch: Launch,
    fake_bus: Callable[..., Any],
    line: Line,
    watch: Callable[[Any], TelemetryWatch],
    until: Until,
    lockstep: bool,
) -> None:
    running = launch(fake_bus(lockstep=lockstep))
    listener = watch(running)
    with running.client(lead=500) as client:  # in real time what is played of a motion is there before it begins
        _pressed_in_motion(running, listener)
        with pytest.raises(MotionStopped, match="somebody pressed STOP: say 'go' when the arm may move again") as told:
            client.execute(line(HOME, AWAY, 600))
        assert told.value.cause is Cause.STOP_PRESSED
        until(lambda: listener.telemetry.latched)
        client.stop()
        telemetry = client.wait_standing()
        assert (telemetry.state, telemetry.latched, telemetry.admitting) == (State.HOLD, True, False)
        client.resume()
        with pytest.raises(MotionRefused, match="somebody pressed STOP"):
            client.execute(line(telemetry.reference, telemetry.reference, 180))
        client.release()
        assert not client.telemetry.latched
        assert client.execute(line(telemetry.reference, telemetry.reference, 180)).result is Result.DONE
    ticks = [m.tick for m, command in running.bus.log if command.busy]
    assert len(ticks) > 250


def _pressed_in_motion(running: Any, listener: TelemetryWatch) -> None:
    """Have a listener press STOP, once, as soon as the arm moves: in the plant's thread, so that it cannot be late."""
    done = list[int]()

    def on_tick(now: int) -> None:
        if not done and np.abs(running.bus.rate).max() > 0.3:
            done.append(now)
            listener._press()

    running.bus.on_tick = on_tick


def test_the_client_stops_itself_as_a_listener_does(launch: Launch, line: Line) -> None:
    running = launch()
    with running.client() as client:
        for _ in range(2):
            client.press_stop()
            assert client.telemetry.latched
        assert client.telemetry.cause is Cause.STOP_PRESSED
        with pytest.raises(MotionRefused, match="somebody pressed STOP"):
            client.execute(line(HOME, AWAY, 400))
        client.release()
        client.release()
        assert client.execute(line(HOME, AWAY, 400)).result is Result.DONE


def test_a_stop_that_is_pressed_while_the_client_releases_one_stays_in_force(
    launch: Launch,
    line: Line,
    watch: Callable[[Any], TelemetryWatch],
    until: Until,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    running = launch()
    listener = watch(running)
    with running.client() as client:
        _press_once(listener, until)
        until(lambda: client.telemetry.latched)
        seen = client.telemetry.presses
        link = client._connected
        real = link.send

        def late(kind: DatagramKind, payload: bytes) -> None:
            if kind is DatagramKind.RELEASE and listener.telemetry.presses == seen:
                _press_once(listener, until)  # it comes before the RELEASE of a client that does not know of it
            real(kind, payload)

        monkeypatch.setattr(link, "send", late)
        client.release()
        assert client.wait_standing().latched
        with pytest.raises(MotionRefused, match="somebody pressed STOP"):
            client.execute(line(HOME, AWAY, 400))
        client.release()
        assert client.execute(line(HOME, AWAY, 400)).result is Result.DONE


def _press_once(listener: TelemetryWatch, until: Until) -> None:
    """Press STOP with a single datagram: `stop` repeats it on a slow machine, and each that comes counts."""
    before = listener.telemetry.presses
    listener._press()
    until(lambda: listener.telemetry.presses > before)


def test_a_recorded_stop_does_not_stop_again(
    launch: Launch, line: Line, lossy_link: Callable[..., Any], until: Until
) -> None:
    running = launch()
    link = lossy_link(running.port)
    with TelemetryWatch("127.0.0.1", link.port, running.key) as listener, running.client() as client:
        _press_once(listener, until)
        until(lambda: client.telemetry.latched)  # what a client has not heard of it cannot release
        client.release()
        assert not client.telemetry.latched
        (stop,) = (data for data in link.seen if data[8] == DatagramKind.STOP)
        before = client.telemetry.bad_sequence
        for _ in range(3):
            link.send(stop)
        until(lambda: client.telemetry.bad_sequence >= before + 3 or client.telemetry.latched)
        assert not client.telemetry.latched
        assert client.execute(line(HOME, AWAY, 400)).result is Result.DONE


def test_stop_comes_through_a_network_that_loses_every_other_datagram(
    launch: Launch, lossy_link: Callable[..., Any]
) -> None:
    running = launch()
    link = lossy_link(running.port, loss=0.5, repeats=0.3, delay=0.01)
    listener = TelemetryWatch("127.0.0.1", link.port, running.key)
    listener.connect(60.0)
    try:
        assert listener.stop(60.0).latched
    finally:
        listener.close()


def test_a_latch_outlives_its_listener_the_client_and_the_lease(
    launch: Launch, line: Line, watch: Callable[[Any], TelemetryWatch], until: Until
) -> None:
    running = launch(lease=0.3, linger=600.0)
    listener = watch(running)
    with running.client() as client:
        client.execute(line(HOME, AWAY, 400))
        listener.stop()
    listener.close()
    another = running.client()
    until(lambda: connects(another))
    telemetry = another.wait_standing()
    assert telemetry.latched
    with pytest.raises(MotionRefused, match="somebody pressed STOP"):
        another.execute(line(telemetry.reference, HOME, 900))
    another.shutdown()
    until(lambda: running.status == 0)
    assert running.bus.last.brake


HANGS = """
import sys, time
import numpy as np
from pathlib import Path
from controller.protocol import SAMPLE
from controller.wire.address import find_controller
from controller.wire.client import ControllerClient
samples = np.frombuffer(Path(sys.argv[2]).read_bytes(), SAMPLE)
def listener(telemetry):
    if telemetry.executed > 300:
        print("hangs", flush=True)
        time.sleep(600.0)  # the link's own thread: nothing is received, acknowledged or beaten any more
with ControllerClient(*find_controller(Path(sys.argv[1])), listener=listener) as client:
    client.execute(samples)
"""


def test_stop_works_while_the_program_that_moves_the_arm_hangs(
    launch: Launch, line: Line, watch: Callable[[Any], TelemetryWatch], until: Until, tmp_path: Any
) -> None:
    """Its samples are on the way, its lease is not over yet; on a lockstep bus plant time stands in mid motion."""
    running = launch(lease=600.0)
    listener = watch(running)
    file = tmp_path / "samples.bin"
    file.write_bytes(np.ascontiguousarray(line(HOME, AWAY, 2000)).tobytes())
    hung = subprocess.Popen(
        [sys.executable, "-P", "-c", HANGS, str(running.directory), str(file)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert hung.stdout is not None
        assert hung.stdout.readline() == "hangs\n"
        until(
            lambda: running.bus.log[-1][0].tick == listener.telemetry.tick and listener.telemetry.flags & Flag.WAITING
        )
        time.sleep(0.2)
        asked = running.bus.log[-1][0].tick
        assert np.abs(running.bus.rate).max() > 0.01, "it hangs where the arm moves"
        assert listener.stop(60.0).latched
        until(lambda: not running.bus.last.busy and np.abs(running.bus.rate).max() < 1e-3)
        assert running.bus.log[-1][0].tick - asked < REST
        until(lambda: listener.telemetry.state is State.HOLD)  # what it is told comes after what the plant knows
        assert not running.bus.last.brake
    finally:
        hung.kill()
        hung.wait()
        hung.stdout.close() if hung.stdout else None


def test_what_a_stop_that_nobody_carries_out_says(launch: Launch, watch: Callable[[Any], TelemetryWatch]) -> None:
    with pytest.raises(ControllerLost, match=r"there is no connection to 127.0.0.1:1: call connect first"):
        TelemetryWatch("127.0.0.1", 1, KEY).stop()
    running = launch()
    listener = watch(running)
    running.kill()
    sentence = r"127.0.0.1:\d+ has not answered STOP within 0.2 s: stop the arm by its own switch, then check whether"
    with pytest.raises(StopUnanswered, match=sentence):
        listener.stop(0.2)


def test_what_a_listener_sends_begins_nothing_in_a_controller(launch: Launch, watch: Any, line: Line) -> None:
    running = launch()
    listener = watch(running)
    before = running.bus.log[-1][0].tick
    for kind, payload in (
        (DatagramKind.RELEASE, RELEASE.struct.pack(0)),
        *((DatagramKind.COMMAND, COMMAND.struct.pack(code)) for code in CommandCode),
        (DatagramKind.ANNOUNCE, ANNOUNCE.struct.pack(1, before + 20, 100, 0)),
    ):
        _send_raw(listener, kind, payload)
    pressed = listener.stop()
    for presses in (pressed.presses, pressed.presses + 1):
        _send_raw(listener, DatagramKind.RELEASE, RELEASE.struct.pack(presses))
    with running.client() as client:
        telemetry = client.wait_standing()
        assert (telemetry.state, telemetry.latched, telemetry.ended_motion) == (State.HOLD, True, 0)
        assert telemetry.flags & telemetry.flags.ADMITTING
        assert running.bus.log[-1][0].tick == before


def _send_raw(listener: TelemetryWatch, kind: DatagramKind, payload: bytes) -> None:
    with listener._sending:
        listener._sequence += 1
        listener._socket.send(listener._envelope.seal(kind, listener._session, listener._sequence, payload))
