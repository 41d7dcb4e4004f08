"""Browsers at a page as far as they load it: ``python -m app.measure.bench.beds.page_watchers ADDRESS COUNT``.

Each of them wants telemetry and the camera, and fetches every picture that it is told of, as the page's script does. A
process of its own: what browsers do is not done by whoever streams samples to the arm. For each line on stdin it prints
how many telemetries and pictures each has had so far; it ends with stdin.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from urllib.parse import urlsplit

from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException
from websockets.typing import Origin


class PageWatcher:
    """A browser that shows the robot and the camera's picture.

    Args:
        address: of the page.

    Attributes:
        telemetry: so many have come.
        pictures: so many were fetched.
    """

    def __init__(self, address: str) -> None:
        self._site = urlsplit(address).netloc
        self.telemetry = self.pictures = 0

    async def run(self) -> None:
        """Watch until the page goes.

        Raises:
            OSError: the page cannot be reached.
            WebSocketException: it does not let somebody watch.
        """
        host, _, port = self._site.partition(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        try:
            await self._fetch(reader, writer, "/robot.json")  # what 3-D draws
            origin = Origin(f"http://{self._site}")
            async with connect(f"ws://{self._site}/live", origin=origin, max_size=None, compression=None) as socket:
                await socket.send(json.dumps({"type": "hello", "token": os.urandom(16).hex()}))
                await socket.send(json.dumps({"type": "watch", "telemetry": True, "camera": True, "film": False}))
                shown = 0
                async for text in socket:
                    frame = json.loads(text)
                    self.telemetry += frame["type"] == "telemetry"
                    camera = (frame.get("changes", {}).get("pictures") or {}).get("camera")
                    if camera and camera["number"] != shown:
                        shown = camera["number"]
                        await self._fetch(reader, writer, f"/picture/camera.jpg?n={shown}")
                        self.pictures += 1
        finally:
            writer.close()

    async def _fetch(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, path: str) -> None:
        """Over one connection, as browsers keep it; that the answer is whole is enough."""
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {self._site}\r\nAccept-Encoding: gzip\r\n\r\n".encode())
        head = (await reader.readuntil(b"\r\n\r\n")).lower()
        if not head.startswith(b"http/1.1 200"):
            raise ConnectionError(f"{path}: {head.decode(errors='replace').splitlines()[0]}")
        await reader.readexactly(int(head.split(b"content-length: ")[1].split(b"\r\n")[0]))


async def _watch(address: str, count: int) -> None:
    watchers = [PageWatcher(address) for _ in range(count)]
    asked = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(asked), sys.stdin)
    watching = asyncio.gather(*(watcher.run() for watcher in watchers))
    while not watching.done():
        line = asyncio.create_task(asked.readline())
        await asyncio.wait((line, watching), return_when=asyncio.FIRST_COMPLETED)
        if line.done() and not line.result():
            watching.cancel()
            break
        if line.done():
            print(json.dumps([[one.telemetry, one.pictures] for one in watchers]), flush=True)
        line.cancel()
    await asyncio.gather(watching, return_exceptions=True)
    if not watching.cancelled() and (error := watching.exception()) is not None:
        raise error


def main(arguments: list[str]) -> int:
    """Watch; the exit status: 0 nobody wants to know more, 2 the page did not let all of them watch."""
    address, count = arguments
    try:
        asyncio.run(_watch(address, int(count)))
    except (OSError, EOFError, WebSocketException) as error:
        print(f"a watcher of {address} was sent away: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
