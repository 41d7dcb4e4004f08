"""Frames of the multiplex protocol: subframes that write, read and answer registers, and a tunnel for text.

From docs/protocol/can.md. A frame is up to 64 bytes of CAN-FD; what its lengths do not allow is filled with NOPs.
"""

import struct
from collections.abc import Iterable, Iterator, Sequence
from enum import IntEnum, unique
from typing import Final, NamedTuple

from hardware.drives.moteus.registers import Resolution

REPLY_WANTED: Final = 0x8000
"""Bit of a frame's id that has the controller answer."""
NOP: Final = 0x50
_FILL: Final = bytes([NOP])
LONGEST: Final = 64
"""Of a frame [bytes]."""
_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
_CODES: Final = "bhif"
_STRUCTS: Final = tuple(struct.Struct(f"<{code}") for code in _CODES)
_WRITE, _READ, _REPLY = 0x00, 0x10, 0x20
_WRITE_ERROR, _READ_ERROR = 0x30, 0x31
_TO_CONTROLLER, _FROM_CONTROLLER, _POLL = 0x40, 0x41, 0x42
_CHANNEL: Final = 1
"""Of the diagnostic console."""


class FrameError(ValueError):
    """A frame cannot be read; the message says where."""


@unique
class SubframeKind(IntEnum):
    """What a subframe does."""

    WRITE = 0
    READ = 1
    REPLY = 2
    WRITE_ERROR = 3
    READ_ERROR = 4
    TEXT_IN = 5
    """Text for the controller's console."""
    TEXT_OUT = 6
    """What the console has said."""
    POLL = 7
    """Asks what the console has to say."""


class Subframe(NamedTuple):
    """One part of a frame; of one register each."""

    part: SubframeKind
    register: int
    """Of an error as well; the most bytes that are asked for by a poll."""
    resolution: Resolution = Resolution.INT8
    value: float = 0.0
    """As it travels, see ``value_of``; of an error its number."""
    text: bytes = b""


def address(destination: int, *, source: int = 0, reply: bool = True) -> int:
    """Id of a frame."""
    return (REPLY_WANTED if reply else 0) | source << 8 | destination


def padded(data: bytes) -> bytes:
    """Data as long as CAN-FD has it, filled with NOPs; raises ``FrameError`` if it is too long."""
    for length in _LENGTHS:
        if length >= len(data):
            return data.ljust(length, _FILL)
    raise FrameError(f"a frame holds at most {LONGEST} bytes, these are {len(data)}")


def _varuint(number: int) -> bytes:
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def _head(kind: int, resolution: Resolution, register: int, count: int) -> bytes:
    first = kind | resolution << 2
    if count <= 3:
        return bytes([first | count]) + _varuint(register)
    return bytes([first]) + _varuint(count) + _varuint(register)


def write(resolution: Resolution, register: int, values: Sequence[float]) -> bytes:
    """Write registers that follow each other; values as they travel."""
    numbers = values if resolution is Resolution.FLOAT else [int(value) for value in values]
    data = struct.pack(f"<{len(values)}{_CODES[resolution]}", *numbers)
    return _head(_WRITE, resolution, register, len(values)) + data


def read(resolution: Resolution, register: int, count: int = 1) -> bytes:
    """Ask for registers that follow each other."""
    return _head(_READ, resolution, register, count)


def reply(resolution: Resolution, register: int, values: Sequence[float]) -> bytes:
    """Answer with registers that follow each other; for emulated controllers."""
    data = write(resolution, register, values)
    return bytes([data[0] | _REPLY]) + data[1:]


def read_error(register: int, number: int) -> bytes:
    """Answer that a register cannot be read; for emulated controllers."""
    return bytes([_READ_ERROR]) + _varuint(register) + _varuint(number)


def text_in(text: bytes) -> bytes:
    """Text for the console."""
    return bytes([_TO_CONTROLLER, _CHANNEL]) + _varuint(len(text)) + text


def text_out(text: bytes) -> bytes:
    """What the console says; for emulated controllers."""
    return bytes([_FROM_CONTROLLER, _CHANNEL]) + _varuint(len(text)) + text


def poll(most: int = 48) -> bytes:
    """Ask what the console has to say."""
    return bytes([_POLL, _CHANNEL]) + _varuint(most)


class _Reader:
    """Takes bytes off a frame."""

    def __init__(self, data: bytes) -> None:
        self._data, self.at = data, 0

    @property
    def more(self) -> bool:
        return self.at < len(self._data)

    def take(self, count: int) -> bytes:
        end = self.at + count
        if end > len(self._data):
            raise FrameError(f"the frame ends within a subframe, {end - len(self._data)} bytes too early")
        taken: bytes = self._data[self.at : end]
        self.at = end
        return taken

    def varuint(self) -> int:
        number = 0
        for shift in range(0, 35, 7):
            byte = self.take(1)[0]
            number |= (byte & 0x7F) << shift
            if not byte & 0x80:
                return number
        raise FrameError("a number of the frame does not end")

    def value(self, resolution: Resolution) -> float:
        one = _STRUCTS[resolution]
        number: float = one.unpack(self.take(one.size))[0]
        return number


def parse(data: bytes) -> Iterator[Subframe]:
    """All parts of a frame in their order; raises ``FrameError`` where it is none."""
    frame = _Reader(data)
    while frame.more:
        first = frame.take(1)[0]
        kind, resolution, count = first & 0xF0, Resolution(first >> 2 & 3), first & 3
        if first == NOP:
            continue
        if kind in (_WRITE, _READ, _REPLY):
            yield from _registers(frame, kind, resolution, count)
        elif first in (_WRITE_ERROR, _READ_ERROR):
            part = SubframeKind.WRITE_ERROR if first == _WRITE_ERROR else SubframeKind.READ_ERROR
            yield Subframe(part, frame.varuint(), value=frame.varuint())
        elif first in (_TO_CONTROLLER, _FROM_CONTROLLER, _POLL):
            yield _tunnel(frame, first)
        else:
            raise FrameError(f"byte {frame.at - 1} of the frame, 0x{first:02x}, begins nothing that is documented")


def _registers(frame: _Reader, kind: int, resolution: Resolution, count: int) -> Iterator[Subframe]:
    count = count or frame.varuint()
    register, part = frame.varuint(), SubframeKind(kind >> 4)
    for at in range(register, register + count):
        yield Subframe(part, at, resolution, 0.0 if part is SubframeKind.READ else frame.value(resolution))


def _tunnel(frame: _Reader, first: int) -> Subframe:
    frame.varuint()  # the channel: there is one
    size = frame.varuint()
    if first == _POLL:
        return Subframe(SubframeKind.POLL, size)
    return Subframe(
        SubframeKind.TEXT_IN if first == _TO_CONTROLLER else SubframeKind.TEXT_OUT, 0, text=frame.take(size)
    )


class Asked(NamedTuple):
    """Registers that follow each other, asked for in one subframe."""

    resolution: Resolution
    register: int
    number: int
    """How many."""


class AnswerLayout:
    """What is asked for in every cycle, and how the answer to exactly that is read at once.

    ``query`` are the subframes to send, ``size`` the length of the answer without NOPs.
    """

    def __init__(self, asked: Iterable[Asked]) -> None:
        groups = list(asked)
        self.query = b"".join(read(*group) for group in groups)
        self._known: list[tuple[int, bytes]] = []
        """Where the answer's subframes begin, and with what."""
        code, self.size = "<", 0
        for group in groups:
            head = reply(*group[:2], [0.0] * group.number)
            start = head[: len(head) - group.number * _STRUCTS[group.resolution].size]
            self._known.append((self.size, start))
            code += f"{len(start)}x{group.number}{_CODES[group.resolution]}"
            self.size += len(head)
        self._struct = struct.Struct(code)

    def unpack(self, data: bytes) -> tuple[float, ...]:
        """The values as they travel, in the order asked for; raises ``FrameError`` if this answers something else."""
        if len(data) < self.size:
            raise FrameError(f"an answer of {len(data)} bytes, {self.size} were expected")
        for at, start in self._known:
            if not data.startswith(start, at):
                raise FrameError(f"byte {at} of the answer is not what was requested")
        return self._struct.unpack_from(data)
