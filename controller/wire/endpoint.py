"""The controller's UDP endpoint: who may speak to it, and what it throws away.

One client holds the lease, from its HELLO until it has been silent for ``lease`` seconds of wall time; where plant time
waits for it, as long as its port is open, ``patience``. A HELLO needs the cookie of a CHALLENGE, so that a recorded one
opens nothing. Everything that does not belong is counted and dropped.
Listeners, `controller.wire.subscribers`, get the telemetry too, and their STOP counts as the client's; they have no
other effect.

Strangers may send as fast as they like: the client has a socket of its own, reading ends by the clock, and what is
cheap to refuse is refused before its tag is computed. So may the client: a datagram of everybody else is read before
each of its own, so that a program that has gone mad keeps nobody's STOP away.
"""

from __future__ import annotations

import contextlib
import math
import secrets
import select
import socket
import time
from collections.abc import Callable
from typing import Final

from controller.protocol.datagram_fields import CHALLENGE, MAX_DATAGRAM, DatagramKind
from controller.protocol.envelope import Drop, Envelope, Header, Opened, SequenceWindow
from controller.protocol.messages import Busy, Hello
from controller.wire.sockets import Address, client_socket, listening_socket
from controller.wire.subscribers import Subscribers

Handler = Callable[[int, memoryview], bool]
"""Takes kind and payload of a datagram; false where its content is impossible."""

_CARRIED_OUT: Final = frozenset(
    map(int, (DatagramKind.COMMAND, DatagramKind.ADMIT_SPEED, DatagramKind.STOP, DatagramKind.RELEASE))
)
"""Kinds of which telemetry tells when they are carried out."""
_ORDERS: Final = _CARRIED_OUT | {int(DatagramKind.ANNOUNCE)}
"""Kinds that must not overtake each other."""
_STOP: Final = int(DatagramKind.STOP)
_OF_ANYBODY: Final = frozenset({int(DatagramKind.HELLO), int(DatagramKind.WATCH)})
"""Kinds that may come under other sessions than the client's."""
_CATCHING_UP: Final = 0.1
"""After a pause of this process what waits is read before the client is given up, for at most so long [s]: a flood of
strangers must not keep a lost client's lease."""


class Endpoint:
    """Admits datagrams of the one client and sends to it and to the listeners.

    Args:
        host: IPv4 address to listen at.
        port: UDP port, 0 for a free one.
        key: secret shared with the clients.
        lease: silence after which the client counts as lost [s].
        welcome: makes the payload that greets a new client.
        clock: wall time that reading ends by [s].
        patience: the same while its port is known to be open; None: ``lease`` [s].

    Attributes:
        dropped: datagrams dropped, by ``Drop``.
        last_command: sequence of the client's newest datagram carried out, of those of which telemetry tells.

    Raises:
        PortInUse: the port is taken or may not be used.
    """

    def __init__(
        self,
        host: str,
        port: int,
        key: bytes,
        lease: float,
        welcome: Callable[[], bytes],
        clock: Callable[[], float] = time.monotonic,
        patience: float | None = None,
    ) -> None:
        self._socket = listening_socket(host, port)
        self._own: socket.socket | None = None
        self._envelope = Envelope(key)
        self._lease, self._patience = lease, lease if patience is None else patience
        self._port_closed = False
        self._welcome = welcome
        self._clock = clock
        # two, so that the payload last handed out outlives the reading of what comes next
        self._views = [memoryview(bytearray(MAX_DATAGRAM + 1)) for _ in range(2)]
        self._admitted: Opened | None = None
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
        self._doubted: float | None = None
        self._may_answer, self._pressed = True, False
        self._subscribers = Subscribers(self._send_to)
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

    @property
    def lease(self) -> float:
        """Silence after which the client counts as lost, as far as is known of its port [s]."""
        return self._lease if self._port_closed else self._patience

    def expire(self, now: float) -> bool:
        """Ends the lease of a silent client; true if that happened now. What waits to be read is no silence."""
        if self._session == 0 or now - self._heard <= self.lease:
            self._doubted = None
            return False
        self._doubted = now if self._doubted is None else self._doubted
        if self._poll.poll(0) and now - self._doubted <= _CATCHING_UP:
            return False
        self._spent, self._session = self._session, 0
        self._admitted = None
        self._close_own()
        return True

    def wait(self, milliseconds: int) -> None:
        """Wait for a datagram, no longer than that."""
        self._poll.poll(milliseconds)

    def drain(self, now: float, until: float, most: int, handle: Handler) -> None:
        """Read what waits and hand what the client sent to ``handle``.

        Args:
            now: wall time [s].
            until: when reading ends, by the clock [s].
            most: datagrams to hand over at most.
            handle: what to do with a datagram; see ``take`` for how long its payload lasts.
        """
        for _ in range(most):
            self.sift(now, until)
            if not self.take(handle):
                return

    def pressed(self) -> bool:
        """Whether a listener's STOP has come since this was asked last."""
        pressed, self._pressed = self._pressed, False
        return pressed

    def sift(self, now: float, until: float) -> bool:
        """Read on until a datagram of the client is found, for ``take``; nothing where one was found already.

        One datagram of everybody is read, then the client's socket, then the open one: at least one datagram of each
        that has any. One HELLO or WATCH of a stranger is answered at most.

        Args:
            now: wall time [s].
            until: when to stop looking, by the clock [s].

        Returns:
            Whether one was found now.
        """
        if self._admitted is not None:
            return False
        # asking first costs a third of the exception that an empty socket would raise
        ready = [end for end, _ in self._poll.poll(0)]
        self._may_answer = True
        turns = [(self._socket, until)]
        if self._own is not None and self._own.fileno() in ready:
            turns = [(self._socket, -math.inf), (self._own, until), *turns]
        for end, latest in turns:
            if end.fileno() in ready and self._admitted is None:
                self._search(end, now, latest)
        return self._admitted is not None

    def take(self, handle: Handler) -> bool:
        """Hand over the datagram that was found.

        Args:
            handle: what to do with it; the payload lasts until the one found next was taken.

        Returns:
            Whether there was one.
        """
        opened, self._admitted = self._admitted, None
        if opened is None:
            return False
        if not handle(opened.kind, opened.payload):
            self.dropped[Drop.CONTENT] += 1
        elif opened.kind in _CARRIED_OUT:
            self.last_command = opened.sequence
        return True

    def _search(self, end: socket.socket, now: float, until: float) -> None:
        """Refuse what waits at a socket, until a datagram of the client is found or the time is over."""
        while end.fileno() >= 0:  # a client that moves closes its old socket
            view = self._views[0]
            try:
                size, address = end.recvfrom_into(view)
            except BlockingIOError:
                return
            except ConnectionError:
                drop, self._port_closed = None, True  # when telemetry came: the lease notices the client's silence
            else:
                drop = self._admit(view[:size], address, now)
            if drop is not None:
                self.dropped[drop] += 1
            elif self._admitted is not None:
                self._views.reverse()
                return
            if self._clock() >= until:
                return

    def relay(self) -> bool:
        """Send a copy of the telemetry to one listener at most that waits for it; whether one did."""
        return self._subscribers.relay()

    @property
    def relays(self) -> bool:
        """Whether a listener waits for a copy."""
        return self._subscribers.waiting

    @property
    def listeners(self) -> int:
        """How many are listening."""
        return len(self._subscribers)

    def publish(self, telemetry: bytes, now: float) -> None:
        """Send telemetry to the client at once; to the listeners it goes with the next calls of ``relay``.

        Args:
            telemetry: its payload.
            now: wall time [s].
        """
        self.send(DatagramKind.TELEMETRY, telemetry)
        self._subscribers.publish(telemetry, now)

    def take_leave(self, telemetry: bytes, now: float) -> None:
        """Send the last telemetry to the client and to every listener, before this returns; arguments as above."""
        self.publish(telemetry, now)
        while self._subscribers.relay():
            pass

    def send(self, kind: DatagramKind, payload: bytes) -> None:
        """Send to the client, if there is one."""
        if self._session:
            self._send_to(self._client, kind, self._session, payload)

    def close(self) -> None:
        """Close the sockets."""
        self._close_own()
        self._socket.close()

    def _admit(self, data: memoryview, address: Address, now: float) -> Drop | None:
        """Why a datagram is dropped; None where it was answered, or is what ``take`` hands over next."""
        header = self._envelope.look(data)
        if isinstance(header, Drop):
            return header
        if header.kind == _STOP and header.session != self._session:
            return self._press(data, header, address, now)
        of_client = header.kind not in _OF_ANYBODY
        if of_client and (drop := self._stale(header)) is not None:
            return drop
        opened = self._envelope.unseal(data, header)
        if isinstance(opened, Drop):
            return opened
        if of_client:
            self._hear(opened, address, now)
            return None
        return (self._greet if opened.kind == DatagramKind.HELLO else self._listen)(opened, address, now)

    def _press(self, data: memoryview, header: Header, address: Address, now: float) -> Drop | None:
        """A STOP that is not the client's: a listener's counts, and is refused as cheaply as the client's datagrams."""
        if (drop := self._subscribers.stale(header, address)) is not None:
            return drop
        opened = self._envelope.unseal(data, header)
        if isinstance(opened, Drop):
            return opened
        drop = self._subscribers.press(opened, now)
        self._pressed = self._pressed or drop is None
        return drop

    def _stale(self, header: Header) -> Drop | None:
        """Why what claims to be the client's would be dropped even if its tag were right."""
        if header.session != self._session or self._session == 0:
            return Drop.SESSION
        overtaken = header.kind in _ORDERS and header.sequence < self._last_order
        return None if self._window.is_new(header.sequence) and not overtaken else Drop.SEQUENCE

    def _hear(self, opened: Opened, address: Address, now: float) -> None:
        """A datagram of the client that is not stale."""
        self._window.accept(opened.sequence)
        if opened.kind in _ORDERS:
            self._last_order = opened.sequence
        self._meet(address, now)
        self._admitted = opened

    def _meet(self, client: Address, now: float) -> None:
        """The client has spoken; where it did so from a new address, it gets a new socket of its own."""
        self._heard, self._port_closed = now, False
        if client == self._client and self._own is not None:
            return
        self._client = client
        self._close_own()
        with contextlib.suppress(OSError):  # no socket to be had: the open one serves the client too
            self._own = client_socket(self._socket, client)
            self._poll.register(self._own, select.POLLIN)

    def _close_own(self) -> None:
        own, self._own = self._own, None
        if own is not None:
            self._poll.unregister(own)
            own.close()

    def _listen(self, opened: Opened, address: Address, now: float) -> Drop | None:
        """A WATCH: nothing but a place among the listeners can come of it, and none under the client's session."""
        return Drop.SESSION if opened.session == self._session else self._subscribers.admit(opened, address, now)

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
            self._meet(address, now)
            self.send(DatagramKind.WELCOME, self._welcome())
            return None
        return self._turn_away(opened.session, address, now)

    def _turn_away(self, session: int, address: Address, now: float) -> Drop | None:
        """Challenge who asks for the first time, or say who holds the lease: one of them at a time."""
        if not self._may_answer:
            return Drop.SESSION
        self._may_answer = False
        if self._session == 0:
            self._send_to(address, DatagramKind.CHALLENGE, session, CHALLENGE.struct.pack(self._cookie))
        else:
            busy = Busy(self._name, *self._client, self.silence(now))
            self._send_to(address, DatagramKind.BUSY, session, busy.pack())
        return None

    def _send_to(self, address: Address, kind: DatagramKind, session: int, payload: bytes) -> None:
        self._sent += 1
        datagram = self._envelope.seal(kind, session, self._sent, payload)
        # a client that is gone or a full queue is not the loop's business: silence is noticed by the lease
        with contextlib.suppress(OSError):
            self._socket.sendto(datagram, address)


def _new_cookie() -> int:
    return secrets.randbits(64) | 1
