"""What cameras with a thread of their own share: the thread, and the newest of what it has read.

Threads that read devices end before the program does: a library must not call into an interpreter that is gone.
"""

import atexit
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from hardware.interfaces import CameraClosed, HardwareError

_T = TypeVar("_T")


class DeviceReader(Generic[_T]):
    """A thread, by its name, and the newest of what it reads, until it is told to end, at the latest at the program's
    end.

    ``run`` is its work and must return soon after ``closing`` is set, which says that it has to end.
    """

    def __init__(self, name: str, run: Callable[[], None]) -> None:
        self.closing = threading.Event()
        self._thread = threading.Thread(target=run, name=name, daemon=True)
        self._news = threading.Condition()
        self._value: _T | None = None
        self._trouble: HardwareError | None = None

    def start(self, patience: float, silent: HardwareError) -> _T:
        """Begin, and wait for the first thing [s, wall]; where none comes the thread ends, and it is said why."""
        atexit.register(self.end)
        self._thread.start()
        with self._news:
            self._news.wait_for(lambda: self._value is not None or self._trouble is not None, patience)
            first, trouble = self._value, self._trouble
        if first is None or trouble is not None:
            self.end()
            raise trouble or silent
        return first

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

    def newest(self) -> _T:
        """The newest one; raises ``CameraClosed`` once this has ended, else the trouble that the thread is in."""
        with self._news:
            if self._value is None or self.closing.is_set():
                raise CameraClosed
            if self._trouble is not None:
                raise self._trouble.with_traceback(None)  # else it keeps all who were told before, and what they hold
            return self._value

    def end(self) -> None:
        """Wait until it has ended; a second call does nothing."""
        atexit.unregister(self.end)
        self.closing.set()
        if self._thread.is_alive():
            self._thread.join()
        self._value = None
