"""The WebSocket of a browser: frames in, checked and counted; state and telemetry out."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from typing import Final

from starlette.websockets import WebSocket, WebSocketDisconnect

from app.page.live.frames import FrameRefused, HelloFrame, read_frame
from app.page.live.hub import Watcher
from app.page.live.people import People, TooMany

HELLO: Final = 5.0
"""The first frame comes within so long [s, wall]."""
PACE: Final = 0.04
"""Between two batches of frames to one browser [s, wall]: what changes more often is told together."""
SLOW: Final = 20.0
"""A browser that takes nothing for so long is let go of [s, wall]."""
RATE: Final = 10.0
"""Frames that a browser may send [1/s]."""
BURST: Final = 40.0
"""Frames that it may send at once."""

GOING_AWAY, POLICY, TRY_LATER = 1001, 1008, 1013
"""Why a WebSocket is closed (RFC 6455)."""


class Allowance:
    """So many a second on average, and so many at once.

    Args:
        rate: [1/s].
        burst: at once.
        now: wall time [s].
    """

    def __init__(self, rate: float, burst: float, now: Callable[[], float] = time.monotonic) -> None:
        self._rate, self._burst, self._now = rate, burst, now
        self._left, self._at = burst, now()

    def take(self) -> bool:
        """Whether one more is allowed now."""
        now = self._now()
        self._left = min(self._burst, self._left + (now - self._at) * self._rate)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True

    def give_back(self) -> None:
        """One that was taken does not count."""
        self._left = min(self._burst, self._left + 1.0)

    @property
    def wait(self) -> float:
        """Until one more is allowed [s]."""
        return max(0.0, (1.0 - self._left) / self._rate)


async def serve_watcher(socket: WebSocket, people: People) -> None:
    """Serve a browser until it goes."""
    await socket.accept()
    try:
        hello = read_frame(await asyncio.wait_for(socket.receive_text(), HELLO))
        if not isinstance(hello, HelloFrame):
            raise FrameRefused("the first frame must say hello: docs/page.md lists the valid frames")
        watcher = people.joined(hello)
    except (FrameRefused, TimeoutError, KeyError) as error:
        await _close(socket, POLICY, str(error) or "no hello arrived")
        return
    except TooMany as error:
        await _close(socket, TRY_LATER, str(error))
        return
    except WebSocketDisconnect:
        return
    sending = asyncio.create_task(_send(socket, watcher))
    hearing = asyncio.create_task(_hear(socket, watcher, people))
    try:
        await asyncio.wait((sending, hearing), return_when=asyncio.FIRST_COMPLETED)
    finally:
        people.left(watcher)
        for task in (sending, hearing):
            task.cancel()
        ends = await asyncio.gather(sending, hearing, return_exceptions=True)
    for end in ends:
        if isinstance(end, Exception) and not isinstance(end, WebSocketDisconnect | TimeoutError):
            raise end
    await _close(socket, GOING_AWAY, "")


async def _send(socket: WebSocket, watcher: Watcher) -> None:
    while True:
        for frame in await watcher.frames():
            await asyncio.wait_for(socket.send_text(frame), SLOW)
        await asyncio.sleep(PACE)


async def _hear(socket: WebSocket, watcher: Watcher, people: People) -> None:
    allowance = Allowance(RATE, BURST)
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            return
        if not allowance.take():
            await _close(socket, POLICY, f"more than {RATE:g} frames a second")
            return
        try:
            frame = read_frame(message.get("text") or "")
        except FrameRefused as error:
            watcher.refuse(str(error))
            continue
        await people.receive(watcher, frame)


async def _close(socket: WebSocket, code: int, reason: str) -> None:
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):  # it is closed already
        await socket.close(code, reason[:100])
