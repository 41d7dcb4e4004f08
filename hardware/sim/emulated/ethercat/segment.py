"""A chain of slaves, and how a frame passes through it (ETG.1000.4).

Faults of the wire are planted here: frames that get lost or damaged, a cable that is cut somewhere.
"""

import struct
from collections.abc import Sequence
from typing import Final

from hardware.sim.emulated.ethercat import registers as reg
from hardware.sim.emulated.ethercat.slave import Slave

ETHERTYPE: Final = 0x88A4
_FIRST: Final = 16
"""Where the first datagram begins: after the headers of Ethernet and EtherCAT [bytes]."""
_DATAGRAM: Final = struct.Struct("<BBHHHH")
"""Command, index, address (slave, memory), length with flags, interrupts."""
_WORD: Final = struct.Struct("<H")
_MORE, _LENGTH = 0x8000, 0x07FF
_OWN_ADDRESS: Final = 0x02
"""In the source address of a frame that has been through."""
APRD, APWR, FPRD, FPWR, BRD, BWR, LRD, LWR, LRW, FRMW = 1, 2, 4, 5, 7, 8, 10, 11, 12, 14
_READS, _WRITES = (APRD, FPRD, BRD, FRMW), (APWR, FPWR, BWR)
_POSITION, _BROADCAST = (APRD, APWR), (BRD, BWR)


class SlaveChain:
    """Slaves in the order in which a frame passes them.

    Attributes:
        slaves: all of them.
        reach: how many of them a frame reaches; fewer where a cable is cut, none where it is pulled.
        losing: so many of the next frames get lost.
        damaging: so many of the next frames are damaged on their way to slave ``damaged_before``, and dropped.
    """

    def __init__(self, slaves: Sequence[Slave]) -> None:
        self.slaves = tuple(slaves)
        self.reach = len(self.slaves)
        self.losing = self.damaging = self.damaged_before = 0
        self.link_up()

    def link_up(self) -> None:
        """Say in each slave's status register which ports have a link now."""
        for place, slave in enumerate(self.slaves):
            status = 0x5A37 if place + 1 < self.reach else 0x5617  # port 1 open, or closed by its loop
            _WORD.pack_into(slave.memory, reg.DL_STATUS, status)

    def pass_through(self, frame: bytearray, now: int) -> list[Slave] | None:
        """Let a frame pass at a time [ns]: it is changed in place. Slaves whose outputs it wrote; None: it got lost."""
        slaves = self.slaves[: self.reach]
        if not slaves or self._spoil(slaves):
            return None
        written: list[Slave] = []
        at, more = _FIRST, True
        frame[6] |= _OWN_ADDRESS
        while more:
            command, _, position, offset, flags, _ = _DATAGRAM.unpack_from(frame, at)
            size, more = flags & _LENGTH, bool(flags & _MORE)
            data = at + _DATAGRAM.size
            if data + size + 2 > len(frame):
                return None  # not what a master sends: no slave would close it with a check sum
            if command in (LRD, LWR, LRW):
                count = self._logical(slaves, command, position | offset << 16, frame, data, size, written)
            else:
                count = self._physical(slaves, command, position, offset, frame, at, size, now)
            counter = _WORD.unpack_from(frame, data + size)[0] + count
            _WORD.pack_into(frame, data + size, counter & 0xFFFF)
            at = data + size + 2
        return written

    def _spoil(self, slaves: Sequence[Slave]) -> bool:
        if self.losing:
            self.losing -= 1
            return True
        if self.damaging:
            self.damaging -= 1
            slaves[min(self.damaged_before, len(slaves) - 1)].damaged()
            return True
        return False

    @staticmethod
    def _logical(
        slaves: Sequence[Slave], command: int, first: int, frame: bytearray, data: int, size: int, written: list[Slave]
    ) -> int:
        """Process data; what the working counter grows by."""
        counter = 0
        for slave in slaves:
            memory, count = slave.memory, 0
            for start, length, at, writes in slave.pieces:
                begin = start - first
                if begin < 0 or begin + length > size:
                    continue
                begin += data
                if writes:
                    if command != LRD:
                        memory[at : at + length] = frame[begin : begin + length]
                        count += 2 if command == LRW else 1
                        written.append(slave)
                elif command != LWR:
                    frame[begin : begin + length] = memory[at : at + length]
                    count += 1
            counter += count + (slave.biased if count else 0)
        return counter

    @staticmethod
    def _physical(
        slaves: Sequence[Slave],
        command: int,
        position: int,
        offset: int,
        frame: bytearray,
        at: int,
        size: int,
        now: int,
    ) -> int:
        """Registers and memory of one slave, of the one at a place, or of all."""
        data = at + _DATAGRAM.size
        count, passed = 0, False
        for slave in slaves:
            mine = command in _BROADCAST or (position == 0 if command in _POSITION else slave.station == position)
            if command in _POSITION or command in _BROADCAST:
                position = (position + 1) & 0xFFFF
            if command == FRMW and not mine:
                if passed and slave.clock is not None:
                    slave.write(offset, bytes(frame[data : data + size]), now)
                    count += 1
                continue
            if not mine:
                continue
            if command in _WRITES:
                count += slave.write(offset, bytes(frame[data : data + size]), now)
            elif command in _READS:
                said = slave.read(offset, size, now)
                if said is not None:
                    passed, count = True, count + 1
                    if command == BRD:
                        said = bytes(a | b for a, b in zip(frame[data : data + size], said, strict=True))
                    frame[data : data + size] = said
        _WORD.pack_into(frame, at + 2, position)
        return count
