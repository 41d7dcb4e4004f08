"""Those at the page: who they are, what they may, and what becomes of what they send."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, replace
from typing import Final

from app.page.live.controls import GRACE, Controls, ControlsRefused
from app.page.live.frames import AnyFrame, ControlsFrame, HelloFrame, LineFrame, StopFrame, WatchFrame
from app.page.live.hub import Hub, Watcher
from app.page.news import AnySaid, LineSaid, PicturesWanted, Present

MOST: Final = 64
"""Browsers at once."""
KNOWN: Final = 1000
"""Tokens that are remembered; the oldest are forgotten first."""
PICTURES: Final = 5.0
"""Of a view that somebody looks at [1/s]."""

Tell = Callable[[AnySaid], None]
Stop = Callable[[], Awaitable[str | None]]
"""Stops the arm; a sentence where that did not go."""


class TooMany(Exception):
    """No more browsers are let in."""


@dataclass(slots=True)
class Streams:
    """How many look at the MJPEG stream of each view."""

    camera: int = 0
    film: int = 0


@dataclass(slots=True)
class People:
    """Lets browsers in, does what they send as far as they may, and tells the game what it has to know.

    Args:
        hub: tells them the state.
        tell: says something to the game.
    """

    hub: Hub
    tell: Tell
    session: Callable[[], str | None] = lambda: None
    """Of the game that is played: its name."""
    stop: Stop | None = None
    """Stops the arm; None: no controller answers."""
    controls: Controls = field(default_factory=Controls)
    now: Callable[[], float] = time.monotonic
    streams: Streams = field(default_factory=Streams)
    ended: bool = False
    """Nobody hears lines any more."""
    _numbers: dict[str, int] = field(default_factory=dict)
    _last: int = 0
    _began: float = 0.0
    _claims: dict[int, str] = field(default_factory=dict)
    """In what session somebody held the controls, as their browsers say: unjudged while no session is known."""
    _held: set[int] = field(default_factory=set)
    """Who held the controls on the page before this one."""
    _timer: asyncio.TimerHandle | None = None
    _present: bool = False
    _wanted: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        self._began = self.now()
        self.show()

    def joined(self, hello: HelloFrame) -> Watcher:
        """A browser comes; by its token it is known again, unless somebody else is here by that.

        Raises:
            TooMany: there is no room.
        """
        number = self._numbers.get(hello.token)
        for watcher in self.hub.watchers:
            if watcher.number == number == hello.again:
                self.hub.leave(watcher)  # itself, by a connection of which nobody knows yet that it is dead
        here = {watcher.number for watcher in self.hub.watchers}
        if len(here) >= MOST:
            raise TooMany(f"{MOST} browsers are already watching: close one of them")
        if number is None or number in here:
            self._last += 1
            number = self._last
            self._numbers[hello.token] = number
            if len(self._numbers) > KNOWN:
                del self._numbers[next(iter(self._numbers))]
        watcher = self.hub.join(number)
        if hello.held is not None:
            self._claims[number] = hello.held
        self._set(self._as_before(self.controls.joined(number, self.now())))
        return watcher

    def session_came(self) -> None:
        """The game has told its name; somebody may have been here before that."""
        self._set(self._as_before(self.controls))

    def _as_before(self, controls: Controls) -> Controls:
        """A page that was started again knows nobody: who held the controls of this game before has them again."""
        if (session := self.session()) is None:
            return controls
        claims, self._claims = self._claims, {}
        if self.now() - self._began > GRACE:
            return controls
        for number in (number for number, held in claims.items() if held == session):
            self._held.add(number)
            controls = controls if controls.holder in self._held else replace(controls, holder=number, left=None)
        return controls

    def left(self, watcher: Watcher) -> None:
        """A browser has gone; one that has come again is still here."""
        if not self.hub.leave(watcher):
            return
        self._claims.pop(watcher.number, None)
        self._set(self.controls.gone(watcher.number, self.now()))
        self.want()

    async def receive(self, watcher: Watcher, frame: AnyFrame) -> None:
        """Do what somebody wants, or tell them why not."""
        match frame:
            case HelloFrame():
                watcher.refuse("you have already said hello")
            case LineFrame(text=text):
                self._say(watcher, text)
            case StopFrame():
                sentence = "there is no controller to stop" if self.stop is None else await self.stop()
                if sentence is not None:
                    watcher.refuse(sentence)
            case ControlsFrame():
                self._change(watcher, frame)
            case WatchFrame():
                looks = {"telemetry": frame.telemetry, "camera": frame.camera, "film": frame.film}
                watcher.watches = frozenset(what for what, looked in looks.items() if looked)
                self.want()

    def want(self) -> None:
        """Tell the game which pictures somebody looks at, where that has changed."""
        camera = self.hub.watched("camera") or self.streams.camera > 0
        film = self.hub.watched("film") or self.streams.film > 0
        wanted = PICTURES * camera, PICTURES * film
        if wanted != self._wanted:
            self._wanted = wanted
            self.tell(PicturesWanted(camera=wanted[0], film=wanted[1]))

    def _say(self, watcher: Watcher, text: str) -> None:
        if self.ended:
            watcher.refuse("the game's program has ended: this was not sent")
        elif self.controls.holder != watcher.number:
            watcher.refuse("you do not hold the controls: ask for them")
        else:
            self.tell(LineSaid(text=text))

    def _change(self, watcher: Watcher, frame: ControlsFrame) -> None:
        who, here = watcher.number, self.controls.expired(self.now())
        try:
            match frame.action:
                case "take":
                    here = here.taken(who)
                case "ask":
                    here = here.asked(who)
                case "give":
                    here = here.given(who)
                case "keep":
                    here = here.kept(who)
                case "release":
                    here = here.released(who)
        except ControlsRefused as refused:
            watcher.refuse(str(refused))
        self._set(here)

    def _expire(self) -> None:
        self._timer = None
        self._set(self.controls.expired(self.now()))

    def _set(self, controls: Controls) -> None:
        changed, self.controls = controls != self.controls, controls
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if controls.deadline is not None:
            delay = max(0.0, controls.deadline - self.now()) + 0.01
            self._timer = asyncio.get_running_loop().call_later(delay, self._expire)
        if changed:
            self.show()
        present = controls.holder is not None
        if present != self._present:
            self._present = present
            self.tell(Present(holder=present))

    def show(self) -> None:
        """Tell everybody about the controls."""
        controls, stoppable = self.controls, self.stop is not None
        self.hub.put_each(
            "controls",
            lambda watcher: {
                "you": watcher.number, "holder": controls.holder, "watchers": len(controls.watchers),
                "asking": controls.asking, "stoppable": stoppable,
            },
        )  # fmt: skip
