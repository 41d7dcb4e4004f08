"""Talk with one controller at a time through the adapter: questions, answers, and its console. For start and tests.

The exchange of every tick has a way of its own, see ``hardware.drives.moteus.cycle``.
"""

import time
from typing import Final

from hardware.drives.moteus import frames
from hardware.drives.moteus.fdcanusb import (
    AdapterLineError,
    AdapterRefusal,
    CanFrame,
    parse_frame,
    send_line,
    shown,
    with_check_sum,
    without_check_sum,
)
from hardware.drives.moteus.frames import SubframeKind, address, padded
from hardware.drives.moteus.registers import Resolution, value_of
from hardware.drives.moteus.serial_port import SerialPort
from hardware.interfaces import HardwareError

PATIENCE: Final = 0.5
"""For an answer at the start; a controller answers within a millisecond, a busy computer hears it later [s]."""
TRIES: Final = 3
_TEXT: Final = 48
"""Bytes of console text in a frame."""


class Adapter:
    """An fdcanusb adapter at a serial port."""

    def __init__(self, port: SerialPort, *, check_sums: bool) -> None:
        self.port = port
        self._check_sums = check_sums

    def line(self, frame: CanFrame) -> bytes:
        """What has a frame sent, with its end."""
        line = send_line(frame)
        return (with_check_sum(line) if self._check_sums else line) + b"\n"

    def take(self, line: bytes) -> CanFrame | None:
        """The frame of a received line, None if it only acknowledges.

        Raises ``AdapterRefusal`` if the adapter has not sent a frame, ``AdapterLineError`` if the line cannot be read.
        """
        line, summed = without_check_sum(line.strip())
        if line.startswith(b"ERR"):  # without a check sum of its own where that of the command was wrong
            raise AdapterRefusal(f"a refusal of the adapter: {shown(line)}")
        if self._check_sums and not summed:
            raise AdapterLineError(f"a line without a check sum: {shown(line)}")
        if line == b"OK":
            return None
        return parse_frame(line)

    def tell(self, device: int, data: bytes) -> None:
        """Send a frame that nobody answers."""
        self.port.write(self.line(CanFrame(address(device, reply=False), padded(data))))

    def ask(self, device: int, data: bytes, patience: float = PATIENCE) -> bytes:
        """Send a frame, and wait for the controller's answer; asked again where a line is damaged.

        Raises ``HardwareError`` if there is none.
        """
        wrong = ""
        for _ in range(TRIES):
            self.port.drop()
            self.port.write(self.line(CanFrame(address(device), padded(data))))
            until = time.monotonic() + patience / TRIES
            while time.monotonic() < until:
                for line in self.port.lines(until):
                    try:
                        frame = self.take(line)
                    except AdapterLineError as error:
                        wrong = f" (there was {error})"
                        continue
                    if frame is not None and frame.source == device:
                        return frame.data
        raise HardwareError(
            f"no controller with id {device} answers at {self.port.path}{wrong}: check its power, the CAN cable, and "
            "its id with 'moteus_tool --info'"
        )

    def register(self, device: int, register: int, resolution: Resolution = Resolution.INT32) -> float:
        """Read one register; raises ``HardwareError`` if the controller does not answer, or has none of that number."""
        data = self.ask(device, frames.read(resolution, register))
        for part in frames.parse(data):
            if part.part is SubframeKind.REPLY and part.register == register:
                return value_of(register, part.resolution, part.value)
        raise HardwareError(f"controller {device} has no register 0x{register:03x}: update its firmware")

    def command(self, device: int, text: str, *, lines: int = 1) -> str:
        """Say a line to a controller's console; its answer, the first line alone.

        Raises ``HardwareError`` if it does not answer, or says that something is wrong.
        """
        data = text.encode() + b"\n"
        for at in range(0, len(data), _TEXT):
            self.tell(device, frames.text_in(data[at : at + _TEXT]))
        heard, until = b"", time.monotonic() + 2.0 * PATIENCE
        while heard.count(b"\n") < lines and time.monotonic() < until:
            heard += b"".join(part.text for part in frames.parse(self.ask(device, frames.poll(_TEXT))))
            heard = heard.replace(b"\r", b"\n").replace(b"\n\n", b"\n").lstrip(b"\n")
        answer = heard.partition(b"\n")[0].decode("latin-1").strip()
        if not answer or answer.startswith("ERR"):
            raise HardwareError(f"controller {device} answers '{answer}' to '{text}': update its firmware")
        return answer

    def configured(self, device: int, name: str) -> float:
        """A value of the controller's configuration."""
        answer = self.command(device, f"conf get {name}")
        try:
            return float(answer)
        except ValueError:
            raise HardwareError(f"controller {device} says {name} is '{answer}', which is not a number") from None

    def configure(self, device: int, name: str, value: float) -> None:
        """Set a value of the controller's configuration, until its power fails, and read it back.

        Raises ``HardwareError`` if it has another value afterwards.
        """
        self.command(device, f"conf set {name} {value:.7g}")
        now = self.configured(device, name)
        if abs(now - value) > 1e-4 * max(1.0, abs(value)):
            raise HardwareError(
                f"controller {device} has {name} {now:g} after it was set to {value:g}: update its firmware"
            )
