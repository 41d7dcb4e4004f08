"""Whole games on the stand-in for Lichess, by a person who is simulated or by an engine; and what must hold of each."""

from __future__ import annotations

import json
import logging
import random
import threading
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import chess
import chess.pgn

from app.online.launch import online_settings, run_online
from app.play.session import SessionResult
from app.records.events import PlyEvent
from app.settings.defaults import Settings
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from app.terminal.shown import ClockShown
from tests.app.online.fake_lichess import TOKEN, FakeGame, FakeLichess, Temper

ROUGH = {
    "cut": 0.12, "lost": 0.06, "limit": 0.02, "broken": 0.04, "draw": 0.05, "take_back": 0.08, "gone": 0.015,
    "flag": 0.012, "resign": 0.02, "abort": 0.04, "again": 0.1, "chat": 0.05,
}  # fmt: skip


@dataclass
class QuickTime:
    """``Waiting`` in which a minute is no time, and a second a little one; it says what was waited."""

    ahead: float = 0.0
    waited: list[float] = field(default_factory=list)

    def now(self) -> float:
        return time.monotonic() + self.ahead

    def wait(self, seconds: float, closed: threading.Event) -> bool:
        self.waited.append(seconds)
        if seconds > 30.0:
            self.ahead += seconds
            return closed.is_set()
        return closed.wait(seconds / 50.0)


class Person(UserInterface):
    """A person at the board, and ``Lines`` of what they say: random legal moves, and a word now and then."""

    def __init__(self, seed: int, longest: int = 60, words: float = 0.1, rematches: int = 0) -> None:
        self.accompanied = rematches > 0
        self._rematches = rematches
        self._random = random.Random(seed)
        self._longest, self._words = longest, words
        self.board = chess.Board()
        self.said: list[str] = []
        self.clocks: list[ClockShown | None] = []
        self.over = False
        self._asked = False
        self._typed: list[str] = []

    # as UserInterface

    def position(self, board: chess.Board) -> None:
        self.board = board.copy()

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        self.board = board.copy()

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.said.append(sentence)
        for word in ("takeback", "draw"):
            if f"say '{word}' to accept" in sentence:
                self._typed.append(self._random.choice([word, "decline"]))
        if "say 'claim'" in sentence:
            self._typed.append("claim")

    def clock(self, shown: ClockShown | None) -> None:
        self.clocks.append(shown)

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        self._asked = turn
        if "say 'rematch'" in sentence:
            self._rematches -= 1
            self._typed = ["rematch" if self._rematches >= 0 else "quit"]
        elif "quit" in answers:
            self._typed = ["quit"]

    def answered(self) -> None:
        self._asked = False

    # as Lines

    def next(self, timeout: float) -> str | None:
        if self._typed:
            return self._typed.pop(0)
        if not self._asked:
            time.sleep(min(timeout, 0.001))
            return None
        time.sleep(0.002)
        self._asked = False
        if len(self.board.move_stack) > self._longest:
            return "resign"
        if self._random.random() < self._words:
            return self._random.choice(["draw", "takeback", "hint", "side", "decline"])
        moves = sorted(self.board.legal_moves, key=chess.Move.uci)
        return self._random.choice(moves).uci() if moves else None

    def forget(self, word: str) -> None:
        """Nothing is forgotten."""


@contextmanager
def written_token(folder: Path, token: str = TOKEN) -> Iterator[Path]:
    """A file with the token, mode 0600."""
    file = folder / "token"
    file.touch(mode=0o600)
    file.write_text(token + "\n")
    yield file


def settings(lichess: FakeLichess, token: Path, folder: Path, use: str, **more: object) -> Settings:
    return online_settings(
        settings_of({
            "rig.name": "board", "rig.video": False, "out": folder, "online.use": use, "online.server": lichess.address,
            "online.token_file": token, "engine.nodes": 40 if use == "bot" else None, **more,
        })
    )  # fmt: skip


@dataclass
class Played:
    """One session: what was played here and there, and all that was written."""

    done: SessionResult
    games: list[FakeGame]
    folder: Path
    person: Person
    time: QuickTime
    temper: Temper
    late: int
    """Requests within a minute after an answer 429."""


def play(use: str, seed: int, folder: Path, temper: Temper | None = None, rematches: int = 0, **more: object) -> Played:
    """A game of the account as board or bot, with whatever the temper brings, and so many rematches."""
    folder.mkdir(parents=True)
    temper = temper or Temper(seed, **ROUGH)
    quick, person = QuickTime(), Person(seed, rematches=rematches if use == "person" else 0)
    with FakeLichess(temper, "BOT" if use == "bot" else None) as lichess, written_token(folder) as token:
        lichess.now, lichess.rematches = quick.now, rematches
        more.setdefault("game.games", 1 + rematches if use == "bot" else 1)
        if use == "bot":
            lichess.challenged_by("Anna")
        done = run_online(settings(lichess, token, folder / "game", use, **more), person, person, waiting=quick)
        late = sum(
            1
            for at in lichess.limited_at
            for asked, _ in lichess.requests
            if at + 0.5 < asked < at + 60.0  # what was under way when the server said so does not count
        )
        return Played(done, list(lichess.games.values()), folder / "game", person, quick, temper, late)


def recorded(folder: Path) -> chess.pgn.Game:
    with (folder / "game.pgn").open() as file:
        game = chess.pgn.read_game(file)
    assert game is not None
    return game


def require_same(played: Played) -> None:
    """The record here is the game there: moves, result, and no ply lost or doubled on the way; the token is nowhere."""
    for number, game in enumerate(played.games, start=1):
        folder = played.folder if number == 1 else played.folder / f"game-{number}"
        pgn = recorded(folder)
        assert [move.uci() for move in pgn.mainline_moves()] == game.moves, played.temper.happened
        assert pgn.headers["Result"] == game.result
        assert pgn.headers["Site"].endswith(f"/{game.id}")
        events = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
        plies = [event for event in events if event["event"] == "ply"]
        back = sum(event.get("taken_back", 0) for event in events if event["event"] == "task")
        assert len(plies) - back == len(game.moves)
    assert played.done.holds, [failure.reason for failure in played.done.report.failures]
    require_no_token(played.folder)
    assert not any(TOKEN in sentence for sentence in played.person.said)


def require_no_token(folder: Path) -> None:
    for path in folder.rglob("*"):
        if path.is_file():
            assert TOKEN.encode() not in path.read_bytes(), path


def log_everything(file: Path) -> None:
    """All that any package would log, into a file: for runs in which the token must not appear."""
    logging.basicConfig(filename=file, level=logging.DEBUG, force=True)
