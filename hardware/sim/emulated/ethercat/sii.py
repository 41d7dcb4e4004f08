"""The EEPROM of a slave (slave information interface, ETG.2010): identity, mailbox, sync managers."""

import struct
from dataclasses import dataclass
from typing import Final

SIZE: Final = 1024
"""[bytes]"""
MAILBOX: Final = 128
"""Of either mailbox [bytes]."""
MAILBOX_OUT, MAILBOX_IN, OUTPUTS, INPUTS = 0x1000, 0x1080, 0x1100, 0x1180
"""Where a slave's mailboxes and process data begin in its memory; outputs are what the master writes."""
_STRINGS, _GENERAL, _FMMU, _SYNC_MANAGERS, _END = 10, 30, 40, 41, 0xFFFF
_COE: Final = 0x0004
_SDO_AND_PDO: Final = 0x01 | 0x04 | 0x08
"""CoE details: SDOs, PDOs can be assigned, PDOs can be mapped; no complete access."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Who a slave is: numbers of vendor, product and revision, and its name."""

    vendor: int
    product: int
    revision: int
    name: str
    serial: int = 1


def eeprom(identity: Identity, *, mailbox: bool, inputs: bool, outputs: bool) -> bytes:
    """The content of an EEPROM; ``mailbox``: it speaks CoE; ``inputs``, ``outputs``: it has process data."""
    head = bytearray(0x80)
    struct.pack_into("<4I", head, 0x10, identity.vendor, identity.product, identity.revision, identity.serial)
    if mailbox:
        struct.pack_into("<5H", head, 0x30, MAILBOX_OUT, MAILBOX, MAILBOX_IN, MAILBOX, _COE)
    struct.pack_into("<HH", head, 0x7C, SIZE // 128 - 1, 1)
    name = identity.name.encode("ascii")
    general = bytearray(32)
    general[3] = 1  # the name is string 1
    general[7] = _SDO_AND_PDO if mailbox else 0
    managers = [(MAILBOX_OUT, MAILBOX, 0x26, 1, 1), (MAILBOX_IN, MAILBOX, 0x22, 1, 2)] if mailbox else []
    if mailbox:
        managers += [(OUTPUTS, 0, 0x64, int(outputs), 3), (INPUTS, 0, 0x20, int(inputs), 4)]
    parts = [_category(_STRINGS, bytes([1, len(name)]) + name), _category(_GENERAL, bytes(general))]
    if managers:
        parts.append(_category(_FMMU, bytes([1, 2, 3, 0])))
        packed = b"".join(
            struct.pack("<HHBBBB", at, size, control, 0, on, kind) for at, size, control, on, kind in managers
        )
        parts.append(_category(_SYNC_MANAGERS, packed))
    content = bytes(head) + b"".join(parts) + struct.pack("<H", _END)
    return content.ljust(SIZE, b"\xff")


def _category(kind: int, data: bytes) -> bytes:
    padded = data + b"\x00" * (len(data) % 2)
    return struct.pack("<HH", kind, len(padded) // 2) + padded
