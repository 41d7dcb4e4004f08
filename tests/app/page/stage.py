"""A page in this process before a game that a test moves as it likes: real publisher, record, server; no robot."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import chess

from app.page.entrance import Entrance, open_entrance
from app.page.live.feed import Feed
from app.page.live.hub import Hub, Watcher
from app.page.live.people import People
from app.page.live.telemetry import PERIOD, TelemetryFeed
from app.page.page_server import PageServer
from app.settings.defaults import PageSection
from tests.app.page.fake_game import FakeGame
from tests.waiting import PATIENCE, until

QUICK = 1000.0
"""The fake game's motions and thinking take their time over so much."""


class _Stoppable(TelemetryFeed):
    """Of a controller that only counts how often it is stopped, and says that it stands."""

    def __init__(self, hub: Hub, people: People, stage: Stage) -> None:
        super().__init__(hub, people)
        self._stage = stage
        people.stop = self.stop
        people.show()

    async def stop(self) -> str | None:
        self._stage.stops += 1
        self._stage.stopped = True
        return None

    async def run(self) -> None:
        while True:
            await asyncio.sleep(PERIOD)
            self._stage.page.hub.telemetry({"stopped": self._stage.stopped})


class Stage:
    """A fake game with its page; enter to begin.

    Args:
        folder: of the records.
        fen: of the position that the game begins with.
        stoppable: there is a controller, which does nothing but count.

    Attributes:
        game: its publisher says what the page shows; ``lines`` is what the page said.
        stops: so often somebody has pressed STOP.
        stopped: the arm stands; the test says when it goes on.
        page: the page.
        address: of the page.
    """

    def __init__(self, folder: Path, fen: str = chess.STARTING_FEN, *, stoppable: bool = True) -> None:
        self.game = FakeGame(folder / "game", QUICK, board=chess.Board(fen))
        self.stops = 0
        self.stopped = False
        self._stoppable = stoppable
        self._folder = folder
        self.page: PageServer
        self._loop: asyncio.AbstractEventLoop
        self._thread: threading.Thread

    def __enter__(self) -> Self:
        entrance = open_entrance(PageSection(port=0))
        self.address = entrance.address
        ours, theirs = socket.socketpair()
        ready = threading.Event()
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._serve(entrance, theirs, ready)), name="stage", daemon=True
        )
        self._thread.start()
        assert ready.wait(PATIENCE)
        self.game.publisher.connect(ours)
        self.game.begin()
        until(lambda: self._told("look"))  # the last thing it says: what a test says from here on is not overwritten
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._loop.call_soon_threadsafe(self.page.stop)
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive(), "the page ends, and everything that it still made"
        self.game.publisher.disconnect()

    async def _serve(self, entrance: Entrance, game: socket.socket, ready: threading.Event) -> None:
        self._loop = asyncio.get_running_loop()
        feed = await Feed.of(game)
        page = self.page = PageServer(entrance, self._folder, feed.say)
        if self._stoppable:
            page.telemetry = _Stoppable(page.hub, page.people, self)
        hearing = asyncio.create_task(self._hear(feed, page))
        await page.serve(ready.set)
        hearing.cancel()
        feed.close()

    async def _hear(self, feed: Feed, page: PageServer) -> None:
        async for news, jpeg in feed.news():
            page.take(news, jpeg)

    def _told(self, name: str) -> Any:
        """A section as somebody who comes now is told it."""
        return json.loads(self.page.hub._sections[name].text(Watcher(0, {})))

    def put(self, **sections: object) -> None:
        """Say sections of the state as they are, past the game."""

        def put() -> None:
            for name, value in sections.items():
                self.page.hub.put(name, value)

        self._loop.call_soon_threadsafe(put)

    def game_section(self, plies: int) -> dict[str, Any]:
        """The section ``game`` as somebody who watches is told it, once so many plies count."""

        def section() -> dict[str, Any] | None:
            game: dict[str, Any] | None = self._told("game")
            return game if game is not None and len(game["moves"]) == plies else None

        found = until(section)
        assert found is not None
        return found
