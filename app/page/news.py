"""What the game's process and the page's tell each other: one JSON object a line, a picture's bytes after its line.

docs/page.md lists the fields; these classes are the schema, for both ends.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, TypeAdapter

from app.terminal.shown import RigKind, View
from hardware.frozen import FrozenFinite

Side = Literal["white", "black"]
Program = Literal["play", "demo", "replay", "setup", "resume"]
Triple = tuple[float, float, float]
LONGEST_LINE = 200
"""Of what somebody can say at once [characters]."""
LARGEST_PICTURE = 1 << 21
"""[bytes]"""


class SessionNews(FrozenFinite):
    """What is played on which rig; said once, first of all."""

    news: Literal["session"] = "session"
    program: Program
    folder: str
    rig: RigKind
    pace: Literal["real", "fast"]
    tick: float
    """Length of a tick [s]."""
    person: Side | None = None
    hands: bool = False
    """A simulated hand moves the person's pieces."""
    sees: bool = False
    """There is a camera."""
    controller: tuple[str, int, str] | None = None
    """Host, UDP port and key file of the controller; None: there is none, or not yet."""
    start: str | None = None
    """FEN of the position that the first game begins from; None: that is not known yet."""


class RoundNews(FrozenFinite):
    """A game, or a setting up, begins; its record lies in a folder."""

    news: Literal["round"] = "round"
    folder: str
    number: int
    sets_up: bool


class PhaseNews(FrozenFinite):
    """What is being done now."""

    news: Literal["phase"] = "phase"
    text: str


class SayNews(FrozenFinite):
    """Something for the person, about some squares."""

    news: Literal["say"] = "say"
    text: str
    squares: tuple[str, ...] = ()


class PromptNews(FrozenFinite):
    """Somebody is to say something; ``id`` 0: nothing is asked any more."""

    news: Literal["prompt"] = "prompt"
    id: int = 0
    text: str = ""
    answers: tuple[str, ...] = ()
    squares: tuple[str, ...] = ()
    turn: bool = False
    """It asks for a move."""


class HeardNews(FrozenFinite):
    """A line was taken."""

    news: Literal["heard"] = "heard"
    text: str


class ClockNews(FrozenFinite):
    """What both clocks show [s], and whose runs."""

    news: Literal["clock"] = "clock"
    white: float | None = None
    black: float | None = None
    running: Side | None = None
    free: float = 0.0
    """So long the one that runs stands first, as of a delay [s]."""
    at: float | None = None
    """Wall time at which they did [s since 1970]: a page that starts later is told the same news; None: now."""


class RemoteNews(FrozenFinite):
    """Who plays from somewhere else, which pieces, and the words that it makes sense to say now."""

    news: Literal["remote"] = "remote"
    name: str | None = None
    """None: nobody is found yet."""
    side: Side | None = None
    words: tuple[str, ...]


class SquareSeen(FrozenFinite):
    """What vision thinks of a square, and how sure it is."""

    seen: Literal["empty", "white", "black"]
    sure: Annotated[float, Field(ge=0.0, le=1.0)]


class LookNews(FrozenFinite):
    """What a look at the board came to."""

    news: Literal["look"] = "look"
    stamp: float
    """Plant time of the exposure [s]."""
    outcome: str
    text: str
    unsure: tuple[str, ...] = ()
    squares: tuple[SquareSeen, ...] = ()
    """Of a1, b1, … h8; none: the board was not read."""
    grid: tuple[tuple[float, float], ...] = ()
    """The corners of the squares in the picture, 81 points from a1's outer corner along the files [px]."""
    width: int
    height: int


class PictureNews(FrozenFinite):
    """A picture; so many bytes of JPEG follow the line."""

    news: Literal["picture"] = "picture"
    view: View
    stamp: float
    bytes: Annotated[int, Field(ge=1, le=LARGEST_PICTURE)]


class PathNews(FrozenFinite):
    """The reference of a motion that begins."""

    news: Literal["path"] = "path"
    label: str
    motion: int
    """Its number, as telemetry counts them."""
    points: tuple[Triple, ...]
    """Of the tool, base frame [m]."""
    stiffness: tuple[Triple, ...]
    """k_p there, along the axes of the base frame [1/s²]."""
    stride: int
    """From point to point [samples]."""


class DeviceNews(FrozenFinite):
    """How a device is, in plain words."""

    news: Literal["device"] = "device"
    name: str
    ok: bool | None
    text: str


class ResultNews(FrozenFinite):
    """The game that is played is over, or is left; its record may not have its end yet."""

    news: Literal["result"] = "result"
    result: str
    reason: str


class EndNews(FrozenFinite):
    """The program ends; nothing comes after it."""

    news: Literal["end"] = "end"
    text: str


AnyNews = (
    SessionNews | RoundNews | PhaseNews | SayNews | PromptNews | HeardNews | RemoteNews | ClockNews | LookNews
    | PictureNews | PathNews | DeviceNews | ResultNews | EndNews
)  # fmt: skip
NEWS: TypeAdapter[AnyNews] = TypeAdapter(Annotated[AnyNews, Field(discriminator="news")])


class LineSaid(FrozenFinite):
    """Somebody says a line on the page."""

    said: Literal["line"] = "line"
    text: Annotated[str, Field(max_length=LONGEST_LINE)]


class Present(FrozenFinite):
    """Whether somebody holds the page's controls."""

    said: Literal["present"] = "present"
    holder: bool


class PicturesWanted(FrozenFinite):
    """How many pictures a second somebody watches [1/s]."""

    said: Literal["pictures"] = "pictures"
    camera: Annotated[float, Field(ge=0.0, le=30.0)]
    film: Annotated[float, Field(ge=0.0, le=30.0)]


AnySaid = LineSaid | Present | PicturesWanted
SAID: TypeAdapter[AnySaid] = TypeAdapter(Annotated[AnySaid, Field(discriminator="said")])
