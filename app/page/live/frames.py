"""What a browser may send: the schema of each text frame, and nothing else is taken."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError

from app.page.news import LONGEST_LINE
from hardware.frozen import FrozenFinite

LARGEST_FRAME: Final = 4096
"""Of a message from a browser [bytes]."""


def _one_line(text: str) -> str:
    if not text.strip() or not text.isprintable():
        raise ValueError("give one line of text")
    return text


class HelloFrame(FrozenFinite):
    """The first frame of a browser: the token that its page drew by lot, to be known again after it was loaded anew."""

    type: Literal["hello"]
    token: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{16,64}$")]
    held: Annotated[str | None, Field(max_length=400)] = None
    """``session.id`` of the game whose controls it held when its connection was lost; null: it held none."""
    again: int | None = None
    """Its number when its connection was lost, of a page that was not loaded anew since."""


class LineFrame(FrozenFinite):
    """Something is said, as if typed at the terminal."""

    type: Literal["line"]
    text: Annotated[str, Field(min_length=1, max_length=LONGEST_LINE), AfterValidator(_one_line)]


class StopFrame(FrozenFinite):
    """The arm is to stop."""

    type: Literal["stop"]


class ControlsFrame(FrozenFinite):
    """Something about the controls."""

    type: Literal["controls"]
    action: Literal["take", "ask", "give", "keep", "release"]


class WatchFrame(FrozenFinite):
    """What is looked at: nothing else of it is sent, or made."""

    type: Literal["watch"]
    telemetry: bool = False
    camera: bool = False
    film: bool = False


AnyFrame = HelloFrame | LineFrame | StopFrame | ControlsFrame | WatchFrame
_FRAME: TypeAdapter[AnyFrame] = TypeAdapter(Annotated[AnyFrame, Field(discriminator="type")])


class FrameRefused(Exception):
    """A frame is none of the schema; the message is one sentence that says what is wrong with it."""


def read_frame(text: str) -> AnyFrame:
    """What a browser sent.

    Raises:
        FrameRefused: it is nothing that a browser may send.
    """
    try:
        return _FRAME.validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False, include_context=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "the frame"
        raise FrameRefused(f"{where}: {first['msg']}: docs/page.md lists the valid frames") from error
