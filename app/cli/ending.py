"""How commands end: with a sentence, a report or a process's status; and what Ctrl-C does meanwhile."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, NoReturn, Protocol, TextIO

if TYPE_CHECKING:
    from rich.console import RenderableType

Handler = Callable[[int, FrameType | None], Any] | int | None
"""Of a signal, as Python's module has them."""


class Shown(Protocol):
    """A report of a command."""

    @property
    def holds(self) -> bool:
        """Whether all is as it should be."""

    def table(self) -> RenderableType:
        """One screen for people."""

    def model_dump_json(self, *, indent: int) -> str:
        """For programs."""


PIPED_WIDTH = 160
"""Of tables that go into a file or to another program: nothing of them is folded [characters]."""


NOBODY_READS: Final = 128 + signal.SIGPIPE
"""Status of a program whose output nobody reads any more, as shells have it."""
INTERRUPTED: Final = "interrupted; nothing is still running"
_IMPORTS: Final = ("<frozen importlib._bootstrap>", "<frozen importlib._bootstrap_external>")
"""Where Python's own code stands that runs while a module is loaded."""
_LONGEST_HELD: Final = 5.0
"""How long an interrupt waits for the end of an import: while Numba compiles that may take longer [s]."""


def fail(sentence: str, status: int = 2) -> NoReturn:
    """Say what is wrong on one line, whatever was quoted in it, and end the program with this status."""
    from typer import Exit

    print(f"touchmove: {' '.join(sentence.split())}", file=sys.stderr)
    raise Exit(status)


@contextlib.contextmanager
def heard() -> Iterator[None]:
    """A standard output that takes nothing more, such as a file on a full disk, ends the program with a sentence.

    What nobody reads any more (a pipe into ``head``) ends it silently, with the status of a program that this ends.
    """
    try:
        try:
            yield
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()  # here, where it can be answered
    except OSError as error:
        if error.errno != errno.EPIPE and not _stuck():
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # Python writes what is left once more as it ends
        if error.errno == errno.EPIPE:
            sys.exit(NOBODY_READS)
        print(f"touchmove: the output cannot be written: {error.strerror}: send it elsewhere", file=sys.stderr)
        sys.exit(2)


def _stuck() -> bool:
    """Whether standard output takes nothing; what did not fit into its buffer is gone, so it is tried with a line."""
    try:
        print(flush=True)
    except OSError:
        return True
    return False


def say(step: str) -> None:
    """Tell a person what goes on."""
    print(f"touchmove: {step}", file=sys.stderr, flush=True)


def ask(question: str) -> str:
    """Ask a person at the terminal; the line that they type. Ends the program where nobody can type."""
    print(f"touchmove: {question}", end="", file=sys.stderr, flush=True)
    line = sys.stdin.readline()
    if not line:
        fail("nobody answers at the terminal: use --yes, and give the answers as options")
    return line.rstrip("\n")


class _Interrupts:
    """What becomes of signals that ask for the end."""

    def __init__(self) -> None:
        self._held_since: float | None = None
        self._terminals = [number for number in range(3) if os.isatty(number)]  # of standard input, output and errors

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handler: raises ``KeyboardInterrupt``, where that is heard.

        Not in an import: compiled libraries, and classes that are being made, turn it into errors of their own.
        """
        if number == signal.SIGHUP:
            self.leave_terminals()
        running = {one.f_code for one in _callers(frame)}
        swallowed = _repeat_swallowed.__code__ in running  # on a busy machine it may not be over yet: lost there, too
        importing = any(code.co_filename in _IMPORTS for code in running)
        if swallowed or (importing and self._may_be_held()):
            _come_again()
        else:
            raise KeyboardInterrupt

    def leave_terminals(self) -> None:
        """What is said to a terminal that is gone is said to nobody: that must not fail while the arm comes to rest."""
        gone = [number for number in self._terminals if not os.isatty(number)]
        if gone:
            nobody = os.open(os.devnull, os.O_RDWR)
            for number in gone:
                os.dup2(nobody, number)
            os.close(nobody)

    def _may_be_held(self) -> bool:
        now = time.monotonic()
        if self._held_since is None or now > self._held_since + 2.0 * _LONGEST_HELD:
            self._held_since = now
        return now < self._held_since + _LONGEST_HELD


def _callers(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


interrupt: Final = _Interrupts()


def take_interrupts() -> dict[int, Handler]:
    """Ctrl-C, SIGTERM and the end of the terminal raise ``KeyboardInterrupt`` from now on, wherever they meet the
    program; what did before.

    SIGINT too where it is ignored: a shell's background job starts so. SIGHUP is not where it is ignored: somebody
    wants the program to outlive the terminal.
    """
    sys.unraisablehook = _repeat_swallowed
    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    return {number: signal.signal(number, interrupt) for number in numbers}


class _Terminal(io.FileIO):
    """Output to a terminal, which may go at any time: what is said from then on is said to nobody.

    Linux closes a terminal to its programs first and tells them of it then: on a busy machine, and in a thread that is
    not the one which hears signals, a line may well meet the first without the second.
    """

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            if error.errno != errno.EIO or self.isatty():
                raise
            interrupt.leave_terminals()
            return len(data)


def outlive_terminals() -> None:
    """Let no line that is written to a terminal after its end fail; whether the program ends, SIGHUP decides."""
    sys.stdout, sys.stderr = _outliving(sys.stdout), _outliving(sys.stderr)


def _outliving(stream: TextIO) -> TextIO:
    if stream is None or not stream.isatty():
        return stream
    terminal = io.BufferedWriter(_Terminal(stream.fileno(), "w", closefd=False))
    return io.TextIOWrapper(terminal, stream.encoding, stream.errors, line_buffering=True)


def _repeat_swallowed(what: sys.UnraisableHookArgs) -> None:
    """An interrupt that met a destructor, where exceptions end unheard, comes again as soon as that is over.

    While Numba loads what it has compiled, destructors are a good part of the time.
    """
    if what.exc_type is KeyboardInterrupt:
        _come_again()
    else:
        sys.__unraisablehook__(what)


def _come_again() -> None:
    again = threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT))
    again.daemon = True
    again.start()


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C and SIGTERM end what runs within in good order, then the program with status 130."""
    before = take_interrupts()
    try:
        yield
    except KeyboardInterrupt:
        fail(INTERRUPTED, 130)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run_process(process: Callable[[], int]) -> NoReturn:
    """Be a process of a rig, and end with its status."""
    from typer import Exit

    from app import UserError
    from hardware.interfaces import HardwareError

    try:
        status = process()
    except (UserError, HardwareError, OSError) as error:
        fail(str(error))
    raise Exit(status)


def show_report(find: Callable[[], Shown], as_json: bool) -> NoReturn:
    """Find out, show it, and end the program with what it says."""
    from rich.console import Console
    from typer import Exit

    from app import UserError

    try:
        with interruptible():
            report = find()
    except UserError as error:
        fail(str(error))
    if as_json:
        print(report.model_dump_json(indent=2))
    else:
        Console(width=None if sys.stdout.isatty() else PIPED_WIDTH).print(report.table())
    raise Exit(0 if report.holds else 1)
