"""Debian's Chromium for tests of the page: one browser for a module, a page for a test."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, ConsoleMessage, Page, expect, sync_playwright

from tests import waiting

# the whole browser draws its own windows, too, with or without a screen: half as much work again
CHROMIUM = Path("/usr/bin/chromium-headless-shell")
ARGUMENTS = (
    "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
FLAT = ("--disable-gpu",)
IN_3D = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""Also WebGL, without a graphics card."""
PATIENCE = 1000.0 * waiting.PATIENCE
"""Of what is expected on a page [ms, wall]."""
SIZES = {"phone": (360, 740), "flat": (740, 360), "tablet": (834, 1112), "desk": (1440, 900), "tv": (1920, 1080)}
Scheme = Literal["light", "dark"]
_SOCKETS = """
window.cut = false;
window.sockets = [];
window.asked = 0;
const Real = window.WebSocket;
window.WebSocket = class extends Real {
  constructor(address) {
    super(window.cut ? `${address}-that-is-not-there` : address);
    window.sockets.push(this);
    this.addEventListener('message', (event) => {
      window.asked = JSON.parse(event.data).changes?.prompt?.id ?? window.asked;
    });
  }
};
"""
"""Sockets that a test can cut in the browser; and the number of the last question."""


@contextmanager
def chromium(graphics: tuple[str, ...] = FLAT) -> Iterator[Browser]:
    """A browser."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=(*ARGUMENTS, *graphics))
        expect.set_options(timeout=PATIENCE)
        try:
            yield browser
        finally:
            browser.close()


class Visitor:
    """Somebody with a browser of their own at the page: a page, and what its console said that was wrong."""

    def __init__(
        self, browser: Browser, address: str, size: str = "desk", scheme: Scheme = "light",
        scripts: tuple[str, ...] = (),
    ) -> None:  # fmt: skip
        width, height = SIZES[size]
        touch = size in ("phone", "flat")
        self.context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme, reduced_motion="reduce", has_touch=touch
        )
        self.context.set_default_timeout(PATIENCE)
        # the views of the robot have tests of their own, and describing it takes a process
        self.context.add_init_script("localStorage.setItem('touchmove.panel', 'null')")
        for script in scripts:
            self.context.add_init_script(script)
        self.page: Page = self.context.new_page()
        self.requests: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.wrong: list[str] = []
        self.context.add_init_script(_SOCKETS)
        self.page.on("console", self._console)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.goto(address)
        expect(self.page.locator("#near .name")).not_to_be_empty()

    def cut(self) -> None:
        """The connection is lost, and no other one is had."""
        self.page.evaluate("cut = true; for (const socket of sockets) socket.close()")

    def mend(self) -> None:
        """A connection can be had again."""
        self.page.evaluate("cut = false")

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

    def until(self, condition: str) -> None:
        """Wait until an expression is true on the page, which admits no text that is evaluated there by itself."""
        deadline = time.monotonic() + PATIENCE / 1000.0
        while not self.page.evaluate(condition):
            assert time.monotonic() < deadline, f"{condition} did not become true"
            self.page.wait_for_timeout(20.0)

    def close(self) -> None:
        """Leave."""
        self.context.close()


Visit = Callable[..., Visitor]
