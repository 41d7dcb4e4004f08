"""Pictures of camera and film view: the newest, and as a stream that programs for streamers take (MJPEG)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from typing import Final

from app.page.live.people import People
from app.page.live.state import VIEWS, ShownPicture
from app.terminal.shown import View

BOUNDARY: Final = "touchmove-picture"
STREAM_TYPE: Final = f"multipart/x-mixed-replace; boundary={BOUNDARY}"
MOST_STREAMS: Final = 32
"""At once, of both views together."""


class Pictures:
    """The newest picture of each view, for whoever looks at it; who is slow misses some."""

    def __init__(self, newest: Mapping[View, ShownPicture], people: People) -> None:
        self._newest, self._people = newest, people
        self._news = {view: asyncio.Event() for view in VIEWS}
        self._open = True

    def newest(self, view: View) -> ShownPicture | None:
        """Of a view; None: there is none yet."""
        return self._newest.get(view)

    def came(self, view: View) -> None:
        """There is a new picture of a view."""
        event, self._news[view] = self._news[view], asyncio.Event()
        event.set()

    def close(self) -> None:
        """End all streams."""
        self._open = False
        for view in VIEWS:
            self.came(view)

    @property
    def full(self) -> bool:
        """No more streams are opened."""
        return self._people.streams.camera + self._people.streams.film >= MOST_STREAMS

    async def stream(self, view: View) -> AsyncIterator[bytes]:
        """Parts of an MJPEG stream."""
        streams = self._people.streams
        setattr(streams, view, getattr(streams, view) + 1)
        self._people.want()
        try:
            shown = 0
            while self._open:
                news = self._news[view]
                picture = self.newest(view)
                if picture is None or picture.number == shown:
                    await news.wait()
                    continue
                shown = picture.number
                head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(picture.jpeg)}\r\n\r\n"
                yield head.encode() + picture.jpeg + b"\r\n"
        finally:
            setattr(streams, view, getattr(streams, view) - 1)
            self._people.want()
