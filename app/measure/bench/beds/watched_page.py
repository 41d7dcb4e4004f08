"""A page beside a rig, with browsers that watch arm and camera: what they cost, and what they get."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Final

from app import UserError
from app.measure.bench.report import Progress, Row, row
from app.page.publisher import PagePublisher
from app.page.supervisor import PageSupervisor
from app.rig.remote import RemoteRig
from app.settings.defaults import PageSection
from app.terminal.shown import SessionShown
from hardware.interfaces import Pace
from hardware.parameters import load_parameters

SHARE_LIMIT: Final = 15.0
"""Of one core, for five watchers [%]."""
START: Final = 60.0
"""The page, and the first telemetry and picture of every watcher, come within so long [s, wall]."""
_GLANCE: Final = 0.1
WATCHERS_PROGRAM: Final = "app.measure.bench.beds.page_watchers"


@dataclass(frozen=True, slots=True)
class Watched:
    """What had come to pass at a moment.

    Attributes:
        at: wall time [s].
        used: processor time of the page's process and of what it had made [s].
        came: of each watcher, so many telemetries and pictures.
    """

    at: float
    used: float
    came: tuple[tuple[int, int], ...]

    def rows_until(self, later: Watched) -> dict[str, Row]:
        """What watchers cost and got since, as rows of a bench."""
        span = later.at - self.at
        telemetry, pictures = (
            [(now[kind] - then[kind]) / span for then, now in zip(self.came, later.came, strict=True)]
            for kind in (0, 1)
        )
        return {
            "watchers": row([len(self.came)], "watchers"),
            "page_of_a_core": row([100.0 * (later.used - self.used) / span], "%", SHARE_LIMIT, "max"),
            "telemetry": row(telemetry, "1/s"),
            "pictures": row(pictures, "1/s"),
        }


class WatchedPage:
    """A page that is being watched; see ``watched_page``."""

    def __init__(self, publisher: PagePublisher, page: PageSupervisor, watchers: subprocess.Popen[str]) -> None:
        self.publisher = publisher
        self._page, self._watchers = page, watchers

    def glance(self) -> Watched:
        """What has come to pass so far.

        Raises:
            UserError: page or watchers are gone.
        """
        ask, answer = self._watchers.stdin, self._watchers.stdout
        assert ask is not None
        assert answer is not None
        try:
            ask.write("\n")
            ask.flush()
            came = tuple((telemetry, pictures) for telemetry, pictures in json.loads(answer.readline()))
            return Watched(time.monotonic(), processor_time(self._page.pid), came)
        except (OSError, ValueError) as error:
            raise UserError(
                "the page, or a browser that watched it, ended too early: read the messages above"
            ) from error

    def wait_for_all(self) -> None:
        """Wait until every watcher has had telemetry and a picture.

        Raises:
            UserError: that did not come to pass.
        """
        deadline = time.monotonic() + START
        while not all(telemetry and pictures for telemetry, pictures in self.glance().came):
            if time.monotonic() > deadline:
                raise UserError(
                    f"not every watcher had telemetry and a picture within {START:g} s: is the PC very busy?"
                )
            time.sleep(_GLANCE)


@contextmanager
def watched_page(rig: RemoteRig, folder: Path, count: int, progress: Progress) -> Iterator[WatchedPage]:
    """A page beside a rig whose world has cameras, with so many watchers.

    Args:
        rig: that is watched.
        folder: for records, where there are none.
        count: of watchers.
        progress: told what is being done.

    Raises:
        UserError: the page did not start.
    """
    publisher, addresses, ready = PagePublisher("demo"), list[str](), Event()

    def invite(address: str) -> None:
        addresses.append(address)
        ready.set()

    def give_up(sentence: str) -> None:
        progress(sentence)
        ready.set()

    tick = load_parameters().drive.tick
    publisher.session(
        SessionShown(
            folder / "game", "sim", Pace.REAL, tick, None, hands=False, sees=True, controller=rig.controller,
            live=rig.film,
        )
    )  # fmt: skip
    with PageSupervisor(PageSection(port=0), publisher, folder, invite, give_up) as page:
        ready.wait(START)
        if not addresses:
            raise UserError(f"the page did not start within {START:g} s: read the messages above")
        with _watchers(addresses[0], count) as watchers:
            watched = WatchedPage(publisher, page, watchers)
            progress(f"waiting until {count} watchers have telemetry and pictures of {addresses[0]}")
            watched.wait_for_all()
            yield watched
            publisher.end("the bench is over")


@contextmanager
def _watchers(address: str, count: int) -> Iterator[subprocess.Popen[str]]:
    watchers = subprocess.Popen(
        [sys.executable, "-P", "-m", WATCHERS_PROGRAM, address, str(count)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    with watchers:
        try:
            yield watchers
        finally:
            watchers.kill()


def processor_time(pid: int) -> float:
    """Processor time that a process, and those of its children that have ended, have used so far [s].

    Raises:
        OSError: there is no such process.
    """
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return sum(int(fields[place]) for place in (11, 12, 13, 14)) / os.sysconf("SC_CLK_TCK")
