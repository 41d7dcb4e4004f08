"""A listener's end of the wire: telemetry without the lease, for displays and recorders, and the STOP of a display.

It can stop the arm, whatever the program that moves it is doing, and command nothing else.
"""

from __future__ import annotations

import contextlib
import errno
import secrets
import socket
import threading
import time
from typing import Self

from controller.protocol.datagram_fields import CHALLENGE, MAX_DATAGRAM, STOP, WATCH, DatagramKind, Layout
from controller.protocol.envelope import Drop, Envelope
from controller.protocol.messages import Telemetry
from controller.wire.address import open_socket
from controller.wire.errors import ControllerLost, ControllerUnavailable, StopUnanswered
from controller.wire.link import HEARTBEAT_INTERVAL, REPEAT, SILENCE, Listener


class TelemetryWatch:
    """Listens to one controller; connects again by itself when the controller was away. Use as a context manager.

    Args:
        host: IPv4 address of the controller.
        port: its UDP port.
        key: the shared secret.
        listener: called with each telemetry in a thread of its own; it must be quick and must not raise.
    """

    def __init__(self, host: str, port: int, key: bytes, listener: Listener | None = None) -> None:
        self._host, self._port = host, port
        self._listener = listener
        self._envelope = Envelope(key)
        self._telemetry: Telemetry | None = None
        self._news = threading.Condition()
        self._sending = threading.Lock()
        self._challenged = False
        self._open = False
        self._heard = time.monotonic()
        self._begin()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def telemetry(self) -> Telemetry:
        """The newest telemetry.

        Raises:
            ControllerLost: there was none for a second, or there is no connection.
        """
        telemetry, silence = self._telemetry, time.monotonic() - self._heard
        if telemetry is None or silence > SILENCE or not self._open:
            raise ControllerLost(f"no telemetry from {self._where} for {silence:.2f} s: is the controller running?")
        return telemetry

    def connect(self, timeout: float = 5.0) -> None:
        """Begin to listen and wait for the first telemetry.

        Args:
            timeout: wall time to wait [s].

        Raises:
            ControllerUnavailable: nobody answered in time, or the controller has too many listeners already.
        """
        self.close()
        self._begin()
        self._telemetry, self._challenged = None, False
        self._socket = end = open_socket(self._host, self._port, REPEAT)
        self._open = True
        self._thread = threading.Thread(target=self._listen, args=(end,), name="telemetry watch", daemon=True)
        self._thread.start()
        with self._news:
            heard = self._news.wait_for(lambda: self._telemetry is not None, timeout)
        if not heard:
            self.close()
            raise ControllerUnavailable(self._explain(timeout))

    def stop(self, timeout: float = 2.0) -> Telemetry:
        """Press STOP: the arm comes to rest within 0.1 s, and moves no more until the client releases it.

        It is repeated until the telemetry shows that it was carried out. May be called from any thread but the
        listener's.

        Args:
            timeout: wall time to wait for that [s].

        Returns:
            Telemetry of the arm, latched; it may still be coming to rest.

        Raises:
            ControllerLost: this watch was not connected, or is closed.
            StopUnanswered: nobody has said that it was carried out; it may have been all the same.
        """
        if not self._open:
            raise ControllerLost(f"there is no connection to {self._where}: call connect first")
        before, deadline = self._telemetry, time.monotonic() + timeout

        def latched() -> bool:
            newest = self._telemetry
            return newest is not None and newest.latched and (before is None or newest.presses != before.presses)

        while True:
            self._press()
            with self._news:
                if self._news.wait_for(latched, min(REPEAT, max(0.0, deadline - time.monotonic()))):
                    assert self._telemetry is not None
                    return self._telemetry
            if time.monotonic() > deadline:
                raise StopUnanswered(self._where, timeout)

    def close(self) -> None:
        """Fall silent; the controller forgets the listener after a second. A second call does nothing."""
        if self._open:
            self._open = False
            if threading.current_thread() is not self._thread:
                self._thread.join()

    @property
    def _where(self) -> str:
        return f"{self._host}:{self._port}"

    def _explain(self, timeout: float) -> str:
        if self._challenged:
            return f"{self._where} answers but admits no more listeners: end another one first"
        return (
            f"no answer from {self._where} within {timeout:g} s: "
            "is the controller running, with the same key and the same version?"
        )

    def _begin(self) -> None:
        """A new session, of which nobody knows anything."""
        with self._sending:
            self._session = secrets.randbits(64) | 1
            self._sequence = self._newest = self._cookie = 0
        self._admitted = False
        self._alive = time.monotonic()

    def _listen(self, end: socket.socket) -> None:
        """The thread: WATCH out, telemetry in."""
        buffer = bytearray(MAX_DATAGRAM + 1)
        asked = 0.0
        with end:
            while self._open:
                now = time.monotonic()
                if now - self._alive > SILENCE:
                    self._begin()
                if now - asked >= (HEARTBEAT_INTERVAL if self._admitted else REPEAT):
                    asked = now
                    self._ask(end)
                try:
                    size = end.recv_into(buffer)
                except TimeoutError:
                    continue
                except OSError as error:
                    if error.errno == errno.EBADF:
                        raise
                    time.sleep(REPEAT)
                    continue
                if self._receive(memoryview(buffer)[:size]):
                    self._ask(end)

    def _ask(self, end: socket.socket) -> None:
        try:
            self._send(end, DatagramKind.WATCH, WATCH)
        except OSError:
            time.sleep(REPEAT)  # nobody is there at present; asked again soon

    def _press(self) -> None:
        with contextlib.suppress(OSError):  # nobody is there at present, or the socket was closed: the deadline tells
            self._send(self._socket, DatagramKind.STOP, STOP)

    def _send(self, end: socket.socket, kind: DatagramKind, layout: Layout) -> None:
        """Send a datagram that consists of the cookie."""
        with self._sending:
            self._sequence += 1
            end.send(self._envelope.seal(kind, self._session, self._sequence, layout.struct.pack(self._cookie)))

    def _receive(self, data: memoryview) -> bool:
        """Take a datagram in; true where it is a challenge to be answered at once."""
        opened = self._envelope.open(data)
        if isinstance(opened, Drop) or opened.session != self._session or opened.sequence <= self._newest:
            return False
        self._newest = opened.sequence
        if opened.kind == DatagramKind.CHALLENGE:
            (self._cookie,) = CHALLENGE.struct.unpack(opened.payload)
            self._challenged, self._admitted = True, False
            return True
        if opened.kind == DatagramKind.TELEMETRY:
            self._heard = self._alive = time.monotonic()
            self._admitted = True
            telemetry = Telemetry.unpack(opened.payload)
            if self._listener is not None:
                self._listener(telemetry)
            with self._news:
                self._telemetry = telemetry
                self._news.notify_all()
        return False
