"""Keeps one engine running: starts it, configures it, and starts it again when it failed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final, TypeVar

from engine.errors import EngineFailed, EngineRefused, Hung, Misbehaved
from engine.options import configuration
from engine.process import UciProcess
from engine.settings import EngineSettings

T = TypeVar("T")

PAUSES: Final = (0.0, 0.2, 1.0)
"""Before each further attempt at one question [s]: what is wrong with the machine may pass."""
MOST_HANGS: Final = 2
"""Attempts at one question that may end by a deadline: each costs its whole time."""


class EngineSupervisor:
    """One engine, closed at first. One thread at a time may ask, any thread, and any may close it."""

    def __init__(self, settings: EngineSettings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._path: str | None = None
        self._process: UciProcess | None = None

    @property
    def process(self) -> UciProcess | None:
        """The process; None while there is none."""
        return self._process

    def open(self, path: str) -> None:
        """Start the engine, so that what is wrong shows here.

        Raises:
            EngineRefused: it does not offer a setting, or not that value.
            EngineFailed: it could not be started, several times.
        """
        self._path = path
        self.ask("starting", lambda process: None)

    def close(self) -> None:
        """End the process at once, also while another thread asks. Harmless when already done."""
        with self._lock:
            self._path = None
        self.drop()

    def ask(self, doing: str, ask: Callable[[UciProcess], T]) -> tuple[T, tuple[str, ...]]:
        """Ask, and after a failure ask a fresh process once more, several times.

        ``doing`` is for the sentence, such as "choosing a move"; ``ask`` is one attempt, which raises ``Misbehaved``.

        Returns:
            The answer, and what went wrong on the way, a phrase each.

        Raises:
            EngineRefused: it is closed; or as ``ask``.
            EngineFailed: every attempt failed.
        """
        reasons, hangs = list[str](), 0
        while True:
            try:
                return ask(self.running()), tuple(reasons)
            except Misbehaved as error:
                self.drop()
                reasons.append(str(error))
                hangs += isinstance(error, Hung)
            if hangs >= MOST_HANGS or len(reasons) > len(PAUSES):
                path = self._path
                if path is None:
                    raise EngineRefused("the engine was closed while it was asked")
                raise EngineFailed(path, doing, reasons)
            time.sleep(PAUSES[len(reasons) - 1])

    def running(self) -> UciProcess:
        """The process, started if there is none.

        Raises:
            EngineRefused: it is closed, or does not offer what is to be set.
            Misbehaved: it could not be started.
        """
        path, process = self._path, self._process
        if path is None:
            raise EngineRefused("the engine is not open: open it before asking")
        if process is not None:
            return process
        process = self._start(path)
        with self._lock:
            if self._path is not None:
                self._process = process
                return process
        process.kill()  # closed meanwhile
        raise EngineRefused("the engine was closed while it was started")

    def _start(self, path: str) -> UciProcess:
        process = UciProcess(path, self._settings.start_deadline)
        try:
            options = configuration(self._settings, process.uci)
            process.call(lambda uci: uci.configure(options), self._settings.start_deadline)
            process.call(lambda uci: uci.ping(), self._settings.start_deadline)
        except BaseException:
            process.kill()
            raise
        return process

    def drop(self) -> None:
        """End the process; the next question starts another one."""
        with self._lock:
            process, self._process = self._process, None
        if process:
            process.kill()
