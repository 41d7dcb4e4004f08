"""Keeps a page's process running beside a game, at one port, whatever becomes of it."""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, Self
from urllib.parse import urlsplit

from app.page.publisher import PagePublisher
from app.page.starting import StartedPage
from app.settings.defaults import PageSection

PATIENCE: Final = 3.0
"""Longer than this nobody waits for a page that is to end [s, wall]."""
TRIES: Final = 5
"""A page that ends so often within ``SOON`` is not started again: the game goes on without."""
SOON: Final = 30.0
"""[s, wall]"""
PAUSE: Final = 0.2
"""Before a page is started again [s, wall]."""


class PageSupervisor:
    """Starts the page's process, again where it dies. A context manager.

    Args:
        settings: host, port, password.
        publisher: tells the page what there is to see.
        records: folder with all recorded games.
        ready: told the address for the browser, once the page can be reached.
        say: told a sentence about a page that there is not.
        first: a process that has been started already; None: it is started now.
    """

    def __init__(
        self, settings: PageSection, publisher: PagePublisher, records: Path, ready: Callable[[str], None],
        say: Callable[[str], None], first: StartedPage | None = None,
    ) -> None:  # fmt: skip
        self._settings, self._publisher, self._records = settings, publisher, records
        self._ready, self._say = ready, say
        self._port = settings.port
        self._starting, self._over = threading.Lock(), threading.Event()
        self._reached = False
        """Somebody may look at the page: it has said where it is."""
        self._process = self._start(first or StartedPage())
        self._thread = threading.Thread(target=self._look_after, name="page supervisor", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Of the page's process, the newest that was started."""
        return self._process.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """The page ends by itself when its socket does; one that does not, or that still loads, is ended."""
        with self._starting:  # a page is started anew before this, or not at all: nobody would end it
            self._over.set()
        if not self._reached:  # as where a game is refused: whoever reads why need not wait for a page
            self._process.kill()
        self._publisher.disconnect()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join()

    def _start(self, started: StartedPage) -> subprocess.Popen[bytes]:
        started.serve(self._settings.model_copy(update={"port": self._port}).model_dump_json(), self._records)
        self._publisher.connect(started.end)
        return started.process

    def _look_after(self) -> None:
        deaths: list[float] = []
        told = False
        while True:
            assert self._process.stdout is not None
            with self._process.stdout as said:
                address = said.readline().decode().strip()
            self._reached = self._reached or bool(address)
            if address and not told and not self._over.is_set():  # nobody is invited to a game that ends
                told, self._port = True, urlsplit(address).port or self._port
                self._ready(self._settings.address or address)
            self._process.wait()
            if self._over.is_set():
                return
            now = time.monotonic()
            deaths = [*(then for then in deaths if now - then < SOON), now]
            if not told or len(deaths) >= TRIES:
                self._publisher.give_up()
                self._say("the page's process ended, see its messages above; the game continues without it")
                return
            self._over.wait(PAUSE)
            with self._starting:
                if self._over.is_set():
                    return
                self._process = self._start(StartedPage())
