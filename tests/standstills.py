"""A machine that stands still now and then upsets whatever has to be punctual, and nobody here is to blame for it.

A host that takes its processors away for longer than a watchdog waits has the drives brake, as they must. So a witness,
a process that does nothing but sleep, tells how late it was woken on each processor. A test marked ``real_time`` that
fails while the machine stood still is run again, and skipped where it never got its time; one that fails on a machine
that did not has failed. What was run again is said at the end.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time

import pytest
from _pytest.runner import runtestprotocol

LONG = 0.022
"""Half of what the drives' watchdog waits: a processor that was away for longer upsets what has to be punctual [s]."""
NAP = 0.004
"""Of the witness [s]."""
TIMES, AT_MOST = 5, 240.0
"""So often a test is run, and not again after so long, which is less than its time-out [s]."""


class Witness:
    """It sleeps on each processor, before all others where the system grants it."""

    def __init__(self) -> None:
        self._process = subprocess.Popen([sys.executable, "-P", __file__], stdout=subprocess.PIPE)
        assert self._process.stdout is not None
        self._said = self._process.stdout
        os.set_blocking(self._said.fileno(), False)

    def longest(self) -> float:
        """How late it was woken at most since it was asked before; 0 where never later than ``LONG`` [s]."""
        time.sleep(2 * NAP)  # it may be about to say so
        return max(map(float, (self._said.read() or b"").split()), default=0.0)

    def end(self) -> None:
        self._process.kill()
        self._process.communicate()


WITNESS = pytest.StashKey[Witness]()
AGAIN = pytest.StashKey[list[str]]()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Run what has to be punctual until this machine lets it."""
    if item.get_closest_marker("real_time") is None:
        return None
    stash = item.config.stash
    if WITNESS not in stash:
        stash[WITNESS] = Witness()
        item.config.add_cleanup(stash[WITNESS].end)
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    deadline, late = time.monotonic() + AT_MOST, list[str]()
    while True:
        stash[WITNESS].longest()
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        stood = stash[WITNESS].longest()
        if not (stood and any(report.failed for report in reports)):
            break
        late.append(f"{stood * 1e3:.0f} ms")
        stash.setdefault(AGAIN, []).append(f"{item.nodeid}: this machine stood still for {late[-1]}")
        if len(late) == TIMES or time.monotonic() > deadline:
            for report in reports:
                if report.failed:
                    report.outcome = "skipped"
                    report.longrepr = (*item.location[:1], 0, f"it failed while this machine stood still: {late}")
            break
        item.session._setupstate.teardown_exact(None)  # all fixtures begin anew, too
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What was run again."""
    if again := terminalreporter.config.stash.get(AGAIN, []):
        terminalreporter.section("run again")
        terminalreporter.write_line("\n".join(again))


def _sleep(processor: int) -> None:
    with contextlib.suppress(AttributeError, OSError):  # a system that has none, a processor that is not ours
        os.sched_setaffinity(0, {processor})
    with contextlib.suppress(AttributeError, OSError):  # it then sees ordinary programs keep it waiting as well
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))
    while True:
        due = time.monotonic() + NAP
        time.sleep(NAP)
        if (late := time.monotonic() - due) > LONG:
            os.write(sys.stdout.fileno(), f"{late:.4f}\n".encode())  # at once: the threads' lines stay apart


if __name__ == "__main__":
    for number in range(os.cpu_count() or 1):
        threading.Thread(target=_sleep, args=(number,)).start()
