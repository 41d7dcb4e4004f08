"""How commands end."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pydantic
import pydantic_core
import pytest
from typer import Exit

from app.cli.commands import _one_sentence
from tests.waiting import PATIENCE

SWALLOWS = """
import os, signal, sys, time
from app.cli.ending import take_interrupts

class Swallows:
    def __del__(self):
        os.kill(os.getpid(), signal.SIG%s)
        time.sleep(0.0)

take_interrupts()
one = Swallows()
try:
    del one
    time.sleep(60.0)
except KeyboardInterrupt:
    sys.exit(130)
"""


SLOW = """
import threading, time
def slow_start(timer, start=threading.Thread.start):
    start(timer)
    threading.Timer.start = start
    time.sleep(0.05)
threading.Timer.start = slow_start
"""
"""On a busy machine an interrupt that comes again may come while its being swallowed is still dealt with."""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("busy", ["", SLOW])
def test_an_interrupt_that_meets_a_destructor_is_not_lost(number: signal.Signals, busy: str) -> None:
    program = busy + SWALLOWS % number.name.removeprefix("SIG")
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "")


def test_what_else_a_destructor_raises_is_told_as_ever() -> None:
    program = (
        "from app.cli.ending import take_interrupts\ntake_interrupts()\n"
        "class Fails:\n    def __del__(self): raise ValueError('a bug')\n"
        "one = Fails()\ndel one"
    )
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "a bug" in done.stderr


IMPORTS = """
import os, signal, sys, time
from app.cli.ending import take_interrupts

signal.signal(signal.SIGHUP, signal.SIG_DFL)  # a program that is to outlive the terminal starts its own so
take_interrupts()
try:
    import interrupted_in_the_middle
    time.sleep(60.0)
except KeyboardInterrupt:
    sys.exit(130 if "interrupted_in_the_middle" in sys.modules else 1)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupt_that_meets_an_import_waits_for_its_end(number: signal.Signals, tmp_path: Path) -> None:
    """A class that is being made tells of any exception by one of its own."""
    (tmp_path / "interrupted_in_the_middle.py").write_text(
        "import os\n"
        "class Named:\n"
        f"    def __set_name__(self, owner, name): os.kill(os.getpid(), {number.value})\n"
        "class Owner:\n"
        "    named = Named()\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=False, env=environment, timeout=PATIENCE
    )
    assert (done.returncode, done.stderr) == (130, "")


def test_an_import_that_takes_too_long_is_interrupted(tmp_path: Path) -> None:
    (tmp_path / "endless.py").write_text(
        "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\nwhile True: time.sleep(0.01)\n"
    )
    program = (
        "import app.cli.ending as ending\nending._LONGEST_HELD = 0.3\nending.take_interrupts()\n"
        "try:\n    import endless\nexcept KeyboardInterrupt:\n    raise SystemExit(130)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", program], check=False, env=environment, timeout=PATIENCE)
    assert done.returncode == 130


def test_who_wants_to_outlive_the_terminal_does() -> None:
    program = (
        "import os, signal\nfrom app.cli.ending import take_interrupts\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\ntake_interrupts()\nos.kill(os.getpid(), signal.SIGHUP)\n"
    )
    assert subprocess.run([sys.executable, "-P", "-c", program], check=False).returncode == 0


def said_to_a_terminal_that_is_gone(program: str) -> int:
    """The status of a program that says something when the terminal is gone and SIGHUP is yet to come."""
    ours, theirs = pty.openpty()
    whole = (
        "import sys\nfrom app.cli.ending import outlive_terminals, take_interrupts\n"
        f"take_interrupts()\noutlive_terminals()\n{program}"
    )
    with subprocess.Popen(
        [sys.executable, "-P", "-c", whole], stdin=subprocess.PIPE, stdout=theirs, stderr=theirs, start_new_session=True
    ) as process:
        os.close(theirs)
        assert os.read(ours, 1) == b"."
        os.close(ours)
        process.communicate(b"\n", PATIENCE)
    return process.returncode


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_what_is_said_to_a_terminal_that_is_gone_does_not_fail(stream: str) -> None:
    """Nor where it is said before the program is told that the terminal is gone."""
    program = (
        "print('.', end='', flush=True)\nsys.stdin.readline()\n"
        f"for _ in range(3): print('x' * 10_000, file=sys.{stream}, flush=True)\n"
        "print('is a terminal' if sys.stdout.isatty() else 'is none')\nsys.exit(7)"
    )
    assert said_to_a_terminal_that_is_gone(program) == 7


class Written(pydantic.BaseModel):
    """Something whose writing is interrupted."""

    where: str = "here"

    @pydantic.field_serializer("where")
    def write_where(self, _where: str) -> str:
        raise KeyboardInterrupt


def test_an_interrupt_that_a_library_makes_an_error_of_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(pydantic_core.PydanticSerializationError):
        Written().model_dump_json()
    with pytest.raises(Exit) as ended, _one_sentence():
        Written().model_dump_json()
    assert (ended.value.exit_code, capsys.readouterr().err) == (
        130,
        "touchmove: interrupted; nothing is still running\n",
    )


def test_a_bug_is_no_interrupt() -> None:
    with pytest.raises(ZeroDivisionError), _one_sentence():
        raise ZeroDivisionError("a bug")


def output_of(program: str, stdout: int) -> tuple[int, str]:
    whole = f"from app.cli.ending import heard\nwith heard():\n    {program}"
    done = subprocess.run(
        [sys.executable, "-P", "-c", whole], stdout=stdout, stderr=subprocess.PIPE, text=True, check=False
    )
    return done.returncode, done.stderr


LOST = "touchmove: the output cannot be written: No space left on device: send it elsewhere\n"


@pytest.mark.parametrize("program", ["print('x')", "print('x' * 100_000)", "print('x'); raise SystemExit(0)"])
def test_a_full_standard_output_is_one_sentence_and_one_that_nobody_reads_none(program: str) -> None:
    with Path("/dev/full").open("wb") as full:
        assert output_of(program, full.fileno()) == (2, LOST)
    unread, written = os.pipe()
    os.close(unread)
    assert output_of(program, written) == (128 + signal.SIGPIPE, "")
    os.close(written)


def test_another_error_of_the_system_is_not_taken_for_a_full_output() -> None:
    status, said = output_of("raise OSError(28, 'of another file')", subprocess.DEVNULL)
    assert status == 1
    assert said.endswith("OSError: [Errno 28] of another file\n")
