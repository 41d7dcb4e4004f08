"""UCI as python-chess speaks it, and what a game on a robot needs beside it.

* Pondering on any position at any time (``go ponder``, then ``ponderhit`` or ``stop``). python-chess itself ponders
  only right after a move of the engine's own, with a clock that it computes, and forgets what was said before the hit.
  Here it is an analysis of python-chess's own whose ``go`` becomes ``go ponder`` on its way out.
* ``stop`` when a search has had its time, so that an engine that heeds no clock loses no game by it.
* A pulse: ``isready`` must be answered in the midst of a search. An engine that was seen to do so and does not any more
  hangs, and is known to long before its time is over.
* A bound on what it may write.
"""

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
        self._ahead = False
        """Whether the search that is about to begin is one of an expected position …"""
        self._told_ahead = False
        """… and whether the engine was told so by its option Ponder."""
        self._analysis: chess.engine.AnalysisResult | None = None
        self._pondered: asyncio.Task[chess.engine.PlayResult] | None = None
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
        task = asyncio.ensure_future(question)
        try:
            while True:
                done, _ = await asyncio.wait({task}, timeout=min(PULSE, end - now) if now < end else TICK)
                if done:
                    return task.result()
                now = loop.time()
                if now >= end:
                    self.send_line("stop")  # each time: the search may have begun after the last one
                if self._searches and now >= pulse + PULSE:
                    pulse = now
                    self._feel_pulse(now)
        finally:
            task.cancel()
            self._pulses.clear()

    async def exact_lines(
        self, board: chess.Board, limit: chess.engine.Limit, lines: int
    ) -> list[chess.engine.InfoDict]:
        """Search a position from scratch; of each of its best lines the last score that is no bound.

        A search that ends in the middle of an iteration often ends on a bound, which may lie pawns off.
        """
        search = await self.analysis(board, limit, multipv=lines, game=object(), info=TOLD)
        exact = dict[int, chess.engine.InfoDict]()
        async for info in search:
            if "score" in info and info.get("pv") and not (info.get("lowerbound") or info.get("upperbound")):
                exact[info.get("multipv", 1)] = info
        await search.wait()
        return [exact[rank] for rank in sorted(exact)] or search.multipv

    async def begin_ponder(self, board: chess.Board, limit: chess.engine.Limit, game: object) -> None:
        """Search a position that is expected; the next question of any kind ends it, ``hit`` makes it count."""
        name = "UCI_AnalyseMode"
        as_in_play = {name: False} if name in self.options and name not in self.target_config else {}
        self._ahead = True
        try:
            self._analysis = await self.analysis(board, limit, game=game, info=TOLD, options=as_in_play)
        finally:
            self._ahead = False
        self._pondered = asyncio.ensure_future(_conclusion(self._analysis))

    async def hit(self) -> chess.engine.PlayResult:
        """The position has come: the answer to the search that runs, as if it had been asked for a move all along."""
        if self._pondered is None:
            raise chess.engine.EngineError("it was not pondering")
        if not self._pondered.done():  # some engines answer before, such as when they see a mate: so be it
            self.send_line("ponderhit")
        return await asyncio.shield(self._pondered)

    def break_off(self, error: chess.engine.EngineError) -> None:
        """What it said at the end of what it pondered made no sense."""
        if self._analysis is not None and self._pondered is not None and not self._pondered.done():
            self._analysis.set_exception(error)

    def _feel_pulse(self, now: float) -> None:
        if self._pulses:
            if self._listens and now - self._pulses[0] > PULSE_DEADLINE:
                raise Hung(f"it has not listened for {PULSE_DEADLINE:g} s in the middle of a search")
            return
        self._pulses.append(now)
        self.send_line("isready")

    # -------------------------------------------------------------------------------------------------- what it is told

    def send_line(self, line: str) -> None:
        """Send it, unless the engine has closed its input: that shows as the answer that does not come."""
        assert self.transport is not None, "it was started"
        pipe = self.transport.get_pipe_transport(0)
        if pipe is None or pipe.is_closing():
            LOGGER.debug("%s: not sent, its input is closed: %s", self, line)
            return
        if line.startswith("position") and self._ahead is not self._told_ahead:
            self._told_ahead = self._ahead
            super().send_line(f"setoption name Ponder value {str(self._ahead).lower()}")
        elif line.startswith("go"):
            self._searches = True
            line = f"go ponder{line.removeprefix('go')}" if self._ahead else line
        super().send_line(line)

    # ---------------------------------------------------------------------------------------------------- what it says

    def line_received(self, line: str) -> None:
        """Note what tells of a search; whatever asked for it hears it too."""
        if line.startswith("bestmove"):
            self._searches = False
        elif self._pulses and line.strip() == "readyok":
            self._pulses.popleft()
            self._listens |= self._searches  # one that answers after the search does not listen in it

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


async def _conclusion(analysis: chess.engine.AnalysisResult) -> chess.engine.PlayResult:
    """What a search came to; what it said on the way is gathered, and not kept line by line."""
    async for _ in analysis:
        pass
    best = await analysis.wait()
    return chess.engine.PlayResult(best.move, best.ponder, analysis.info)
