"""Starts the page's process. It loads while whoever has started it does, and then waits to be told what to serve."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path


class StartedPage:
    """A page's process that has been started and waits to be told what to serve.

    Attributes:
        process: prints the page's address once it can be reached.
        end: our end of the socket between game and page.
    """

    def __init__(self) -> None:
        self.end, theirs = socket.socketpair()
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "app.page.process", "--fd", str(theirs.fileno())],
                pass_fds=[theirs.fileno()], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
            )  # fmt: skip

    def serve(self, settings: str, records: Path) -> None:
        """Have it serve; one that has died says so on stdout, by saying nothing.

        Args:
            settings: of the section ``[page]``, as JSON.
            records: folder with all recorded games.
        """
        wishes = {"records": str(records.absolute()), "settings": json.loads(settings)}
        assert self.process.stdin is not None
        with suppress(BrokenPipeError), self.process.stdin as told:
            told.write(json.dumps(wishes).encode() + b"\n")

    def cancel(self) -> None:
        """End it, if it has not ended; a second call does nothing."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            with suppress(BrokenPipeError):  # what was not read
                pipe.close()
        self.end.close()
