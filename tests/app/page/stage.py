"""A page in this process before a game that a test moves as it likes: real publisher, record, server; no robot."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path
from types import TracebackType
from typing import Self

import chess

from app.page.address import Entrance, open_entrance
from app.page.live.feed import Feed
from app.page.page_server import PageServer
from app.settings.tree import PageSection
from tests.app.page.fake_game import FakeGame

QUICK = 1000.0
"""The fake game's motions and thinking take their time over so much."""


class Stage:
    """A fake game with its page; enter to begin.

    Args:
        folder: of the records.
        fen: of the position that the game begins with.
        stoppable: there is a controller, which does nothing but count.

    Attributes:
        game: its publisher says what the page shows; ``lines`` is what the page said.
        stops: so often somebody has pressed STOP.
        address: of the page.
    """

    def __init__(self, folder: Path, fen: str = chess.STARTING_FEN, *, stoppable: bool = True) -> None:
        self.game = FakeGame(folder / "game", QUICK, board=chess.Board(fen))
        self.stops = 0
        self._stoppable = stoppable
        self._folder = folder
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="stage", daemon=True)
        self._page: PageServer
        self._serving: Future[None]

    def __enter__(self) -> Self:
        entrance = open_entrance(PageSection(port=0))
        self.address = entrance.address
        ours, theirs = socket.socketpair()
        ready = threading.Event()
        self._thread.start()
        self._serving = asyncio.run_coroutine_threadsafe(self._serve(entrance, theirs, ready), self._loop)
        assert ready.wait(20.0)
        self.game.publisher.connect(ours)
        self.game.begin()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        asyncio.run_coroutine_threadsafe(self._page.end(), self._loop).result(10.0)
        self._serving.result(10.0)
        self.game.publisher.disconnect()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10.0)
        self._loop.close()

    async def _serve(self, entrance: Entrance, game: socket.socket, ready: threading.Event) -> None:
        feed = await Feed.of(game)
        page = self._page = PageServer(entrance, self._folder, feed.say)
        if self._stoppable:
            page.people.stop = self._stop
            page.people.show()
        hearing = asyncio.create_task(self._hear(feed, page))
        await page.serve(ready.set)
        hearing.cancel()
        feed.close()

    async def _hear(self, feed: Feed, page: PageServer) -> None:
        async for news, jpeg in feed.news():
            page.take(news, jpeg)

    async def _stop(self) -> str | None:
        self.stops += 1
        return None

    def put(self, **sections: object) -> None:
        """Say sections of the state as they are, past the game."""

        def put() -> None:
            for name, value in sections.items():
                self._page.hub.put(name, value)

        self._loop.call_soon_threadsafe(put)

    def telemetry(self, frame: Mapping[str, object]) -> None:
        """Say telemetry to who looks at it."""
        self._loop.call_soon_threadsafe(self._page.hub.telemetry, frame)
