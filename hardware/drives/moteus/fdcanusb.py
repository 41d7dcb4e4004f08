"""The text that an fdcanusb adapter (mjcanfd-usb-1x) speaks over its serial port: one line for each frame.

``can send ID DATA FLAGS`` is acknowledged by ``OK`` or ``ERR …``; what is received comes as ``rcv ID DATA FLAGS``. A
line may end in ``*XX``, a CRC-8 of all before the star; who gets such a line answers with one.
"""

from typing import Final, NamedTuple

FLAGS: Final = b"BF"
"""Of frames to send: fast bit rate, CAN-FD."""
_TABLE: Final = (0x00, 0x97, 0xB9, 0x2E, 0xE5, 0x72, 0x5C, 0xCB, 0x5D, 0xCA, 0xE4, 0x73, 0xB8, 0x2F, 0x01, 0x96)
"""CRC-8 with polynomial 0x97, half a byte at a time."""


class AdapterLineError(ValueError):
    """A line cannot be read; the message says what was wrong with it."""


class AdapterRefusal(AdapterLineError):
    """The adapter has not sent a frame; the message says what it said."""


class CanFrame(NamedTuple):
    """A frame of the CAN bus."""

    id: int
    data: bytes

    @property
    def source(self) -> int:
        """Who has sent it."""
        return self.id >> 8 & 0x7F

    @property
    def destination(self) -> int:
        """Whom it is for."""
        return self.id & 0x7F


def crc8(data: bytes) -> int:
    """Check sum of a line."""
    crc = 0
    for byte in data:
        crc = _TABLE[(crc >> 4 ^ byte >> 4) & 15] ^ crc << 4 & 0xFF
        crc = _TABLE[(crc >> 4 ^ byte) & 15] ^ crc << 4 & 0xFF
    return crc


def with_check_sum(line: bytes) -> bytes:
    """A line, without its end, and its check sum."""
    line += b" "
    return line + b"*%02X" % crc8(line)


def without_check_sum(line: bytes) -> tuple[bytes, bool]:
    """A line without its check sum, and whether there was one; raises ``AdapterLineError`` if it is wrong."""
    star = line.rfind(b"*")
    if star < 0 or star + 3 != len(line):
        return line, False
    try:
        said = int(line[star + 1 :], 16)
    except ValueError:
        return line, False
    if said != crc8(line[:star]):
        raise AdapterLineError(f"a line with a wrong check sum: {shown(line)}")
    return line[:star].rstrip(b" "), True


def send_line(frame: CanFrame) -> bytes:
    """The line that has a frame sent, without its end."""
    return b"can send %04x %s %s" % (frame.id, frame.data.hex().encode(), FLAGS)


def received_line(frame: CanFrame) -> bytes:
    """The line that tells of a received frame, without its end; for an emulated adapter."""
    return b"rcv %x %s E B F" % (frame.id, frame.data.hex().upper().encode())


def parse_frame(line: bytes, verb: bytes = b"rcv") -> CanFrame:
    """The frame of a line that begins with these words; raises ``AdapterLineError``."""
    words = line.removeprefix(verb).split()
    try:
        if not line.startswith(verb) or len(words) < 2:
            raise ValueError
        return CanFrame(int(words[0], 16), bytes.fromhex(words[1].decode("ascii")))
    except ValueError:
        raise AdapterLineError(f"a line that describes no frame: {shown(line)}") from None


def shown(line: bytes) -> str:
    """A line for people: short, and printable."""
    text = line[:60].decode("ascii", errors="backslashreplace")
    return f"'{text}…'" if len(line) > 60 else f"'{text}'"
