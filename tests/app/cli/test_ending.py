"""How commands end."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

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
