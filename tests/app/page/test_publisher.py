"""The game's end of the page: all that there is to see reaches a page, also one that starts later; lines come back."""

from __future__ import annotations

import dataclasses
import io
import json
import socket
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import chess
import numpy as np
import pytest

from app.page import live_pictures
from app.page.news import LARGEST_PICTURE, NEWS, LookNews, PathNews, PictureNews, PromptNews, RemoteNews
from app.page.publisher import KEPT, POINTS, PagePublisher
from app.players.person import PersonGone
from app.terminal.game_display import Together, UserInterface
from app.terminal.shown import ClockShown, LookShown, PathShown, RemoteShown, SessionShown
from app.terminal.typed_lines import TypedLines
from hardware.interfaces import Pace
from hardware.piece_set import Colour
from tests.waiting import PATIENCE, until


class Page:
    """The other end of a publisher's socket."""

    def __init__(self, publisher: PagePublisher) -> None:
        ours, theirs = socket.socketpair()
        publisher.connect(ours)
        theirs.settimeout(PATIENCE)
        self.socket, self.stream = theirs, theirs.makefile("rwb")

    def next(self):
        news = NEWS.validate_json(self.stream.readline())
        after = self.stream.read(news.bytes) if isinstance(news, PictureNews) else b""
        return news, after

    def close(self) -> None:
        self.stream.close()
        self.socket.close()

    def say(self, **what: object) -> None:
        self.stream.write(json.dumps(what).encode() + b"\n")
        self.stream.flush()


@pytest.fixture
def publisher():
    made = PagePublisher("play")
    yield made
    made.disconnect()


@pytest.fixture
def open_page():
    with ExitStack() as pages:

        def opened(publisher: PagePublisher) -> Page:
            page = Page(publisher)
            pages.callback(page.close)
            return page

        yield opened


def session(folder: Path) -> SessionShown:
    place = ("127.0.0.1", 4711, folder / "key")
    return SessionShown(folder, "sim", Pace.FAST, 0.00088, Colour.WHITE, True, True, place, lambda view, rate: None)


def look(stamp: float = 1.0) -> LookShown:
    likelihood = np.full((64, 3), 0.01)
    likelihood[:, 0] = 0.98
    likelihood[28] = (0.4, 0.5, 0.1)
    grid = np.zeros((81, 2))
    return LookShown(np.zeros((48, 64, 3), np.uint8), stamp, "doubt", "what is on e4?", likelihood, grid, ("e4",))


def test_a_page_is_told_everything_in_order_and_pictures_come_whole(publisher, open_page, tmp_path: Path) -> None:
    page = open_page(publisher)
    publisher.session(session(tmp_path))
    publisher.round(tmp_path, 1, sets_up=False)
    publisher.say("put it back", ["e4"])
    publisher.prompt("done?", ("done",), ("e4",))
    publisher.clock(ClockShown({chess.WHITE: 61.5, chess.BLACK: 60.0}, chess.WHITE))
    publisher.look(look())
    position = np.linspace(0.0, 1.0, 3000).reshape(1000, 3)
    publisher.path(PathShown("carry", position, np.ones((1000, 3)), 7))
    kinds, told = [], []
    for _ in range(8):
        news, after = page.next()
        kinds.append(news.news)
        told.append((news, after))
    assert kinds == ["session", "round", "say", "prompt", "clock", "picture", "look", "path"]
    assert told[5][1][:2] == b"\xff\xd8"  # a JPEG
    seen = told[6][0]
    assert isinstance(seen, LookNews)
    assert seen.unsure == ("e4",)
    assert seen.squares[28].seen == "white"
    path = told[7][0]
    assert isinstance(path, PathNews)
    assert len(path.points) <= POINTS
    assert path.stride * (len(path.points) - 1) < 1000 <= path.stride * len(path.points)


def test_a_page_that_starts_later_hears_the_newest_of_each_and_what_was_said_last(
    publisher, open_page, tmp_path: Path
) -> None:
    publisher.session(session(tmp_path))
    for number in range(KEPT + 50):
        publisher.say(f"sentence {number}")
        publisher.phase(f"phase {number}")
    publisher.prompt("your move", turn=True)
    publisher.answered()
    page = open_page(publisher)
    heard = [page.next()[0] for _ in range(KEPT + 3)]
    assert heard[0].news == "session"
    assert [one.text for one in heard if one.news == "say"] == [f"sentence {n}" for n in range(50, KEPT + 50)]
    assert [one.text for one in heard if one.news == "phase"] == [f"phase {KEPT + 49}"]
    assert [one for one in heard if one.news == "prompt"] == [PromptNews()]


def test_who_plays_elsewhere_and_what_can_be_said_is_told_again_to_a_page_that_starts_later(
    publisher, open_page
) -> None:
    ui = Together(UserInterface(), publisher)
    ui.remote(RemoteShown(None, None, ("quit",)))
    ui.remote(RemoteShown("Ada", Colour.BLACK, ("draw", "resign")))
    news, _ = open_page(publisher).next()
    assert news == RemoteNews(name="Ada", side="black", words=("draw", "resign"))


def test_the_game_goes_on_whatever_becomes_of_the_page(publisher, open_page, tmp_path: Path) -> None:
    publisher.say("before")
    page = open_page(publisher)
    assert page.next()[0].text == "before"
    page.close()
    for number in range(5000):  # nobody reads
        publisher.say(str(number))
    open_page(publisher)  # one that does not read: it is let go of, and nobody waits
    for _ in range(20000):
        publisher.say("x" * 100)
    other = open_page(publisher)
    assert other.next()[0].news == "say"


def test_what_is_said_on_the_page_is_heard_like_what_is_typed_also_after_the_end_of_input(publisher, open_page) -> None:
    heard: list[str] = []

    class Hears(UserInterface):
        def heard(self, line: str) -> None:
            heard.append(line)

    ui = Together(Hears(), publisher)
    lines = TypedLines(io.StringIO("e4 # the king's pawn\n\n"), ui.heard, lambda: publisher.used)
    publisher.subscribe(lines.offer)
    page = open_page(publisher)
    page.say(said="present", holder=True)
    until(lambda: publisher.used)
    assert lines.next(PATIENCE) == "e4"
    # the end of input is not the last word where somebody is at the page
    until(lambda: lines.next(0.01) is None and lines._ended)
    page.say(said="line", text="  resign ")
    assert lines.next(PATIENCE) == "resign"
    assert heard == ["e4", "resign"]


def test_where_nobody_was_at_the_page_the_end_of_input_is_the_end() -> None:
    lines = TypedLines(io.StringIO("e4\n"))
    assert lines.next(PATIENCE) == "e4"
    with pytest.raises(PersonGone):
        lines.next(PATIENCE)


def test_a_page_that_starts_later_is_told_since_when_a_clock_runs(publisher, open_page) -> None:
    before = time.time()
    publisher.clock(ClockShown({chess.WHITE: 61.5, chess.BLACK: 60.0}, chess.WHITE, 3.0))
    after = time.time()
    told = open_page(publisher).next()[0]
    assert before <= told.at <= after
    assert told.free == 3.0


def test_a_picture_is_never_larger_than_a_page_takes(publisher, open_page) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (2160, 3840, 3), np.uint8)
    page = open_page(publisher)
    publisher.look(dataclasses.replace(look(), colour=noise))
    told, jpeg = page.next()
    assert isinstance(told, PictureNews)
    assert len(jpeg) == told.bytes <= LARGEST_PICTURE
    assert page.next()[0].width == 3840


class Source:
    """Pictures without end."""

    def __init__(self) -> None:
        self.over = threading.Event()

    def next(self):
        return None if self.over.wait(0.01) else (np.zeros((48, 64, 3), np.uint8), 0)

    def cancel(self) -> None:
        self.over.set()

    def close(self) -> None:
        self.over.set()


def test_pictures_that_a_page_wanted_are_not_taken_for_the_page_after_it(publisher, open_page, tmp_path: Path) -> None:
    opened: list[Source] = []

    def live(view: str, rate: float) -> Source:
        opened.append(Source())
        return opened[-1]

    publisher.session(dataclasses.replace(session(tmp_path), live=live))
    page = open_page(publisher)
    page.say(said="pictures", camera=0.0, film=5.0)
    until(lambda: len(opened) == 1)
    page.close()
    open_page(publisher)
    assert opened[0].over.wait(PATIENCE)
    assert len(opened) == 1


def test_pictures_that_have_ended_begin_again_while_somebody_watches(
    publisher, open_page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_pictures, "AGAIN", 0.0)
    opened: list[Source] = []

    def live(view: str, rate: float) -> Source:
        opened.append(Source())
        if len(opened) < 3:
            opened[-1].over.set()  # its camera says nothing any more
        return opened[-1]

    publisher.session(dataclasses.replace(session(tmp_path), live=live))
    page = open_page(publisher)
    page.say(said="pictures", camera=5.0, film=0.0)
    until(lambda: len(opened) == 3)
    page.say(said="pictures", camera=0.0, film=0.0)
    assert opened[2].over.wait(PATIENCE)
    assert len(opened) == 3
