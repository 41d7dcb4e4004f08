"""Measures the way to a controller and back: pings echoed in the telemetry, and the order in which that arrives."""

from __future__ import annotations

import secrets
import socket
import time
from typing import NamedTuple, Self

from controller.protocol.datagram_fields import CHALLENGE, HEARTBEAT, MAX_DATAGRAM, DatagramKind
from controller.protocol.envelope import Drop, Envelope, Opened
from controller.protocol.messages import Busy, Hello, Telemetry, Welcome
from controller.wire.errors import ControllerBusy, ControllerLost, ControllerUnavailable

PATIENCE = 0.050
"""A ping whose echo takes longer counts as lost [s]."""
PAUSE = 0.0037
"""From one ping to the next [s]: no multiple of a tick, so that pings meet the tick at every phase."""
_REPEAT = 0.02
_SILENCE = 1.0
"""Without telemetry for so long the controller counts as lost [s]."""


class ProbeFigures(NamedTuple):
    """What a probe saw; times are wall times [s]."""

    pings: int
    round_trips: tuple[float, ...]
    """Of each ping that was echoed in time. A controller on a real-time bus keeps a ping for one tick to two."""
    telemetry: int
    """Datagrams of telemetry received."""
    overtaken: int
    """Of them: those that a newer one had overtaken."""
    repeated: int
    """Of them: those received before."""
    ticks: int
    """From the first to the last telemetry."""
    skipped: int
    """Ticks without an exchange among them, as the controller counts them."""
    period: float
    """Mean wall time between two exchanges in the last second."""
    lateness: float
    """Largest in any second that lies within the measurement."""
    work: float
    """Largest in any second that lies within the measurement."""
    lockstep: bool

    @property
    def lost(self) -> float:
        """Share of the pings that were not echoed in time, 0 to 1."""
        return 1.0 - len(self.round_trips) / max(1, self.pings)


class Probe:
    """A client that only pings. It takes the lease, so that nothing else moves the arm meanwhile. A context manager.

    Args:
        host: IPv4 address of the controller.
        port: its UDP port.
        key: the shared secret.
        name: told to others who want the lease.

    Raises:
        ControllerUnavailable: the address cannot be used.
    """

    def __init__(self, host: str, port: int, key: bytes, name: str = "touchmove link-test") -> None:
        self._where, self._name = f"{host}:{port}", name
        self._envelope, self._session = Envelope(key), secrets.randbits(64) | 1
        self._sequence = self._cookie = self._newest = 0
        self._ping = secrets.randbits(31)  # an echo of another client's ping must not pass for one of ours
        self._welcome: Welcome | None = None
        self._seen: set[int] = set()
        self._telemetry: list[tuple[float, Telemetry]] = []
        self._overtaken = self._repeated = 0
        self._buffer = bytearray(MAX_DATAGRAM + 1)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.connect((host, port))
        except OSError as error:
            self._socket.close()
            raise ControllerUnavailable(
                f"{self._where} cannot be used: {error}: give the controller's address"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Fall silent; the controller notices after a second."""
        self._socket.close()

    def greet(self, timeout: float = 5.0) -> None:
        """Take the lease, also from a client that has just fallen silent.

        Args:
            timeout: wall time to wait [s].

        Raises:
            ControllerBusy: another client holds the lease all the time.
            ControllerUnavailable: nobody answered in time.
        """
        deadline, busy = time.monotonic() + timeout, None
        while self._welcome is None:
            if time.monotonic() > deadline:
                if busy is not None:
                    raise ControllerBusy(self._where, busy)
                raise ControllerUnavailable(
                    f"no answer from {self._where} within {timeout:g} s: "
                    "is the controller running, with the same key and the same version?"
                )
            self._send(DatagramKind.HELLO, Hello(self._cookie, self._name).pack())
            until = time.monotonic() + _REPEAT
            while (opened := self._receive(until)) is not None:
                if opened.kind == DatagramKind.BUSY:
                    busy = Busy.unpack(opened.payload)

    def measure(self, duration: float) -> ProbeFigures:
        """Ping for so long [s, wall], one ping at a time.

        Raises:
            ControllerLost: no telemetry for a second.
        """
        trips, pings, until = [], 0, time.monotonic() + duration
        self._seen.clear()
        self._telemetry.clear()
        self._overtaken = self._repeated = 0
        heard = silent = 0
        while time.monotonic() < until:
            trip = self._round_trip()
            pings += 1
            if trip is not None:
                trips.append(trip)
            pause = time.monotonic() + PAUSE
            while self._receive(pause) is not None:
                pass
            # pings that nothing followed, not time: after a pause of this computer much may lie there unread
            heard, silent = len(self._telemetry), silent + 1 if len(self._telemetry) == heard else 0
            if silent * PATIENCE > _SILENCE:
                raise ControllerLost(f"no telemetry from {self._where} for {_SILENCE:g} s: is the controller running?")
        return self._figures(pings, tuple(trips))

    def _round_trip(self) -> float | None:
        """Of one ping [s]; None when its echo does not come in time."""
        self._ping = (self._ping + 1) % (1 << 32)
        began = time.monotonic()
        self._send(DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(self._ping))
        while (opened := self._receive(began + PATIENCE)) is not None:
            if opened.kind == DatagramKind.TELEMETRY and self._telemetry and self._telemetry[-1][1].echo == self._ping:
                trip = self._telemetry[-1][0] - began
                return trip if trip <= PATIENCE else None  # this process may have slept after the echo was there
        return None

    def _figures(self, pings: int, trips: tuple[float, ...]) -> ProbeFigures:
        newest = [telemetry for _, telemetry in self._telemetry]
        if not newest:
            raise ControllerLost(f"no telemetry from {self._where} at all: is the controller running?")
        start, end = self._telemetry[0][0], newest[-1]
        # the controller's "last second" must have begun after the measurement did
        inside = [telemetry for at, telemetry in self._telemetry if at - start > 1.5] or newest[-1:]
        assert self._welcome is not None
        return ProbeFigures(
            pings, trips, len(self._seen) + self._repeated, self._overtaken, self._repeated,
            end.tick - newest[0].tick, end.skipped - newest[0].skipped, end.period,
            max(telemetry.lateness for telemetry in inside), max(telemetry.work for telemetry in inside),
            self._welcome.lockstep,
        )  # fmt: skip

    def _send(self, kind: DatagramKind, payload: bytes) -> None:
        self._sequence += 1
        try:
            self._socket.send(self._envelope.seal(kind, self._session, self._sequence, payload))
        except OSError as error:
            raise ControllerUnavailable(
                f"nothing listens at {self._where} ({error.strerror}): start the controller"
            ) from error

    def _receive(self, until: float) -> Opened | None:
        """The next datagram of the controller, taken in; None when none comes until then."""
        while (left := until - time.monotonic()) > 0.0:
            self._socket.settimeout(left)
            try:
                size = self._socket.recv_into(self._buffer)
            except TimeoutError:
                return None
            except OSError as error:
                raise ControllerUnavailable(
                    f"nothing listens at {self._where} ({error.strerror}): start the controller"
                ) from error
            opened = self._envelope.open(memoryview(self._buffer)[:size])
            if not isinstance(opened, Drop) and opened.session == self._session:
                self._take(opened, time.monotonic())
                return opened
        return None

    def _take(self, opened: Opened, now: float) -> None:
        if opened.kind == DatagramKind.CHALLENGE:
            (self._cookie,) = CHALLENGE.struct.unpack(opened.payload)
        elif opened.kind == DatagramKind.WELCOME:
            self._welcome = Welcome.unpack(opened.payload)
        elif opened.kind == DatagramKind.TELEMETRY:
            if opened.sequence in self._seen:
                self._repeated += 1
                return
            self._seen.add(opened.sequence)
            if opened.sequence < self._newest:
                self._overtaken += 1
                return
            self._newest = opened.sequence
            self._telemetry.append((now, Telemetry.unpack(opened.payload)))
