"""The controller as a whole: real datagrams on loopback, a plant behind the bus, a client that may misbehave."""

from __future__ import annotations

import math
import os
import random
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.loop.server import serve
from controller.protocol import SAMPLE, CommandCode, DatagramKind, Flag, Result
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import CHALLENGE, COMMAND, HEADER, HEARTBEAT
from controller.protocol.envelope import Envelope
from controller.protocol.key import KEY_FILE, create_key
from controller.protocol.messages import Hello, Telemetry
from controller.protocol.states import State
from controller.settings import CONTROLLER_FILE, ControllerSettings
from controller.wire.address import find_controller
from controller.wire.client import ControllerClient
from controller.wire.errors import (
    CommandFailed,
    ControllerBusy,
    ControllerLost,
    ControllerUnavailable,
    MotionRefused,
    MotionStopped,
)
from controller.wire.listener import TelemetryWatch
from controller.wire.sockets import LOCKSTEP_SILENCE
from hardware.interfaces import Command, DriveStatus
from hardware.parameters import load_parameters
from tests.controllers import connects, free_port
from tests.waiting import PATIENCE

HOME, AWAY = (0.0, 0.0, 0.35), (0.10, 0.05, 0.40)
Launch = Callable[..., Any]
Line = Callable[..., NDArray[Any]]
FakeBusFactory = Callable[..., Any]
Until = Callable[..., None]


def trajectory(bus: Any) -> list[tuple[int, Any, Any, Any]]:
    """What the plant went through while somebody was busy: tick, angles, torques, finger velocity."""
    return [(m.tick, m.angle, c.torque, c.finger_velocity) for m, c in bus.log if c.busy]


def a_ply(client: ControllerClient, line: Line, grip: Line) -> list[Any]:
    """Go there, grip, come back; the outcomes."""
    back = line(AWAY, HOME, 600)
    back["finger_velocity"] = -0.025
    outcomes = [client.execute(line(HOME, AWAY, 600), followed=True), client.execute(grip(AWAY, 900), followed=True)]
    return [*outcomes, client.execute(back)]


# motions


def test_a_ply_is_executed_and_told(launch: Launch, line: Line, grip: Line) -> None:
    running = launch()
    running.bus.object_at = 0.010
    with running.client() as client:
        there, gripped, back = a_ply(client, line, grip)
        client.wait_standing()
        client.shutdown()
    assert running.join() == 0
    assert (there.result, gripped.result, back.result) == (Result.DONE, Result.GRIPPED, Result.DONE)
    assert gripped.gripped
    assert not back.gripped
    assert there.duration == pytest.approx(600 * 0.00088)
    assert there.position == pytest.approx(AWAY, abs=1e-4)
    assert there.finger_position == pytest.approx(0.022)
    assert gripped.finger_position == pytest.approx(0.010)
    assert gripped.peak_tactile == pytest.approx(4.0)
    assert 0.8 < there.peak_torque < 4.0
    # the next motion begins eight ticks after the end of a FOLLOWED one, however slow this machine is
    assert gripped.first_tick == there.end_tick + 8
    assert back.first_tick == gripped.end_tick + 8


def test_a_lossy_link_changes_nothing_of_the_motion(
    launch: Launch, lossy_link: Callable[..., Any], line: Line, grip: Line
) -> None:
    runs = []
    for options in ({}, {"loss": 0.3, "repeats": 0.1, "delay": 0.02}):
        running = launch()
        running.bus.object_at = 0.010
        client = running.client_through(lossy_link(running.port, **options))
        client.connect()
        outcomes = a_ply(client, line, grip)
        client.wait_standing()
        runs.append((outcomes, trajectory(running.bus), client.telemetry))
        client.close()
    (outcomes, lossless, _), (outcomes_again, lossy, telemetry) = runs
    assert outcomes == outcomes_again
    assert lossless == lossy
    assert len(lossless) > 1500
    assert telemetry.bad_sequence > 0


def test_a_run_repeats_exactly(launch: Launch, line: Line) -> None:
    runs = []
    for pause in (0.0, 0.05):
        running = launch()
        with running.client() as client:
            for start, end in ((HOME, AWAY), (AWAY, HOME)):
                client.wait_standing()
                time.sleep(pause)
                client.execute(line(start, end, 500))
            runs.append((client.wait_standing().tick, trajectory(running.bus)))
    assert runs[0] == runs[1]


def test_plant_time_stands_between_followed_motions(launch: Launch, line: Line) -> None:
    running = launch()
    with running.client() as client:
        outcome = client.execute(line(HOME, AWAY, 500), followed=True)
        time.sleep(0.2)
        telemetry = client.wait_standing()
        assert telemetry.flags & Flag.WAITING
        assert telemetry.tick == outcome.end_tick
        assert telemetry.reference == pytest.approx(AWAY)


def test_a_long_motion_streams_through_a_small_ring(launch: Launch, line: Line) -> None:
    running = launch(capacity=100)
    with running.client() as client:
        assert client.execute(line(HOME, AWAY, 1500)).result is Result.DONE


@pytest.mark.real_time
def test_a_real_time_bus(launch: Launch, fake_bus: FakeBusFactory, line: Line) -> None:
    for chances in (2, 1, 0):  # all of it shares one interpreter, and a busy machine may stand still for 0.15 s
        try:
            with launch(fake_bus(lockstep=False)).client() as client:
                assert not client.lockstep
                outcome = client.execute(line(HOME, AWAY, 500), followed=True)
                again = client.execute(line(AWAY, HOME, 500))
                assert outcome.end_tick < again.first_tick
                assert again.position == pytest.approx(HOME, abs=1e-4)
                return
        except (MotionRefused, MotionStopped) as stop:
            if stop.cause not in (Cause.LATE, Cause.UNDERRUN) or not chances:
                raise


@pytest.mark.real_time
def test_on_a_real_time_bus_a_late_announcement_is_tried_again(
    launch: Launch, fake_bus: FakeBusFactory, line: Line
) -> None:
    running = launch(fake_bus(lockstep=False))
    with running.client(lead=1) as client:
        refused: list[int] = []
        link = client._connected
        send, seen = link.send, []

        def slow_once(kind: DatagramKind, payload: bytes) -> None:
            if kind is DatagramKind.ANNOUNCE and not seen:
                seen.append(payload)
                client._lead = 600  # enough, if this machine stumbles
                time.sleep(0.02)
            send(kind, payload)

        link.send = slow_once  # type: ignore[method-assign]  # a hiccup of this process
        assert client.execute(line(HOME, HOME, 50)).result is Result.DONE
        assert not refused
        assert client.telemetry.ended_motion == 2


@pytest.mark.real_time
def test_on_a_real_time_bus_an_underrun_stops(
    launch: Launch, fake_bus: FakeBusFactory, lossy_link: Callable[..., Any], line: Line
) -> None:
    running = launch(fake_bus(lockstep=False))
    samples = line(HOME, AWAY, 600)

    def cut(data: bytes) -> bool:
        _motion, start = struct.unpack_from("<II", data, 28)
        return data[8] == DatagramKind.SAMPLES and start >= 300

    client = running.client_through(lossy_link(running.port, veto=cut), lead=500)  # none is late for its start
    client.connect()
    # at the 300th, or before where this machine stood still
    with pytest.raises(
        MotionStopped, match=r"stopped motion 1 .*: sample ([12]?\d?\d|300) was due, but only \1 had arrived"
    ):
        client.execute(samples)
    client.stop()
    telemetry = client.telemetry
    assert telemetry.admitting
    # sent as a whole before it begins, so that it lacks nothing
    assert client.execute(line(telemetry.reference, telemetry.reference, 180)).result is Result.DONE


def test_a_refusal_is_an_error_with_the_numbers(launch: Launch, line: Line) -> None:
    with launch().client() as client:
        with pytest.raises(
            MotionRefused, match=r"refused motion 1: the motion starts 0.122 m from the present reference"
        ):
            client.execute(line(AWAY, HOME, 500))
        fast = line(HOME, AWAY, 250)
        # refused, or stopped if it had begun when the bad sample came
        sentence = r"motion 2.*: a sample asks for 0.8.. m/s, at most 0.816 m/s"
        with pytest.raises((MotionRefused, MotionStopped), match=sentence):
            client.execute(fast)
        assert client.execute(line(client.wait_standing().reference, AWAY, 500)).result is Result.DONE


@pytest.mark.parametrize("samples", [np.zeros((2, 2), SAMPLE), np.zeros(3)])
def test_only_samples_are_executed(launch: Launch, samples: NDArray[Any]) -> None:
    with launch().client() as client, pytest.raises(ValueError, match=r"give shape \(n,\) of type SAMPLE"):
        client.execute(samples)


def test_a_stop_in_the_middle(launch: Launch, line: Line) -> None:
    running = launch()
    with running.client() as client:
        stopper = running.bus.on_tick = _At(
            1500, lambda: client._connected.send(DatagramKind.COMMAND, COMMAND.struct.pack(4))
        )
        with pytest.raises(MotionStopped, match="a stop was commanded: plan again from the reference in the telemetry"):
            client.execute(line(HOME, AWAY, 900))
        assert stopper.done
        telemetry = client.wait_standing()
        assert telemetry.state is State.HOLD
        assert telemetry.position == pytest.approx(telemetry.reference, abs=2e-3)
        assert client.execute(line(telemetry.reference, HOME, 900)).result is Result.DONE


class _At:
    """Calls something once, at a tick."""

    def __init__(self, tick: int, call: Callable[[], Any]) -> None:
        self.tick, self.call, self.done = tick, call, False

    def __call__(self, tick: int) -> None:
        if tick >= self.tick and not self.done:
            self.done = True
            self.call()
            time.sleep(0.02)


class _Moving(_At):
    """The same, once the arm moves."""

    def __init__(self, bus: Any, call: Callable[[], Any]) -> None:
        super().__init__(0, call)
        self.bus = bus

    def __call__(self, tick: int) -> None:
        if np.abs(self.bus.rate).max() > 0.3:
            super().__call__(tick)


# commands


def test_commands_are_idempotent_and_acknowledged(launch: Launch, line: Line) -> None:
    with launch().client() as client:
        for _ in range(2):
            client.hold()
            assert not client.telemetry.admitting
        with pytest.raises(MotionRefused, match="a hold is in force: send resume before the next motion"):
            client.execute(line(HOME, HOME, 10))
        for command in (client.resume, client.resume, client.stop, client.enable, client.clear_fault):
            command()
        assert client.telemetry.admitting
        assert client.execute(line(HOME, HOME, 10)).result is Result.DONE


def test_a_fault_is_told_and_can_be_cleared(launch: Launch, line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    running = launch()
    with running.client() as client:
        running.bus.on_tick = _At(1400, lambda: setattr(running.bus, "status", DriveStatus.FAULT))
        with pytest.raises(MotionStopped, match=r"a drive reports a fault"):
            client.execute(line(HOME, AWAY, 900))
        with pytest.raises(MotionRefused, match=r"refused motion 2: the arm is on its brakes: a drive reports a fault"):
            client.execute(line(client.wait_standing().reference, AWAY, 900))
        with monkeypatch.context() as patch:
            patch.setattr("controller.wire.client._COMMAND_TIMEOUT", 0.2)
            with pytest.raises(
                CommandFailed, match=r"enable had no effect within 0.2 s in state FAULT: a drive reports"
            ):
                client.enable()
        assert running.bus.last.brake
        running.bus.status = DriveStatus.OK
        client.clear_fault()
        assert running.bus.last.brake
        client.enable()
        assert client.execute(line(client.wait_standing().reference, HOME, 900)).result is Result.DONE


def test_an_order_that_was_lost_is_not_taken_for_another_threads_that_was_not(
    launch: Launch, lossy_link: Callable[..., Any], fake_bus: FakeBusFactory
) -> None:
    """The guard tells it to hold, and its first datagram is lost; the game lets it go on at the same moment."""
    running, lost = launch(fake_bus(lockstep=False)), threading.Event()

    def first_hold(data: bytes) -> bool:
        kind, body = struct.unpack_from("<H", data, 8)[0], data[HEADER.size :]
        hold = kind == DatagramKind.COMMAND and body.startswith(COMMAND.struct.pack(CommandCode.HOLD))
        if not hold or lost.is_set():
            return False
        lost.set()
        return True

    client = running.client_through(lossy_link(running.port, veto=first_hold))
    causes = list[Cause]()
    client._listener = lambda telemetry: causes.append(telemetry.cause)
    client.connect()
    others = threading.Thread(target=lambda: (lost.wait(PATIENCE), client.resume()))
    others.start()
    client.ask_to_hold()
    others.join()
    assert lost.is_set()
    assert Cause.HOLD_COMMAND in causes, "it was carried out"


# the lease


def test_a_second_client_is_told_who_holds_the_lease(launch: Launch, line: Line) -> None:
    running = launch()
    with running.client(name="the first") as first:
        second = running.client(name="the second")
        with pytest.raises(
            ControllerBusy, match=r"is held by the first \(127.0.0.1:\d+, heard \d.\d\d s ago\): end that"
        ):
            second.connect()
        assert first.execute(line(HOME, AWAY, 400)).result is Result.DONE


@pytest.mark.parametrize("lockstep", [True, pytest.param(False, marks=pytest.mark.real_time)])
def test_a_lost_client_lets_the_arm_rest_and_another_one_goes_on(
    launch: Launch, fake_bus: FakeBusFactory, line: Line, until: Until, lockstep: bool
) -> None:
    # with a small ring the motion cannot be there as a whole
    running = launch(fake_bus(lockstep=lockstep), lease=1.0, capacity=400)
    client = running.client(lead=500)  # what comes before the loss is there before it begins
    client.connect()
    running.bus.on_tick = _Moving(running.bus, client._connected.close)
    with pytest.raises(ControllerLost, match=r"no telemetry from .*: is the controller running?"):
        client.execute(line(HOME, AWAY, 600))
    until(lambda: not running.bus.last.busy and not np.abs(running.bus.rate).max() > 1e-3)
    rested = max(measured.tick for measured, command in list(running.bus.log) if command.busy)
    another = running.client()
    until(lambda: connects(another))
    assert not running.bus.last.brake
    with closing(another):
        telemetry = another.wait_standing()
        assert (telemetry.state, telemetry.result) == (State.HOLD, Result.STOPPED)
        causes = {Cause.CLIENT_LOST} if lockstep else {Cause.CLIENT_LOST, Cause.UNDERRUN}
        assert telemetry.reason in causes
        # from the stop to rest
        assert rested - telemetry.end_tick < 0.3 / 0.00088
        assert another.execute(line(telemetry.reference, HOME, 900)).result is Result.DONE


def test_without_a_client_it_lingers_and_ends_on_its_brakes(launch: Launch, line: Line) -> None:
    running = launch(lease=1.0, linger=0.5)
    with running.client() as client:
        client.execute(line(HOME, AWAY, 400))
        began = time.monotonic()
    assert running.join() == 0
    assert time.monotonic() - began > 0.5
    assert running.bus.last.brake
    assert not running.bus.rate.any()


def test_its_first_client_is_waited_for_longer_than_another_one(launch: Launch) -> None:
    running = launch(lease=0.5, linger=0.2)
    time.sleep(1.0)
    assert running.status is None
    with running.client():
        pass
    assert running.join() == 0


class Overtime:
    """Ends leases at once, by the controller's clock; a listener sees it."""

    def __init__(self, clock: Any, listener: TelemetryWatch, until: Until) -> None:
        self.clock, self.listener, self.until = clock, listener, until

    def lose(self, client: ControllerClient | Intruder) -> None:
        """Let the lease of a client end."""
        client.stop()
        self.until(lambda: self.listener.telemetry.cause is Cause.STOP_COMMAND)  # not that of the lease before
        leapt = -math.inf

        def lost() -> bool:
            """What the client has sent before may be read after the leap, and keeps the lease: then another one."""
            nonlocal leapt
            if self.listener.telemetry.cause is Cause.CLIENT_LOST:
                return True
            if time.monotonic() > leapt + 0.25 * PATIENCE:
                leapt = time.monotonic()
                self.clock.ahead += 2.0 * PATIENCE
            return False

        self.until(lost)


@pytest.fixture
def overtime(wall_clock: Any, watch: Callable[[Any], TelemetryWatch], until: Until) -> Callable[[Any], Overtime]:
    """For a controller that is launched after this."""
    return lambda running: Overtime(wall_clock, watch(running), until)


def test_a_new_client_keeps_it_from_ending(overtime: Callable[[Any], Overtime], launch: Launch) -> None:
    running = launch(linger=300.0)
    over = overtime(running)
    for _ in range(3):
        with running.client() as client:
            over.lose(client)
        over.clock.ahead += 200.0  # alone, but not for long enough
    with running.client() as client:
        client.wait_standing()
    assert running.status is None


def test_a_file_left_by_a_killed_controller_is_replaced(launch: Launch, fake_bus: FakeBusFactory) -> None:
    running = launch()
    file, stale = running.directory / CONTROLLER_FILE, '{"host": "127.0.0.1", "port": 9}'
    running.kill()
    file.write_text(stale)
    bus, ready = fake_bus(), threading.Event()
    arguments = (bus, load_parameters(), ControllerSettings(), running.directory)
    again = threading.Thread(target=serve, args=arguments, kwargs={"ready": lambda host, port: ready.set()})
    again.start()
    assert ready.wait(PATIENCE)
    assert file.read_text() != stale
    client = running.client()
    client.connect()
    client.shutdown()
    again.join()


def test_a_connection_that_is_not_there(launch: Launch, tmp_path: Path) -> None:
    with pytest.raises(ControllerUnavailable, match=r"controller.json cannot be used .*: is the controller running?"):
        ControllerClient(*find_controller(tmp_path))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        port = free_port()  # which nobody gets once this socket is closed
        taken.bind(("127.0.0.1", port))
        with pytest.raises(ControllerUnavailable, match=rf"no answer from 127.0.0.1:{port} within 0.1 s: is the contr"):
            ControllerClient("127.0.0.1", port, bytes(32)).connect(timeout=0.1)
    with pytest.raises(ControllerUnavailable, match=rf"nothing listens at 127.0.0.1:{port}: start the controller"):
        ControllerClient("127.0.0.1", port, bytes(32)).connect()
    with pytest.raises(ControllerLost, match=r"there is no connection to 127.0.0.1:9: call connect first"):
        ControllerClient("127.0.0.1", 9, bytes(32)).wait_standing()
    running = launch()
    file = running.directory / CONTROLLER_FILE
    file.write_text(file.read_text().replace('"protocol": ', '"protocol": 1'))
    with pytest.raises(ControllerUnavailable, match=r"speaks protocol .*, this program .*: start both from the same"):
        running.client()


def test_a_controller_that_dies_is_lost_at_once(launch: Launch, line: Line, capfd: pytest.CaptureFixture[str]) -> None:
    running = launch()
    client = running.client()
    client.connect()
    died = list[float]()
    running.bus.on_tick = _At(1300, lambda: (setattr(running.bus, "lost", True), died.append(time.monotonic())))
    with pytest.raises(ControllerLost, match="no telemetry from"):
        client.execute(line(HOME, AWAY, 900))
    assert time.monotonic() - died[0] < LOCKSTEP_SILENCE, "known by the closed port, not by the silence"
    assert running.join() == 1
    assert capfd.readouterr().err == (
        "the controller ends because the drives are lost: the plant has ended: start it again\n"
    )
    assert not (running.directory / CONTROLLER_FILE).exists()


# bad datagrams


class Intruder:
    """Speaks the protocol by hand, with the key."""

    def __init__(self, running: Any, session: int) -> None:
        self.envelope, self.session, self.sequence = Envelope(running.key), session, 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(PATIENCE)
        self.socket.connect(("127.0.0.1", running.port))

    def send(self, kind: DatagramKind, payload: bytes, sequence: int | None = None) -> bytes:
        self.sequence += 1
        data = self.envelope.seal(kind, self.session, self.sequence if sequence is None else sequence, payload)
        self.socket.send(data)
        return data

    def receive(self, kind: DatagramKind) -> bytes:
        while True:
            opened = self.envelope.open(memoryview(self.socket.recv(2048)))
            assert isinstance(opened, tuple)
            if opened.kind == kind:
                return bytes(opened.payload)

    def telemetry(self) -> Telemetry:
        return Telemetry.unpack(self.receive(DatagramKind.TELEMETRY))

    def take_lease(self) -> bytes:
        self.send(DatagramKind.HELLO, Hello(0, "by hand").pack())
        (cookie,) = CHALLENGE.struct.unpack(self.receive(DatagramKind.CHALLENGE))
        hello = self.send(DatagramKind.HELLO, Hello(cookie, "by hand").pack())
        self.receive(DatagramKind.WELCOME)
        return hello

    def stop(self) -> None:
        self.send(DatagramKind.COMMAND, COMMAND.struct.pack(CommandCode.STOP))

    def newest(self, ping: int) -> Telemetry:
        """Telemetry sent after everything before was read."""
        self.send(DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(ping))
        while (telemetry := self.telemetry()).echo != ping:
            pass
        return telemetry


def refused(telemetry: Telemetry) -> int:
    """Datagrams of whoever has not the key."""
    return telemetry.bad_size + telemetry.bad_version + telemetry.bad_tag


def test_bad_datagrams_are_counted_and_without_effect(launch: Launch) -> None:
    running = launch()
    hand = Intruder(running, 77)
    with hand.socket:
        hand.take_lease()
        stop = COMMAND.struct.pack(CommandCode.HOLD)
        other = Intruder(running, 78)
        with other.socket:
            other.send(DatagramKind.COMMAND, stop)
            good = other.envelope.seal(DatagramKind.COMMAND, 77, 99, stop)
            for bad in (
                good[:-1],
                good + b"\0",
                b"",
                good[:4] + b"abcd" + good[8:],
                b"\0".join((good[:28], good[29:])),
            ):
                other.socket.send(bad)
        hand.send(DatagramKind.COMMAND, stop, sequence=2)
        hand.send(DatagramKind.COMMAND, COMMAND.struct.pack(99))
        hand.send(DatagramKind.TELEMETRY, bytes(344))
        hand.send(DatagramKind.SAMPLES, b"\1\0\0\0\0\0\0\0\7\0" + bytes(SAMPLE.itemsize))
        telemetry = hand.newest(5)
    assert telemetry.flags & Flag.ADMITTING
    assert telemetry.command == 0
    assert (telemetry.bad_size, telemetry.bad_version, telemetry.bad_tag) == (3, 1, 1)
    assert (telemetry.bad_session, telemetry.bad_sequence, telemetry.bad_content) == (1, 1, 3)


def test_orders_do_not_overtake_each_other(launch: Launch) -> None:
    hand = Intruder(launch(), 77)
    with hand.socket:
        hand.take_lease()
        hand.send(DatagramKind.COMMAND, COMMAND.struct.pack(CommandCode.HOLD), sequence=20)
        hand.send(DatagramKind.COMMAND, COMMAND.struct.pack(CommandCode.RESUME), sequence=19)
        hand.sequence = 30
        telemetry = hand.newest(5)
    assert not telemetry.flags & Flag.ADMITTING
    assert (telemetry.command, telemetry.bad_sequence) == (20, 1)


def test_a_recorded_session_opens_nothing(overtime: Callable[[Any], Overtime], launch: Launch, until: Until) -> None:
    running = launch()
    over, hand = overtime(running), Intruder(running, 77)
    with hand.socket:
        recorded = [hand.take_lease(), hand.send(DatagramKind.COMMAND, COMMAND.struct.pack(CommandCode.HOLD))]
        assert not hand.newest(1).flags & Flag.ADMITTING
        hand.send(DatagramKind.COMMAND, COMMAND.struct.pack(CommandCode.RESUME))
        until(lambda: bool(hand.newest(2).flags & Flag.ADMITTING))
        over.lose(hand)
        before = over.listener.telemetry.bad_session
        for data in recorded:
            hand.socket.send(data)
        until(lambda: over.listener.telemetry.bad_session >= before + 2)
    with running.client() as client:
        assert client.telemetry.admitting


def test_a_recorded_hello_of_another_session_gets_a_challenge_only(
    overtime: Callable[[Any], Overtime], launch: Launch
) -> None:
    running = launch()
    over, first, second = overtime(running), Intruder(running, 77), Intruder(running, 78)
    with first.socket, second.socket:
        recorded = first.take_lease()
        over.lose(first)
        second.take_lease()
        over.lose(second)
        first.socket.send(recorded)
        assert len(first.receive(DatagramKind.CHALLENGE)) == 8


def test_noise_changes_nothing_of_the_motion(launch: Launch, line: Line) -> None:
    quiet = launch()
    with quiet.client() as client:
        client.execute(line(HOME, AWAY, 2000))
    noisy, rng, sent, flooded = launch(), random.Random(5), 0, threading.Event()
    with noisy.client() as client, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as noise:
        noise.connect(("127.0.0.1", noisy.port))
        example = client._connected._envelope.seal(DatagramKind.COMMAND, client._connected._session, 10**6, b"\6\0")
        ended = threading.Event()

        def play() -> None:
            # how much arrives while the arm moves is the machine's affair: so much is there already when it starts
            flooded.wait()
            client.execute(line(HOME, AWAY, 2000))
            ended.set()

        player = threading.Thread(target=play)
        player.start()
        while not ended.is_set():
            if sent >= 100:
                flooded.set()
            if sent - refused(client.telemetry) > 100:  # what overflows is not counted
                time.sleep(0.001)
                continue
            data = bytearray(example if rng.random() < 0.7 else rng.randbytes(rng.randrange(1500)))
            if data:
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            noise.send(data)
            sent += 1
            time.sleep(0.0)
        player.join()
        client.wait_standing()
        assert trajectory(noisy.bus) == trajectory(quiet.bus)
        assert refused(client.telemetry) >= sent // 2 > 10


# the end


def test_shutdown_brakes_at_rest(launch: Launch, line: Line) -> None:
    running = launch()
    client = running.client()
    client.connect()
    running.bus.on_tick = _At(1500, lambda: client._connected.send(DatagramKind.COMMAND, COMMAND.struct.pack(6)))
    with pytest.raises((MotionStopped, ControllerLost)):
        client.execute(line(HOME, AWAY, 900))
    assert running.join() == 0
    assert running.bus.closed
    assert running.bus.last == Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
    moving = [m for m, c in running.bus.log if not c.brake]
    assert max(map(abs, moving[-1].velocity)) < 0.02
    assert not (running.directory / CONTROLLER_FILE).exists()


def test_shutdown_of_a_controller_at_rest(launch: Launch) -> None:
    running = launch()
    with running.client() as client:
        client.shutdown()
    assert running.join() == 0


def test_the_last_words_of_a_controller_are_read_however_late(
    launch: Launch, until: Until, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A client that is held up until there is nobody any more, and SHUTDOWN is repeated in vain."""
    running = launch()
    with running.client() as client:
        link = client._connected
        receive = link._receive

        def late(data: memoryview) -> None:
            running.join()
            sent = link.sequence
            until(lambda: link.sequence > sent + 2)
            monkeypatch.setattr(link, "_receive", receive)
            receive(data)

        monkeypatch.setattr(link, "_receive", late)
        client.shutdown()
    assert running.join() == 0


def test_an_exception_in_the_loop_still_brakes(launch: Launch, line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    running = launch()
    with running.client() as client:
        client.execute(line(HOME, AWAY, 400))
        monkeypatch.setattr("controller.loop.supervisor.Supervisor.advance", lambda self, measurement: 1 / 0)
        with pytest.raises(ControllerLost):
            client.execute(line(AWAY, HOME, 400))
    running.kill()
    assert isinstance(running.error, ZeroDivisionError)
    assert running.bus.last == Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
    assert running.bus.closed


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_has_the_effect_of_a_shutdown(
    fake_bus: FakeBusFactory, tmp_path: Path, until: Until, number: signal.Signals
) -> None:
    create_key(tmp_path / KEY_FILE)
    given = signal.signal(number, signal.default_int_handler)  # nohup's tests have SIGHUP ignored
    before = signal.getsignal(number)
    bus = fake_bus()

    def ask() -> None:
        until(lambda: signal.getsignal(number) is not before and (tmp_path / CONTROLLER_FILE).exists())
        os.kill(os.getpid(), number)

    asking = threading.Thread(target=ask)
    asking.start()
    assert serve(bus, load_parameters(), ControllerSettings(), tmp_path) == 0
    asking.join()
    assert signal.signal(number, given) is before
    assert (bus.last.brake, bus.closed) == (True, True)


def test_what_keeps_it_from_starting_is_said_in_one_sentence(
    fake_bus: FakeBusFactory, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bus = fake_bus()
    assert serve(bus, load_parameters(), ControllerSettings(), tmp_path) == 2
    assert "the controller cannot start: key file" in capfd.readouterr().err
    assert bus.closed
    create_key(tmp_path / KEY_FILE)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        assert serve(fake_bus(), load_parameters(), ControllerSettings(port=port), tmp_path) == 2
    assert capfd.readouterr().err == (
        f"the controller cannot start: UDP port {port} at 127.0.0.1 cannot be used: Address already in use: "
        "end the program that uses it, or set the port to 0 for a free one\n"
    )


def test_brakes_that_do_not_hold_end_with_status_1(
    launch: Launch, fake_bus: FakeBusFactory, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = fake_bus()
    running = launch(bus, rest_ticks=50)
    measure = bus._measure
    with running.client() as client:
        monkeypatch.setattr(bus, "_measure", lambda *a: measure(*a)._replace(velocity=(0.5, 0.0, 0.0)))
        client.shutdown()
    assert running.join() == 1
    assert (
        "the controller ends with the arm on its brakes: the arm still moved at 0.500 rad/s after 50"
        in capfd.readouterr().err
    )


def test_a_boot_that_fails_can_be_read_by_a_client(launch: Launch, fake_bus: FakeBusFactory) -> None:
    bus = fake_bus()
    bus.unpowered = True
    running = launch(bus, boot_ticks=20)
    with running.client() as client:
        assert client.telemetry.state is State.FAULT
        assert "the drives did not enable within 20 ticks (BRAKED)" in client.telemetry.explain_cause()
        client.shutdown()
    assert running.join() == 0


def test_listeners_hear_every_telemetry(launch: Launch, line: Line) -> None:
    heard: list[Telemetry] = []
    with launch().client(listener=heard.append) as client:
        outcome = client.execute(line(HOME, AWAY, 640))
    ticks = [telemetry.tick for telemetry in heard]
    assert ticks == sorted(ticks)
    during = [tick for tick in ticks if outcome.first_tick <= tick <= outcome.end_tick]
    assert len(during) >= 30
    assert {telemetry.state for telemetry in heard} >= {State.HOLD, State.TRACK}
