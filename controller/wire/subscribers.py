"""Listeners: who gets telemetry without holding the lease, and may stop the arm.

A WATCH with the right cookie makes its sender a listener, whose STOP counts, and nothing else. The cookie belongs to
one address, one session and one admission: it comes in a CHALLENGE, and every admission makes those before it worthless
to others. So a recorded WATCH or STOP opens nothing, and an address that somebody else gave receives a CHALLENGE as
short as the WATCH itself, never telemetry.

One CHALLENGE and one copy of the telemetry leave a tick at most, the copies in turn, so that neither a flood nor eight
listeners cost a tick more than that.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable

from controller.protocol.datagram_fields import CHALLENGE, STOP, WATCH, DatagramKind
from controller.protocol.envelope import Drop, Header, Opened, SequenceWindow
from controller.wire.sockets import Address

Send = Callable[[Address, DatagramKind, int, bytes], None]
"""Sends a datagram: to whom, what, under which session, payload."""

MAX_LISTENERS = 8
SILENCE = 1.0
"""A listener that was silent for so long is forgotten [s, wall]."""


class _Listener:
    """One that was admitted; ``session`` is its own, ``heard`` in wall time [s]."""

    def __init__(self, session: int, address: Address, cookie: int, now: float) -> None:
        self.session, self.address, self.cookie, self.heard = session, address, cookie, now
        self.window = SequenceWindow()


class Subscribers:
    """The listeners of one controller.

    Args:
        send: of the socket they speak to.
    """

    def __init__(self, send: Send) -> None:
        self._send = send
        self._secret = secrets.token_bytes(32)
        self._admissions = 0
        self._listeners: list[_Listener] = []
        self._payload = b""
        self._due = 0
        self._next = 0
        self._may_challenge = True

    def __len__(self) -> int:
        return len(self._listeners)

    @property
    def waiting(self) -> bool:
        """Whether ``relay`` has something to send."""
        return self._due > 0

    def admit(self, opened: Opened, address: Address, now: float) -> Drop | None:
        """Take a WATCH in: a listener stays one, a newcomer is challenged or admitted.

        Args:
            opened: the datagram, its tag checked.
            address: where it came from.
            now: wall time [s].

        Returns:
            Why it was dropped: a number seen before, no session, no place left, a challenge too many; None otherwise.
        """
        (cookie,) = WATCH.struct.unpack(opened.payload)
        session = opened.session
        if session == 0:
            return Drop.SESSION
        listener = self._find(session)
        if listener is not None and listener.address == address and listener.cookie == cookie:
            return self._hear(listener, opened.sequence, now)
        wanted = self._cookie(session, address)
        if cookie != wanted:
            return self._challenge(session, address, wanted)
        self._admissions += 1
        self._forget(now)
        listener = self._find(session) or self._seat(session, address, cookie, now)
        if listener is None:
            return Drop.SESSION
        # the same session from a new address: its numbers go on, so that what was recorded stays worthless
        drop = self._hear(listener, opened.sequence, now)
        if drop is None:
            listener.address, listener.cookie = address, cookie
        return drop

    def stale(self, header: Header, address: Address) -> Drop | None:
        """Why a listener's STOP would be dropped even if its tag were right: whose session it is not, or seen before.

        Args:
            header: of the datagram; nothing of it is proven.
            address: where it came from.
        """
        listener = self._find(header.session)
        if listener is None or listener.address != address:
            return Drop.SESSION
        return None if listener.window.is_new(header.sequence) else Drop.SEQUENCE

    def press(self, opened: Opened, now: float) -> Drop | None:
        """Whether a STOP counts that is not stale, its tag checked; why it does not, as ``admit``."""
        (cookie,) = STOP.struct.unpack(opened.payload)
        listener = self._find(opened.session)
        if listener is None or listener.cookie != cookie:
            return Drop.SESSION
        return self._hear(listener, opened.sequence, now)

    def publish(self, payload: bytes, now: float) -> None:
        """New telemetry for all; what of the one before was not sent yet is not sent any more.

        Args:
            payload: of the TELEMETRY.
            now: wall time [s].
        """
        if self._listeners:
            self._forget(now)
            self._payload, self._due = payload, len(self._listeners)

    def relay(self) -> bool:
        """The end of a turn: send one copy of the telemetry, to the listener who waits longest.

        Returns:
            False where nobody waits.
        """
        self._may_challenge = True
        if not self._due:
            return False
        self._due -= 1
        self._next = (self._next + 1) % len(self._listeners)
        listener = self._listeners[self._next]
        self._send(listener.address, DatagramKind.TELEMETRY, listener.session, self._payload)
        return True

    def _challenge(self, session: int, address: Address, cookie: int) -> Drop | None:
        if not self._may_challenge:
            return Drop.SESSION
        self._may_challenge = False
        self._send(address, DatagramKind.CHALLENGE, session, CHALLENGE.struct.pack(cookie))
        return None

    def _hear(self, listener: _Listener, sequence: int, now: float) -> Drop | None:
        if not listener.window.accept(sequence):
            return Drop.SEQUENCE
        listener.heard = now
        return None

    def _seat(self, session: int, address: Address, cookie: int, now: float) -> _Listener | None:
        if len(self._listeners) >= MAX_LISTENERS:
            return None
        self._listeners.append(_Listener(session, address, cookie, now))
        return self._listeners[-1]

    def _find(self, session: int) -> _Listener | None:
        for listener in self._listeners:
            if listener.session == session:
                return listener
        return None

    def _forget(self, now: float) -> None:
        """Drop those who were silent."""
        if any(now - listener.heard > SILENCE for listener in self._listeners):
            self._listeners = [listener for listener in self._listeners if now - listener.heard <= SILENCE]
            self._due = min(self._due, len(self._listeners))

    def _cookie(self, session: int, address: Address) -> int:
        """Of a newcomer: a secret function of who asks and of the admissions so far; never 0."""
        text = f"{self._admissions} {session} {address}"
        digest = hashlib.blake2s(text.encode(), key=self._secret, digest_size=8).digest()
        return int.from_bytes(digest, "little") | 1
