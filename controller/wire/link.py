"""A client's end of the wire: takes the lease, keeps it alive from a thread of its own, keeps the newest telemetry."""

from __future__ import annotations

import errno
import secrets
import select
import threading
import time
from collections.abc import Callable

from controller.protocol.datagram_fields import CHALLENGE, HEARTBEAT, MAX_DATAGRAM, DatagramKind
from controller.protocol.envelope import Drop, Envelope
from controller.protocol.messages import Busy, Hello, Telemetry, Welcome
from controller.wire.address import open_socket
from controller.wire.errors import ControllerBusy, ControllerLost, ControllerUnavailable
from controller.wire.sockets import LOCKSTEP_SILENCE

HEARTBEAT_INTERVAL = 0.1
"""[s]"""
SILENCE = 3.0
"""Without telemetry for so long the controller counts as lost [s]. The arm is safe without the client, so this may be
generous: a machine that is busy for a moment ends no game."""
REPEAT = 0.02
"""What is not answered is repeated after this [s]."""
_WAKE_SAMPLES = 40
"""A waiting sender is woken when so many more samples were executed; waking it for each telemetry costs more."""
_WAKE_SAMPLES_LOCKSTEP = 80
"""The same where plant time waits for samples that are late; there telemetry comes each 45 ticks."""

Listener = Callable[[Telemetry], None]


class Link:
    """One connection to one controller. ``send`` may be called from any thread.

    Args:
        host: IPv4 address of the controller.
        port: its UDP port.
        key: the shared secret.
        name: told to others who want the lease.
        listener: called with each telemetry, in the link's own thread.

    Raises:
        ControllerUnavailable: the address cannot be used.
    """

    def __init__(self, host: str, port: int, key: bytes, *, name: str, listener: Listener | None) -> None:
        self.where = f"{host}:{port}"
        self.sequence = 0
        self._name = name
        self._listener = listener
        self._envelope = Envelope(key)
        self._session = secrets.randbits(64) | 1
        self._news = threading.Condition()
        self._sending = threading.Lock()
        self._newest = 0
        self._ping = 0
        self._cookie = 0
        self._welcome: Welcome | None = None
        self._busy: Busy | None = None
        self._telemetry: Telemetry | None = None
        self._woken_at, self._wake_samples = 0, _WAKE_SAMPLES
        self._heard = time.monotonic()
        self._refused = False
        self._unsent = False
        """Something could not be sent: judged by the own thread, once nothing that was said before lies unread."""
        self._open = True
        self._socket = open_socket(host, port, HEARTBEAT_INTERVAL / 4)
        self._thread = threading.Thread(target=self._listen, name="controller link", daemon=True)
        self._thread.start()

    @property
    def telemetry(self) -> Telemetry:
        """The newest telemetry.

        Raises:
            ControllerLost: there was none for three seconds (in lockstep thirty), or the link is closed.
        """
        telemetry, silence = self._telemetry, time.monotonic() - self._heard
        patience = LOCKSTEP_SILENCE if self._welcome is not None and self._welcome.lockstep else SILENCE
        if telemetry is None or self._refused or silence > patience or not self._open:
            raise ControllerLost(f"no telemetry from {self.where} for {silence:.2f} s: is the controller running?")
        return telemetry

    @property
    def last_telemetry(self) -> Telemetry | None:
        """The newest telemetry, however old."""
        return self._telemetry

    def greet(self, timeout: float) -> Welcome:
        """Take the lease and wait for the first telemetry.

        Args:
            timeout: wall time to wait [s].

        Raises:
            ControllerBusy: another client holds the lease.
            ControllerUnavailable: nobody answered in time.
        """
        deadline = time.monotonic() + timeout
        while self._welcome is None or self._telemetry is None:
            if self._busy is not None:
                raise ControllerBusy(self.where, self._busy)
            if self._refused:
                raise ControllerUnavailable(f"nothing listens at {self.where}: start the controller")
            if time.monotonic() > deadline:
                raise ControllerUnavailable(
                    f"no answer from {self.where} within {timeout:g} s: "
                    "is the controller running, with the same key and the same version?"
                )
            if self._welcome is None:
                self.send(DatagramKind.HELLO, Hello(self._cookie, self._name).pack())
            with self._news:
                self._news.wait(REPEAT)
        return self._welcome

    def ping(self) -> int:
        """A new number for the controller to echo; ``beat`` sends it."""
        self._ping = (self._ping + 1) % (1 << 32)
        return self._ping

    def beat(self) -> None:
        """Send a heartbeat with the newest ping."""
        self.send(DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(self._ping))

    def send(self, kind: DatagramKind, payload: bytes) -> None:
        """Send a datagram."""
        with self._sending:
            self.sequence += 1
            try:
                self._socket.send(self._envelope.seal(kind, self._session, self.sequence, payload))
            except OSError:
                self._unsent = True

    def wait_for_news(self, seen: Telemetry) -> None:
        """Wait until there is telemetry other than ``seen`` that one may act on, but not long."""
        with self._news:
            if self._telemetry is seen:
                self._news.wait(REPEAT)

    def close(self) -> None:
        """Fall silent; the controller notices after a second and holds."""
        self._open = False
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _listen(self) -> None:
        """The link's own thread: telemetry in, heartbeats out."""
        buffer = bytearray(MAX_DATAGRAM + 1)
        beaten = 0.0
        with self._socket:
            while self._open:
                now = time.monotonic()
                if self._welcome is not None and now - beaten >= HEARTBEAT_INTERVAL:
                    beaten = now
                    self.beat()
                try:
                    size = self._socket.recv_into(buffer)
                except TimeoutError:
                    self._refused |= self._unsent
                    continue
                except OSError as error:  # is told before what lies unread, such as a controller's last words
                    if error.errno == errno.EBADF:
                        raise
                    self._refused |= not self._unread()
                    continue
                self._receive(memoryview(buffer)[:size])

    def _unread(self) -> bool:
        """Whether something has come that was not read yet."""
        look = select.poll()
        look.register(self._socket, select.POLLIN)
        return any(event & select.POLLIN for _, event in look.poll(0))

    def _receive(self, data: memoryview) -> None:
        opened = self._envelope.open(data)
        if isinstance(opened, Drop) or opened.session != self._session or opened.sequence <= self._newest:
            return
        self._newest = opened.sequence
        self._refused = self._unsent = False
        self._heard = time.monotonic()
        if opened.kind == DatagramKind.TELEMETRY:
            self._take(Telemetry.unpack(opened.payload))
            return
        with self._news:
            if opened.kind == DatagramKind.CHALLENGE:
                (self._cookie,) = CHALLENGE.struct.unpack(opened.payload)
            elif opened.kind == DatagramKind.WELCOME:
                self._welcome = Welcome.unpack(opened.payload)
                self._wake_samples = _WAKE_SAMPLES_LOCKSTEP if self._welcome.lockstep else _WAKE_SAMPLES
            elif opened.kind == DatagramKind.BUSY:
                self._busy = Busy.unpack(opened.payload)
            self._news.notify_all()

    def _take(self, telemetry: Telemetry) -> None:
        before, self._telemetry = self._telemetry, telemetry
        executed = abs(telemetry.executed - self._woken_at) >= self._wake_samples
        if before is None or executed or _changed(before, telemetry):
            self._woken_at = telemetry.executed
            with self._news:
                self._news.notify_all()
        if self._listener is not None:
            self._listener(telemetry)


def _changed(before: Telemetry, now: Telemetry) -> bool:
    return (
        now.state is not before.state
        or now.flags != before.flags
        or now.echo != before.echo
        or now.command != before.command
        or now.motion != before.motion
        or now.ended_motion != before.ended_motion
    )
