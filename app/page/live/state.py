"""The state of a page that shows what goes on: what the game says, and its record, as sections of the hub."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from app.page.live.hub import Hub
from app.page.news import (
    AnyNews,
    ClockNews,
    DeviceNews,
    EndNews,
    HeardNews,
    LookNews,
    PathNews,
    PhaseNews,
    PictureNews,
    PromptNews,
    RemoteNews,
    ResultNews,
    RoundNews,
    SayNews,
    SessionNews,
)
from app.page.recorded.catalogue import RecordPlace
from app.page.recorded.follower import RecordFollower
from app.page.recorded.game_fold import RoundShown
from app.records.files import RecordError
from app.terminal.shown import View
from hardware.piece_set import Colour

KEPT: Final = 200
"""Of what was said and done last."""


@dataclass(frozen=True, slots=True)
class ShownPicture:
    """A picture of a view."""

    number: int
    """Rises with each picture of the view."""
    stamp: float
    """Plant time of its exposure [s]."""
    jpeg: bytes


class PageState:
    """Takes news and the record in, and puts sections into the hub.

    Args:
        hub: that tells them on.
        record_id: of a record's folder, in the page's addresses.
        now: wall time [s since 1970].
    """

    def __init__(self, hub: Hub, record_id: Callable[[Path], str], now: Callable[[], float] = time.time) -> None:
        self._hub, self._record_id, self._now = hub, record_id, now
        self.session: SessionNews | None = None
        self.ended: str | None = None
        self._live = True
        self._shows: str | None = None
        self._shown_folder: Path | None = None
        self.pictures: dict[View, ShownPicture] = {}
        self._round: RoundNews | None = None
        self._result: ResultNews | None = None
        self._record: RecordFollower | None = None
        self._failed: str | None = None
        self._log: deque[dict[str, Any]] = deque(maxlen=KEPT)
        self._entries = 0
        self._devices: dict[str, dict[str, Any]] = {}
        hub.put("log", [])
        hub.put("devices", [])
        hub.put("pictures", {"camera": None, "film": None})
        self._put_session()

    @property
    def session_id(self) -> str | None:
        """What the session is called; None: there is none."""
        return None if self.session is None else self._record_id(Path(self.session.folder))

    @property
    def folder(self) -> Path | None:
        """Of the record that is shown; None: there is none."""
        return self._shown_folder if self._round is None else Path(self._round.folder)

    def take(self, news: AnyNews, jpeg: bytes = b"") -> None:
        """Something new from the game; a picture with its JPEG."""
        match news:
            case SessionNews():
                self.session = news
                self._put_session()
                self._begin()
            case RoundNews():
                self._round, self._result = news, None
                self._put_session()
                self._begin()
            case PhaseNews(text=text):
                self._hub.put("phase", text)
                self._write("phase", text)
            case SayNews(text=text, squares=squares):
                self._write("say", text, squares)
            case HeardNews(text=text):
                self._write("heard", text)
            case ResultNews():
                self._result = news
                self._put_game()
            case EndNews(text=text):
                self.end(text)
            case PictureNews():
                self._take_picture(news, jpeg)
            case _:
                self._put(news)

    def _put(self, news: PromptNews | RemoteNews | ClockNews | LookNews | PathNews | DeviceNews) -> None:
        """News that are a section, nearly."""
        shown = news.model_dump(exclude={"news"})
        match news:
            case PromptNews():
                self._hub.put("prompt", shown if news.id else None)
            case RemoteNews():
                self._hub.put("remote", shown)
            case ClockNews():
                self._put_clock(news)
            case LookNews():
                camera = self.pictures.get("camera")
                self._hub.put("look", {**shown, "picture": None if camera is None else camera.number})
            case PathNews():
                self._hub.put("path", shown)
            case DeviceNews():
                self._devices[news.name] = shown
                self._hub.put("devices", list(self._devices.values()))

    def end(self, sentence: str) -> None:
        """Nothing more comes."""
        self.follow()
        self.ended = sentence
        self._put_session()
        self._hub.put("prompt", None)
        self._write("say", sentence)

    def show_record(self, place: RecordPlace | None) -> None:
        """Nothing is played: a record is shown, or None: whichever somebody chooses."""
        self._live = False
        if place is not None:
            self._shows, self._shown_folder = place.id, place.folder
        self._put_session()

    def follow(self) -> None:
        """Read what the record holds since."""
        if self._record is None or self._failed is not None:
            return
        try:
            events = self._record.follow()
        except RecordError as error:
            self._failed = str(error)
            self._write("trouble", self._failed)
            return
        if events:
            self._put_game()

    def _begin(self) -> None:
        """A game's record is followed from its beginning."""
        if self._round is None:
            return
        folder = Path(self._round.folder)
        self._record, self._failed = RecordFollower(folder), None
        self._hub.put("game", None)
        self.follow()

    def _put_game(self) -> None:
        if self._round is None or self._record is None or (game := self._record.game) is None:
            return
        decided = None if self._result is None else (self._result.result, self._result.reason)
        person = None if self.session is None or self.session.person is None else Colour(self.session.person)
        shown = RoundShown(
            self._record_id(Path(self._round.folder)), self._round.number, self._round.sets_up, person
        )  # fmt: skip
        self._hub.put_made("game", lambda: game.section(shown, decided))

    def _put_session(self) -> None:
        news = self.session
        shown = {"live": self._live and self.ended is None, "ended": self.ended, "shows": self._shows}
        known = {} if news is None else news.model_dump(exclude={"news", "folder", "controller"})
        if known and self._round is not None and self._round.number > 1:
            known["start"] = None  # that was the first game's
        self._hub.put("session", {"id": self.session_id, **known, **shown})

    def _put_clock(self, news: ClockNews) -> None:
        since = self._now() if news.at is None else news.at
        shown = news.model_dump(exclude={"news", "at"})
        self._hub.put_each("clock", lambda _: {**shown, "age": round(max(0.0, self._now() - since), 3)})

    def _take_picture(self, news: PictureNews, jpeg: bytes) -> None:
        before = self.pictures.get(news.view)
        self.pictures[news.view] = ShownPicture(1 if before is None else before.number + 1, news.stamp, jpeg)
        self._hub.put(
            "pictures",
            {
                view: None
                if (shown := self.pictures.get(view)) is None
                else {"number": shown.number, "stamp": shown.stamp}
                for view in VIEWS
            },
        )

    def _write(self, kind: str, text: str, squares: tuple[str, ...] = ()) -> None:
        self._entries += 1
        self._log.append({"id": self._entries, "kind": kind, "text": text, "squares": squares})
        self._hub.put_made("log", lambda: list(self._log))


VIEWS: Final[tuple[View, ...]] = ("camera", "film")
