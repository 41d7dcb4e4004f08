"""Requests obey the server's limits, end by themselves, and say in one sentence what is wrong."""

from __future__ import annotations

import logging
import socket
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from app import UserError
from app.online import client as client_module
from app.online.client import RATE_LIMIT, Cut, LichessClient, RequestRefused
from app.online.messages import MessageError
from app.online.token import Token
from tests.app.online.fake_lichess import TOKEN, FakeLichess, Temper
from tests.app.online.online_games import QuickTime
from tests.waiting import PATIENCE

DEEP = b'{"a":' + b"[" * 100_000 + b"]" * 100_000 + b"}"


def client_of(lichess: FakeLichess, token: str = TOKEN) -> LichessClient:
    return LichessClient(lichess.address, Token(token), QuickTime())


@contextmanager
def answering(answer: bytes) -> Iterator[str]:
    """A server that says the same to everybody, whatever they ask."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                with connection:
                    connection.recv(4096)
                    connection.sendall(answer)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
    thread.join()


def response(body: bytes, status: str = "200 OK", headers: str = "") -> bytes:
    return f"HTTP/1.1 {status}\r\nContent-Length: {len(body)}\r\n{headers}\r\n".encode() + body


def test_after_429_nothing_is_asked_for_a_full_minute() -> None:
    temper = Temper(limit=1.0)
    with FakeLichess(temper) as lichess:
        client = client_of(lichess)
        time = client.waiting
        assert isinstance(time, QuickTime)
        lichess.now = time.now
        said = list[str]()

        def slowed(sentence: str) -> None:
            said.append(sentence)
            temper.limit = 0.0

        client.slowed = slowed
        client.account()
        assert [asked - lichess.limited_at[0] >= RATE_LIMIT for asked, _ in lichess.requests] == [False, True]
        assert len(time.waited) == 1
        assert time.waited[0] == pytest.approx(RATE_LIMIT, abs=20.0)  # less by what a busy machine lost before
        assert said == [f"{lichess.address} asks for fewer requests: nothing is asked for 60 s"]


def test_a_token_that_is_not_accepted_is_a_sentence_without_it() -> None:
    other = TOKEN[::-1]
    with FakeLichess() as lichess, pytest.raises(UserError, match="does not accept the token") as caught:
        client_of(lichess, other).account()
    assert other not in "".join(traceback.format_exception(caught.value))


def test_nothing_that_anybody_logs_holds_the_token(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG), FakeLichess() as lichess:
        client = client_of(lichess)
        client.account()
        with pytest.raises(RequestRefused, match="Not found"):
            client.act("board", "missing1", "resign")
    assert "api/account" in caplog.text
    assert TOKEN not in caplog.text


def test_an_answer_that_is_lost_is_asked_for_again() -> None:
    temper = Temper(seed=3, lost=0.5, broken=0.2)
    with FakeLichess(temper) as lichess:
        client = client_of(lichess)
        names = [client.account().username for _ in range(4)]
    assert names == ["Robot"] * 4
    assert temper.happened["lost"] > 1


def test_a_server_that_is_not_there_is_a_cut_link() -> None:
    client = LichessClient("http://127.0.0.1:9", Token(TOKEN), QuickTime())
    with pytest.raises(Cut, match="Connection"):
        client.account()


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        (response(b"<html>"), Cut),
        (response(b'{"id": 5}'), MessageError),
        (response(b"[]"), MessageError),
        (response(DEEP), Cut),
        (response(b"", "302 Found", "Location: http://127.0.0.1:9/\r\n"), Cut),
        (response(b'{"error": "\\u001b[31mno\\n"}', "403 Forbidden"), RequestRefused),
        (response(b"", "503 Service Unavailable"), Cut),
    ],
)
def test_answers_that_make_no_sense_change_nothing(answer: bytes, error: type[Exception]) -> None:
    with answering(answer) as server:
        client = LichessClient(server, Token(TOKEN), QuickTime())
        with pytest.raises(error) as caught:
            client.account()
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("line", [b"{", b"[1]", b"\xff\xfe", b"7", DEEP])
def test_a_stream_that_makes_no_sense_is_a_cut_link(line: bytes) -> None:
    with answering(response(b"\n" + line + b"\n")) as server:
        stream = LichessClient(server, Token(TOKEN), QuickTime()).events()
        with pytest.raises(Cut):
            list(stream)


def test_who_leaves_a_stream_may_go_on_with_its_next_line() -> None:
    with answering(response(b'{"a": 1}\n{"b": 2}\n\n{"c": 3}\n')) as server:
        stream = LichessClient(server, Token(TOKEN), QuickTime()).events()
        for said in stream:
            assert said == {"a": 1}
            break
        assert next(stream) == {"b": 2}
        assert list(stream) == [None, {"c": 3}]
        assert list(stream) == []
        left = LichessClient(server, Token(TOKEN), QuickTime()).events()
        assert next(left) == {"a": 1}
        left.close()
        assert list(left) == []


def test_a_stream_has_no_endless_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client_module, "LONGEST_LINE", 1000)
    with answering(response(b"x" * 1_000_000)) as server:
        stream = LichessClient(server, Token(TOKEN), QuickTime()).events()
        with pytest.raises(Cut, match="more than 1000 bytes"):
            list(stream)


def test_a_silent_stream_is_a_cut_link(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client_module, "SILENCE", 0.05)
    with FakeLichess() as lichess, pytest.raises(Cut):
        list(client_of(lichess).events())


def test_a_stream_is_closed_from_another_thread() -> None:
    with FakeLichess() as lichess:
        stream = client_of(lichess).events()
        heard = list[object]()

        def listen() -> None:
            try:
                heard.extend(stream)
            except Cut as cut:
                heard.append(cut)

        thread = threading.Thread(target=listen)
        thread.start()
        stream.close()
        thread.join(PATIENCE)
        assert not thread.is_alive()
