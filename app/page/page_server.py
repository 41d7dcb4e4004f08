"""The page as a whole: its state, those who are there, its pictures and records, served on a socket."""

from __future__ import annotations

import asyncio
import os
import threading
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Final

import uvicorn

from app.page.entrance import Entrance, open_entrance
from app.page.live.controls import GRACE
from app.page.live.hub import Hub
from app.page.live.people import People
from app.page.live.state import PageState
from app.page.live.telemetry import TelemetryFeed
from app.page.news import AnyNews, AnySaid, EndNews, PictureNews, SessionNews
from app.page.recorded.catalogue import Catalogue
from app.page.recorded.shower import RecordShower
from app.page.web.connections import HttpConnection, WebSocketConnection
from app.page.web.pictures import Pictures
from app.page.web.server import Site, site_app
from app.records.files import RecordError
from app.settings.defaults import PageSection

FOLLOW: Final = 0.1
"""A record that grows is looked at so often [s, wall]."""
FAREWELL: Final = 0.5
"""Browsers have so long to take the last news [s, wall]."""
LONGEST_HEAD: Final = 1 << 14
"""Of a request [bytes]."""
LARGEST_FRAME: Final = 1 << 12
"""Of what a browser sends [bytes]."""
PING: Final = 10.0
"""A browser that does not answer for so long is gone [s, wall]."""
KEEP_ALIVE: Final = 5
"""A connection waits so long for a further request [s, wall]."""


class PageServer:
    """A page that is being served.

    Args:
        entrance: where it listens.
        records: folders with recorded games.
        tell: says something to the game.
    """

    def __init__(self, entrance: Entrance, records: Path, tell: Callable[[AnySaid], None] = lambda _: None) -> None:
        self.catalogue = Catalogue(records)
        self.hub = Hub()
        self.state = PageState(self.hub, self.catalogue.id_of)
        self.people = People(self.hub, tell, lambda: self.state.session_id)
        self.telemetry = TelemetryFeed(self.hub, self.people)
        self.pictures = Pictures(self.state.pictures, self.people)
        self._entrance = entrance
        site = Site(
            self.people, self.state, self.pictures, self.catalogue, RecordShower(), entrance.sign_in
        )  # fmt: skip
        self._server = uvicorn.Server(
            uvicorn.Config(
                site_app(site, entrance.names), http=HttpConnection, ws=WebSocketConnection, lifespan="off",
                log_config=None, log_level="error", access_log=False, server_header=False, proxy_headers=False,
                ws_max_size=LARGEST_FRAME, ws_ping_interval=PING, ws_ping_timeout=PING, ws_per_message_deflate=False,
                h11_max_incomplete_event_size=LONGEST_HEAD, timeout_keep_alive=KEEP_ALIVE,
                timeout_graceful_shutdown=1,
            )
        )  # fmt: skip

    async def serve(self, ready: Callable[[], None]) -> None:
        """Serve until ``end``, or SIGTERM or SIGINT; ``ready`` is told once the page can be reached."""
        serving = asyncio.create_task(self._server.serve([self._entrance.socket]))
        background = [asyncio.create_task(self._follow()), asyncio.create_task(self.telemetry.run())]
        for task in background:
            task.add_done_callback(
                lambda _: self.stop()
            )  # what fails there takes the page down, which is started again
        while not self._server.started and not serving.done():
            await asyncio.sleep(0.005)
        if self._server.started:
            ready()
        try:
            await serving
            # whose request was cut off may have a process to end; the loop would cut that off, too
            await asyncio.gather(*self._server.server_state.tasks, return_exceptions=True)
        finally:
            self.telemetry.close()
            for task in background:
                task.cancel()
            ends = await asyncio.gather(*background, return_exceptions=True)
        for end in ends:
            if isinstance(end, Exception):
                raise end

    def stop(self) -> None:
        """Stop serving, at once."""
        self.pictures.close()
        self._server.should_exit = True

    async def wait_for_rest(self) -> None:
        """Wait while somebody here could still stop the arm."""
        lonely = 0.0
        while not self.telemetry.at_rest and lonely < GRACE:
            await asyncio.sleep(FOLLOW)
            lonely = 0.0 if self.hub.watchers else lonely + FOLLOW

    async def end(self) -> None:
        """Let browsers take the last news, and stop serving."""
        await asyncio.sleep(FAREWELL)
        self.stop()

    def take(self, news: AnyNews, jpeg: bytes) -> None:
        """Something new from the game."""
        self.state.take(news, jpeg)
        if isinstance(news, PictureNews):
            self.pictures.came(news.view)
        elif isinstance(news, SessionNews):
            self.catalogue.add(Path(news.folder))
            self.telemetry.listen(news.controller, news.tick)
            self.people.session_came()
        elif isinstance(news, EndNews):
            self.people.ended = True

    async def _follow(self) -> None:
        while True:
            await asyncio.sleep(FOLLOW)
            self.state.follow()
            if self._server.should_exit:  # by a signal: who looks at a stream would keep it open
                self.pictures.close()


async def show_records(settings: PageSection, folder: Path, ready: Callable[[str], None]) -> None:
    """Show the recorded games in a folder until SIGINT or SIGTERM; ``ready`` is told the address.

    Raises:
        UserError: there are none, or the page cannot be opened.
    """
    folder = folder.resolve()
    places = Catalogue(folder).places()
    if not places:
        raise RecordError(f"there is no recorded game in {folder}: name the folder of one, or of many")
    entrance = open_entrance(settings)
    page = PageServer(entrance, folder)
    page.state.show_record(next((place for place in places.values() if place.folder == folder), None))
    await page.serve(lambda: ready(settings.address or entrance.address))


def open_in_browser(address: str) -> None:
    """Open the browser where somebody sees it; does not wait for it."""
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        threading.Thread(target=webbrowser.open, args=(address,), name="browser", daemon=True).start()
