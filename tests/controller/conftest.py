"""A plant for the controller's tests, and a controller that ticks with it in a thread."""

from __future__ import annotations

import contextlib
import heapq
import json
import random
import select
import socket
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.law.task_space import TaskSpaceController
from controller.loop.server import serve
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from controller.protection.limits import Limits
from controller.protocol import SAMPLE, Guard
from controller.protocol.key import KEY_FILE, create_key
from controller.settings import CONTROLLER_FILE, ControllerSettings
from controller.wire.address import find_controller
from controller.wire.client import ControllerClient
from controller.wire.listener import TelemetryWatch
from controller.wire.probe import Probe
from hardware.interfaces import BusLost, Command, DriveStatus, Measurement, Triple
from hardware.parameters import RobotParameters, load_parameters
from tests.waiting import PATIENCE
from tests.waiting import until as wait_for

HOME = (0.0, 0.0, 0.35)


class FakeBus:
    """A frictionless arm (no Coriolis terms) behind a bus; a lockstep bus stands when nobody is busy.

    Attributes:
        log: every new tick's measurement with the command that led to it.
        object_at: finger position at which the fingers meet an object [m].
        jammed: the arm cannot move.
        push: force on the tool, base frame, shape (3,) [N].
        lost: the next exchange raises BusLost.
        status: added to the drives' status.
    """

    def __init__(self, parameters: RobotParameters, lockstep: bool = True, point: Triple = HOME) -> None:
        self.lockstep = lockstep
        self.period = parameters.drive.tick
        self.log: list[tuple[Measurement, Command]] = []
        self.object_at = 0.0
        self.jammed = self.lost = self.closed = False
        self.status = DriveStatus.OK
        self.unpowered = False
        self.push: NDArray[np.float64] = np.zeros(3)
        self.hurry = 1.0
        self.on_tick: Callable[[int], None] = lambda tick: None
        self._parameters = parameters
        model = DeltaModel(parameters)
        self._body = TaskSpaceController(model)
        self._angle = posture_at(model, np.array(point)).y
        self._rate = np.zeros(3)
        self._finger = parameters.gripper.stroke
        self._tactile = (0.0, 0.0)
        self._tick = 1000
        self._next = time.monotonic()
        self.last = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=True)

    @property
    def rate(self) -> NDArray[np.float64]:
        """Servomotor velocities [rad/s]."""
        return self._rate

    def exchange(self, command: Command) -> Measurement:
        """One tick, or none if all stands."""
        if self.lost or self.closed:
            raise BusLost("the plant has ended: start it again")
        self.last = command
        if self.lockstep and not command.busy and np.abs(self._rate).max() < 1e-3 and not self.push.any():
            time.sleep(0.0005)
            return self._measure(command, DriveStatus.STANDING)
        self._pace()
        self._move(command)
        self._tick += 1
        self.on_tick(self._tick)
        measurement = self._measure(command, DriveStatus.OK)
        self.log.append((measurement, command))
        return measurement

    def close(self) -> None:
        """No exchange after this."""
        self.closed = True

    def _pace(self) -> None:
        if not self.lockstep:
            self._next = max(self._next + self.period / self.hurry, time.monotonic() - 0.01)
            time.sleep(max(0.0, self._next - time.monotonic()))

    def _move(self, command: Command) -> None:
        if command.brake or self.jammed or not command.enable:
            self._rate[:] = 0.0
        else:
            body = self._body
            assert body.update(_triple(self._angle), _triple(self._rate)) == 0
            torque = np.clip(command.torque, -8.4, 8.4) + body.state.jacobian.T @ self.push
            self._rate = self._rate + self.period * np.linalg.solve(body.state.inertia, torque - body.state.gravity)
            self._angle = self._angle + self.period * self._rate
        gripper = self._parameters.gripper
        wanted = self._finger + self.period * command.finger_velocity
        self._finger = float(np.clip(wanted, self.object_at, gripper.stroke))
        force = gripper.velocity_gain * max(0.0, -command.finger_velocity) if wanted < self.object_at else 0.0
        self._tactile = (force, force)

    def _measure(self, command: Command, status: DriveStatus) -> Measurement:
        status |= self.status
        if command.enable and not self.unpowered:
            status |= DriveStatus.ENABLED
        if command.brake:
            status |= DriveStatus.BRAKED
        angle, rate = _triple(self._angle), _triple(self._rate)
        return Measurement(self._tick, angle, rate, self._finger, self._tactile, status)


class Running:
    """A controller in a thread, with its bus and run directory."""

    def __init__(self, bus: FakeBus, directory: Path, settings: ControllerSettings, limits: Limits | None) -> None:
        self.bus = bus
        self.directory = directory
        self.status: int | None = None
        self.error: BaseException | None = None
        self._clients: list[ControllerClient] = []
        self._arguments = (bus, load_parameters(), settings, directory, limits)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        wait_for(lambda: (directory / CONTROLLER_FILE).exists() or not self._thread.is_alive())

    @property
    def port(self) -> int:
        """Where it listens."""
        port: int = json.loads((self.directory / CONTROLLER_FILE).read_text())["port"]
        return port

    @property
    def key(self) -> bytes:
        """Its secret."""
        return (self.directory / KEY_FILE).read_bytes()

    def client(self, **options: Any) -> ControllerClient:
        """A client of it, not connected; closed with the controller."""
        self._clients.append(ControllerClient(*find_controller(self.directory), **options))
        return self._clients[-1]

    def client_through(self, link: LossyLink, **options: Any) -> ControllerClient:
        """A client of it behind a link, not connected; closed with the controller."""
        self._clients.append(ControllerClient("127.0.0.1", link.port, self.key, **options))
        return self._clients[-1]

    def join(self) -> int | None:
        """Wait for its end; the exit status."""
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive(), "the controller did not end"
        return self.status

    def kill(self) -> None:
        """Take its drives and clients away."""
        for client in self._clients:
            client.close()
        self.bus.lost = True
        self._thread.join(PATIENCE)

    def _run(self) -> None:
        try:
            self.status = serve(*self._arguments)
        except BaseException as error:
            self.error = error


Launch = Callable[..., Running]
Line = Callable[..., NDArray[Any]]


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """No end of a link gives another up, or forgets it, because a busy machine holds up a thread for some seconds."""
    for method in (ControllerClient.connect, TelemetryWatch.connect, TelemetryWatch.stop, Probe.greet):
        monkeypatch.setattr(method, "__defaults__", (PATIENCE,))
    for name in ("link.SILENCE", "listener.SILENCE", "subscribers.SILENCE", "client._COMMAND_TIMEOUT"):
        monkeypatch.setattr(f"controller.wire.{name}", PATIENCE)
    monkeypatch.setattr("controller.loop.flight._END_TIMEOUT", PATIENCE)


@pytest.fixture
def memory() -> Callable[[], int]:
    """Bytes that the controller's own code has allocated since ``tracemalloc`` began: threads of pytest's do so too."""

    def allocated() -> int:
        mine = (tracemalloc.Filter(True, "*/controller/*"), tracemalloc.Filter(False, "*/tests/*"))
        return sum(trace.size for trace in tracemalloc.take_snapshot().filter_traces(mine).traces)

    return allocated


class WallClock:
    """What controllers take for the wall clock: it may be put forward."""

    def __init__(self) -> None:
        self.ahead = 0.0

    def monotonic(self) -> float:
        return time.monotonic() + self.ahead


@pytest.fixture
def wall_clock(monkeypatch: pytest.MonkeyPatch) -> WallClock:
    """The clock of the controllers launched after this: leases end at once, and not while this machine stands still."""
    clock = WallClock()
    monkeypatch.setattr("controller.loop.server.time", clock)
    return clock


@pytest.fixture
def launch(tmp_path: Path, patient: None) -> Iterator[Launch]:
    """Starts controllers, each in a run directory of its own; ends them all."""
    started: list[Running] = []

    def start(bus: FakeBus | None = None, limits: Limits | None = None, **settings: Any) -> Running:
        directory = tmp_path / f"run{len(started)}"
        directory.mkdir(mode=0o700)
        create_key(directory / KEY_FILE)
        bus = bus or FakeBus(load_parameters())
        # this process is not the controller's own; in real time a client that it holds up is not lost
        usual = {"realtime": False, "stays": False, **({} if bus.lockstep else {"lease": PATIENCE})}
        started.append(Running(bus, directory, ControllerSettings(**{**usual, **settings}), limits))
        return started[-1]

    yield start
    for running in started:
        running.kill()


class LossyLink:
    """A UDP relay that loses, repeats and delays datagrams in both directions, by a seeded script.

    Args:
        port: of the controller.
        loss: share of the datagrams lost.
        repeats: share sent twice.
        delay: longest delay, so that they overtake each other [s].
        veto: true for datagrams of the client that never pass.
    """

    def __init__(
        self,
        port: int,
        *,
        loss: float = 0.0,
        repeats: float = 0.0,
        delay: float = 0.0,
        veto: Callable[[bytes], bool] = lambda data: False,
    ) -> None:
        self.seen: list[bytes] = []
        self.loss, self._repeats, self._delay, self._veto = loss, repeats, delay, veto
        self._random = random.Random(7)
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.bind(("127.0.0.1", 0))
        self._back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._back.connect(("127.0.0.1", port))
        self._client: Any = None
        self._late: list[tuple[float, int, bytes, bool]] = []
        self._count = 0
        self._open = True
        self._thread = threading.Thread(target=self._relay, daemon=True)
        self._thread.start()

    @property
    def port(self) -> int:
        """Where the client should go."""
        port: int = self._front.getsockname()[1]
        return port

    def send(self, data: bytes) -> None:
        """Put a datagram of anybody's on the way to the controller."""
        self._back.send(data)

    def close(self) -> None:
        """Cut the link."""
        self._open = False
        self._thread.join()

    def _relay(self) -> None:
        with self._front, self._back:
            while self._open:
                wait = 0.05 if not self._late else min(0.05, max(0.0, self._late[0][0] - time.monotonic()))
                readable, _, _ = select.select([self._front, self._back], [], [], wait)
                for end in readable:
                    self._take(end)
                while self._late and self._late[0][0] <= time.monotonic():
                    _, _, data, forth = heapq.heappop(self._late)
                    self._pass(data, forth)

    def _take(self, end: socket.socket) -> None:
        try:
            data, address = end.recvfrom(2048)
        except ConnectionRefusedError:
            return
        forth = end is self._front
        if forth:
            self._client = address
            self.seen.append(data)
        if (forth and self._veto(data)) or self._random.random() < self.loss:
            return
        for _ in range(2 if self._random.random() < self._repeats else 1):
            self._count += 1
            due = time.monotonic() + self._random.random() * self._delay
            heapq.heappush(self._late, (due, self._count, data, forth))

    def _pass(self, data: bytes, forth: bool) -> None:
        with contextlib.suppress(ConnectionRefusedError):
            if forth:
                self._back.send(data)
            else:
                self._front.sendto(data, self._client)


@pytest.fixture
def lossy_link() -> Iterator[Callable[..., LossyLink]]:
    """Makes lossy links to a controller's port; cuts them all at the end."""
    links: list[LossyLink] = []

    def make(port: int, **options: Any) -> LossyLink:
        links.append(LossyLink(port, **options))
        return links[-1]

    yield make
    for link in links:
        link.close()


@pytest.fixture
def watch(launch: Launch) -> Iterator[Callable[[Running], TelemetryWatch]]:
    """Listens to a controller."""
    made = list[TelemetryWatch]()

    def make(running: Running) -> TelemetryWatch:
        made.append(TelemetryWatch(*find_controller(running.directory)))
        made[-1].connect()
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def fake_bus() -> Callable[..., FakeBus]:
    """Makes plants; options as of ``FakeBus``."""
    return lambda **options: FakeBus(load_parameters(), **options)


@pytest.fixture
def until() -> Callable[..., None]:
    """Waits for something that another thread does."""
    return wait_for


@pytest.fixture
def line() -> Line:
    """Makes a straight minimum-jerk motion, sampled once a tick: (start, end, ticks) to (ticks + 1,) samples."""
    return line_samples


@pytest.fixture
def grip() -> Line:
    """Makes a motion that stands and closes the fingers: (point, ticks) to samples, guard at 3 N."""

    def make(point: Triple, ticks: int, velocity: float = -0.025, level: float = 3.0) -> NDArray[Any]:
        samples = line_samples(point, point, ticks)
        samples["finger_velocity"], samples["guard"], samples["guard_level"] = velocity, Guard.GRIP, level
        return samples

    return make


def line_samples(start: Triple, end: Triple, ticks: int, period: float = 0.00088) -> NDArray[Any]:
    t = np.linspace(0.0, 1.0, ticks + 1)[:, None]
    way, duration = np.subtract(end, start), ticks * period
    samples = np.zeros(ticks + 1, dtype=SAMPLE)
    samples["position"] = np.asarray(start) + way * (10 * t**3 - 15 * t**4 + 6 * t**5)
    samples["velocity"] = way * (30 * t**2 - 60 * t**3 + 30 * t**4) / duration
    samples["acceleration"] = way * (60 * t - 180 * t**2 + 120 * t**3) / duration**2
    samples["stiffness"], samples["damping"] = 4900.0, 140.0
    return samples


def _triple(values: NDArray[np.float64]) -> Triple:
    a, b, c = values.tolist()
    return a, b, c
