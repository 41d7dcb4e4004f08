"""What people type at the terminal, and what others say elsewhere, line by line."""

from __future__ import annotations

import io
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TextIO

from app.players.person import PersonGone

_NO_MORE: Final = None


class TypedLines:
    """``Lines`` of a stream, read in a thread of its own so that nobody is kept waiting, and of others who offer some.

    Args:
        stream: is read to its end; None: there is none, and others alone say something.
        heard: told each line when it is taken.
        company: whether somebody else may yet say something, so that the end of the stream is not the last word.
        remedy: for who ends the stream too early, what to do about it; None: there is nothing.
    """

    def __init__(
        self, stream: TextIO | None, heard: Callable[[str], None] = lambda _: None,
        company: Callable[[], bool] = lambda: False, remedy: str | None = None,
    ) -> None:  # fmt: skip
        self._heard, self._company, self._remedy = heard, company, remedy
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._putting = threading.Lock()
        self._ended = stream is None
        if stream is not None:
            threading.Thread(target=self._read, args=(stream,), name="typed lines", daemon=True).start()

    def next(self, timeout: float) -> str | None:
        """See ``Lines.next``; empty lines and what comes after ``#`` are left out: a script can be explained."""
        try:
            line = self._lines.get(timeout=0.0 if self._ended and not self._company() else timeout)
        except queue.Empty:
            line = None
        else:
            if line is not _NO_MORE:
                self._heard(line)
                return line
            self._ended = True
        if self._ended and self._lines.empty() and not self._company():
            raise PersonGone(self._remedy)
        return None

    def forget(self, word: str) -> None:
        """See ``Lines.forget``."""
        with self._putting, suppress(queue.Empty):
            for _ in range(self._lines.qsize()):
                line = self._lines.get_nowait()
                if line is _NO_MORE or line.lower() != word:
                    self._lines.put(line)

    @property
    def accompanied(self) -> bool:
        """See ``Lines.accompanied``."""
        return self._company()

    def offer(self, line: str) -> None:
        """Somebody else says something; from any thread."""
        if line := _meant(line):
            self._put(line)

    def _put(self, line: str | None) -> None:
        with self._putting:
            self._lines.put(line)

    def _read(self, stream: TextIO) -> None:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # what is no text is answered like any other nonsense
        with suppress(OSError):  # the terminal was closed, or its computer is gone: the same as the end of input
            for raw in stream:
                self.offer(raw)
        self._put(_NO_MORE)


def _meant(raw: str) -> str:
    return raw.split("#", 1)[0].strip()
