"""UCI as python-chess speaks it, and what a game on a robot needs beside it.

* Pondering on any position at any time (``go ponder``, then ``ponderhit`` or ``stop``). python-chess itself ponders
  only right after a move of the engine's own, with a clock that it computes, and forgets what was said before the hit.
* ``stop`` when a search has had its time, so that an engine that heeds no clock loses no game by it.
* A pulse: ``isready`` must be answered in the midst of a search. An engine that was seen to do so and does not any more
  hangs, and is known to long before its time is over.
* A bound on what it may write.
"""

from __future__ import annotations

import asyncio
import logging
import math
import os
import signal
from collections import deque
from collections.abc import Awaitable
from contextlib import suppress
from typing import TypeVar

import chess
import chess.engine
from chess.engine import _parse_uci_bestmove, _parse_uci_info  # its own commands are closed to new ones

from engine.errors import Hung

T = TypeVar("T")

LOGGER = logging.getLogger(__name__)
# What an engine writes beside the protocol is no news for the terminal: a handler keeps Python's last resort silent.
logging.getLogger(chess.engine.__name__).addHandler(logging.NullHandler())

PULSE = 1.0
"""Between two looks at whether a searching engine still listens [s]."""

PULSE_DEADLINE = 5.0
"""An engine that listens answers within this, however busy the machine [s]."""

TICK = 0.2
"""Between two looks at a search that should have ended [s]."""

FLOOD = 8 << 20
"""More than this within a second is no chess [bytes]; Stockfish writes some 10^4."""

LONGEST_LINE = 1 << 20
"""[bytes]; the longest lines hold a variation of some 10^3."""

TOLD = chess.engine.INFO_BASIC | chess.engine.INFO_SCORE | chess.engine.INFO_PV
"""What is kept of what an engine says of its search."""


class Uci(chess.engine.UciProtocol):
    """The protocol of one process."""

    def __init__(self) -> None:
        super().__init__()
        self.last_words = ""
        """Last line from stderr: often the only explanation of a death."""
        self.trouble = ""
        """Phrase of why it was killed from in here, if it was."""
        self._pondering: _Ponder | None = None
        self._pulses = deque[float]()
        self._searches = False
        self._listens = False
        self._window = (0.0, 0)

    # -------------------------------------------------------------------------------------------------------- questions

    async def watched(self, question: Awaitable[T], stop_after: float | None) -> T:
        """Await a search, feel its pulse, and stop it when its time is over.

        Args:
            question: such as ``play`` or ``hit`` of this protocol.
            stop_after: seconds until ``stop`` is sent; None: never.

        Raises:
            Hung: it has answered pulses before, and does not any more.
        """
        loop = asyncio.get_running_loop()
        now = pulse = loop.time()
        end = math.inf if stop_after is None else now + stop_after
        self._searches = True
        task = asyncio.ensure_future(question)
        try:
            while True:
                done, _ = await asyncio.wait({task}, timeout=min(PULSE, end - now) if now < end else TICK)
                if done:
                    return task.result()
                now = loop.time()
                if now >= end:
                    self.send_line("stop")  # each time: the search may have begun after the last one
                if now >= pulse + PULSE:
                    pulse = now
                    self._feel_pulse(now)
        finally:
            task.cancel()
            self._pulses.clear()

    async def begin_ponder(self, board: chess.Board, limit: chess.engine.Limit, game: object) -> None:
        """Search a position that is expected; the next question of any kind ends it, ``hit`` makes it count."""
        self._pondering = await self.communicate(lambda _: _Ponder(self, board, limit, game))

    async def hit(self) -> chess.engine.PlayResult:
        """The position has come: the answer to the search that runs, as if it had been asked for a move all along."""
        if self._pondering is None:
            raise chess.engine.EngineError("it was not pondering")
        return await self._pondering.hit()

    def _feel_pulse(self, now: float) -> None:
        if self._pulses:
            if self._listens and now - self._pulses[0] > PULSE_DEADLINE:
                raise Hung(f"it has not listened for {PULSE_DEADLINE:g} s in the midst of a search")
            return
        self._pulses.append(now)
        self.send_line("isready")

    # ---------------------------------------------------------------------------------------------------- what it says

    def _line_received(self, line: str) -> None:
        if line.startswith("bestmove"):
            self._searches = False
        if self._pulses and line.strip() == "readyok":
            self._pulses.popleft()
            self._listens |= self._searches  # one that answers after the search does not listen in it
            return
        super()._line_received(line)

    def error_line_received(self, line: str) -> None:
        """Keep it."""
        LOGGER.debug("%s: stderr: %s", self, line)
        self.last_words = line.strip() or self.last_words

    def pipe_data_received(self, fd: int, data: bytes | str) -> None:
        """Read on, unless it is a flood: then the process is killed."""
        if self.trouble:
            return
        second, written = self._window
        now = self.loop.time()
        self._window = (second, written + len(data)) if now - second < 1.0 else (now, len(data))
        if self._window[1] > FLOOD:
            self._kill(f"it wrote more than {FLOOD >> 20} MiB within a second")
        elif len(self.buffer[fd]) > LONGEST_LINE:
            self._kill(f"it wrote a line of more than {LONGEST_LINE >> 20} MiB")
        else:
            super().pipe_data_received(fd, data)

    def _kill(self, trouble: str) -> None:
        self.trouble = trouble
        assert self.transport is not None, "it has written"
        with suppress(ProcessLookupError):  # it died of its own just now
            os.killpg(self.transport.get_pid(), signal.SIGKILL)


class _Ponder(chess.engine.BaseCommand["_Ponder"]):
    """``go ponder``: its result, itself, is there as soon as the search runs; it is finished by ``bestmove``."""

    def __init__(self, uci: Uci, board: chess.Board, limit: chess.engine.Limit, game: object) -> None:
        super().__init__(uci)
        self._uci, self._board, self._limit, self._game = uci, board, limit, game
        self._info: chess.engine.InfoDict = {}
        self._answer: asyncio.Future[chess.engine.PlayResult] = asyncio.get_running_loop().create_future()
        self._new_game = False

    async def hit(self) -> chess.engine.PlayResult:
        if not self._answer.done():  # some engines answer before, such as when they see a mate: so be it
            self._uci.send_line("ponderhit")
        return await asyncio.shield(self._answer)

    def start(self) -> None:
        uci = self._uci
        for name, value in (("UCI_AnalyseMode", False), ("Ponder", True)):
            if name in uci.options and name not in uci.target_config:
                uci._setoption(name, value)
        if "MultiPV" in uci.options:
            uci._setoption("MultiPV", uci.options["MultiPV"].default)
        uci._configure({})  # what a hint has changed
        self._new_game = uci.first_game or uci.game != self._game
        if self._new_game:
            uci.game = self._game
            uci._ucinewgame()
            uci._isready()
        else:
            self._go()

    def _go(self) -> None:
        self._uci._position(self._board)
        self._uci._go(self._limit, ponder=True)
        self.result.set_result(self)

    def line_received(self, line: str) -> None:
        token, _, rest = line.strip().partition(" ")
        if token == "info":
            self._info.update(_parse_uci_info(rest, self._board, TOLD))
        elif token == "readyok" and self._new_game and not self.result.done():
            self._go()
        elif token == "bestmove" and self.result.done():
            self._conclude(rest)

    def _conclude(self, rest: str) -> None:
        try:
            best = _parse_uci_bestmove(self._board.copy(), rest)
        except chess.engine.EngineError as error:
            self._answer.set_exception(error)
        else:
            self._answer.set_result(chess.engine.PlayResult(best.move, best.ponder, self._info))
        self._answer.exception()  # retrieved: nobody may want it
        self.set_finished()

    def cancel(self) -> None:
        self._uci.send_line("stop")

    def engine_terminated(self, exc: Exception) -> None:
        if not self._answer.done():
            self._answer.set_exception(exc)
            self._answer.exception()
        super().engine_terminated(exc)
