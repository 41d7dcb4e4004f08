"""The state in sections, and those who watch it: each gets every section's newest, a slow one less often.

Nothing queues up for anybody: of a section and of telemetry the newest alone waits for a watcher who has not read yet.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

SECTIONS: Final = (
    "session", "game", "clock", "remote", "prompt", "log", "phase", "look", "pictures", "path", "devices", "controls",
)  # fmt: skip
"""Of the state, in the order in which they are told."""


class Section:
    """A part of the state, encoded once for all, and only if somebody is there to be told.

    Args:
        make: what it says now.
        each: it is made for everybody by itself and whenever it is sent.
    """

    def __init__(self, make: Callable[[Watcher], object], *, each: bool = False) -> None:
        self._make, self._each = make, each
        self._text: str | None = None

    def text(self, watcher: Watcher) -> str:
        """JSON for somebody."""
        if self._text is None or self._each:
            self._text = encoded(self._make(watcher))
        return self._text


class Watcher:
    """A browser that is connected, known by a number."""

    def __init__(self, number: int, sections: Mapping[str, Section]) -> None:
        self.number = number
        self.watches: frozenset[str] = frozenset()
        """What it looks at: some of telemetry, camera, film."""
        self._sections = sections
        self._changed: set[str] = set(SECTIONS)
        self._telemetry: str | None = None
        self._refusals: list[str] = []
        self._news = asyncio.Event()
        self._news.set()

    def changed(self, names: Iterable[str]) -> None:
        """Some sections are new."""
        self._changed.update(names)
        self._news.set()

    def telemetry(self, frame: str) -> None:
        """New telemetry; what has not been sent of it before is lost."""
        if "telemetry" in self.watches:
            self._telemetry = frame
            self._news.set()

    def refuse(self, sentence: str) -> None:
        """What it sent is not done, and why; of many such only the last few are told."""
        self._refusals = [*self._refusals[-_REFUSALS:], encoded({"type": "refused", "text": sentence})]
        self._news.set()

    async def frames(self) -> list[str]:
        """What is to be sent, once there is something; the first time the whole state."""
        await self._news.wait()
        self._news.clear()
        frames = []
        if self._changed:
            names = [name for name in SECTIONS if name in self._changed]
            self._changed.clear()
            parts = ",".join(f'"{name}":{self._sections[name].text(self)}' for name in names)
            frames.append(f'{{"type":"state","changes":{{{parts}}}}}')
        frames += self._refusals
        self._refusals = []
        if self._telemetry is not None:
            frames.append(self._telemetry)
            self._telemetry = None
        return frames


_REFUSALS: Final = 7
"""Refusals that may wait for a browser, less one."""


class Hub:
    """Sections by name, each encoded once for all who watch."""

    def __init__(self) -> None:
        self._sections = {name: Section(lambda _: None) for name in SECTIONS}
        self._watchers: dict[int, Watcher] = {}

    @property
    def watchers(self) -> tuple[Watcher, ...]:
        """Who is connected."""
        return tuple(self._watchers.values())

    def put(self, name: str, value: object) -> None:
        """A section is new: the same for everybody."""
        self._put(name, Section(lambda _: value))

    def put_made(self, name: str, make: Callable[[], object]) -> None:
        """A section is new, and made once where somebody is told it."""
        self._put(name, Section(lambda _: make()))

    def put_each(self, name: str, make: Callable[[Watcher], object]) -> None:
        """A section is new, and made for each watcher whenever it is sent."""
        self._put(name, Section(make, each=True))

    def _put(self, name: str, section: Section) -> None:
        if name not in self._sections:
            raise ValueError(f"there is no section '{name}': {', '.join(SECTIONS)} are")
        self._sections[name] = section
        for watcher in self.watchers:
            watcher.changed((name,))

    def join(self, number: int) -> Watcher:
        """A browser comes; it is told everything.

        Raises:
            ValueError: somebody has that number.
        """
        if number in self._watchers:
            raise ValueError(f"watcher {number} is there already")
        watcher = self._watchers[number] = Watcher(number, self._sections)
        return watcher

    def leave(self, watcher: Watcher) -> bool:
        """A browser has gone; false: it had gone before."""
        here = self._watchers.get(watcher.number) is watcher
        if here:
            del self._watchers[watcher.number]
        return here

    def watched(self, what: str) -> bool:
        """Whether somebody looks at telemetry, camera or film."""
        return any(what in watcher.watches for watcher in self.watchers)

    def telemetry(self, message: Mapping[str, Any]) -> None:
        """Tell telemetry to those who look at it."""
        frame = encoded({"type": "telemetry", **message})
        for watcher in self.watchers:
            watcher.telemetry(frame)


def encoded(value: object) -> str:
    """JSON, as short as it can be; numbers are finite."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
