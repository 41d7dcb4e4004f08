"""Moves and requests spoken aloud at the terminal, by Debian's espeak-ng."""

from __future__ import annotations

import queue
import re
import shutil
import subprocess
import threading
from collections.abc import Collection, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import Final, Self

import chess

from app import UserError
from app.records import PlyEvent
from app.terminal.interface import UserInterface

PROGRAM: Final = "espeak-ng"
WAITING: Final = 3
"""Sentences that may wait for those before them; what is older then is no longer worth saying."""
LAST_WORDS: Final = 15.0
"""At the end so long is waited for what is still to be said [s, wall]."""
_PIECES: Final[Mapping[str, str]] = MappingProxyType(
    {"K": "king", "Q": "queen", "R": "rook", "B": "bishop", "N": "knight"}
)
_SAN: Final = re.compile(r"([KQRBN]?)([a-h]?[1-8]?)(x?)([a-h][1-8])(?:=([QRBN]))?([+#]?)")
_ENDS: Final = {"": "", "+": ", check", "#": ", checkmate"}


class SpeakerMissing(UserError):
    """There is nothing here that speaks."""

    def __init__(self) -> None:
        super().__init__(f"{PROGRAM} is not installed: run 'sudo apt-get install {PROGRAM}', or leave --speak out")


class Speaker(UserInterface):
    """Says moves, what the person should not miss, and what they are asked. A context manager.

    Args:
        program: is given a sentence as its last argument, and returns when it was said.

    Raises:
        SpeakerMissing: it is not there.
    """

    def __init__(self, program: str = PROGRAM) -> None:
        found = shutil.which(program)
        if found is None:
            raise SpeakerMissing
        self._program = found
        self._sentences: queue.Queue[str | None] = queue.Queue()
        self._saying: subprocess.Popen[bytes] | None = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="speaker", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """What waits is still said, unless that takes long, as where the loudspeaker is taken and the voice hangs."""
        self._sentences.put(None)
        self._thread.join(LAST_WORDS)
        self._over.set()
        if (saying := self._saying) is not None:
            saying.kill()
        self._thread.join()

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        self._say(spoken(event.san))

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        """See ``UserInterface.say``."""
        self._say(sentence)

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """See ``UserInterface.prompt``; whose turn it is can be heard from the move before."""
        if not turn:
            self._say(sentence)

    def result(self, result: str, reason: str) -> None:
        """See ``UserInterface.result``."""
        self._say(reason)

    def _say(self, sentence: str) -> None:
        with suppress(queue.Empty):  # they may have been said this moment
            while self._sentences.qsize() >= WAITING:
                self._sentences.get_nowait()
        self._sentences.put(sentence)

    def _run(self) -> None:
        while (sentence := self._sentences.get()) is not None:
            # a machine without loudspeaker, or an end in mid-word: the game goes on in writing
            self._saying = subprocess.Popen(
                [self._program, "--", sentence], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )  # fmt: skip
            if self._over.is_set():
                self._saying.kill()
            self._saying.wait()


def spoken(san: str) -> str:
    """A move in SAN as people say it: ``Nbxd7+`` is "knight b takes d7, check"."""
    castles = san.rstrip("+#")
    if castles in ("O-O", "O-O-O"):
        return f"castles {'short' if castles == 'O-O' else 'long'}{_ENDS[san[len(castles) :]]}"
    found = _SAN.fullmatch(san)
    if found is None:
        raise ValueError(f"'{san}' is not a move in SAN: take it from python-chess")
    piece, origin, takes, target, promoted, end = found.groups()
    words = [_PIECES.get(piece, ""), origin, "takes" if takes else "", target]
    if promoted:
        words.append(f"becomes a {_PIECES[promoted]}")
    return " ".join(word for word in words if word) + _ENDS[end]
