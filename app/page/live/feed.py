"""The page's end of the socket to the game: news in, what was said out."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from typing import Final, Self

from app.page.news import NEWS, AnyNews, AnySaid, PictureNews

LONGEST: Final = 1 << 20
"""Of a line [bytes]: a page of the same version reads every line that a game writes."""


class Feed:
    """News of the game, one after the other; ends with the socket."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Of streams that are open; use ``of``."""
        self._reader, self._writer = reader, writer

    @classmethod
    async def of(cls, end: socket.socket) -> Self:
        """Of a stream socket."""
        end.setblocking(False)
        return cls(*await asyncio.open_unix_connection(sock=end, limit=LONGEST))

    async def news(self) -> AsyncIterator[tuple[AnyNews, bytes]]:
        """All news until the game is gone, pictures with their JPEG."""
        while True:
            try:
                line = await self._reader.readuntil(b"\n")
                news = NEWS.validate_json(line)
                jpeg = await self._reader.readexactly(news.bytes) if isinstance(news, PictureNews) else b""
            except (asyncio.IncompleteReadError, ConnectionError):
                return
            yield news, jpeg

    def say(self, said: AnySaid) -> None:
        """Tell the game something; where it is gone nobody hears it."""
        if not self._writer.is_closing():
            self._writer.write(said.model_dump_json().encode() + b"\n")

    def close(self) -> None:
        """Let go of the socket."""
        self._writer.close()
