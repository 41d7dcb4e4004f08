"""A serial port with lines, without asyncio: one write and one wait for each exchange."""

import contextlib
import fcntl
import os
import select
import termios
import time
import tty
from pathlib import Path
from typing import Final

from hardware.interfaces import BusLost, HardwareError

_LONGEST_LINE: Final = 4096
"""More without an end is thrown away."""


class SerialPort:
    """An open port of bytes, read line by line. Nothing is sent or waited for behind the caller's back."""

    def __init__(self, path: Path) -> None:
        """Open; raises ``HardwareError`` if there is no such port."""
        self.path = path
        self._rest = b""
        self._closed = False
        try:
            self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise HardwareError(
                f"the serial port {path} cannot be opened ({error.strerror}): check that the adapter is plugged in, "
                "and that your account is in the group dialout"
            ) from error
        try:
            tty.setraw(self._file)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            termios.tcflush(self._file, termios.TCIOFLUSH)
        except (OSError, termios.error) as error:
            os.close(self._file)
            raise HardwareError(f"{path} is not a serial port, or another program uses it ({error})") from error

    def write(self, data: bytes) -> None:
        """Send; raises ``BusLost`` if the adapter is gone, or takes nothing for a second."""
        while data:
            try:
                data = data[os.write(self._file, data) :]
            except BlockingIOError:
                if not select.select((), (self._file,), (), 1.0)[1]:
                    raise BusLost(
                        f"the adapter at {self.path} accepts no more commands: unplug it and plug it in again"
                    ) from None
            except OSError as error:
                raise self._gone(error) from error

    def lines(self, until: float) -> list[bytes]:
        """Lines that have come, without their ends; waits for some until then (``time.monotonic``) [s].

        Raises ``BusLost`` if the adapter is gone.
        """
        left = until - time.monotonic()
        try:
            if not select.select((self._file,), (), (), max(0.0, left))[0]:
                return []
            data = os.read(self._file, 65536)
        except BlockingIOError:
            return []
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        if not data:
            raise self._gone(None)
        *whole, self._rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if len(self._rest) > _LONGEST_LINE:
            self._rest = b""
        return [line for line in whole if line]

    def drop(self) -> None:
        """Forget what has come too late."""
        while self.lines(0.0):
            pass
        self._rest = b""

    def close(self) -> None:
        """Release the port; a second call does nothing."""
        if not self._closed:
            self._closed = True
            with contextlib.suppress(OSError):  # unplugged
                os.close(self._file)

    def _gone(self, error: Exception | None) -> BusLost:
        why = f" ({error.strerror})" if isinstance(error, OSError) and error.strerror else ""
        return BusLost(f"the adapter at {self.path} is gone{why}: check its plug, then start the controller again")
