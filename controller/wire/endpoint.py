"""The controller's UDP socket: who may speak to it, and what it throws away.

One client holds the lease, from its HELLO until it has been silent for ``lease`` seconds of wall time. A HELLO needs
the cookie of a CHALLENGE, so that a recorded one opens nothing. Everything that does not belong is counted and dropped.
Listeners, `controller.wire.subscribers`, get the telemetry too and have no other effect.
"""

from __future__ import annotations

import contextlib
import secrets
import select
import socket
from collections.abc import Callable
from typing import Final

from controller.protocol.envelope import Drop, Envelope, Opened, SequenceWindow
from controller.protocol.layout import CHALLENGE, MAX_DATAGRAM, DatagramKind
from controller.protocol.messages import Busy, Hello
from controller.wire.subscribers import Address, Audience

Handler = Callable[[int, memoryview], bool]
"""Takes kind and payload of a datagram; false where its content is impossible."""

_RECEIVE_BUFFER = 1 << 20
_ORDERS: Final = frozenset({int(DatagramKind.COMMAND), int(DatagramKind.ANNOUNCE)})
"""Kinds that must not overtake each other."""


class PortInUse(Exception):
    """The UDP port cannot be taken; the message says what to do."""


class Door:
    """Admits datagrams of the one client and sends to it and to the listeners.

    Args:
        host: IPv4 address to listen at.
        port: UDP port, 0 for a free one.
        key: secret shared with the clients.
        lease: silence after which the client counts as lost [s].
        welcome: makes the payload that greets a new client.

    Attributes:
        dropped: datagrams dropped, by ``Drop``.
        last_command: sequence of the client's newest COMMAND carried out.

    Raises:
        PortInUse: the port is taken or may not be used.
    """

    def __init__(self, host: str, port: int, key: bytes, lease: float, welcome: Callable[[], bytes]) -> None:
        self._socket = _bind(host, port)
        self._envelope = Envelope(key)
        self._lease = lease
        self._welcome = welcome
        self._buffer = bytearray(MAX_DATAGRAM + 1)
        self._view = memoryview(self._buffer)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        self._cookie = _new_cookie()
        self._session = 0
        self._spent = 0
        self._name = ""
        self._client: Address = ("0.0.0.0", 0)
        self._window = SequenceWindow()
        self._last_order = 0
        self.last_command = 0
        self._sent = 0
        self._heard = 0.0
        self._audience = Audience(self._send_to)
        self.dropped = [0] * len(Drop)

    @property
    def address(self) -> Address:
        """Where it listens."""
        host, port = self._socket.getsockname()
        return host, port

    @property
    def leased(self) -> bool:
        """Whether a client holds the lease."""
        return self._session != 0

    def silence(self, now: float) -> float:
        """How long the client has been silent, at wall time ``now`` [s]."""
        return now - self._heard

    def expire(self, now: float) -> bool:
        """Ends the lease of a silent client; true if that happened now. What waits to be read is no silence."""
        if self._session == 0 or now - self._heard <= self._lease or self._poll.poll(0):
            return False
        self._spent, self._session = self._session, 0
        return True

    def wait(self, milliseconds: int) -> None:
        """Wait for a datagram, no longer than that."""
        self._poll.poll(milliseconds)

    def drain(self, now: float, budget: int, handle: Handler) -> int:
        """Read up to ``budget`` waiting datagrams and hand those of the client to ``handle``.

        Args:
            now: wall time [s].
            budget: datagrams to read at most, also bad ones.
            handle: what to do with a datagram; the payload is overwritten by the next one that is read.

        Returns:
            How many were read.
        """
        for read in range(budget):
            # asking first costs a third of the exception that an empty socket would raise
            if not self._poll.poll(0):
                return read
            try:
                size, address = self._socket.recvfrom_into(self._buffer)
            except BlockingIOError:
                continue  # the kernel dropped it meanwhile: its checksum was wrong
            drop = self._admit(self._view[:size], address, now, handle)
            if drop is not None:
                self.dropped[drop] += 1
        return budget

    def relay(self) -> bool:
        """Send a copy of the telemetry to one listener at most that waits for it; whether one did."""
        return self._audience.relay()

    @property
    def listeners(self) -> int:
        """How many are listening."""
        return len(self._audience)

    def publish(self, telemetry: bytes, now: float) -> None:
        """Send telemetry to the client at once; to the listeners it goes with the next calls of ``relay``.

        Args:
            telemetry: its payload.
            now: wall time [s].
        """
        self.send(DatagramKind.TELEMETRY, telemetry)
        self._audience.publish(telemetry, now)

    def take_leave(self, telemetry: bytes, now: float) -> None:
        """Send the last telemetry to the client and to every listener, before this returns; arguments as above."""
        self.publish(telemetry, now)
        while self._audience.relay():
            pass

    def send(self, kind: DatagramKind, payload: bytes) -> None:
        """Send to the client, if there is one."""
        if self._session:
            self._send_to(self._client, kind, self._session, payload)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _admit(self, data: memoryview, address: Address, now: float, handle: Handler) -> Drop | None:
        opened = self._envelope.open(data)
        if isinstance(opened, Drop):
            return opened
        if opened.kind == DatagramKind.HELLO:
            return self._greet(opened, address, now)
        if opened.kind == DatagramKind.WATCH:
            return self._listen(opened, address, now)
        if opened.session != self._session or self._session == 0:
            return Drop.SESSION
        return self._obey(opened, address, now, handle)

    def _obey(self, opened: Opened, address: Address, now: float, handle: Handler) -> Drop | None:
        """A datagram of the client."""
        if not self._is_new(opened):
            return Drop.SEQUENCE
        self._heard, self._client = now, address
        if not handle(opened.kind, opened.payload):
            return Drop.CONTENT
        if opened.kind == DatagramKind.COMMAND:
            self.last_command = opened.sequence
        return None

    def _is_new(self, opened: Opened) -> bool:
        """Whether this number was not seen before, and for an order, whether no newer order came before it."""
        if not self._window.accept(opened.sequence):
            return False
        if opened.kind in _ORDERS:
            if opened.sequence < self._last_order:
                return False
            self._last_order = opened.sequence
        return True

    def _listen(self, opened: Opened, address: Address, now: float) -> Drop | None:
        """A WATCH: no more than a place among the listeners can come of it, and none under the client's session."""
        return Drop.SESSION if opened.session == self._session else self._audience.admit(opened, address, now)

    def _greet(self, opened: Opened, address: Address, now: float) -> Drop | None:
        """Challenge, welcome or turn away."""
        hello = Hello.unpack(opened.payload)
        if opened.session in (0, self._spent):
            return Drop.SESSION
        if self._session == 0 and hello.cookie == self._cookie:
            self._session, self._name, self._cookie = opened.session, hello.name, _new_cookie()
            # what was sent before the lease must not come again and speak for the client
            self._window, self._last_order, self.last_command = SequenceWindow(opened.sequence - 1), 0, 0
        if self._session == opened.session:
            if not self._window.accept(opened.sequence):
                return Drop.SEQUENCE
            self._heard, self._client = now, address
            self.send(DatagramKind.WELCOME, self._welcome())
        elif self._session == 0:
            self._send_to(address, DatagramKind.CHALLENGE, opened.session, CHALLENGE.struct.pack(self._cookie))
        else:
            busy = Busy(self._name, *self._client, self.silence(now))
            self._send_to(address, DatagramKind.BUSY, opened.session, busy.pack())
        return None

    def _send_to(self, address: Address, kind: DatagramKind, session: int, payload: bytes) -> None:
        self._sent += 1
        datagram = self._envelope.seal(kind, session, self._sent, payload)
        # a client that is gone or a full queue is not the loop's business: silence is noticed by the lease
        with contextlib.suppress(OSError):
            self._socket.sendto(datagram, address)


def _new_cookie() -> int:
    return secrets.randbits(64) | 1


def _bind(host: str, port: int) -> socket.socket:
    door = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    door.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
    door.setblocking(False)
    try:
        door.bind((host, port))
    except OSError as error:
        door.close()
        raise PortInUse(
            f"UDP port {port} at {host} cannot be taken: {error.strerror}: "
            "end the program that has it, or set the port to 0 for a free one"
        ) from error
    return door
