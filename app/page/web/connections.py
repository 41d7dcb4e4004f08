"""Connections that strangers cannot wear out: uvicorn's protocols with limits to time, number and what may wait.

uvicorn bounds a request's head and a message's size. What it leaves open is closed here: who sends a request slowly or
never, who does not read what was sent, who opens many connections, who sends a message in endless empty parts, and who
pings without reading.
"""

from __future__ import annotations

import asyncio
from typing import Any, Final, cast

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

REQUEST: Final = 10.0
"""A request is whole within so long of its connection, or of the answer before it [s, wall]."""
UNREAD: Final = 20.0
"""Who takes nothing of what is sent for so long is let go of [s, wall]."""
MOST: Final = 200
"""Connections at once; one more takes the place of the oldest that waits for a request."""
PARTS: Final = 64
"""Of one message."""

BAD_REQUEST: Final = b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\nContent-Length: 0\r\n\r\n"
INVALID_DATA, TOO_MANY_PARTS = 1007, 1009
"""Why a WebSocket is closed (RFC 6455)."""


class UnreadTimer:
    """Ends a connection whose other side does not read."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport
        self._timer: asyncio.TimerHandle | None = None

    def paused(self) -> None:
        """More waits to be read than should."""
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(UNREAD, self._transport.abort)

    def resumed(self) -> None:
        """It was read, or the connection is gone."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class EndsWithoutReader(asyncio.Protocol):
    """Before a protocol of uvicorn's in the order of bases: who does not read is let go of."""

    _unread: UnreadTimer

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See ``asyncio.BaseProtocol``."""
        super().connection_made(transport)
        self._unread = UnreadTimer(cast("asyncio.Transport", transport))

    def connection_lost(self, exc: Exception | None) -> None:
        """See ``asyncio.BaseProtocol``."""
        self._unread.resumed()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """See ``asyncio.BaseProtocol``."""
        super().pause_writing()
        self._unread.paused()

    def resume_writing(self) -> None:
        """See ``asyncio.BaseProtocol``."""
        super().resume_writing()
        self._unread.resumed()


class HttpConnection(EndsWithoutReader, H11Protocol):
    """A connection with requests, one after the other."""

    _due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See ``asyncio.BaseProtocol``."""
        super().connection_made(transport)
        self.since = self.loop.time()
        self._await_request()
        if len(self.connections) > MOST:
            waiting = [one for one in self.connections if isinstance(one, HttpConnection) and one.idle]
            min(waiting, key=lambda one: one.since).transport.abort()

    @property
    def idle(self) -> bool:
        """It waits for a request, or for the rest of one."""
        return self.cycle is None or self.cycle.response_complete or self.cycle.more_body

    def connection_lost(self, exc: Exception | None) -> None:
        """See ``asyncio.Protocol``."""
        self._forget()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """An answer was sent."""
        self.since = self.loop.time()
        self._await_request()
        super().on_response_complete()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """It becomes a WebSocket."""
        self._forget()
        super().handle_websocket_upgrade(event)

    def send_400_response(self, msg: str) -> None:
        """What came is no HTTP; where it was the body of a request, nobody answers that any more."""
        cycle = self.cycle
        if cycle is not None and not cycle.response_complete:
            cycle.disconnected = True
            cycle.message_event.set()
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self.transport.write(BAD_REQUEST)
        self.conn.send_failed()  # nothing more is said, also where an answer is under way
        self.transport.close()

    def _await_request(self) -> None:
        self._forget()
        self._due = self.loop.call_later(REQUEST, self._expire)

    def _expire(self) -> None:
        self._due = None
        if self.idle:
            self.transport.abort()

    def _forget(self) -> None:
        if self._due is not None:
            self._due.cancel()
            self._due = None


class WebSocketConnection(EndsWithoutReader, WebSocketsSansIOProtocol):
    """A WebSocket."""

    async def run_asgi(self) -> None:
        """Serve it; a browser that has gone before it was let in is no error."""
        app = self.app

        async def until_gone(scope: Any, receive: Any, send: Any) -> None:
            await app(scope, receive, send)
            if self.transport.is_closing():
                self.handshake_complete = True

        self.app = until_gone
        await super().run_asgi()

    def handle_cont(self, event: Frame) -> None:
        """A further part of a message; empty ones count."""
        if len(self.frames) >= PARTS:
            self._fail(TOO_MANY_PARTS, "too many parts")
        else:
            super().handle_cont(event)

    def handle_ping(self) -> None:
        """A ping is answered to who reads the answers."""
        if self.writable.is_set():
            super().handle_ping()
        else:
            self.transport.abort()

    def send_receive_event_to_app(self) -> None:
        """A message is whole; text is UTF-8."""
        if self.curr_msg_data_type == "text":
            try:
                b"".join(self.frames).decode()
            except UnicodeDecodeError:
                self._fail(INVALID_DATA, "text that is no UTF-8")
                return
        super().send_receive_event_to_app()

    def _fail(self, code: int, reason: str) -> None:
        self.frames = []
        if not self.close_sent:
            self.conn.fail(code, reason)
            self.handle_parser_exception()
