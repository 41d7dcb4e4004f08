"""The servo bus of the simulated plant, as the controller process sees it."""

import contextlib
import socket
import struct
from pathlib import Path

from hardware.interfaces import BusLost, Command, DriveStatus, Measurement
from hardware.sim.clients import wire

SILENCE = 5.0
"""Without an answer for this long the world is lost [s, wall]."""
GONE = "the simulated drives are gone: the world has ended, or heard nothing from this controller for too long"


class SimServoBus:
    """``ServoBus`` over the world's socket. One controller at a time holds the drives."""

    def __init__(self, run_dir: Path, timeout: float = 30.0) -> None:
        """Connect; raises ``HardwareError`` when no world answers or another controller holds the drives."""
        self._link, answer = wire.connect(run_dir, "servo", timeout)
        # the kernel's time-out instead of Python's: with the latter every receive would begin by sleeping
        self._link.settimeout(None)
        self._link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", int(SILENCE), 0))
        self.lockstep = bool(answer["lockstep"])
        self.period = float(answer["period"])
        self._receiver = wire.Receiver(self._link)
        self._running = False

    def exchange(self, command: Command) -> Measurement:
        """See ``ServoBus.exchange``."""
        try:
            self._link.send(wire.pack_command(command))
            answer = (self._receiver.spin() if self._running else None) or self._link.recv(wire.LARGEST_MESSAGE)
        except BlockingIOError as error:
            raise BusLost(
                f"the simulated drives do not answer within {SILENCE:.0f} s: is the world stopped?"
            ) from error
        except OSError as error:
            raise BusLost(f"{GONE} ({error.strerror})") from error
        if not answer:
            raise BusLost(GONE)
        measurement = wire.unpack_measurement(answer)
        self._running = self.lockstep and not measurement.status & DriveStatus.STANDING
        return measurement

    def close(self) -> None:
        """Say goodbye; the world brakes the drives, comes to rest and ends."""
        with contextlib.suppress(OSError):  # the world is gone already: there is nobody left to tell
            self._link.send(wire.GOODBYE)
        self._link.close()
