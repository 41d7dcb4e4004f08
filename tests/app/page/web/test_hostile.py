"""Strangers who mean harm: nothing that they send has an effect, or takes the page down."""

from __future__ import annotations

import base64
import itertools
import os
import random
import socket
import struct
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.page.news import PictureNews, RoundNews, SessionNews
from app.page.web import connections
from app.page.web.sign_in import PasswordHash
from tests.app.page.recorded.recorded_games import RecordedGame
from tests.app.page.serving import Browser, PageProcess, ServedPage, served
from tests.waiting import PATIENCE, until

HOSTILE = 6_000
METHODS = ("GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "TRACE", "CONNECT", "PATCH", "get", "G\0T", "X" * 300)
PATHS = (
    "/", "/live", "/games", "/games/match/record.json", "/games/../../etc/passwd", "/static/../process.py",
    "/static/%2e%2e/%2e%2e/news.py", "/games/%00/film", "/picture/camera.jpg", "/stream/camera", "/login", "//", "*",
    "/static//etc/passwd", "/games/match/frames/..%2f..%2fevents.jsonl", "/" + "a" * 9000, "/" + "%ff" * 50, "",
    "http://evil.example/", "/games/match/telemetry.json?from=nan&to=inf", "/robot.json?" + "x=1&" * 2000,
)  # fmt: skip
ODD_HEADERS = (
    "Content-Length: 99999999999", "Content-Length: -1", "Transfer-Encoding: chunked", "Range: bytes=0-0," * 50,
    "X-Forwarded-Host: evil", "Expect: 100-continue",
)  # fmt: skip


def request(lot: random.Random, port: int) -> bytes:
    """Something that a browser would not send."""
    ours = f"127.0.0.1:{port}"
    host = lot.choice(
        (ours, ours, "evil.example", f"localhost.evil:{port}", "", ours + "\r\nHost: evil.example", "[::1]")
    )
    headers = [f"Host: {host}"]
    if lot.random() < 0.5:
        headers.append(f"Origin: {lot.choice(('http://evil.example', 'null', f'http://{ours}', 'x' * 5000, chr(233)))}")
    if lot.random() < 0.3:
        headers.append(
            f"Cookie: touchmove-{port}={lot.choice(('', 'a.b', '7fffffff.' + 'A' * 22, chr(34), ';' * 500))}"
        )
    if lot.random() < 0.2:
        headers.append(lot.choice(ODD_HEADERS))
    if lot.random() < 0.3:
        key = base64.b64encode(lot.randbytes(16)).decode()
        headers += ["Upgrade: websocket", "Connection: Upgrade", f"Sec-WebSocket-Key: {lot.choice((key, 'x', ''))}",
                    f"Sec-WebSocket-Version: {lot.choice(('13', '8', ''))}"]  # fmt: skip
    if lot.random() < 0.05:
        headers += [f"X-{number}: y" for number in range(lot.choice((100, 3000)))]
    head = f"{lot.choice(METHODS)} {lot.choice(PATHS)} HTTP/{lot.choice(('1.1', '1.1', '1.0', '9.9', ''))}\r\n"
    body = lot.choice((b"", b"", b"", b"password=x", lot.randbytes(200), b"A" * 70_000, b"5\r\nabcde\r\n0\r\n\r\n"))
    sent = (head + "\r\n".join(headers) + "\r\n\r\n").encode("latin-1") + body
    return lot.randbytes(lot.randint(0, 400)) if lot.random() < 0.05 else sent


TEXTS = (
    b"", b"{", b"\xff\xfe", b'{"type":"line","text":"e4\\n"}', b"[" * 3000, b'{"type":"stop"}', b"A" * 4097,
    b'{"type":"hello","token":"aaaaaaaaaaaaaaaaaaaa"}', b'{"type":"controls","action":"take"}', b"\0" * 126,
)  # fmt: skip


def frame(lot: random.Random) -> bytes:
    """Bytes of a WebSocket after its handshake that are no good."""
    mask = lot.randbytes(4)

    def masked(content: bytes) -> bytes:
        return bytes(one ^ key for one, key in zip(content, itertools.cycle(mask), strict=False))

    def whole(first: int, content: bytes) -> bytes:
        size = len(content)
        length = bytes([0x80 | size]) if size < 126 else b"\xfe" + struct.pack("!H", size)
        return bytes([first]) + length + mask + masked(content)

    text = lot.choice(TEXTS)
    return lot.choice((
        whole(0x81, text), whole(0x82, text[:100]), whole(0x01, text), whole(0x80, text), whole(0xF1, text[:100]),
        whole(0x88, b"x"), whole(0x88, b"\x00\x01bye"), whole(0x89, b"p" * 126), whole(0x83, b""),
        b"\x81\x05hello", b"\x81\xff" + struct.pack("!Q", 1 << 62), b"\x81\xff" + b"\xff" * 8, lot.randbytes(50),
        whole(0x01, b"") + whole(0x00, b"") * 200, whole(0x89, b"ping") * 50,
    ))  # fmt: skip


def let_in(port: int) -> socket.socket:
    """A WebSocket after its handshake, or a connection that was shown the door."""
    end = socket.create_connection(("127.0.0.1", port), PATIENCE)
    end.sendall(
        (
            f"GET /live HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {'A' * 22}==\r\n\r\n"
        ).encode()
    )
    answer = b""
    while b"\r\n\r\n" not in answer and (part := end.recv(1 << 16)):
        answer += part
    return end


def attack(end: socket.socket, content: bytes, *, answered: bool) -> None:
    """Send bytes, maybe wait for what is answered, and go."""
    with end:
        try:
            end.sendall(content)
            if answered:
                end.shutdown(socket.SHUT_WR)
                end.recv(1 << 16)
        except OSError:
            pass  # it was shown the door


def hostile(lot: random.Random, port: int) -> None:
    """One hostile request, or a WebSocket with hostile frames."""
    answered = lot.random() < 0.9
    if lot.random() < 0.25:
        hello = b'\x81\xab\0\0\0\0{"type":"hello","token":"1234567890123456"}'
        first = lot.choice((b"", hello))
        attack(let_in(port), first + frame(lot) + frame(lot), answered=answered)
    else:
        content = request(lot, port)
        attack(socket.create_connection(("127.0.0.1", port), PATIENCE), content, answered=answered)


def said_by_the_page(game: socket.socket) -> bytes:
    """What the page has told the game."""
    game.setblocking(False)
    try:
        return game.recv(1 << 20)
    except BlockingIOError:
        return b""


@pytest.fixture(params=[False, True], ids=["open", "password"])
def page(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[PageProcess]:
    games = tmp_path / "games"
    game = RecordedGame(games / "match")
    game.ply("e4")
    settings = {}
    if request.param:
        PasswordHash.of("correct horse battery").save(tmp_path / "password")
        settings["password"] = tmp_path / "password"
    with PageProcess(games, **settings) as running:
        folder = str(games / "match")
        running.tell(
            SessionNews(program="play", folder=folder, rig="sim", pace="real", tick=0.001, person=None, sees=True)
        )
        running.tell(RoundNews(folder=folder, number=1, sets_up=False))
        running.tell(PictureNews(view="camera", stamp=0.0, bytes=4), b"jpeg")
        yield running
    assert running.said == "", "no log, no traceback"
    assert running.process.returncode == 0
    assert sorted(path.name for path in (games / "match").iterdir()) == ["events.jsonl", "game.pgn"], (
        "nothing is written"
    )


@pytest.mark.slow
def test_six_thousand_hostile_requests_have_no_effect(page: PageProcess) -> None:
    lot = random.Random(1)
    locked = page.process.args[-1].find('password":null') < 0  # type: ignore[union-attr]
    hostile(lot, page.port)
    before, files = page.memory, page.files
    for _ in range(HOSTILE // 2):  # the other half with the other parameter
        hostile(lot, page.port)
    assert page.process.poll() is None
    until(lambda: page.files <= files + 2, "the sockets are closed")
    assert page.memory < before + 25.0, "memory is bounded"
    assert b'"said":"line"' not in said_by_the_page(page.game), "nobody has said anything"
    if not locked:
        with Browser(page.port, "0123456789abcdef") as browser:
            assert browser.state["game"]["id"] == "match"


# ------------------------------------------------------------------------------------------------- who wears a page out


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ServedPage]:
    """A page with little patience."""
    monkeypatch.setattr(connections, "REQUEST", 0.4)
    monkeypatch.setattr(connections, "UNREAD", 0.4)
    monkeypatch.setattr(connections, "MOST", 12)
    RecordedGame(tmp_path / "match").record.close()
    with served(tmp_path) as running:
        yield running


def closed(end: socket.socket) -> bool:
    """Whether the other side has hung up."""
    end.settimeout(PATIENCE)
    try:
        while end.recv(1 << 16):
            pass
    except ConnectionResetError:
        pass
    return True


@pytest.mark.parametrize(
    "sent",
    [b"", b"GET / HTTP/1.1\r\nHost: x", b"POST /login HTTP/1.1\r\nHost: HOST\r\nContent-Length: 100\r\n\r\npass"],
    ids=["nothing", "half a head", "half a body"],
)
def test_who_sends_no_whole_request_is_let_go_of(small: ServedPage, sent: bytes) -> None:
    with socket.create_connection(("127.0.0.1", small.port)) as end:
        end.sendall(sent.replace(b"HOST", f"127.0.0.1:{small.port}".encode()))
        assert closed(end)


def test_who_trickles_is_let_go_of_too(small: ServedPage) -> None:
    with socket.create_connection(("127.0.0.1", small.port)) as end:
        trickle = (end.sendall(b"G") or time.sleep(0.05) for _ in range(int(PATIENCE / 0.05)))
        with pytest.raises(OSError, match=r"reset|Broken pipe|aborted"):
            deque(trickle, maxlen=0)


def test_good_browsers_come_in_though_others_hold_all_places(small: ServedPage) -> None:
    idle = [socket.create_connection(("127.0.0.1", small.port)) for _ in range(40)]
    with small.browser() as browser:
        assert browser.state["controls"]
        assert small.get("/games").status == 200
    for end in idle:
        end.close()


def test_who_does_not_read_is_let_go_of(small: ServedPage) -> None:
    jpeg = os.urandom(1 << 20)
    with socket.create_connection(("127.0.0.1", small.port)) as end:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        end.sendall(f"GET /stream/camera HTTP/1.1\r\nHost: 127.0.0.1:{small.port}\r\n\r\n".encode())
        until(lambda: small.page.people.streams.camera == 1)
        for number in range(12):
            small.take(PictureNews(view="camera", stamp=float(number), bytes=len(jpeg)), jpeg)
            time.sleep(0.1)
        until(lambda: small.page.people.streams.camera == 0, "the stream ends")


@pytest.mark.parametrize("flood", ["frames", "pings", "empty parts", "large message"])
def test_a_browser_that_floods_is_let_go_of(small: ServedPage, flood: str) -> None:
    with small.browser() as good:
        with let_in(small.port) as end:
            hello = b'{"type":"hello","token":"ffffffffffffffff"}'
            mask = b"\0\0\0\0"
            end.sendall(b"\x81" + bytes([0x80 | len(hello)]) + mask + hello)
            good.until(lambda: good.controls["watchers"] == 2)
            content = {
                "frames": (b"\x81\x82" + mask + b"{}") * 20_000,
                "pings": (b"\x89\xfd" + mask + b"x" * 125) * 20_000,
                "empty parts": b"\x01\x80" + mask + (b"\x00\x80" + mask) * 100_000,
                "large message": b"\x81\xff" + struct.pack("!Q", 1 << 40) + mask + b"x" * 100_000,
            }[flood]
            try:
                end.settimeout(PATIENCE)
                end.sendall(content)
            except (ConnectionResetError, BrokenPipeError):
                pass
            if flood != "pings":  # who reads no answers is let go of for that
                assert closed(end)
        good.until(lambda: good.controls["watchers"] == 1)
        assert good.holds
