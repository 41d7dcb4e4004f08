"""Threads that read devices end before the program does: a library must not call into an interpreter that is gone."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable


class Background:
    """A thread that runs until it is told to end, at the latest at the program's end.

    Args:
        name: of the thread.
        run: its work; must return soon after ``closing`` is set.

    Attributes:
        closing: set when it has to end.
    """

    def __init__(self, name: str, run: Callable[[], None]) -> None:
        self.closing = threading.Event()
        self._thread = threading.Thread(target=run, name=name, daemon=True)

    def start(self) -> None:
        """Begin."""
        atexit.register(self.end)
        self._thread.start()

    def end(self) -> None:
        """Wait until it has ended; a second call does nothing."""
        atexit.unregister(self.end)
        self.closing.set()
        if self._thread.is_alive():
            self._thread.join()
