"""CANopen over EtherCAT in a slave's mailbox: SDO uploads and downloads (ETG.1000.6, section 5.6).

Uploads are expedited up to four bytes and segmented where the mailbox is too small; downloads are expedited or normal,
in one message: no object here is longer than a mailbox.
"""

import struct
from typing import Final

from hardware.sim.emulated.ethercat.dictionary import Abort, Dictionary

_HEADER: Final = struct.Struct("<HHBB")
"""Of a mailbox: length, address, channel, type and counter."""
_SDO: Final = struct.Struct("<HBHB")
"""CoE header, command, index, subindex."""
_COE, _REQUEST, _RESPONSE = 3, 2 << 12, 3 << 12
_UPLOAD, _SEGMENT, _DOWNLOAD_EXPEDITED, _DOWNLOAD, _ABORT = 0x40, 0x60, 0x23, 0x21, 0x80
_UNKNOWN_COMMAND, _TOGGLE_NOT_ALTERNATED = 0x05040001, 0x05030000
_MAILBOX_ERROR: Final = b"\x04\x00\x00\x00\x00\x00\x01\x00\x02\x00"
"""Its protocol is not supported."""


class CoeServer:
    """Answers a slave's SDO requests, one after the other."""

    def __init__(self, dictionary: Dictionary, room: int) -> None:
        """``room``: size of a mailbox [bytes]."""
        self._dictionary = dictionary
        self._room = room
        self._rest = b""
        self._toggle = 0
        self._count = 0

    def answer(self, message: bytes) -> bytes:
        """The answer to a mailbox message, with its header."""
        length, _, _, kind = _HEADER.unpack_from(message)
        if kind & 0x0F != _COE or length < 10:
            return _MAILBOX_ERROR
        service, command, index, subindex = _SDO.unpack_from(message, _HEADER.size)
        data = message[_HEADER.size + _SDO.size : _HEADER.size + length]
        try:
            if service & 0xF000 != _REQUEST:
                raise Abort(_UNKNOWN_COMMAND)
            answer = self._serve(command, index, subindex, data)
        except Abort as error:
            answer = struct.pack("<BHBI", _ABORT, index, subindex, error.code)
        body = struct.pack("<H", _RESPONSE) + answer
        self._count = self._count % 7 + 1
        return _HEADER.pack(len(body), 0, 0, _COE | self._count << 4) + body

    def _serve(self, command: int, index: int, subindex: int, data: bytes) -> bytes:
        if command & 0xE0 == _UPLOAD and not command & 0x10:
            return self._upload(index, subindex)
        if command & 0xE0 == _SEGMENT:
            return self._segment(command)
        if command & 0x33 == _DOWNLOAD_EXPEDITED:
            return self._download(index, subindex, data[: 4 - (command >> 2 & 3)])
        if command & 0x33 == _DOWNLOAD:
            (size,) = struct.unpack_from("<I", data)
            return self._download(index, subindex, data[4 : 4 + size])
        raise Abort(_UNKNOWN_COMMAND)

    def _upload(self, index: int, subindex: int) -> bytes:
        value = self._dictionary.read(index, subindex)
        if len(value) <= 4:
            command = 0x43 | (4 - len(value)) << 2
            return struct.pack("<BHB", command, index, subindex) + value.ljust(4, b"\x00")
        first = self._room - _HEADER.size - 10
        self._rest, self._toggle = value[first:], 0
        return struct.pack("<BHBI", 0x41, index, subindex, len(value)) + value[:first]

    def _segment(self, command: int) -> bytes:
        if command & 0x10 != self._toggle:
            raise Abort(_TOGGLE_NOT_ALTERNATED)
        most = self._room - _HEADER.size - 3
        part, self._rest = self._rest[:most], self._rest[most:]
        unused = max(0, 7 - len(part))
        answer = bytes([self._toggle | unused << 1 | (not self._rest)]) + part.ljust(7, b"\x00")
        self._toggle ^= 0x10
        return answer

    def _download(self, index: int, subindex: int, value: bytes) -> bytes:
        self._dictionary.write(index, subindex, value)
        return struct.pack("<BHBI", 0x60, index, subindex, 0)
