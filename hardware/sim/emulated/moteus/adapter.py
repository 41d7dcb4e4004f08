"""An emulated fdcanusb: lines of a pseudo-terminal to frames of controllers, and their answers back."""

import contextlib
import os
import pty
import tty
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from hardware.drives.moteus.fdcanusb import (
    AdapterLineError,
    CanFrame,
    parse_frame,
    received_line,
    with_check_sum,
    without_check_sum,
)
from hardware.drives.moteus.frames import REPLY_WANTED, padded
from hardware.sim.emulated.moteus.controller import EmulatedController

_LONGEST: Final = 1 << 16


class EmulatedAdapter:
    """Answers who writes to ``path``, a symbolic link to the pseudo-terminal."""

    def __init__(self, path: Path, controllers: Mapping[int, EmulatedController]) -> None:
        """Open; a link that a program before has left is replaced."""
        self._controllers = controllers
        self.number, self._other = pty.openpty()  # the other end stays open, so that its user may come and go
        for end in (self.number, self._other):
            tty.setraw(end)
            os.set_blocking(end, False)
        self._path, self._rest = path, b""
        path.unlink(missing_ok=True)
        path.symlink_to(os.ttyname(self._other))

    def serve(self, now: float) -> set[int]:
        """Answer all that has come; ids of controllers that were given a command."""
        commanded: set[int] = set()
        try:
            data = os.read(self.number, _LONGEST)
        except BlockingIOError:
            return commanded
        *lines, self._rest = (self._rest + data).split(b"\n")
        answers = [answer for line in lines if line.strip() for answer in self._answer(line.strip(), now, commanded)]
        with contextlib.suppress(BlockingIOError):  # nobody reads: what does not fit is lost, as on a real adapter
            os.write(self.number, b"".join(answer + b"\r\n" for answer in answers))
        return commanded

    def close(self) -> None:
        """Take the port away."""
        for end in (self.number, self._other):
            os.close(end)
        self._path.unlink(missing_ok=True)

    def _answer(self, line: bytes, now: float, commanded: set[int]) -> list[bytes]:
        try:
            line, summed = without_check_sum(line)
        except AdapterLineError:
            return [b"ERR checksum error"]
        close = with_check_sum if summed else bytes
        try:
            frame = parse_frame(line, b"can send")
        except AdapterLineError:
            return [close(b"ERR unknown command")]
        answers = [close(b"OK")]
        for controller in self._meant(frame.destination):
            before = controller.commands
            answer = controller.take(frame.data, now)
            if controller.commands != before:
                commanded.add(controller.device)
            if frame.id & REPLY_WANTED and controller.injected.lost_replies > 0:
                controller.injected.lost_replies -= 1
            elif frame.id & REPLY_WANTED and answer:
                back = CanFrame(controller.device << 8 | frame.source, padded(answer))
                answers.append(self._damaged(controller, close(received_line(back))))
        return answers

    def _meant(self, destination: int) -> list[EmulatedController]:
        """One controller, or all: 0x7f is everybody's id."""
        if destination == 0x7F:
            return list(self._controllers.values())
        return [self._controllers[destination]] if destination in self._controllers else []

    @staticmethod
    def _damaged(controller: EmulatedController, line: bytes) -> bytes:
        if controller.injected.corrupt_replies <= 0:
            return line
        controller.injected.corrupt_replies -= 1
        middle = len(line) // 3
        return line[:middle] + b"?" + line[middle + 1 :]
