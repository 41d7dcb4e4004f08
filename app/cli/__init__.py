"""The command line: ``touchmove COMMAND``."""

from __future__ import annotations

import atexit
import gc
import os
import sys

from app.cli.ending import INTERRUPTED, heard, outlive_terminals, take_interrupts


def main() -> None:
    """Entry point of the command.

    At its end nothing is looked for that could be thrown away: among all that Python and Numba have loaded that takes
    half a second, and the system takes the memory back anyway.

    Matrices are small, at most some hundred rows: OpenBLAS does them in one thread, here and in all processes started
    from here. Several threads wait for each other, and where the processors are busy they wait for long.
    """
    take_interrupts()  # before anything is loaded or started that an interrupt must end
    outlive_terminals()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    atexit.register(gc.freeze)
    try:
        from app.cli.commands import app

        with heard():
            app()
    except KeyboardInterrupt:  # before a command was found
        print(f"touchmove: {INTERRUPTED}", file=sys.stderr)
        sys.exit(130)
