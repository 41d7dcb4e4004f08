"""Takes moves and requests that are spoken at the board, and offers them as if they had been typed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection
from typing import Self

import chess

from app import UserError
from app.records import PlyEvent
from app.terminal.game_display import UserInterface
from app.voice.dialogue import PATIENCE, Reply, reply
from app.voice.microphone import PROGRAM, Microphone
from app.voice.phrases import ADDRESS, NEITHER, NO, YES, grammar_of, lines_of, sayable
from app.voice.recogniser import Recogniser


class Listener(UserInterface):
    """Follows the game, so that it knows which moves can be said. A context manager.

    Args:
        offer: is given each line; from a thread of its own.
        tell: is given what the person is asked, and why nothing is heard any more; from that thread.
        deaf: whether the robot itself speaks, so that it does not hear itself.
        program: records.

    Raises:
        UserError: there is nothing that records or understands; one sentence with the remedy.
    """

    def __init__(
        self, offer: Callable[[str], None], tell: Callable[[str], None], deaf: Callable[[], bool] = lambda: False,
        program: str = PROGRAM,
    ) -> None:  # fmt: skip
        self._recogniser = Recogniser()
        self._microphone = Microphone(program)
        self._offer, self._tell, self._deaf = offer, tell, deaf
        self._board, self._answers = chess.Board(), frozenset[str]()
        self._waiting: str | None = None
        self._called = False
        self._heeded = 0.0
        self._thread = threading.Thread(target=self._run, name="listener", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._microphone.__exit__()
        self._thread.join()

    def position(self, board: chess.Board) -> None:
        """See ``UserInterface.position``."""
        self._board, self._waiting = board.copy(stack=False), None

    def ply(self, event: PlyEvent, board: chess.Board) -> None:
        """See ``UserInterface.ply``."""
        self.position(board)

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        """See ``UserInterface.prompt``."""
        self._answers = frozenset(answers)
        if YES in self._answers:
            self._waiting = None  # from now on a yes is meant for this question

    def answered(self) -> None:
        """See ``UserInterface.answered``."""
        self._answers = frozenset()

    def _run(self) -> None:
        try:
            for sound in self._microphone.utterances(self._deaf):
                self._heed(sound)
        except UserError as error:
            self._tell(f"{error}; moves can be typed")

    def _heed(self, sound: bytes) -> None:
        if time.monotonic() - self._heeded > PATIENCE:
            self._waiting, self._called = None, False
        addressed = self._recogniser.addressed(sound)
        if addressed or self._called:
            self._heed_request(sound, f"{ADDRESS} " if addressed else "")
        elif self._waiting is not None:
            answer = self._recogniser.understood(sound, " | ".join((YES, NO, *NEITHER)))
            if answer in (YES, NO):
                self._go_on(reply(answer, self._waiting))

    def _heed_request(self, sound: bytes, before: str) -> None:
        said = sayable(self._board, filter(self._recogniser.knows, self._answers))
        grammar = f"{before}( {grammar_of(said)} )" + (f" | {before}" if before else "")
        phrase = (self._recogniser.understood(sound, grammar) or "").removeprefix(before)
        lines = lines_of(said)
        self._called, self._heeded = bool(before) and phrase not in lines, time.monotonic()  # what is wanted may follow
        if phrase in lines:
            self._go_on(reply(lines[phrase], self._waiting))

    def _go_on(self, next_step: Reply) -> None:
        self._waiting, self._heeded = next_step.waiting, time.monotonic()
        if next_step.sentence is not None:
            self._tell(next_step.sentence)
        if next_step.line is not None:
            self._offer(next_step.line)
