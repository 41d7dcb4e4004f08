"""The motion under way: its announcement and the ring of its samples, filled in any order, read in one.

Repeated, late or reordered samples change nothing: the first copy of each index counts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from controller.loop.memory import EXECUTED, FIRST, LENGTH, RECEIVED, TickMemory
from controller.protection.limits import Violation
from controller.protection.reference_check import COLUMNS, SampleCheck, rows_from_samples
from controller.protocol.messages import Announce, Samples


class MotionBuffer:
    """Samples of the announced motion; allocated once.

    Args:
        capacity: of the ring [samples].
        check: of samples.
        memory: where the counts are kept; by default one of its own.

    Attributes:
        announced: the motion, ``None`` when there is none.
        rows: the ring, shape (capacity, 19).
    """

    def __init__(self, capacity: int, check: SampleCheck, memory: TickMemory | None = None) -> None:
        self.announced: Announce | None = None
        self._block = (memory or TickMemory()).block
        self._capacity = capacity
        self._check = check
        # filled, not only reserved: the first touch of a page costs more than a sample
        self.rows = np.full((capacity, COLUMNS), np.nan)
        self._present = np.zeros(capacity, dtype=np.bool_)
        self._early = 0

    @property
    def received(self) -> int:
        """Contiguous samples received, all within their limits."""
        return int(self._block[RECEIVED])

    @received.setter
    def received(self, count: int) -> None:
        self._block[RECEIVED] = count

    @property
    def executed(self) -> int:
        """Samples executed."""
        return int(self._block[EXECUTED])

    @executed.setter
    def executed(self, count: int) -> None:
        self._block[EXECUTED] = count

    def announce(self, motion: Announce, reference: NDArray[np.float64]) -> None:
        """Start with an empty ring a motion that must begin at the reference, shape (3,) [m]."""
        self.announced = motion
        self._block[FIRST], self._block[LENGTH] = motion.first_tick, motion.length
        self._check.begin(reference)
        self.received = self.executed = self._early = 0
        self._present[:] = False

    def takes(self, samples: Samples) -> bool:
        """Whether samples are of the announced motion."""
        return self.announced is not None and samples.motion == self.announced.motion

    def clear(self) -> None:
        """No motion any more."""
        self.announced = None
        self._block[LENGTH] = 0.0

    def row(self, index: int) -> NDArray[np.float64]:
        """Sample ``index``, shape (19,); a view that lasts until it is overwritten ``capacity`` samples later."""
        row: NDArray[np.float64] = self.rows[index % self._capacity]
        return row

    def store(self, samples: Samples) -> Violation | None:
        """Take samples of the announced motion in; those beyond it or the ring are left for the sender to repeat.

        Returns:
            The first violation among the samples that became contiguous; they do not count as received.
        """
        motion = self.announced
        if motion is None:
            return None
        first = max(samples.start, self.received)
        # one place stays free, so that the row before the first new one is still there to be compared with
        end = min(samples.start + len(samples.rows), motion.length, self.executed + self._capacity - 1)
        if first >= end:
            return None
        rows = rows_from_samples(samples.rows[first - samples.start : end - samples.start])
        if first == self.received and not self._early:  # as nearly always
            trouble = self._verify(rows, first, end)
            if trouble is None:
                self._put(first, end, rows)
                self.received = end
            return trouble
        self._keep(first, rows)
        before = self.received
        if first > before:
            return None
        ready = self._contiguous(end)
        trouble = self._verify(self.rows[np.arange(before, ready) % self._capacity], before, ready)
        if trouble is None:
            self.received = ready
        return trouble

    def _put(self, first: int, end: int, rows: NDArray[np.float64]) -> None:
        """Write consecutive rows into the ring."""
        place = first % self._capacity
        if place + end - first <= self._capacity:
            self.rows[place : place + end - first] = rows
        else:
            self.rows[np.arange(first, end) % self._capacity] = rows

    def _keep(self, first: int, rows: NDArray[np.float64]) -> None:
        """Write rows of which some may have come before; the first copy of each counts."""
        places = np.arange(first, first + len(rows)) % self._capacity
        missing = ~self._present[places]
        places, rows = places[missing], rows[missing]
        self._present[places] = True
        self._early += len(places)
        self.rows[places] = rows

    def _contiguous(self, end: int) -> int:
        """How many samples are there without a gap, at least ``end``; forgets which of them came early."""
        if self._early:
            self._early -= self._forget(self.received, end)
            while self._early and self._present[end % self._capacity]:
                self._early -= self._forget(end, end + 1)
                end += 1
        return end

    def _forget(self, first: int, end: int) -> int:
        places = np.arange(first, end) % self._capacity
        count = int(np.count_nonzero(self._present[places]))
        self._present[places] = False
        return count

    def _verify(self, rows: NDArray[np.float64], first: int, end: int) -> Violation | None:
        """What is wrong with rows that now follow the contiguous ones."""
        previous = self.row(first - 1) if first else None
        trouble = self._check.rows(rows, previous)
        if trouble is None and first == 0:
            trouble = self._check.start(rows[0])
        if trouble is None and self.announced is not None and end == self.announced.length:
            trouble = self._check.end(rows[-1])
        return trouble
