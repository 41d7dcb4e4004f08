"""What stands where in a slave's process data: objects in order, packed as a ``struct``."""

import struct
from dataclasses import dataclass
from functools import cached_property
from typing import Final

_FORMATS: Final = {
    "u8": ("B", 8),
    "i8": ("b", 8),
    "u16": ("H", 16),
    "i16": ("h", 16),
    "u32": ("I", 32),
    "i32": ("i", 32),
}


@dataclass(frozen=True, slots=True)
class Object:
    """One object of a drive's dictionary; ``kind`` is u8 … i32, index 0 a gap."""

    name: str
    index: int
    kind: str
    subindex: int = 0

    @property
    def bits(self) -> int:
        """Its length."""
        return _FORMATS[self.kind][1]

    @property
    def mapped(self) -> bytes:
        """As it stands in a PDO's mapping."""
        return struct.pack("<I", self.index << 16 | self.subindex << 8 | self.bits)

    @property
    def format(self) -> str:
        """For ``struct``."""
        return _FORMATS[self.kind][0] if self.index else f"{self.bits // 8}x"


def gap(kind: str) -> Object:
    """A gap, so that what follows begins at an even byte."""
    return Object("", 0, kind)


@dataclass(frozen=True)
class PdoLayout:
    """Objects of a PDO, in order."""

    objects: tuple[Object, ...]

    @cached_property
    def packed(self) -> struct.Struct:
        """For packing its values, in the order of ``names``."""
        return struct.Struct("<" + "".join(one.format for one in self.objects))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of its values, without gaps."""
        return tuple(one.name for one in self.objects if one.index)

    def place(self, name: str) -> int:
        """Where a value stands among the unpacked ones."""
        return self.names.index(name)
