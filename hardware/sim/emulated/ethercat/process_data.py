"""A slave's process data: its mapped objects as packed bytes."""

import struct

from hardware.sim.emulated.ethercat.dictionary import INPUT_ASSIGNMENT, OUTPUT_ASSIGNMENT, Dictionary, Entry

Line = tuple[struct.Struct, list[Entry]]


class ProcessData:
    """Of an object dictionary, as its PDOs are mapped."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._outputs: Line = (struct.Struct("<"), [])
        self._inputs: Line = (struct.Struct("<"), [])
        self._sizes: tuple[int, int] | None = None

    def sizes(self) -> tuple[int, int]:
        """Of outputs and inputs [bytes]."""
        if self._sizes is not None and not self._dictionary.configurable():
            return self._sizes
        return self._mapped()

    def map(self) -> None:
        """Take over the mapping as it is now."""
        self._sizes = self._mapped()
        self._outputs, self._inputs = (_line(self._dictionary.process_data(which)) for which in _BOTH)

    def _mapped(self) -> tuple[int, int]:
        bits = [sum(size for _, size in self._dictionary.process_data(which)) for which in _BOTH]
        return bits[0] // 8, bits[1] // 8

    def take(self, outputs: bytes) -> None:
        """Set the objects that the master writes."""
        packed, entries = self._outputs
        for entry, value in zip(entries, packed.unpack(outputs), strict=True):
            entry.value = value

    def give(self) -> bytes:
        """The objects that the master reads."""
        packed, entries = self._inputs
        return packed.pack(*[entry.value for entry in entries])


_BOTH = (OUTPUT_ASSIGNMENT, INPUT_ASSIGNMENT)


def _line(mapped: list[tuple[Entry | None, int]]) -> Line:
    form = "".join(f"{bits // 8}x" if entry is None else entry.format for entry, bits in mapped)
    return struct.Struct("<" + form), [entry for entry, _ in mapped if entry is not None]
