"""Moves and requests spoken aloud at the terminal, by Debian's espeak-ng."""

from __future__ import annotations

import queue
import shutil
import subprocess
import threading
from collections.abc import Collection
from contextlib import suppress
from typing import Final, Self

import chess

from app import UserError
from app.records import PlyEvent
from app.settings.defaults import Voice
from app.terminal.game_display import UserInterface
from app.voice.german import MOVES, in_german
from app.voice.spoken_moves import ENGLISH

PROGRAM: Final = "espeak-ng"
WAITING: Final = 3
"""Sentences that may wait for those before them; what is older then is no longer worth saying."""
LAST_WORDS: Final = 15.0
"""At the end so long is waited for what is still to be said [s, wall]."""
_LANGUAGES: Final = {Voice.ENGLISH: "en", Voice.GERMAN: "de"}
"""As espeak-ng calls them."""


class SpeakerMissing(UserError):
    """There is nothing here that speaks."""

    def __init__(self) -> None:
        super().__init__(f"{PROGRAM} is not installed: run 'sudo apt-get install {PROGRAM}', or leave --speak out")


class Speaker(UserInterface):
    """Says moves, what the person should not miss, and what they are asked. A context manager.

    Args:
        voice: speaks; what it has no words for, the English one says.
        program: is given a sentence as its last argument, and returns when it was said.

    Raises:
        SpeakerMissing: it is not there.
    """

    def __init__(self, voice: Voice = Voice.ENGLISH, program: str = PROGRAM) -> None:
        found = shutil.which(program)
        if found is None:
            raise SpeakerMissing
        self._program, self._voice = found, voice
        self._sentences: queue.Queue[tuple[Voice, str] | None] = queue.Queue()
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

    def speaks(self) -> bool:
        """Whether something is being said, or is to be said next."""
        saying = self._saying
        return not self._sentences.empty() or (saying is not None and saying.poll() is None)

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        moves = MOVES if self._voice is Voice.GERMAN else ENGLISH
        self._put(self._voice, moves.spoken(event.san))

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
        german = in_german(sentence) if self._voice is Voice.GERMAN else None
        self._put(Voice.ENGLISH if german is None else Voice.GERMAN, german or sentence)

    def _put(self, voice: Voice, sentence: str) -> None:
        with suppress(queue.Empty):  # they may have been said this moment
            while self._sentences.qsize() >= WAITING:
                self._sentences.get_nowait()
        self._sentences.put((voice, sentence))

    def _run(self) -> None:
        while (said := self._sentences.get()) is not None:
            voice, sentence = said
            # a machine without loudspeaker, or an end in mid-word: the game goes on in writing
            self._saying = subprocess.Popen(
                [self._program, "-v", _LANGUAGES[voice], "--", sentence],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            if self._over.is_set():
                self._saying.kill()
            self._saying.wait()
