"""One slave: its controller's memory with all that reacts when it is read or written, and an application behind it."""

import struct
from typing import Final, Protocol

from hardware.sim.emulated.ethercat import registers as reg
from hardware.sim.emulated.ethercat import sii
from hardware.sim.emulated.ethercat.clock import SlaveClock
from hardware.sim.emulated.ethercat.coe import CoeServer
from hardware.sim.emulated.ethercat.dictionary import Dictionary

_FMMU: Final = struct.Struct("<IHBBHBBB")
"""Logical start, length, first and last bit, physical start, bit, type, active."""
_READS, _WRITES = 1, 2
_NEXT: Final = {reg.INIT: reg.PREOP, reg.PREOP: reg.SAFEOP, reg.SAFEOP: reg.OP}
Piece = tuple[int, int, int, bool]
"""Of logical memory: first address, length, where it lies in the slave's memory, whether the master writes it."""


class Application(Protocol):
    """What stands behind a slave controller."""

    @property
    def identity(self) -> sii.Identity:
        """Who it is."""

    @property
    def dictionary(self) -> Dictionary | None:
        """None: it has no mailbox, and no process data."""

    def sizes(self) -> tuple[int, int]:
        """Process data that it takes and gives, as it is mapped at present [bytes]."""

    def start(self) -> None:
        """Process data are mapped; they flow from now on."""

    def take(self, outputs: bytes) -> None:
        """The master's process data, in OP."""

    def give(self) -> bytes:
        """Its own process data."""

    def stop(self, *, watchdog: bool) -> None:
        """OP is left, because no outputs came for too long, or because the master or a fault wants it so."""


class Slave:
    """A slave on the segment.

    Attributes:
        memory: registers and process memory.
        pieces: of logical memory that it serves, see ``Piece``.
        bites: False plants a fault: its watchdog never ends OP.
        biased: added to the working counter of its process data; a planted fault.
    """

    def __init__(self, application: Application, clock: SlaveClock | None) -> None:
        self.application, self.clock = application, clock
        self.memory = memory = bytearray(reg.MEMORY)
        self.pieces: tuple[Piece, ...] = ()
        self.bites, self.biased = True, 0
        self._coe = CoeServer(application.dictionary, sii.MAILBOX) if application.dictionary is not None else None
        if application.dictionary is not None:
            application.dictionary.configurable = self._is_configurable
        has_inputs, has_outputs = self._carries()
        self._eeprom = sii.eeprom(
            application.identity, mailbox=self._coe is not None, inputs=has_inputs, outputs=has_outputs
        )
        memory[0:8] = bytes((0x11, 0, 1, 0, reg.FMMUS, reg.SYNC_MANAGERS, 8, 0x0F))
        self._put16(reg.FEATURES, reg.DC_FEATURE if clock is not None else 0)
        self._put16(reg.PDI_CONTROL, 0x0005)
        self._put16(reg.WATCHDOG_DIVIDER, reg.DIVIDER_DEFAULT)
        self._put16(reg.WATCHDOG_TIME, reg.WATCHDOG_DEFAULT)
        self._put16(reg.EEPROM_CONTROL, reg.EEPROM_EIGHT_BYTES)
        self._put16(reg.AL_STATUS, reg.INIT)
        self._fed: int | None = None
        self._said = b""

    # frames

    @property
    def station(self) -> int:
        """The address that the master has given it."""
        return self._get16(reg.STATION)

    @property
    def state(self) -> int:
        """Of the application layer, without the error flag."""
        return self.memory[reg.AL_STATUS] & 0x0F

    def read(self, address: int, size: int, now: int) -> bytes | None:
        """Memory as a datagram reads it at a time [ns]; None: it may not at present."""
        if self.clock is not None and address < reg.TIME_OFFSET and address + size > reg.RECEIVE_TIMES:
            self.clock.publish(self.memory, now)
        if self._coe is not None and sii.MAILBOX_IN <= address < sii.MAILBOX_IN + sii.MAILBOX:
            return self._read_mailbox(address, size)
        return bytes(self.memory[address : address + size])

    def write(self, address: int, data: bytes, now: int) -> bool:
        """Memory as a datagram writes it; False: it may not at present."""
        if address >= 0x1000:
            return self._write_process_memory(address, data)
        if address < reg.DL_STATUS:
            self.memory[address : address + len(data)] = data
        elif address == reg.AL_CONTROL:
            self._ask_state(data[0])
        elif address == reg.EEPROM_CONTROL:
            self.memory[address : address + len(data)] = data
            self._read_eeprom()
        elif reg.SYNC_MANAGER <= address < reg.SYNC_MANAGER + 0x80:
            self._write_sync_managers(address, data)
        elif reg.RECEIVE_TIMES <= address < 0x09B0:
            if self.clock is not None:
                self.clock.write(self.memory, address, data, now)
        else:
            self.memory[address : address + len(data)] = data
        if reg.FMMU <= address < reg.SYNC_MANAGER + 0x80:
            self._map()
        return True

    def outputs_written(self, now: int) -> None:
        """The master has written process data [ns]."""
        self._fed = now
        self.memory[reg.WATCHDOG_STATUS] = 1
        if self.state == reg.OP:
            start = sii.OUTPUTS
            self.application.take(bytes(self.memory[start : start + self.application.sizes()[0]]))

    def offer_inputs(self) -> None:
        """Put the application's process data where the next frame finds them."""
        if self.state in (reg.SAFEOP, reg.OP):
            data = self.application.give()
            self.memory[sii.INPUTS : sii.INPUTS + len(data)] = data

    def watch(self, now: int) -> None:
        """See whether the watchdog bites [ns]."""
        limit = self.watchdog
        if self.state != reg.OP or self._fed is None or not limit or now - self._fed <= limit:
            return
        self.memory[reg.WATCHDOG_STATUS] = 0
        if self.bites:
            self.memory[reg.WATCHDOG_COUNT] = min(255, self.memory[reg.WATCHDOG_COUNT] + 1)
            self.drop(reg.SAFEOP, reg.SYNC_MANAGER_WATCHDOG, watchdog=True)

    @property
    def watchdog(self) -> int:
        """Of process data; 0: it is off [ns]."""
        ticks = self._get16(reg.WATCHDOG_TIME)
        return ticks * (self._get16(reg.WATCHDOG_DIVIDER) + 2) * reg.DIVIDER_TICK

    def damaged(self) -> None:
        """A frame has come in damaged."""
        self.memory[reg.RX_ERRORS] = min(255, self.memory[reg.RX_ERRORS] + 1)

    # states

    def drop(self, state: int, code: int, *, watchdog: bool = False) -> None:
        """Fall to a lower state by itself, with an AL status code."""
        if self.state == reg.OP:
            self.application.stop(watchdog=watchdog)
        self._enter(state, code)

    def _ask_state(self, control: int) -> None:
        wanted, current = control & 0x0F, self.state
        failed = self.memory[reg.AL_STATUS] & reg.ERROR
        if failed and not control & reg.ERROR and wanted >= current:
            return  # the error has to be acknowledged first
        code = may_change(current, wanted) or self._unready(current, wanted)
        if code:
            self._enter(current, code)
            return
        if current == reg.OP and wanted != reg.OP:
            self.application.stop(watchdog=False)
        self._enter(wanted, 0)

    def _unready(self, current: int, wanted: int) -> int:
        """Why a state cannot be entered yet: an AL status code, or 0."""
        if current == reg.INIT and wanted == reg.PREOP and self._coe is not None:
            enabled = all(self._manager(number)[2] for number in (0, 1))
            return 0 if enabled else reg.BAD_MAILBOX
        if current == reg.PREOP and wanted == reg.SAFEOP:
            outputs, inputs = self.application.sizes()
            if outputs and self._manager(reg.OUTPUTS_SM)[:2] != (sii.OUTPUTS, outputs):
                return reg.BAD_OUTPUTS
            if inputs and self._manager(reg.INPUTS_SM)[:2] != (sii.INPUTS, inputs):
                return reg.BAD_INPUTS
        if current == reg.SAFEOP and wanted == reg.OP and self.application.sizes()[0] and self._fed is None:
            return reg.NO_VALID_OUTPUTS
        return 0

    def _enter(self, state: int, code: int) -> None:
        before = self.state
        self.memory[reg.AL_STATUS] = state | (reg.ERROR if code else 0)
        self._put16(reg.AL_CODE, code)
        if before == reg.PREOP and state == reg.SAFEOP:
            self.application.start()
        if state < reg.SAFEOP:
            self._fed = None
        self._map()

    # memory

    def _is_configurable(self) -> bool:
        return self.state == reg.PREOP

    def _carries(self) -> tuple[bool, bool]:
        outputs, inputs = self.application.sizes()
        return inputs > 0, outputs > 0

    def _manager(self, number: int) -> tuple[int, int, bool]:
        start, size, _, _, on, _ = struct.unpack_from(
            "<HHBBBB", self.memory, reg.SYNC_MANAGER + reg.SYNC_MANAGER_SIZE * number
        )
        return start, size, bool(on & reg.SM_ENABLED)

    def _map(self) -> None:
        """Which pieces of logical memory it serves, now that an FMMU, a sync manager or the state has changed."""
        pieces: list[Piece] = []
        if self.state in (reg.SAFEOP, reg.OP):
            for number in range(reg.FMMUS):
                start, size, _, _, at, _, kind, active = _FMMU.unpack_from(
                    self.memory, reg.FMMU + reg.FMMU_SIZE * number
                )
                if active & 1 and size:
                    pieces.append((start, size, at, bool(kind & _WRITES)))
        self.pieces = tuple(pieces)

    def _write_sync_managers(self, address: int, data: bytes) -> None:
        """Status and the slave's own control byte stay as they are."""
        repeat_before = self.memory[reg.SYNC_MANAGER + 8 + 6] & reg.SM_REPEAT
        for at, byte in enumerate(data, address):
            if (at - reg.SYNC_MANAGER) % reg.SYNC_MANAGER_SIZE not in (5, 7):
                self.memory[at] = byte
        repeat = self.memory[reg.SYNC_MANAGER + 8 + 6] & reg.SM_REPEAT
        if repeat != repeat_before:  # the master has not got the last answer: once more
            self.memory[reg.SYNC_MANAGER + 8 + 7] = repeat
            self._post(self._said)

    def _write_process_memory(self, address: int, data: bytes) -> bool:
        if self._coe is not None and sii.MAILBOX_OUT <= address < sii.MAILBOX_OUT + sii.MAILBOX:
            if not self._manager(0)[2] or self.memory[reg.SYNC_MANAGER + 5] & reg.MAILBOX_FULL:
                return False
            self._post(self._coe.answer(data))
            return True
        self.memory[address : address + len(data)] = data
        return True

    def _post(self, message: bytes) -> None:
        self._said = message
        at = sii.MAILBOX_IN
        self.memory[at : at + sii.MAILBOX] = message.ljust(sii.MAILBOX, b"\x00")
        self.memory[reg.SYNC_MANAGER + 8 + 5] |= reg.MAILBOX_FULL

    def _read_mailbox(self, address: int, size: int) -> bytes | None:
        status = reg.SYNC_MANAGER + 8 + 5
        if not self.memory[status] & reg.MAILBOX_FULL:
            return None
        if address + size >= sii.MAILBOX_IN + sii.MAILBOX:
            self.memory[status] &= ~reg.MAILBOX_FULL & 0xFF
        return bytes(self.memory[address : address + size])

    def _read_eeprom(self) -> None:
        if self._get16(reg.EEPROM_CONTROL) & reg.EEPROM_READ:
            at = 2 * self._get16(reg.EEPROM_ADDRESS)
            self.memory[reg.EEPROM_DATA : reg.EEPROM_DATA + 8] = self._eeprom[at : at + 8].ljust(8, b"\xff")
        self._put16(reg.EEPROM_CONTROL, reg.EEPROM_EIGHT_BYTES)

    def _get16(self, address: int) -> int:
        return self.memory[address] | self.memory[address + 1] << 8

    def _put16(self, address: int, value: int) -> None:
        struct.pack_into("<H", self.memory, address, value)


def may_change(current: int, wanted: int) -> int:
    """0, or the AL status code of a refusal: one step up at a time, any number of steps down (ETG.1000.6, 6.4)."""
    if wanted not in (reg.INIT, reg.PREOP, reg.SAFEOP, reg.OP):
        return reg.UNKNOWN_STATE
    if wanted <= current or _NEXT.get(current) == wanted:
        return 0
    return reg.INVALID_CHANGE
