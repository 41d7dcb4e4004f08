"""The game's end of the page: tells the page's process what there is to see, and hears what is said there.

Whatever happens to the page, the game goes on: news are queued for a thread that writes them, and where nobody reads,
they are dropped once a page that starts anew would be told them again anyhow.
"""

from __future__ import annotations

import queue
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

import chess

from app.page.live_pictures import LivePictures
from app.page.news import (
    LARGEST_PICTURE,
    SAID,
    AnyNews,
    ClockNews,
    DeviceNews,
    EndNews,
    HeardNews,
    LineSaid,
    LookNews,
    PathNews,
    PhaseNews,
    PictureNews,
    PicturesWanted,
    Present,
    Program,
    PromptNews,
    RemoteNews,
    ResultNews,
    RoundNews,
    SayNews,
    SessionNews,
    Side,
    SquareSeen,
)
from app.terminal.game_display import UserInterface
from app.terminal.shown import ClockShown, LookShown, PathShown, RemoteShown, SessionShown, View
from hardware.piece_set import Colour

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

KEPT: Final = 200
"""So many of what was said and done last a page that starts is told again."""
WAITING: Final = 1000
"""News that may wait for a page that does not read; then it is given up, and told all anew when it reads again."""
POINTS: Final = 64
"""Of a motion's path: enough for a line that looks smooth."""
SURE: Final = 0.8
"""A square whose likeliest content is less likely than this counts as unsure."""
_STATES: Final = ("empty", "white", "black")
QUALITY: Final = 80
"""Of pictures, as JPEG counts it."""

Message = tuple[str, bytes]
"""A line and the bytes that follow it."""


class PagePublisher(UserInterface):
    """A user interface that the page's process shows.

    Args:
        program: that plays.
    """

    def __init__(self, program: Program) -> None:
        self._program = program
        self._line: Callable[[str], None] = lambda _: None
        self._lock = threading.Lock()
        self._newest = dict[str, Message]()
        """The last of each kind, or of each view or device, in the order in which they are told."""
        self._spoken = deque[Message](maxlen=KEPT)
        self._page: _PageLink | None = None
        self._prompts = 0
        self._pictures = LivePictures(self._picture)
        self.used = False
        """Somebody has held the page's controls."""
        self.given_up = False
        """There is no page any more, and none will come."""

    def subscribe(self, line: Callable[[str], None]) -> None:
        """Have somebody told each line that is said on the page."""
        self._line = line

    # ---- what there is to see

    def session(self, shown: SessionShown) -> None:
        """See ``UserInterface.session``."""
        place = None if shown.controller is None else (*shown.controller[:2], str(shown.controller[2].absolute()))
        self._tell(
            SessionNews(
                program=self._program, folder=str(shown.folder.absolute()), rig=shown.rig, pace=shown.pace.value,
                tick=shown.tick, person=None if shown.person is None else shown.person.value, hands=shown.hands,
                sees=shown.sees, controller=place, start=shown.start,
            )
        )  # fmt: skip
        self._pictures.open(shown.live, shown.tick)

    def round(self, folder: Path, number: int, *, sets_up: bool) -> None:
        """See ``UserInterface.round``."""
        with self._lock:  # a page that starts at this moment is being told all of them
            self._newest.pop("result", None)
        self._tell(RoundNews(folder=str(folder.absolute()), number=number, sets_up=sets_up))

    def phase(self, text: str) -> None:
        """See ``UserInterface.phase``."""
        self._tell(PhaseNews(text=text))

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        """See ``UserInterface.say``."""
        self._tell(SayNews(text=sentence, squares=tuple(squares)), spoken=True)

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """See ``UserInterface.prompt``."""
        self._prompts += 1
        asked = PromptNews(
            id=self._prompts, text=sentence, answers=tuple(answers), squares=tuple(squares), turn=turn
        )  # fmt: skip
        self._tell(asked)

    def answered(self) -> None:
        """See ``UserInterface.answered``."""
        self._tell(PromptNews())

    def heard(self, line: str) -> None:
        """See ``UserInterface.heard``."""
        self._tell(HeardNews(text=line), spoken=True)

    def result(self, result: str, reason: str) -> None:
        """See ``UserInterface.result``."""
        self._tell(ResultNews(result=result, reason=reason))

    def remote(self, shown: RemoteShown) -> None:
        """See ``UserInterface.remote``."""
        side: Side | None = None if shown.side is None else shown.side.value
        self._tell(RemoteNews(name=shown.name, side=side, words=shown.words))

    def clock(self, shown: ClockShown | None) -> None:
        """See ``UserInterface.clock``."""
        if shown is None:
            self._tell(ClockNews())
            return
        running = None if shown.running is None else _side(shown.running)
        white, black = (shown.left[colour] for colour in chess.COLORS)
        self._tell(ClockNews(white=white, black=black, running=running, free=shown.free, at=time.time()))

    def look(self, shown: LookShown) -> None:
        """See ``UserInterface.look``."""
        squares, unsure = _squares(shown)
        height, width = shown.colour.shape[:2]
        grid = tuple((round(float(x), 1), round(float(y), 1)) for x, y in shown.grid)
        self._picture("camera", shown.colour, shown.stamp)
        self._tell(
            LookNews(
                stamp=shown.stamp, outcome=shown.outcome, text=shown.text, unsure=unsure, squares=squares, grid=grid,
                width=width, height=height,
            )
        )  # fmt: skip

    def path(self, shown: PathShown) -> None:
        """See ``UserInterface.path``."""
        stride = max(1, -(-len(shown.position) // POINTS))
        position, stiffness = shown.position[::stride], shown.stiffness[::stride]
        self._tell(
            PathNews(
                label=shown.label, motion=shown.motion, stride=stride,
                points=tuple(map(tuple, position.round(5).tolist())),
                stiffness=tuple(map(tuple, stiffness.round(1).tolist())),
            )
        )  # fmt: skip

    def device(self, name: str, ok: bool | None, sentence: str) -> None:
        """See ``UserInterface.device``."""
        self._tell(DeviceNews(name=name, ok=ok, text=sentence), key=f"device {name}")

    def end(self, sentence: str) -> None:
        """The program ends; returns when the page has been told, or does not read."""
        self._pictures.close()
        self._tell(EndNews(text=sentence))
        if (page := self._page) is not None:
            page.finish()

    def _picture(self, view: View, colour: NDArray[np.uint8], stamp: float) -> None:
        import cv2  # only where there is a camera

        page = self._page
        if page is None or page.crowded:
            return
        shown = cv2.cvtColor(colour, cv2.COLOR_RGB2BGR)
        while True:
            done, encoded = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
            if not done:
                raise RuntimeError("OpenCV could not encode a picture")
            if encoded.size <= LARGEST_PICTURE:
                break
            shown = cv2.resize(shown, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        jpeg = encoded.tobytes()
        self._tell(PictureNews(view=view, stamp=stamp, bytes=len(jpeg)), jpeg, key=f"picture {view}")

    def _tell(self, news: AnyNews, after: bytes = b"", *, key: str | None = None, spoken: bool = False) -> None:
        message = news.model_dump_json() + "\n", after
        with self._lock:
            if spoken:
                self._spoken.append(message)
            else:
                self._newest[key or news.news] = message
            if self._page is not None:
                self._page.send(message)

    # ---- the page

    def connect(self, end: socket.socket) -> None:
        """A page has been started at the other end of a socket: it is told all that there is to see now."""
        self._pictures.want({})  # whoever looked at some did so on the page before
        with self._lock:
            before, self._page = self._page, _PageLink(end, self._hear)
            first = [self._newest[kind] for kind in ("session", "round") if kind in self._newest]
            rest = [message for kind, message in self._newest.items() if kind not in ("session", "round")]
            for message in (*first, *self._spoken, *rest):
                self._page.send(message)
        if before is not None:
            before.close()

    def disconnect(self) -> None:
        """Nobody shows anything any more."""
        with self._lock:
            page, self._page = self._page, None
        self._pictures.want({})  # whoever looked at some did so on that page
        if page is not None:
            page.close()

    def give_up(self) -> None:
        """Nobody shows anything any more, nor will anybody say anything on a page."""
        self.given_up = True
        self.disconnect()

    def _hear(self, raw: bytes) -> None:
        match SAID.validate_json(raw):
            case LineSaid(text=text):
                self._line(text)
            case Present(holder=holder):
                self.used = self.used or holder
            case PicturesWanted(camera=camera, film=film):
                self._pictures.want({"camera": camera, "film": film})


class _PageLink:
    """One page: a thread writes, another reads; ends with its socket."""

    def __init__(self, end: socket.socket, hear: Callable[[bytes], None]) -> None:
        self._socket, self._hear = end, hear
        self._waiting: queue.Queue[Message | None] = queue.Queue()
        self._writer = threading.Thread(target=self._write, name="page writer", daemon=True)
        self._writer.start()
        threading.Thread(target=self._read, name="page reader", daemon=True).start()

    @property
    def crowded(self) -> bool:
        """It does not read as quickly as pictures are made."""
        return self._waiting.qsize() > POINTS

    def send(self, message: Message) -> None:
        """Queue a message; a page that has stopped reading is let go of, and its process is started anew."""
        if self._waiting.qsize() > WAITING:
            self.close()
        else:
            self._waiting.put(message)

    def finish(self, patience: float = 1.0) -> None:
        """Write what waits, and no more; not for longer than the patience [s]."""
        self._waiting.put(None)
        self._writer.join(patience)

    def close(self) -> None:
        """Let go."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._waiting.put(None)

    def _write(self) -> None:
        with self._socket, suppress(OSError):  # the page is gone: who started it sees that, too
            while (message := self._waiting.get()) is not None:
                line, after = message
                self._socket.sendall(line.encode() + after)

    def _read(self) -> None:
        with suppress(OSError), self._socket.makefile("rb") as lines:
            for line in lines:
                self._hear(line)


def _side(colour: chess.Color) -> Side:
    return Colour.WHITE.value if colour else Colour.BLACK.value


def _squares(shown: LookShown) -> tuple[tuple[SquareSeen, ...], tuple[str, ...]]:
    """What is seen on each square, and the squares where that is not sure."""
    if shown.likelihood is None:
        return (), ()
    likeliest, sure = shown.likelihood.argmax(axis=1), shown.likelihood.max(axis=1)
    squares = tuple(
        SquareSeen(seen=_STATES[state], sure=round(float(how), 4)) for state, how in zip(likeliest, sure, strict=True)
    )
    return squares, tuple(chess.square_name(int(square)) for square in (sure < SURE).nonzero()[0])
