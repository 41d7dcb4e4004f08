"""What else stands on a segment: a bus coupler, and an analog input terminal of two channels like an EL3102."""

from typing import Final

from hardware.sim.emulated.ethercat.dictionary import (
    INPUT_ASSIGNMENT,
    INPUT_MAPPING,
    OUTPUT_ASSIGNMENT,
    Dictionary,
    Entry,
)
from hardware.sim.emulated.ethercat.process_data import ProcessData
from hardware.sim.emulated.ethercat.sii import Identity

COUPLER: Final = Identity(0x0002, 0x044C2C52, 0x00120000, "EK1100")
TERMINAL: Final = Identity(0x0002, 0x0C1E3052, 0x00100000, "EL3102")
FULL_SCALE: Final = 10.0
"""At 0x7FFF [V]."""
_UNDERRANGE, _OVERRANGE, _ERROR = 0x01, 0x02, 0x40


class Coupler:
    """``Application`` of a coupler: it only passes frames on."""

    identity, dictionary = COUPLER, None

    def sizes(self) -> tuple[int, int]:
        """See ``Application``."""
        return 0, 0

    def start(self) -> None:
        """See ``Application``."""

    def take(self, outputs: bytes) -> None:
        """See ``Application``."""

    def give(self) -> bytes:
        """See ``Application``."""
        return b""

    def stop(self, *, watchdog: bool) -> None:
        """See ``Application``."""


class AnalogTerminal:
    """``Application`` of two channels of ±10 V; each gives a status of 16 bits and a value of 16.

    Attributes:
        volts: at the inputs, set by the plant.
    """

    def __init__(self) -> None:
        self.identity = TERMINAL
        self.volts = [0.0, 0.0]
        objects = self.dictionary = Dictionary()
        objects.add(0x1000, 0, Entry(32, 0x01291389))
        objects.add(0x1C00, 0, Entry(8, 4))
        for manager in range(4):
            objects.add(0x1C00, manager + 1, Entry(8, manager + 1))
        self._channels = []
        for channel, index in enumerate((0x6000, 0x6010)):
            objects.add(index, 0, Entry(8, 17))
            status, value = objects.add(index, 1, Entry(16)), objects.add(index, 17, Entry(16, signed=True))
            self._channels.append((status, value))
            objects.add_pdo(INPUT_MAPPING + 2 * channel, [(index, 1, 16), (index, 17, 16)], 2)
        objects.add_assignment(OUTPUT_ASSIGNMENT, [], 0)
        objects.add_assignment(INPUT_ASSIGNMENT, [INPUT_MAPPING, INPUT_MAPPING + 2], 2)
        self._data = ProcessData(objects)

    def sizes(self) -> tuple[int, int]:
        """See ``Application``."""
        return self._data.sizes()

    def start(self) -> None:
        """See ``Application``."""
        self._data.map()

    def take(self, outputs: bytes) -> None:
        """See ``Application``; it has none."""

    def give(self) -> bytes:
        """See ``Application``."""
        for volts, (status, value) in zip(self.volts, self._channels, strict=True):
            counts = round(volts / FULL_SCALE * 0x7FFF)
            over, under = counts > 0x7FFF, counts < -0x8000
            value.value = max(-0x8000, min(0x7FFF, counts))
            status.value = (
                (_OVERRANGE if over else 0) | (_UNDERRANGE if under else 0) | (_ERROR if over or under else 0)
            )
        return self._data.give()

    def stop(self, *, watchdog: bool) -> None:
        """See ``Application``."""
