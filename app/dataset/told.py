"""The telemetry of a match as arrays: one row a tick that was told."""

from __future__ import annotations

import re
from array import array
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.dataset.signals import REFERENCE, STATE, Rows, state_row
from app.records.files import RecordError
from app.records.telemetry import TELEMETRY_FILE, read_telemetry

_BEFORE_STATE: Final = 2 + len(REFERENCE)
"""Columns beside the state while rows are gathered: tick, time, reference."""


@dataclass(frozen=True, slots=True)
class ToldTicks:
    """What the controller said of itself, tick by tick, in the order of time.

    Attributes:
        tick: shape (n,), rising.
        time: plant time, shape (n,) [s].
        state: rows of ``signals.STATE``, shape (n, 21).
        reference: rows of ``signals.REFERENCE``, shape (n, 3) [m].
    """

    tick: NDArray[np.int64]
    time: NDArray[np.float64]
    state: Rows
    reference: Rows

    def nearest(self, ticks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows whose ticks are nearest to ticks, shape (m,)."""
        after = np.clip(np.searchsorted(self.tick, ticks), 1, len(self.tick) - 1)
        before = after - 1
        return np.where(ticks - self.tick[before] <= self.tick[after] - ticks, before, after)


def telemetry_files(match: Path) -> tuple[Path, ...]:
    """Of a match: the first program's, then those of programs that went on."""
    stem = Path(TELEMETRY_FILE).stem
    numbered = re.compile(rf"{stem}(?:-(\d+))?\.mcap")
    found = ((numbered.fullmatch(path.name), path) for path in match.glob(f"{stem}*.mcap"))
    return tuple(path for _, path in sorted((int(name[1] or 1), path) for name, path in found if name))


def read_told(match: Path) -> ToldTicks:
    """All telemetry of a match; of a tick that was told more than once, what was said last.

    Raises:
        RecordError: there is none, or it cannot be read.
    """
    numbers = array("d")  # as small as they are in the end
    for path in telemetry_files(match):
        for time, told in read_telemetry(path):
            numbers.extend((told.tick, time, *told.reference, *state_row(told)))
    if not numbers:
        raise RecordError(
            f"{match} has no {TELEMETRY_FILE} with telemetry: what can be learned from is what an arm's controller told"
        )
    rows = np.frombuffer(numbers).reshape(-1, _BEFORE_STATE + len(STATE))
    order = np.argsort(rows[:, 0], kind="stable")
    rows = rows[order[np.append(np.diff(rows[order, 0]) > 0.0, True)]]
    return ToldTicks(
        tick=rows[:, 0].astype(np.int64), time=rows[:, 1], reference=rows[:, 2:_BEFORE_STATE],
        state=rows[:, _BEFORE_STATE:],
    )  # fmt: skip
