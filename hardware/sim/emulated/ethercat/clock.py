"""Distributed clocks: each slave's own time, and what a master does to bring them together (ET1100, section I.9)."""

import struct
from typing import Final

from hardware.sim.emulated.ethercat import registers as reg

HOP: Final = 150
"""From one slave to the next [ns]."""


class SlaveClock:
    """A slave's clock, which has begun anywhere; all times in nanoseconds."""

    def __init__(self, began: int, place: int, places: int) -> None:
        """``began``: when it showed zero; ``place`` of so many on the segment, for its delays."""
        self._began = began
        self._there, self._back = place * HOP, (2 * (places - 1) - place) * HOP
        self.has_child = place < places - 1
        self.offset = self.delay = 0

    def local(self, now: int) -> int:
        """What it shows when a frame that set out at ``now`` reaches it."""
        return now - self._began + self._there

    def system(self, now: int) -> int:
        """With the offset that the master has set."""
        return (self.local(now) + self.offset) & (1 << 64) - 1

    def publish(self, memory: bytearray, now: int) -> None:
        """Put the time into the registers."""
        struct.pack_into("<Q", memory, reg.SYSTEM_TIME, self.system(now))

    def write(self, memory: bytearray, address: int, data: bytes, now: int) -> None:
        """A datagram writes registers of the clock."""
        if address == reg.RECEIVE_TIMES:
            self._latch(memory, now)
            return
        if address == reg.SYSTEM_TIME:
            if len(data) == 8:
                self._follow(memory, int.from_bytes(data, "little"), now)
            return
        memory[address : address + len(data)] = data
        (self.offset,) = struct.unpack_from("<q", memory, reg.TIME_OFFSET)
        (self.delay,) = struct.unpack_from("<I", memory, reg.TIME_DELAY)

    def _latch(self, memory: bytearray, now: int) -> None:
        """When the frame comes by at each port, and back."""
        first, back = self.local(now), self.local(now) - self._there + self._back
        low = (1 << 32) - 1
        struct.pack_into("<4I", memory, reg.RECEIVE_TIMES, first & low, back & low if self.has_child else 0, 0, 0)
        struct.pack_into("<Q", memory, reg.UNIT_TIME, first)

    def _follow(self, memory: bytearray, reference: int, now: int) -> None:
        """The reference clock's time comes by: how far from it this one is, and no further from now on."""
        difference = self.system(now) - (reference + self.delay)
        size = min(abs(difference), (1 << 31) - 1)
        struct.pack_into("<I", memory, reg.TIME_DIFFERENCE, size | (1 << 31 if difference < 0 else 0))
        self.offset -= difference
