"""STOP goes straight to the controller, whatever else the page does."""

from __future__ import annotations

import asyncio
import threading

from app.page.live.hub import Hub
from app.page.live.people import People
from app.page.live.telemetry import TelemetryFeed
from tests.waiting import PATIENCE


class Watch:
    """A controller that stops at once."""

    def __init__(self) -> None:
        self.pressed = 0

    def stop(self, timeout: float) -> None:
        self.pressed += 1


def test_stop_does_not_wait_for_whatever_is_looked_up_in_records() -> None:
    async def press() -> tuple[str | None, int]:
        hub = Hub()
        feed, watch, over = TelemetryFeed(hub, People(hub, lambda _: None)), Watch(), threading.Event()
        feed._watch = watch  # type: ignore[assignment]
        busy = [asyncio.create_task(asyncio.to_thread(over.wait, PATIENCE)) for _ in range(64)]
        await asyncio.sleep(0)
        try:
            said = await asyncio.wait_for(feed.stop(), 0.5 * PATIENCE)
        finally:
            over.set()
            await asyncio.gather(*busy)
        return said, watch.pressed

    assert asyncio.run(press()) == (None, 1)
