"""An object dictionary: what a slave can be asked and told by SDO, and which of it stands in its process data."""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

NOT_THERE, NO_SUBINDEX, READ_ONLY, WRONG_SIZE, NOT_NOW, OUT_OF_RANGE, NOT_MAPPABLE = (
    0x06020000, 0x06090011, 0x06010002, 0x06070010, 0x08000022, 0x06090030, 0x06040041,
)  # fmt: skip
"""SDO abort codes (ETG.1000.6, table 41)."""
OUTPUT_ASSIGNMENT, INPUT_ASSIGNMENT = 0x1C12, 0x1C13
OUTPUT_MAPPING, INPUT_MAPPING = 0x1600, 0x1A00
_LENGTHS: Final = {8: "b", 16: "h", 32: "i"}


class Abort(Exception):
    """A request is refused, with an SDO abort code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort 0x{code:08X}")
        self.code = code


@dataclass(slots=True)
class Entry:
    """One object, or one part of it: its length and value."""

    bits: int
    value: int = 0
    signed: bool = False
    writable: bool = False
    text: bytes | None = None
    """Of visible strings, instead of a value."""
    check: Callable[[int], None] | None = None
    """Called before a value is written; raises ``Abort``."""

    @property
    def format(self) -> str:
        """Of a number, for ``struct``."""
        letter = _LENGTHS[self.bits]
        return letter if self.signed else letter.upper()

    def read(self) -> bytes:
        """As it goes over the wire."""
        return self.text if self.text is not None else struct.pack("<" + self.format, self.value)


@dataclass(slots=True)
class Dictionary:
    """All objects by index and subindex. ``configurable``: whether PDOs may be changed now, in PRE-OP."""

    entries: dict[tuple[int, int], Entry] = field(default_factory=dict)
    configurable: Callable[[], bool] = lambda: True

    def add(self, index: int, subindex: int, entry: Entry) -> Entry:
        """A new object."""
        self.entries[index, subindex] = entry
        return entry

    def add_pdo(self, index: int, mapped: list[tuple[int, int, int]], room: int) -> None:
        """A PDO's mapping with room for so many objects; ``mapped`` are index, subindex and bits."""
        self.add(index, 0, Entry(8, len(mapped), writable=True, check=self._check_pdo))
        for place in range(1, room + 1):
            value = _packed(*mapped[place - 1]) if place <= len(mapped) else 0
            self.add(index, place, Entry(32, value, writable=True, check=self._check_mapped))

    def add_assignment(self, index: int, pdos: list[int], room: int) -> None:
        """Which PDOs a sync manager carries."""
        self.add(index, 0, Entry(8, len(pdos), writable=True, check=self._check_pdo))
        for place in range(1, room + 1):
            value = pdos[place - 1] if place <= len(pdos) else 0
            self.add(index, place, Entry(16, value, writable=True, check=self._check_pdo))

    def read(self, index: int, subindex: int) -> bytes:
        """What an SDO upload says; raises ``Abort``."""
        return self._entry(index, subindex).read()

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """What an SDO download does; raises ``Abort``."""
        entry = self._entry(index, subindex)
        if not entry.writable:
            raise Abort(READ_ONLY)
        if len(data) * 8 != entry.bits:
            raise Abort(WRONG_SIZE)
        (value,) = struct.unpack("<" + entry.format, data)
        if entry.check is not None:
            entry.check(value)
        entry.value = value

    def process_data(self, assignment: int) -> list[tuple[Entry | None, int]]:
        """What a sync manager carries, in order: objects with their bits; None fills a gap."""
        carried: list[tuple[Entry | None, int]] = []
        for place in range(1, self.entries[assignment, 0].value + 1):
            pdo = self.entries[assignment, place].value
            for line in range(1, self.entries[pdo, 0].value + 1):
                index, subindex, bits = unpacked(self.entries[pdo, line].value)
                carried.append((self.entries.get((index, subindex)), bits))
        return carried

    def _entry(self, index: int, subindex: int) -> Entry:
        entry = self.entries.get((index, subindex))
        if entry is None:
            raise Abort(NO_SUBINDEX if (index, 0) in self.entries else NOT_THERE)
        return entry

    def _check_pdo(self, _value: int) -> None:
        if not self.configurable():
            raise Abort(NOT_NOW)

    def _check_mapped(self, value: int) -> None:
        self._check_pdo(value)
        index, subindex, bits = unpacked(value)
        entry = self.entries.get((index, subindex))
        if index and (entry is None or entry.bits != bits):
            raise Abort(NOT_MAPPABLE)


def _packed(index: int, subindex: int, bits: int) -> int:
    return index << 16 | subindex << 8 | bits


def unpacked(mapping: int) -> tuple[int, int, int]:
    """Index, subindex and bits of a mapped object."""
    return mapping >> 16, mapping >> 8 & 0xFF, mapping & 0xFF
