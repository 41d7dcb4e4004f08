#!/usr/bin/env python3
"""A real engine behind a mouth that talks nonsense: passes UCI through, and now and then does something else.

Started as ``nonsense.py ENGINE STARTS SEED KIND...``; STARTS is a file that grows by a byte a start, so that each start
draws differently. A kind is drawn for one answer in four.
"""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

engine, starts, seed, *kinds = sys.argv[1:]
with Path(starts).open("a", encoding="ascii") as file:
    file.write("x")
rng = random.Random(f"{seed} {Path(starts).stat().st_size}")
child = subprocess.Popen([engine], stdin=subprocess.PIPE, stdout=subprocess.PIPE)


def say(data: bytes) -> None:
    """All of it."""
    while data:
        data = data[os.write(1, data) :]


def do(kind: str, answer: bytes, previous: bytes) -> None:
    """Instead of the answer."""
    if kind == "word":
        say(b"bestmove xyzzy\n")
    elif kind == "illegal":
        say(b"bestmove a1h8\n")
    elif kind == "null":
        say(b"bestmove 0000\n")
    elif kind == "stale":
        say(previous)
    elif kind == "twice":
        say(answer + answer)
    elif kind == "garbage":
        say(b"\xff\x00\xfe\ninfo depth deep pv e9e9 score cp\nreadyok\nuciok\noption name\nid\n\n   \n" + answer)
    elif kind == "late":
        say(answer)
        time.sleep(0.05)
        say(b"bestmove a2a3\n")
    elif kind == "flood":
        while True:
            say(b"x" * 65536)
    elif kind == "exit":
        print("out of nonsense", file=sys.stderr)
        os._exit(9)
    elif kind == "stop":
        os.kill(os.getpid(), signal.SIGSTOP)
    else:
        assert kind == "silent", kind


def talk() -> None:
    """Pass on what the engine says."""
    previous = b"bestmove h7h5\n"
    assert child.stdout is not None
    for line in child.stdout:
        if line.startswith(b"bestmove") and rng.random() < 0.25:
            do(rng.choice(kinds), line, previous)
        else:
            say(line)
        previous = line if line.startswith(b"bestmove") else previous


threading.Thread(target=talk, daemon=True).start()
assert child.stdin is not None
for line in sys.stdin.buffer:
    child.stdin.write(line)
    child.stdin.flush()
child.kill()
