"""How two robots prove to each other that they know the secret; how every later line is numbered and authenticated.

With *T* = SHA-256 of both hellos and both certificates' fingerprints, as each end sees them, and *K* the key made of
the secret::

    guest → host    HMAC(K, "guest" T) and the guest's signature of T
    host → guest    HMAC(K, "host" T)
    a line          HMAC(K_direction, number body) number body,  K_direction = HMAC(K, direction T)

A man in the middle shows the guest another certificate than the host has, so *T* differs at both ends and both proofs
fail. Nonces in the hellos make every *T* new, so nothing recorded can be used again; within a connection, a line counts
only if it has the next number.
"""

from __future__ import annotations

import hashlib
import hmac
from dataclasses import dataclass
from typing import Final

from app.linked.errors import LinkBroken
from app.linked.secret import LinkSecret

_TAG: Final = 64
"""Of a line: hex digits of its HMAC-SHA-256."""


@dataclass(frozen=True, slots=True)
class Handshake:
    """What both ends have said and seen, and so who they are.

    Attributes:
        secret: theirs, one hopes.
        transcript: *T*.
    """

    secret: LinkSecret
    transcript: bytes

    @classmethod
    def of(cls, secret: LinkSecret, guest_hello: bytes, host_hello: bytes, guest: str, host: str) -> Handshake:
        """Of both hellos as they were sent, and the fingerprints of both certificates."""
        parts = (guest_hello, host_hello, guest.encode(), host.encode())
        digest = hashlib.sha256(b"touchmove link 1")
        for part in parts:
            digest.update(len(part).to_bytes(4, "big") + part)
        return cls(secret, digest.digest())

    def proof(self, role: str) -> str:
        """Of the end with this role, guest or host; in hex."""
        return self._derived(f"{role} knows the secret").hex()

    def proves(self, role: str, proof: str) -> bool:
        """Whether that is the proof of the end with this role; takes as long for every other one."""
        return hmac.compare_digest(self.proof(role), proof)

    def signed(self) -> bytes:
        """What the guest signs."""
        return b"touchmove link 1: the guest's certificate " + self.transcript

    def sealer(self, role: str) -> Sealer:
        """Of the lines that the end with this role sends."""
        return Sealer(self._derived(f"lines of the {role}"))

    def opener(self, role: str) -> Opener:
        """Of the lines that the end with this role has sent."""
        return Opener(self._derived(f"lines of the {role}"))

    def _derived(self, purpose: str) -> bytes:
        return hmac.digest(self.secret.key, purpose.encode() + b"\0" + self.transcript, "sha256")


class Sealer:
    """Makes lines, each with the next number."""

    def __init__(self, key: bytes) -> None:
        self._key, self._number = key, 0

    def seal(self, body: bytes) -> bytes:
        """A line, with its end, that says this; ``body`` is JSON without line breaks."""
        content = b"%d %s" % (self._number, body)
        self._number += 1
        return hmac.digest(self._key, content, "sha256").hex().encode() + b" " + content + b"\n"


class Opener:
    """Reads lines, each with the next number; what it refuses changes nothing."""

    def __init__(self, key: bytes) -> None:
        self._key, self._number = key, 0

    def open(self, line: bytes) -> bytes:
        """What a line says.

        Raises:
            LinkBroken: it was changed, repeated, left out or brought out of order.
        """
        tag, content = line[:_TAG], line[_TAG + 1 :].removesuffix(b"\n")
        whole = line[_TAG : _TAG + 1] == b" " and line.endswith(b"\n")
        if not whole or not hmac.compare_digest(hmac.digest(self._key, content, "sha256").hex().encode(), tag):
            raise LinkBroken("a line was changed on its way: the link is taken up anew")
        number, _, body = content.partition(b" ")
        if number != b"%d" % self._number:
            raise LinkBroken("a line came twice or out of order: the link is taken up anew")
        self._number += 1
        return body
