"""What the side to move has used of its time: measured where it sits, and shown at both ends."""

from __future__ import annotations

from collections.abc import Callable


class Stopwatch:
    """Runs and stands; ``now`` is monotonic wall time [s]."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._used = 0.0
        self._since: float | None = None

    @property
    def running(self) -> bool:
        """Whether it runs."""
        return self._since is not None

    @property
    def used(self) -> float:
        """Since it was reset, while it ran [s]."""
        return self._used + (0.0 if self._since is None else max(0.0, self._now() - self._since))

    def run(self, running: bool) -> None:
        """Let it run, or stand."""
        self._used, self._since = self.used, self._now() if running else None

    def reset(self) -> None:
        """Begin anew, standing."""
        self._used, self._since = 0.0, None
