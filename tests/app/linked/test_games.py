"""Whole games of two robots on two rigs ``board``, each in its own thread, over TLS."""

from __future__ import annotations

import io
import sys
import threading
import time
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import chess
import chess.pgn
import pytest

from app import UserError
from app.linked.games import resume_linked_games, run_linked_games
from app.linked.link import parse_address
from app.linked.log import LOG_FILE
from app.play.session import Interrupted, SessionResult
from app.records import PlyEvent
from app.settings.defaults import Settings
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines
from tests.app.linked.pair import SECRET
from tests.controllers import free_port
from tests.waiting import PATIENCE

ENDING = "8/8/4k3/8/8/4K3/4P3/8 w - - 0 1"
LINE = "e3e4 e6d6 e4d4 d6e6 e2e4 e6d6 e4e5 d6e6"


class Shown(UserInterface):
    """Keeps what is said; may break the game off after a ply, as Ctrl-C does."""

    def __init__(self, until: int | None = None) -> None:
        super().__init__()
        self.said: list[str] = []
        self.plies = 0
        self._until = until

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.said.append(sentence)

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        self.plies += 1
        if self.plies == self._until:
            raise KeyboardInterrupt


class Person(Shown):
    """Answers whenever they are asked, and wants no rematch: ``UserInterface`` and ``Lines`` in one."""

    def __init__(self, *lines: str, accompanied: bool = False) -> None:
        super().__init__()
        self._lines, self._asked, self.accompanied = list(lines), False, accompanied
        self.prompted: list[str] = []

    def prompt(self, sentence: str, *_: object, **__: object) -> None:
        self._asked = True
        self.prompted.append(sentence)
        if "rematch" in sentence and not self._lines:
            self._lines.append("quit")

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        super().say(sentence, squares)
        self._asked = self._asked or "to accept" in sentence

    def next(self, timeout: float) -> str | None:
        if self._asked and self._lines:
            self._asked = False
            return self._lines.pop(0)
        time.sleep(timeout)
        return None

    def forget(self, word: str) -> None:
        raise AssertionError("nobody stops the arm")


class Playing:
    """One robot, in a thread."""

    def __init__(self, play: Callable[[], SessionResult]) -> None:
        self._play = play
        self.result: SessionResult | None = None
        self.error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.result = self._play()
        except BaseException as error:
            self.error = error

    def end(self) -> SessionResult:
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive(), "the game does not end"
        if self.error is not None:
            raise self.error
        assert self.result is not None
        return self.result


def settings(folder: Path, role: str, port: int, **changes: Any) -> Settings:
    named = {name.replace("__", "."): value for name, value in changes.items()}
    base = {
        "rig.name": "board", "rig.video": False, "out": folder / role, "link.role": role, "link.port": port,
        "link.host": "127.0.0.1", "link.identity": folder / f"{role}-identity",
    }  # fmt: skip
    return settings_of({**base, **named})


def start(told: Settings, ui: UserInterface | None = None) -> Playing:
    lines = ui if isinstance(ui, Person) else TypedLines(io.StringIO())
    return Playing(lambda: run_linked_games(told, ui or UserInterface(), lines, SECRET))


def game_of(folder: Path) -> chess.pgn.Game:
    with (folder / "game.pgn").open(encoding="utf-8") as stream:
        game = chess.pgn.read_game(stream)
    assert game is not None
    return game


def alike(folder: Path) -> list[str]:
    """Both records hold one game; its moves."""
    host, guest = (game_of(folder / role) for role in ("host", "guest"))
    assert dict(host.headers) == dict(guest.headers)
    moves = [move.uci() for move in host.mainline_moves()]
    assert moves == [move.uci() for move in guest.mainline_moves()]
    assert (folder / "host" / LOG_FILE).read_bytes() == (folder / "guest" / LOG_FILE).read_bytes()
    return moves


def test_two_tables_play_one_game_whichever_is_broken_off_and_goes_on(tmp_path: Path) -> None:
    port, shown = free_port(), Shown()
    host = start(settings(tmp_path, "host", port, game__fen=ENDING, game__moves=LINE), shown)
    guest = start(settings(tmp_path, "guest", port, game__moves=LINE), Shown(until=5))
    with pytest.raises(Interrupted):
        guest.end()
    lines = TypedLines(io.StringIO())
    guest = Playing(lambda: resume_linked_games(tmp_path / "guest", UserInterface(), lines, SECRET))
    results = [playing.end() for playing in (host, guest)]
    assert [result.report.exit_reason for result in results] == ["8 plies played"] * 2
    assert all(result.holds for result in results)
    assert alike(tmp_path) == LINE.split()
    assert any(sentence.startswith("line has left (") for sentence in shown.said)
    assert "line is connected again" in shown.said
    with pytest.raises(UserError, match=r"is over after 8 plies: start a new one$"):
        resume_linked_games(tmp_path / "host", UserInterface(), lines, SECRET)


def test_people_at_both_tables_agree_on_a_draw_and_the_guest_plays_the_other_colour(tmp_path: Path) -> None:
    port = free_port()
    host = start(
        settings(tmp_path, "host", port, game__fen=ENDING, link__person=True, link__color="black", link__name="Ada"),
        Person("Kd6", "draw"),
    )
    guest = start(settings(tmp_path, "guest", port, link__person=True), Person("Ke4", "draw"))
    reports = [playing.end().report for playing in (guest, host)]
    assert [(one.result, one.exit_reason) for one in reports] == [("1/2-1/2", "draw by agreement")] * 2
    assert alike(tmp_path) == ["e3e4", "e6d6"]
    assert (game_of(tmp_path / "guest").headers["White"], game_of(tmp_path / "guest").headers["Black"]) == (
        "Human", "Ada",
    )  # fmt: skip


@pytest.mark.parametrize("accompanied", [True, False], ids=["page", "terminal"])
def test_a_rematch_is_played_with_the_colours_changed_and_an_engine_agrees_to_one(
    tmp_path: Path, accompanied: bool
) -> None:
    port = free_port()
    person = Person("Ke4", "resign", "new", "resign", "quit", accompanied=accompanied)
    host = start(
        settings(tmp_path, "host", port, game__fen=ENDING, link__person=True, link__name="Ada"), person
    )  # fmt: skip
    guest = start(settings(tmp_path, "guest", port, engine__nodes=50))
    results = [playing.end() for playing in (host, guest)]
    assert [result.report.result for result in results] == ["1-0", "1-0"]
    asked = [sentence for sentence in person.prompted if "move" not in sentence]
    assert asked == ["a rematch, with the colours changed? say 'new' or 'quit'"] * 2
    for role in ("host", "guest"):
        first, second = game_of(tmp_path / role), game_of(tmp_path / role / "game-2")
        assert (first.headers["White"], first.headers["Result"]) == ("Ada", "0-1")
        assert (second.headers["Black"], second.headers["Result"]) == ("Ada", "1-0")
    alike(tmp_path)


def test_the_secret_is_in_no_file_and_nothing_that_is_said(tmp_path: Path) -> None:
    port, shown = free_port(), (Shown(), Shown())
    host = start(settings(tmp_path, "host", port, game__fen=ENDING, game__moves="e3e4"), shown[0])
    guest = start(settings(tmp_path, "guest", port, game__moves="e3e4"), shown[1])
    for playing in (host, guest):
        playing.end()
    for path in tmp_path.rglob("*"):
        if path.is_file():
            content = path.read_bytes()
            assert SECRET.key not in content
            assert SECRET.key.hex().encode() not in content
    assert not any(SECRET.key.hex() in sentence for one in shown for sentence in one.said)
    key = tmp_path / "host-identity" / "key.pem"
    assert key.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"game__plies": 5000}, r"^--plies is 5000: two robots play at most 2000$"),
        ({"clock__time": "soon"}, r"soon"),
        ({"clock__arm_time": "own"}, r"^in a game of two robots nobody's clock runs while an arm moves: leave"),
        ({"game__from_board": True}, r"^two robots begin with a position that both know: give it with --fen$"),
        ({"game__fen": "8/8/8/8/8/8/8/8 w - - 0 1"}, r"^--fen is not a legal position"),
    ],
)
def test_what_two_robots_cannot_play_is_said_before_anything_is_opened(
    tmp_path: Path, changes: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(UserError, match=sentence):
        start(settings(tmp_path, "host", 1, **changes)).end()
    assert not (tmp_path / "host").exists()


def test_without_the_extra_one_sentence_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cryptography", None)
    with pytest.raises(UserError, match=r"^two robots need certificates, and the package cryptography, which makes"):
        start(settings(tmp_path, "host", free_port(), game__fen=ENDING)).end()


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("robot.local", "robot.local", 8065), ("10.0.0.7:9000", "10.0.0.7", 9000), ("[::1]:9000", "::1", 9000),
        ("::1", "::1", 8065), ("[fe80::1]", "fe80::1", 8065),
    ],
)  # fmt: skip
def test_an_address_is_read_as_people_write_it(text: str, host: str, port: int) -> None:
    assert parse_address(text, 8065) == (host, port)


@pytest.mark.parametrize("text", ["", ":9000", "host:port", "host:0", "host:70000", "a host"])
def test_what_is_no_address_is_said(text: str) -> None:
    with pytest.raises(UserError, match=r"is no address of a robot: write HOST or HOST:PORT, such as robot"):
        parse_address(text, 8065)
