"""One engine process, with a deadline on every call and no way to outlive us.

python-chess speaks the protocol in an event loop of its own thread; callers here are ordinary blocking code. The
thread lives exactly as long as the process, because Linux delivers the parent death signal when the *thread* that
forked ends, not when the whole parent does.
"""

import asyncio
import ctypes
import logging
import os
import signal
import sys
import threading
from collections.abc import Awaitable, Callable, Coroutine
from concurrent.futures import CancelledError
from contextlib import suppress
from typing import Any, TypeVar

import chess.engine

from engine.errors import Hung, Misbehaved
from engine.protocol import Uci

T = TypeVar("T")

LOGGER = logging.getLogger(__name__)

KILL_DEADLINE = 2.0
"""Longest wait for a killed process to be gone [s]; only the kernel can be slow here."""
PR_SET_PDEATHSIG = 1

_HINTS = {
    -signal.SIGILL: "the binary was built for another CPU",
    -signal.SIGKILL: "killed from outside, perhaps because memory ran out",
}


def exit_phrase(code: int, last_words: str) -> str:
    """Say how a process ended: by its exit code, or minus the signal, and the last line on its stderr, if any."""
    details = [text for text in (_HINTS.get(code), f"last words: {last_words!r}" if last_words else None) if text]
    return f"it died with exit code {code}" + (f" ({'; '.join(details)})" if details else "")


class UciProcess:
    """A running engine that has said ``uciok``, in a session of its own so that Ctrl-C does not reach it."""

    def __init__(self, path: str, deadline: float) -> None:
        """Start the process and shake hands, each within the deadline [s, wall].

        A script around the binary must ``exec`` it, or it will not end with us. Raises ``Misbehaved`` if it could not
        be started, died or did not answer.
        """
        self._transport: asyncio.SubprocessTransport | None = None
        self._uci: Uci | None = None
        self._loop = asyncio.new_event_loop()
        self._loop.set_exception_handler(_note_loop_error)
        self._thread = threading.Thread(target=self._serve, name=f"engine {path}", daemon=True)
        self._thread.start()
        try:
            self._wait_for(self._spawn(path), deadline)
            self.call(lambda uci: uci.initialize(), deadline)
        except BaseException:
            self.kill()
            raise

    @property
    def uci(self) -> Uci:
        """Protocol of the running process: its options and names."""
        assert self._uci is not None, "set by the constructor"
        return self._uci

    @property
    def pid(self) -> int:
        """Process id; the process leads a session and a group of the same number."""
        assert self._transport is not None, "set by the constructor"
        return self._transport.get_pid()

    def call(self, question: Callable[[Uci], Awaitable[T]], deadline: float) -> T:
        """Ask and wait for the answer, whatever happens no longer than the deadline, in wall time [s].

        The question makes the awaitable, in the engine's thread. Raises ``Hung`` if there is no answer in time and
        ``Misbehaved`` if the process died, or it broke the protocol. Kill it then, as after ``Hung``.
        """
        return self._wait_for(self._answer(question), deadline)

    def tell(self, line: str) -> None:
        """Send a line that has no answer of its own, such as ``stop``; from any thread. Harmless when it is gone."""
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._send, line)

    def _send(self, line: str) -> None:
        if self._uci is not None and not self._uci.returncode.done():
            self._uci.send_line(line)

    def kill(self) -> None:
        """Kill process and group, wait until they are gone, end the thread. Harmless when already done.

        An engine has nothing to save, so that there is no polite way beside this one.
        """
        if not self._thread.is_alive():
            return
        # A time-out means that the kernel keeps the process (a dead file server): nothing is left to be done here.
        with suppress(TimeoutError):
            asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(KILL_DEADLINE)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(KILL_DEADLINE)

    def _serve(self) -> None:
        """Body of the thread."""
        try:
            self._loop.run_forever()
        finally:
            self._loop.close()

    def _wait_for(self, coroutine: Coroutine[Any, Any, T], deadline: float) -> T:
        """Run a coroutine in the thread; on a time-out it is left alone, as killing the process ends it."""
        try:
            answer = asyncio.run_coroutine_threadsafe(coroutine, self._loop)
        except RuntimeError as error:  # the loop is closed
            coroutine.close()
            raise Misbehaved("it was ended") from error
        try:
            return answer.result(deadline)
        except TimeoutError as error:
            raise Hung(f"it gave no answer within {deadline:g} s") from error
        except CancelledError as error:
            raise Misbehaved("it was ended while it was asked") from error
        except chess.engine.EngineTerminatedError as error:
            raise Misbehaved(self._death()) from error
        except chess.engine.EngineError as error:
            raise Misbehaved(f"it broke the protocol: {error}") from error

    def _death(self) -> str:
        """Phrase of how the process ended."""
        assert self._uci is not None, "only a started process can die"
        return self._uci.trouble or exit_phrase(self._uci.returncode.result(), self._uci.last_words)

    async def _spawn(self, path: str) -> None:
        try:
            self._transport, self._uci = await Uci.popen(path, start_new_session=True, preexec_fn=dying_with_parent())
        except OSError as error:
            raise Misbehaved(f"it could not be started: {error.strerror}") from error

    async def _answer(self, question: Callable[[Uci], Awaitable[T]]) -> T:
        """Await the answer or the death of the process: python-chess alone misses a death early in an analysis."""
        uci = self.uci
        task = asyncio.ensure_future(question(uci))
        first: set[asyncio.Future[Any]] = {task, uci.returncode}
        await asyncio.wait(first, return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            return task.result()
        task.cancel()
        raise chess.engine.EngineTerminatedError("died in mid-question")

    async def _end(self) -> None:
        if self._transport is not None and self._uci is not None:
            if self._transport.get_returncode() is None:
                with suppress(ProcessLookupError):
                    os.killpg(self._transport.get_pid(), signal.SIGKILL)
            await asyncio.wait({self._uci.returncode}, timeout=KILL_DEADLINE / 2)
            self._transport.close()
        rest = asyncio.all_tasks() - {asyncio.current_task()}
        for task in rest:
            task.cancel()
        await asyncio.gather(*rest, return_exceptions=True)


def _note_loop_error(_loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Keep python-chess's complaints about a broken engine off the terminal: deadlines report the engine itself.

    What an engine says at the end of an analysis is told here alone when it makes no sense.
    """
    error, uci = context.get("exception"), context.get("protocol")
    LOGGER.debug("engine loop: %s", context["message"], exc_info=error)
    if isinstance(uci, Uci) and isinstance(error, chess.engine.EngineError):
        uci.break_off(error)


def dying_with_parent(sign: signal.Signals = signal.SIGKILL) -> Callable[[], None] | None:
    """Code for the forked child that ties its life by a signal to the forking thread; None where nothing can do that.

    Everything is looked up before the fork, so that the child makes system calls only and takes no lock that another
    thread may have held.
    """
    if not sys.platform.startswith("linux"):
        return None
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    parent = os.getpid()

    def tie() -> None:
        if prctl(PR_SET_PDEATHSIG, sign, 0, 0, 0) != 0 or os.getppid() != parent:
            os._exit(1)

    return tie
