"""Foreign pages are kept out, whatever they call themselves."""

from __future__ import annotations

import asyncio
import string
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from starlette.responses import PlainTextResponse
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.page.entrance import PageRefused, open_entrance
from app.page.web.security import HEADERS, Gatekeeper, Names
from app.page.web.server import STATIC
from app.page.web.sign_in import PasswordHash
from app.settings.defaults import PageSection
from tests.app.page.recorded.recorded_games import RecordedGame
from tests.app.page.serving import ServedPage, served

NAMES = Names.of("127.0.0.1", 8064, "https://Robot.example")
OURS = {"127.0.0.1:8064", "localhost:8064", "robot.example"}
HOSTS = st.text(alphabet=string.ascii_letters + string.digits + ".:-[]@ ", max_size=30) | st.sampled_from(
    [f"{one}{tail}" for one in OURS for tail in ("", ".", ":80", ".evil.example", "@evil.example", " ")]
)


def answer(headers: dict[str, str], kind: str = "http", path: str = "/games", method: str = "GET") -> dict[str, Any]:
    """Status and headers of what the gatekeeper answers; 200: it let the request pass."""
    sent: list[dict[str, Any]] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": "websocket.connect" if kind == "websocket" else "http.request"}

    raw = [(name.encode(), value.encode("latin-1", "replace")) for name, value in headers.items()]
    scope = {
        "type": kind, "path": path, "method": method, "headers": raw, "query_string": b"", "extensions": {
            "websocket.http.response": {}
        },
    }  # fmt: skip
    asyncio.run(Gatekeeper(PlainTextResponse("in"), NAMES, None)(scope, receive, send))
    start = sent[0]
    shown = {name.decode(): value.decode() for name, value in start["headers"]}
    assert set(map(str.lower, HEADERS)) <= set(shown), "every answer says what a browser is to refuse"
    return {"status": start["status"], **shown}


@pytest.mark.parametrize(("written", "said"), [("https://robot.example:443", "https://robot.example"),
                                               ("http://robot.example:80", "http://robot.example"),
                                               ("https://robot.example:8443", "https://robot.example:8443"),
                                               ("http://robot.example:443", "http://robot.example:443")])  # fmt: skip
def test_an_address_with_the_schemes_own_port_is_known_as_browsers_say_it(written: str, said: str) -> None:
    names = Names.of("127.0.0.1", 8064, written)
    assert said in names.origins
    assert said.partition("//")[2] in names.hosts


@given(HOSTS, st.sampled_from(["http", "websocket"]))
@example("127.0.0.1:8064", "http")
@example("ROBOT.EXAMPLE", "websocket")
def test_a_foreign_host_is_refused(host: str, kind: str) -> None:
    assert answer({"host": host}, kind)["status"] == (200 if host.lower() in OURS else 421)


@given(st.sampled_from(["http", "https", "HTTP", "file", "ws"]), HOSTS, st.sampled_from(["http", "websocket"]))
@example("http", "127.0.0.1:8064", "http")
@example("https", "robot.example", "websocket")
def test_a_foreign_origin_is_refused(scheme: str, host: str, kind: str) -> None:
    origin = f"{scheme}://{host}"
    ours = {"http://127.0.0.1:8064", "http://localhost:8064", "https://robot.example"}
    status = answer({"host": "127.0.0.1:8064", "origin": origin}, kind)["status"]
    assert status == (200 if origin.lower() in ours else 403)


@pytest.mark.parametrize("origin", ["null", "", "http://127.0.0.1:8064/", "http://127.0.0.1:8064 http://evil.example"])
def test_odd_origins_are_foreign(origin: str) -> None:
    assert answer({"host": "127.0.0.1:8064", "origin": origin})["status"] == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_another_site_may_only_lead_here(site: str) -> None:
    headers = {"host": "127.0.0.1:8064", "sec-fetch-site": site}
    assert answer(headers)["status"] == 403
    follows = {**headers, "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}
    assert answer(follows)["status"] == 200
    assert answer(follows, method="POST")["status"] == 403
    assert answer({**follows, "sec-fetch-dest": "iframe"})["status"] == 403
    assert answer({**headers, "sec-fetch-site": "same-origin"})["status"] == 200


def test_a_request_without_a_host_is_refused() -> None:
    assert answer({})["status"] == 421


# ----------------------------------------------------------------------------------------------------------- in earnest


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedPage]:
    folder = tmp_path_factory.mktemp("security")
    (folder / "outside.txt").write_text("outside", encoding="utf-8")
    RecordedGame(folder / "games" / "match").record.close()
    with served(folder / "games") as running:
        yield running


def test_every_answer_carries_the_policy(page: ServedPage) -> None:
    for path in ("/login", "/games", "/nowhere", "/static/login.css", "/picture/camera.jpg"):
        headers = page.get(path).headers
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert "unsafe" not in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Server"] is None


def test_a_websocket_of_another_page_is_refused(page: ServedPage) -> None:
    for origin in ("http://evil.example", f"http://127.0.0.1:{page.port + 1}", "null"):
        with (
            pytest.raises(InvalidStatus, match="403"),
            connect(f"ws://127.0.0.1:{page.port}/live", origin=origin),  # type: ignore[arg-type]
        ):
            pass


PARTS = st.sampled_from(
    ["..", "%2e%2e", "%2E.", ".", "/", "%2f", "\\", "%5c", "//", "etc", "passwd", "games", "match", "static", "frames",
     "film", "record.json", "events.jsonl", "%00", "~", "match~game-2", "outside.txt", "=2E=2E", "%c0%ae"]
)  # fmt: skip


@given(st.lists(PARTS, min_size=1, max_size=8))
def test_no_path_leads_out_of_what_is_shown(page: ServedPage, parts: list[str]) -> None:
    path = "/" + "/".join(parts)
    answer = page.get(path)
    content = answer.content  # type: ignore[attr-defined]
    assert b"outside" not in content
    assert b"root:" not in content
    assert answer.status in (200, 303, 307, 400, 404, 405)
    if answer.status == 200:
        shown = {file.read_bytes() for file in STATIC.rglob("*") if file.is_file()}
        assert content in shown or path.strip("/") == "games" or "record.json" in path


# ----------------------------------------------------------------------------------------------------- where it listens


def test_others_are_let_in_only_with_a_password_and_tls(tmp_path: Path) -> None:
    PasswordHash.of("long enough for all").save(tmp_path / "password")
    known = {"password": tmp_path / "password"}
    for settings, sentence in (
        ({"host": "0.0.0.0"}, "needs a password: 'touchmove page --set-password FILE' makes one"),
        ({"host": "0.0.0.0", **known}, "needs a TLS proxy in front of it"),
        ({"host": "0.0.0.0", "address": "http://robot.example", **known}, "needs a TLS proxy in front of it"),
        ({"address": "https://robot.example"}, "needs a password"),
        ({"address": "robot.example", **known}, "write it as the browser shows it"),
        ({"address": "https://robot.example/page", **known}, "write it as the browser shows it"),
        ({"host": "192.0.2.1", "address": "https://robot.example", **known}, "cannot listen on 192.0.2.1"),
    ):
        with pytest.raises(PageRefused, match=sentence):
            open_entrance(PageSection(port=0, **settings))
    for settings in ({}, known, {"host": "0.0.0.0", "address": "https://robot.example", **known}):
        entrance = open_entrance(PageSection(port=0, **settings))
        entrance.socket.close()
        assert (entrance.sign_in is None) == (not settings)
        assert entrance.names.origins >= ({"https://robot.example"} if "address" in settings else set())


def test_a_port_that_is_taken_is_another_ones() -> None:
    first = open_entrance(PageSection(port=0))
    port = first.socket.getsockname()[1]
    second = open_entrance(PageSection(port=port))
    assert second.socket.getsockname()[1] != port
    assert second.address != first.address
    first.socket.close()
    second.socket.close()
    again = open_entrance(PageSection(port=port))
    assert again.socket.getsockname()[1] == port, "a page that was started again is where it was"
    again.socket.close()
