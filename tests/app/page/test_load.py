"""What five watchers cost: telemetry twenty times a second, a picture five times a second, each fetched by all."""

from __future__ import annotations

import asyncio
import json
import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from websockets.asyncio.client import connect

from app.page.news import PictureNews, RoundNews, SessionNews
from tests.app.page.fake_controller import TICK, FakeController
from tests.app.page.recorded.recorded_games import RecordedGame
from tests.app.page.serving import PageProcess
from tests.waiting import PATIENCE

WATCHERS = 5
SPAN = 6.0
"""[s, wall]"""
PICTURE = 60_000
"""Of 640 by 480 pixels with noise, as the camera's [bytes]."""
MOST = 0.15
"""Of one core."""


class Watching:
    """A browser that shows everything: what came, by kind."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.telemetry = self.pictures = 0

    async def run(self) -> None:
        address = f"127.0.0.1:{self.port}"
        async with connect(
            f"ws://{address}/live", origin=f"http://{address}", max_size=None, compression=None
        ) as socket:  # type: ignore[arg-type]
            await socket.send(json.dumps({"type": "hello", "token": os.urandom(16).hex()}))
            await socket.send(json.dumps({"type": "watch", "telemetry": True, "camera": True, "film": False}))
            shown = None
            reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
            try:
                async for text in socket:
                    frame = json.loads(text)
                    self.telemetry += frame["type"] == "telemetry"
                    pictures = frame.get("changes", {}).get("pictures")
                    if pictures and pictures["camera"] and pictures["camera"]["number"] != shown:
                        shown = pictures["camera"]["number"]
                        writer.write(f"GET /picture/camera.jpg?n={shown} HTTP/1.1\r\nHost: {address}\r\n\r\n".encode())
                        head = await reader.readuntil(b"\r\n\r\n")
                        size = int(head.lower().split(b"content-length: ")[1].split(b"\r\n")[0])
                        assert len(await reader.readexactly(size)) == PICTURE
                        self.pictures += 1
            finally:
                writer.close()
                await writer.wait_closed()


@pytest.mark.slow
@pytest.mark.real_time
def test_five_watchers_cost_little(tmp_path: Path) -> None:
    game = RecordedGame(tmp_path / "games" / "match")
    for san in ("e4", "e5", "Nf3", "Nc6", "Bb5", "a6", "Ba4", "Nf6", "O-O", "Be7"):
        game.ply(san)
    jpeg = np.random.default_rng(1).bytes(PICTURE)
    with FakeController(tmp_path) as robot, PageProcess(tmp_path / "games") as page:
        host, port, key = robot.address
        folder = str(game.folder)
        page.tell(
            SessionNews(
                program="play", folder=folder, rig="sim", pace="real", tick=TICK, sees=True,
                controller=(host, port, str(key)),
            )
        )  # fmt: skip
        page.tell(RoundNews(folder=folder, number=1, sets_up=False))
        over = threading.Event()

        def film() -> None:
            number = 0
            while not over.wait(0.2):
                number += 1
                page.tell(PictureNews(view="camera", stamp=0.2 * number, bytes=PICTURE), jpeg)

        threading.Thread(target=film, daemon=True).start()
        watching = [Watching(page.port) for _ in range(WATCHERS)]

        async def watch() -> tuple[float, float]:
            tasks = [asyncio.create_task(one.run()) for one in watching]
            deadline = time.monotonic() + PATIENCE
            while not all(one.telemetry and one.pictures for one in watching) and time.monotonic() < deadline:
                await asyncio.sleep(0.1)
            for one in watching:
                one.telemetry = one.pictures = 0
            used, began = page.seconds, time.monotonic()
            await asyncio.sleep(SPAN)
            spent = page.seconds - used, time.monotonic() - began
            for task in tasks:
                task.cancel()
            ends = await asyncio.gather(*tasks, return_exceptions=True)
            assert all(isinstance(end, asyncio.CancelledError) for end in ends), ends
            return spent

        used, span = asyncio.run(watch())
        over.set()
        share = used / span
        print(
            f"page: {100 * share:.1f} % of one core, {page.memory:.0f} MiB; each watcher "
            f"{sum(one.telemetry for one in watching) / WATCHERS / span:.1f} telemetry/s, "
            f"{sum(one.pictures for one in watching) / WATCHERS / span:.1f} pictures/s"
        )
        assert share < MOST
        for one in watching:
            assert one.telemetry > 10.0 * span
            assert one.pictures > 2.5 * span
