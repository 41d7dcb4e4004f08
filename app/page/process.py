"""The page's process: ``python -m app.page.process --fd N``, started by a game.

It is told what to serve by a line on stdin, once it has loaded; where none comes, it is not wanted any more. It ends
when the game does: at once where that said so, else when the controller falls silent: until then STOP works.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import os
import socket
import sys
import time
from pathlib import Path
from typing import Final

from app import UserError
from app.page.entrance import Entrance, open_entrance
from app.page.live.feed import Feed
from app.page.page_server import PageServer
from app.settings.defaults import PageSection
from hardware.frozen import Frozen

NICE: Final = 5
"""The page steps back behind game and controller [steps of the scheduler's niceness]."""
AWAITED: Final = 10.0
"""It does so after this in any case [s, wall]: by then devices have been opened, and an arm may move."""
GLANCE: Final = 0.1
"""[s, wall]"""
GONE: Final = "the game's program died without a message: 'touchmove resume' continues its game"


class Wishes(Frozen):
    """What is to be served."""

    records: Path
    """Folder of all recorded games."""
    settings: PageSection


def main() -> int:
    """Be the page's process; its exit status: 0 the game has ended, 2 the page cannot be opened."""
    parser = argparse.ArgumentParser(prog="app.page.process", description=__doc__)
    parser.add_argument("--fd", type=int, required=True, help="socket to the game's process")
    game = socket.socket(fileno=parser.parse_args().fd)
    told = sys.stdin.buffer.readline()
    if not told:
        return 0
    wishes = Wishes.model_validate_json(told)
    try:
        entrance = open_entrance(wishes.settings)
    except UserError as error:
        print(f"touchmove: {error}", file=sys.stderr)
        return 2
    gc.freeze()  # what was loaded stays
    asyncio.run(_serve(entrance, wishes.records, game))
    return 0


async def _serve(entrance: Entrance, records: Path, game: socket.socket) -> None:
    feed = await Feed.of(game)
    page = PageServer(entrance, records, feed.say)
    hearing, stepping = asyncio.create_task(_hear(feed, page)), asyncio.create_task(_step_back(page))
    hearing.add_done_callback(lambda _: page.stop())
    try:
        await page.serve(lambda: print(entrance.address, flush=True))
    finally:
        feed.close()
        for task in (hearing, stepping):
            task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await hearing


async def _step_back(page: PageServer) -> None:
    """Step back behind game and controller, once the first browser has loaded the page: somebody waits for that."""
    deadline = time.monotonic() + AWAITED
    while not page.hub.watchers and time.monotonic() < deadline:
        await asyncio.sleep(GLANCE)
    os.nice(NICE)


async def _hear(feed: Feed, page: PageServer) -> None:
    """Take the game's news until it is gone."""
    async for news, jpeg in feed.news():
        page.take(news, jpeg)
    if page.state.ended is None:
        page.state.end(GONE)
        page.people.ended = True
        await page.wait_for_rest()
    await page.end()


if __name__ == "__main__":
    sys.exit(main())
