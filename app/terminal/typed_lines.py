"""Lines that a person types, or a script holds, on the standard input."""

from __future__ import annotations

import io
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TextIO

from app.players.person import PersonGone

_END: Final = None


class TypedLines:
    """``Lines`` of a stream, read in a thread of its own so that nobody is kept waiting.

    Args:
        stream: is read to its end.
        heard: told each line when it is taken.
    """

    def __init__(self, stream: TextIO, heard: Callable[[str], None] = lambda _: None) -> None:
        self._heard = heard
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._stream = stream
        self._thread = threading.Thread(target=self._read, name="typed lines", daemon=True)
        self._thread.start()

    def next(self, timeout: float) -> str | None:
        """See ``Lines.next``; empty lines and what comes after ``#`` are left out: a script can be explained."""
        try:
            line = self._lines.get(timeout=timeout)
        except queue.Empty:
            return None
        if line is _END:
            self._lines.put(_END)
            raise PersonGone
        self._heard(line)
        return line

    def _read(self) -> None:
        if isinstance(self._stream, io.TextIOWrapper):
            self._stream.reconfigure(errors="replace")  # what is no text is answered like any other nonsense
        with suppress(OSError):  # the terminal was closed, or its computer is gone: the same as the end of input
            for raw in self._stream:
                line = raw.split("#", 1)[0].strip()
                if line:
                    self._lines.put(line)
        self._lines.put(_END)
