"""Frames that come again and again, read and answered at once: only the values in them change.

A driver sends the same frame a thousand times a second with another torque in it. Taking each apart part by part would
make the emulated controllers slower than the bus they stand for.
"""

import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

from hardware.drives.moteus import frames
from hardware.drives.moteus.frames import Subframe, SubframeKind
from hardware.drives.moteus.registers import Resolution, raw_of, value_of

_CODES = "bhif"
Values = Callable[[int], float | None]
"""What a register says; None: there is no such one."""


class FramePlan(NamedTuple):
    """A frame of writes and reads, for all frames that differ from it in values alone."""

    constant: tuple[tuple[int, bytes], ...]
    """What a frame has to have where."""
    size: int
    written: struct.Struct
    registers: tuple[tuple[int, Resolution], ...]
    """Written, in their order."""
    asked: tuple[tuple[int, Resolution], ...]
    answer: struct.Struct
    heads: tuple[bytes, ...]
    """Of the answer's subframes: one before each run of registers."""
    runs: tuple[int, ...]
    """Where among the registers asked for the runs begin."""

    def fits(self, data: bytes) -> bool:
        """Whether a frame differs from this one in values alone."""
        return len(data) == self.size and all(data.startswith(part, at) for at, part in self.constant)

    def values(self, data: bytes) -> list[tuple[int, float]]:
        """Registers and what is written into them."""
        raw = self.written.unpack_from(data)
        return [
            (register, one if resolution is Resolution.FLOAT else value_of(register, resolution, one))
            for (register, resolution), one in zip(self.registers, raw, strict=True)
        ]

    def reply(self, values: Values) -> bytes | None:
        """The answer; None: one of the registers does not exist."""
        parts: list[float | bytes] = []
        heads = iter(self.heads)
        for number, (register, resolution) in enumerate(self.asked):
            value = values(register)
            if value is None:
                return None
            if number in self.runs:
                parts.append(next(heads))
            parts.append(value if resolution is Resolution.FLOAT else raw_of(register, resolution, value))
        return self.answer.pack(*parts)


def plan_of(data: bytes, parts: Sequence[Subframe]) -> FramePlan | None:
    """The plan of a frame whose parts are these; None: it holds something else than writes and reads."""
    if any(part.part not in (SubframeKind.WRITE, SubframeKind.READ) for part in parts):
        return None
    constant, code, at = list[tuple[int, bytes]](), "<", 0
    writes = [part for part in parts if part.part is SubframeKind.WRITE]
    for run in runs_of(writes):
        body = frames.write(run[0].resolution, run[0].register, [part.value for part in run])
        head = body[: len(body) - struct.calcsize(f"<{len(run)}{_CODES[run[0].resolution]}")]
        if not data.startswith(body, at):
            return None  # written in another order, or another way
        constant.append((at, head))
        code += f"{len(head)}x{len(run)}{_CODES[run[0].resolution]}"
        at += len(body)
    constant.append((at, data[at:]))
    reads = [part for part in parts if part.part is SubframeKind.READ]
    answer, heads, starts, count = "<", list[bytes](), list[int](), 0
    for run in runs_of(reads):
        whole = frames.reply(run[0].resolution, run[0].register, [0.0] * len(run))
        size = struct.calcsize(f"<{len(run)}{_CODES[run[0].resolution]}")
        starts.append(count)
        heads.append(whole[: len(whole) - size])
        answer += f"{len(heads[-1])}s{len(run)}{_CODES[run[0].resolution]}"
        count += len(run)
    return FramePlan(
        tuple(constant), len(data), struct.Struct(code), tuple((one.register, one.resolution) for one in writes),
        tuple((one.register, one.resolution) for one in reads), struct.Struct(answer), tuple(heads), tuple(starts),
    )  # fmt: skip


def runs_of(parts: Sequence[Subframe]) -> list[list[Subframe]]:
    """Registers that follow each other, with one resolution."""
    runs: list[list[Subframe]] = []
    for part in parts:
        if runs and (part.register, part.resolution) == (runs[-1][-1].register + 1, runs[-1][-1].resolution):
            runs[-1].append(part)
        else:
            runs.append([part])
    return runs
