"""What cameras with a thread of their own share: the thread, and the newest of what it has read.

Threads that read devices end before the program does: a library must not call into an interpreter that is gone.
"""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from hardware.interfaces import HardwareError

_T = TypeVar("_T")


class Background:
    """A thread, by its name, that runs until it is told to end, at the latest at the program's end.

    ``run`` is its work and must return soon after ``closing`` is set, which says that it has to end.
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


class Newest(Generic[_T]):
    """The newest thing that a thread has read, or why there is none any more."""

    def __init__(self) -> None:
        self._news = threading.Condition()
        self._value: _T | None = None
        self._trouble: HardwareError | None = None

    def put(self, value: _T) -> None:
        """There is a newer one; all is well again."""
        with self._news:
            self._value, self._trouble = value, None
            self._news.notify_all()

    def fail(self, trouble: HardwareError) -> None:
        """There will be no more until there is a newer one."""
        with self._news:
            self._trouble = trouble
            self._news.notify_all()

    def get(self, patience: float = 0.0) -> _T | None:
        """The newest one, None if there was none yet; waits for the first one as long as ``patience`` [s, wall]. Raises
        what the thread has put in.
        """
        with self._news:
            self._news.wait_for(lambda: self._value is not None or self._trouble is not None, patience)
            if self._trouble is not None:
                raise self._trouble
            return self._value
