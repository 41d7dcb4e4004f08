"""When emulated devices were asked, and had answered: what a measurement of a driver beside them has to leave out.

A real drive answers by itself; an emulated one needs a processor of the same computer, and time that is not the
driver's. So devices that are run for a measurement note both moments of each answer.
"""

from array import array
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

_FILE: Final = "answer_times.npy"
LONGEST: Final = 1 << 17
"""So many answers are kept, the first ones: two minutes of them."""


class AnswerTimes:
    """Of one bus; every page of its memory has been touched."""

    def __init__(self) -> None:
        self._times = array("d", [0.0]) * (2 * LONGEST)
        self._count = 0

    def note(self, asked: float, answered: float) -> None:
        """An answer: what it answers was read at one moment, and it was given at another (``time.monotonic``) [s]."""
        at = 2 * self._count
        if at < len(self._times):
            self._times[at], self._times[at + 1] = asked, answered
            self._count += 1

    def save(self, run_dir: Path) -> None:
        """Leave them in a run directory."""
        np.save(run_dir / _FILE, np.frombuffer(self._times).reshape(-1, 2)[: self._count])


def load_answer_times(run_dir: Path) -> NDArray[np.float64]:
    """What devices have left there: asked, answered, (n, 2) [s]."""
    times: NDArray[np.float64] = np.load(run_dir / _FILE)
    return times
