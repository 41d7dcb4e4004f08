"""Sealing and opening datagrams: header, keyed tag, and which sequence numbers are still new."""

from __future__ import annotations

import hashlib
import hmac
from enum import IntEnum, unique
from typing import NamedTuple

from controller.protocol.datagram_fields import (
    HEADER,
    MAGIC,
    MAX_DATAGRAM,
    PAYLOADS,
    SAMPLE,
    TAG_SIZE,
    VERSION,
    DatagramKind,
)

_HEADER = HEADER.struct
_OVERHEAD = HEADER.size + TAG_SIZE
_SIZES: dict[int, int] = {int(kind): layout.size for kind, layout in PAYLOADS.items()}
_SAMPLES = int(DatagramKind.SAMPLES)
_WINDOW = 256
"""Sequence numbers remembered behind the newest one; a datagram later than that is dropped and sent again anew."""


@unique
class Drop(IntEnum):
    """Why a datagram was dropped; the telemetry counts each."""

    SIZE = 0
    VERSION = 1
    TAG = 2
    SESSION = 3
    SEQUENCE = 4
    CONTENT = 5


class Header(NamedTuple):
    """What a datagram says of itself; nothing is proven yet."""

    kind: int
    session: int
    sequence: int


class Opened(NamedTuple):
    """A datagram whose tag is right."""

    kind: int
    session: int
    sequence: int
    payload: memoryview


class Envelope:
    """Seals and opens datagrams with one key."""

    def __init__(self, key: bytes) -> None:
        self._keyed = hashlib.blake2s(key=key, digest_size=TAG_SIZE)

    def _tag(self, data: bytes | memoryview) -> bytes:
        tag = self._keyed.copy()
        tag.update(data)
        return tag.digest()

    def seal(self, kind: DatagramKind, session: int, sequence: int, payload: bytes) -> bytes:
        """A whole datagram: header, payload, tag over both."""
        size = _OVERHEAD + len(payload)
        body = _HEADER.pack(MAGIC, VERSION, kind, size, session, sequence) + payload
        return body + self._tag(body)

    def open(self, data: memoryview) -> Opened | Drop:
        """Check size, magic, version, tag and the payload's size, in this order."""
        header = self.look(data)
        return header if isinstance(header, Drop) else self.unseal(data, header)

    def look(self, data: memoryview) -> Header | Drop:
        """Check size, magic and version: all that costs next to nothing."""
        length = len(data)
        if not _OVERHEAD <= length <= MAX_DATAGRAM:
            return Drop.SIZE
        magic, version, kind, size, session, sequence = _HEADER.unpack_from(data)
        if magic != MAGIC or size != length:
            return Drop.SIZE
        return Header(kind, session, sequence) if version == VERSION else Drop.VERSION

    def unseal(self, data: memoryview, header: Header) -> Opened | Drop:
        """Check tag and the payload's size of a datagram that ``look`` let pass."""
        if not hmac.compare_digest(self._tag(data[:-TAG_SIZE]), data[-TAG_SIZE:]):
            return Drop.TAG
        if not _payload_fits(header.kind, len(data) - _OVERHEAD):
            return Drop.CONTENT
        return Opened(*header, data[HEADER.size : -TAG_SIZE])


def _payload_fits(kind: int, size: int) -> bool:
    fixed = _SIZES.get(kind)
    if fixed is None:
        return False
    if kind == _SAMPLES:
        return size > fixed and (size - fixed) % SAMPLE.itemsize == 0
    return size == fixed


class SequenceWindow:
    """Accepts each sequence number once; reordering is fine as long as it is not too old.

    Args:
        newest: this number and all below it count as seen.
    """

    def __init__(self, newest: int = 0) -> None:
        self._newest = newest
        self._seen = (1 << _WINDOW) - 1

    def is_new(self, sequence: int) -> bool:
        """Whether this number would be accepted."""
        ahead = sequence - self._newest
        return ahead > 0 or (ahead > -_WINDOW and not self._seen >> -ahead & 1)

    def accept(self, sequence: int) -> bool:
        """Whether this number is new; it is remembered then."""
        if not self.is_new(sequence):
            return False
        ahead = sequence - self._newest
        if ahead > 0:
            self._seen = ((self._seen << ahead) | 1) & ((1 << _WINDOW) - 1) if ahead < _WINDOW else 1
            self._newest = sequence
        else:
            self._seen |= 1 << -ahead
        return True
