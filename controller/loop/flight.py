"""The flight recorder: every tick of the last half minute in memory, on disk after a fault or a stop by protection.

The loop writes a row a tick into a ring made before the first one. When something goes wrong the loop goes on a little,
so that the file also tells what the arm did next; then it takes the spare ring, and a helper thread writes the full one
to ``flight-<tick>.npz`` in the run directory. A file so begins where the one before it ended, or half a minute earlier.
A client that wants to know what a motion of its own was like asks for the same: that goes to ``record-<tick>.npz``.
The loop never waits: while a file is being written further faults are noted and their ticks kept for the next one.

`controller.records.flight_file` says what a row holds, and reads the files.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Final, NamedTuple

from controller.loop.supervisor import Supervisor
from controller.loop.tick import FlightRing
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import CommandCode
from controller.protocol.messages import Announce
from controller.records.flight_file import FlightHead, Order, Trigger, write_flight

ORDERLY: Final = frozenset({Cause.NONE, Cause.HOLD_COMMAND, Cause.STOP_COMMAND, Cause.STOP_PRESSED, Cause.SHUTDOWN})
"""Causes that somebody asked for; every other one is written to disk."""
AFTERMATH: Final = 0.25
"""What a file still holds after a fault [s of plant time]: the longest controlled stop and the closing of the
brakes."""
PATIENCE: Final = 0.5
"""The same in wall time, where plant time stands [s]."""
FLIGHT_NAME: Final = "flight"
RECORD_NAME: Final = "record"
"""What files begin with that were written because something went wrong, and because the client wants to know."""
_ORDERS: Final = 64
_TRIGGERS: Final = 16
_TURN: Final = 1e-4
_END_TIMEOUT: Final = 5.0
"""For the last file to be written when the process ends [s]."""


class _Job(NamedTuple):
    loop: int
    name: str
    tick: int
    head: FlightHead
    ring: FlightRing


class FlightRecorder:
    """Records the ticks of one controller. Make it before real time is set up, else its thread inherits the loop's.

    Args:
        supervisor: whose ticks.
        directory: of the run; the files go there.
        period: of a tick [s].
        duration: of what is kept in memory [s].
        files: so many are kept, the newest; older ones are deleted.
    """

    def __init__(self, supervisor: Supervisor, directory: Path, *, period: float, duration: float, files: int) -> None:
        length = max(1, round(duration / period))
        self._supervisor = supervisor
        self._directory, self._period, self._files = directory, period, files
        self._ring = FlightRing(length)
        self._spare: FlightRing | None = FlightRing(length)
        self._timed = 0
        supervisor.plain.note_into(self._ring)
        self._epoch = time.time() - time.monotonic()
        self._cause: object = None
        self._tick = 0
        self._orders: deque[Order] = deque(maxlen=_ORDERS)
        self._triggers: list[Trigger] = []
        self._aftermath = max(1, round(AFTERMATH / period))
        self._due_count, self._due_time = 0, 0.0
        self._wanted = False
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._write_files, name="flight recorder", daemon=True)
        self._thread.start()

    def record(self, answered: float) -> None:
        """Take in what came since the last call, a tick or several plain ones, when all its work is done.

        Args:
            answered: wall time at which the exchange brought it, on the monotonic clock [s].
        """
        ring, supervisor = self._ring, self._supervisor
        self._tick = supervisor.measurement.tick
        if ring.count == self._timed:
            supervisor.note()
        ring.time(self._timed, self._epoch + answered, time.monotonic() - answered)
        self._timed = ring.count

    def note(self, order: CommandCode | Announce) -> None:
        """Remember what the client asked for; repeated announcements once. Of RECORD write what is in memory."""
        if not (self._orders and self._orders[-1].order == order and isinstance(order, Announce)):
            self._orders.append(Order(self._tick, self._epoch + time.monotonic(), order))
        if order is CommandCode.RECORD:  # what was written just before is not written again
            self._wanted = self._wanted or self._ring.count >= self._aftermath

    def watch(self, now: float) -> None:
        """Notice faults, and hand the ring over once their aftermath is in it. For every turn of the loop.

        Args:
            now: wall time, on the monotonic clock [s].
        """
        cause = self._supervisor.cause
        if cause is not self._cause:
            self._cause = cause
            if cause.cause not in ORDERLY:
                self._alarm(Trigger(self._tick, self._epoch + now, *cause[:3]), now)
        due = bool(self._triggers) and (self._ring.count >= self._due_count or now >= self._due_time)
        if due or (self._wanted and not self._triggers):
            spare = self._spare
            if spare is not None:  # only then is it taken away: the helper may give it back at any moment
                self._spare = None
                full, self._ring, self._timed = self._ring, spare, 0
                self._supervisor.plain.note_into(spare)
                self._hand_over(full, abnormal=False)

    def close(self, abnormal: bool) -> None:
        """The end: write what was noted, wait for the files. A second call does nothing.

        Args:
            abnormal: write in any case, the process did not bring the arm to rest.
        """
        if not self._thread.is_alive():
            return
        if abnormal and self._supervisor.measurement.tick > self._tick:
            self.record(time.monotonic())  # what could not be carried through is what one wants to see
        if (self._triggers or self._wanted or abnormal) and self._ring.count:
            self._hand_over(self._ring, abnormal)
        self._jobs.put(None)
        self._thread.join(_END_TIMEOUT)

    def _alarm(self, trigger: Trigger, now: float) -> None:
        if not self._triggers:
            self._due_count, self._due_time = self._ring.count + self._aftermath, now + PATIENCE
        if len(self._triggers) < _TRIGGERS:
            self._triggers.append(trigger)

    def _hand_over(self, ring: FlightRing, abnormal: bool) -> None:
        """Let the helper thread write a ring, named after the first fault, or after the last tick."""
        triggers, self._triggers = self._triggers, []
        name = RECORD_NAME if self._wanted and not triggers and not abnormal else FLIGHT_NAME
        self._wanted = False  # what went wrong meanwhile is in the same file, and counts for more
        head = FlightHead(self._period, abnormal, tuple(triggers), tuple(self._orders))
        self._jobs.put(_Job(threading.get_native_id(), name, triggers[0].tick if triggers else self._tick, head, ring))

    def _write_files(self) -> None:
        """The helper thread."""
        while (job := self._jobs.get()) is not None:
            path = self._directory / f"{job.name}-{job.tick}.npz"
            try:
                with _beside(job.loop):
                    write_flight(path, job.head, job.ring.parts())
                    self._prune(job.name)
            except OSError as error:
                sentence = f"{path} cannot be written ({error.strerror}): the ticks before the fault are lost"
                print(f"{sentence}; free some space", file=sys.stderr, flush=True)
            job.ring.count = 0
            self._spare = job.ring

    def _prune(self, name: str) -> None:
        """Delete the oldest files of a kind."""
        found = sorted(self._directory.glob(f"{name}-*.npz"), key=lambda path: path.stat().st_mtime_ns)
        for path in found[: -self._files]:
            path.unlink(missing_ok=True)


@contextlib.contextmanager
def _beside(loop: int) -> Iterator[None]:
    """While this thread works it does not keep the loop from the interpreter for longer than a moment.

    It lets go of the interpreter after a tenth of a millisecond. And where the loop has real time this thread has it
    too, two steps below, so that the kernel still hands over what comes at a serial port (`hardware.kernel_workers`):
    else any other program could take the processor from it while it has the interpreter.

    Args:
        loop: the kernel's number of the loop's thread.
    """
    before = sys.getswitchinterval()
    sys.setswitchinterval(_TURN)
    with contextlib.suppress(OSError):
        if os.sched_getscheduler(loop) == os.SCHED_FIFO:
            priority = max(1, os.sched_getparam(loop).sched_priority - 2)
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        sys.setswitchinterval(before)
