"""One panel of the page alone in a real browser: its own files, and answers that a test gives instead of the server.

The store is the page's own; what would be sent is kept. The headers are those of the page's server, so that
a panel which breaks its Content-Security-Policy breaks here.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Page

from app.page.web.security import HEADERS
from app.page.web.server import STATIC

KINDS = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".html": "text/html; charset=utf-8"}
PANEL_PAGE = """<!doctype html>
<html lang="en" data-theme="light"><head><meta charset="utf-8"><title>A panel</title>
<meta name="viewport" content="width=device-width">
<link rel="stylesheet" href="/static/css/tokens.css"><link rel="stylesheet" href="/static/css/layout.css">
<link rel="stylesheet" href="/static/css/parts.css"></head>
<script type="module" src="/panel.js"></script></head>
<body><div role="main"><h1>A panel</h1><div id="panel"></div></div></body></html>"""
PANEL_SCRIPT = """
import {createStore} from '/static/store.js';
const store = createStore();
const sent = [];
store.attach((frame) => sent.push(frame) > 0);
const module = await import(`/static/${new URLSearchParams(location.search).get('panel')}.js`);
const element = document.getElementById('panel');
Object.assign(window, {store, sent, module, element, unmount: module.mount(element, store), ready: true});
"""
PATIENCE = 60.0
"""A loaded machine without a graphics card draws its first picture within this [s]."""


@dataclass
class PanelSite:
    """What the page's server would answer.

    Attributes:
        answers: by path; content that is no bytes is sent as JSON.
        asked: paths that were asked for and not there.
    """

    answers: dict[str, Any] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)
    address: str = ""

    def content(self, path: str) -> tuple[bytes, str] | None:
        """What is answered, and its media type."""
        if path == "/":
            return PANEL_PAGE.encode(), KINDS[".html"]
        if path == "/panel.js":
            return PANEL_SCRIPT.encode(), KINDS[".js"]
        if path.startswith("/static/"):
            file = STATIC / path.removeprefix("/static/")
            return (file.read_bytes(), KINDS[file.suffix]) if file.is_file() else None
        if path not in self.answers:
            return None
        answer = self.answers[path]
        return (
            (answer, "application/octet-stream")
            if isinstance(answer, bytes)
            else (json.dumps(answer).encode(), "application/json")
        )


@contextmanager
def served(site: PanelSite) -> Iterator[PanelSite]:
    """Answer on loopback for as long as it takes."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            found = site.content(urlsplit(self.path).path)
            if found is None:
                site.asked.append(self.path)
            body, kind = found or (b"", "text/plain")
            self.send_response(200 if found else 404)
            for name, value in {**HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    site.address = f"http://127.0.0.1:{server.server_port}"
    try:
        yield site
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


@contextmanager
def panel(browser: Browser, site: PanelSite, name: str, fragment: str = "") -> Iterator[Page]:
    """A panel alone in a page; an error of its script, or of its Content-Security-Policy, fails the test."""
    page = browser.new_page(viewport={"width": 640, "height": 560}, reduced_motion="reduce")
    page.set_default_timeout(1e3 * PATIENCE)
    troubles: list[str] = []
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.on(
        "console", lambda said: troubles.append(said.text) if said.type == "error" and "404" not in said.text else None
    )
    page.goto(f"{site.address}/?panel={name}{fragment}")
    until(lambda: page.evaluate("window.ready === true"), page)
    try:
        yield page
    finally:
        page.close()
    assert not troubles


def until(holds: Callable[[], Any], page: Page) -> Any:
    """Wait until something holds; what it came to. The page's policy forbids what Playwright's own waiting does."""
    end = time.monotonic() + PATIENCE
    while not (found := holds()):
        assert time.monotonic() < end, "it did not come to hold"
        page.wait_for_timeout(50)
    return found
