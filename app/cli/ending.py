"""How commands end: with a sentence, a report or a process's status; and what Ctrl-C does meanwhile."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

import typer

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


def fail(sentence: str, status: int = 2) -> NoReturn:
    """Say what is wrong on one line, whatever was quoted in it, and end the program with this status."""
    print(f"touchmove: {' '.join(sentence.split())}", file=sys.stderr)
    raise typer.Exit(status)


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


def interrupt(_number: int, frame: FrameType | None) -> None:
    """Handler of signals that ask for the end."""
    while frame is not None:
        if frame.f_code is _repeat_swallowed.__code__:  # on a busy machine it may not be over yet: lost there, too
            _come_again()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def take_interrupts() -> dict[int, Handler]:
    """Ctrl-C and SIGTERM raise ``KeyboardInterrupt`` from now on, wherever they meet the program; what did before.

    SIGINT too: a shell's background job starts with it ignored.
    """
    sys.unraisablehook = _repeat_swallowed
    return {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}


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
        fail("interrupted; nothing is still running", 130)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run_process(process: Callable[[], int]) -> NoReturn:
    """Be a process of a rig, and end with its status."""
    from app import UserError
    from hardware.interfaces import HardwareError

    try:
        status = process()
    except (UserError, HardwareError, OSError) as error:
        fail(str(error))
    raise typer.Exit(status)


def show_report(find: Callable[[], Shown], as_json: bool) -> NoReturn:
    """Find out, show it, and end the program with what it says."""
    from rich.console import Console

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
    raise typer.Exit(0 if report.holds else 1)
