"""Debian's Chromium for tests of the page: one browser for a module, a page for a test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, ConsoleMessage, Page, WebSocketRoute, expect, sync_playwright

CHROMIUM = Path("/usr/bin/chromium")
ARGUMENTS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
PATIENCE = 20_000.0
"""Of what is expected on a page [ms, wall]; a machine may be busy."""
SIZES = {"phone": (360, 740), "flat": (740, 360), "tablet": (834, 1112), "desk": (1440, 900), "tv": (1920, 1080)}
Scheme = Literal["light", "dark"]


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        expect.set_options(timeout=PATIENCE)
        try:
            yield browser
        finally:
            browser.close()


class Visitor:
    """Somebody with a browser of their own at the page: a page, and what its console said that was wrong."""

    def __init__(self, browser: Browser, address: str, size: str = "desk", scheme: Scheme = "light") -> None:
        width, height = SIZES[size]
        touch = size in ("phone", "flat")
        self.context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme, reduced_motion="reduce", has_touch=touch
        )
        self.context.set_default_timeout(PATIENCE)
        # the views of the robot have tests of their own, and describing it takes a process
        self.context.add_init_script("localStorage.setItem('touchmove.panel', 'null')")
        self.page: Page = self.context.new_page()
        self.wrong: list[str] = []
        self._sockets: list[WebSocketRoute] = []
        self._cut = False
        self.context.route_web_socket("**/live", self._connected)
        self.page.on("console", self._console)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.goto(address)
        expect(self.page.locator("#near .name")).not_to_be_empty()

    def _connected(self, socket: WebSocketRoute) -> None:
        if self._cut:
            socket.close()
        else:
            self._sockets.append(socket)
            socket.connect_to_server()

    def cut(self) -> None:
        """The connection is lost, and no other one is had."""
        self._cut = True
        while self._sockets:
            self._sockets.pop().close()

    def mend(self) -> None:
        """A connection can be had again."""
        self._cut = False

    def _console(self, message: ConsoleMessage) -> None:
        # a connection that is lost is said to whoever looks, and logged by the browser besides
        if message.type in ("error", "warning") and "/live" not in message.text:
            self.wrong.append(f"{message.text} {message.location}")

    def at(self, square: str, *, turned: bool = False) -> tuple[float, float]:
        """Where the centre of a square is on the page [CSS px]."""
        box = self.page.locator("#board cg-board").bounding_box()
        assert box is not None
        file, rank = "abcdefgh".index(square[0]), int(square[1]) - 1
        across, up = (7 - file, 7 - rank) if turned else (file, rank)
        return box["x"] + box["width"] * (across + 0.5) / 8, box["y"] + box["height"] * (7.5 - up) / 8

    def click(self, *squares: str) -> None:
        """Click squares."""
        for square in squares:
            self.page.mouse.click(*self.at(square))

    def drag(self, source: str, target: str) -> None:
        """Drag what stands on a square to another one."""
        self.page.mouse.move(*self.at(source))
        self.page.mouse.down()
        self.page.mouse.move(*self.at(target), steps=4)
        self.page.mouse.up()

    def cell(self, label: str) -> None:
        """Expect a cell of the grid with a label."""
        expect(self.page.get_by_role("gridcell", name=label, exact=True)).to_have_count(1)

    def close(self) -> None:
        """Leave."""
        self.context.close()


Visit = Callable[..., Visitor]
