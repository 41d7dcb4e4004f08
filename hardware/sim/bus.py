"""The servo bus of the simulated plant, as the controller process sees it."""

from __future__ import annotations

from pathlib import Path

from hardware.interfaces import BusLost, Command, Measurement
from hardware.sim import wire

SILENCE = 5.0
"""Without an answer for this long the world is lost [s, wall]."""


class SimServoBus:
    """``ServoBus`` over the world's socket. One controller at a time holds the drives."""

    def __init__(self, run_dir: Path, timeout: float = 30.0) -> None:
        """Connect; raises ``HardwareError`` when no world answers or another controller holds the drives."""
        self._link, answer = wire.connect(run_dir, "servo", timeout)
        self._link.settimeout(SILENCE)
        self._lockstep = bool(answer["lockstep"])
        self._period = float(answer["period"])

    @property
    def lockstep(self) -> bool:
        """Pace fast: plant time waits for the next exchange."""
        return self._lockstep

    @property
    def period(self) -> float:
        """Tick [s]."""
        return self._period

    def exchange(self, command: Command) -> Measurement:
        """See ``ServoBus.exchange``."""
        try:
            self._link.send(wire.pack_command(command))
            answer = (self._lockstep and wire.spin(self._link)) or self._link.recv(wire.MEASUREMENT.size)
        except OSError as error:
            raise BusLost(f"the simulated drives do not answer: {error or 'timed out'}") from error
        if not answer:
            raise BusLost("the simulated drives are gone: the world has ended")
        return wire.unpack_measurement(answer)

    def close(self) -> None:
        """Say goodbye; the world brakes the drives and, when nothing else keeps it, ends."""
        try:
            self._link.send(wire.GOODBYE)
        except OSError:
            pass  # the world is gone already: there is nobody left to tell
        self._link.close()
