"""Bench ``drives``: what a driver costs of a tick, and how regularly the arm moves through it.

For each kind of drives twice: the driver alone exchanges with emulated devices, which run in a process of their own;
then a controller moves the arm through it back and forth, as games do. Nobody else is busy.

Emulated devices are programs on this computer, where real ones answer by themselves. So what they compute is told by
itself, and the driver's share is all the rest: its own work before and after, and the way through the operating system,
there and back. A tick would be missed where that takes longer than the period; ``_late`` tells how often it did, and
how often it would have with devices that answer at once, and with a way that takes no time as well.
"""

import tempfile
from pathlib import Path
from typing import Final, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from app.measure.bench.loop import DURATION, MISSED_LIMIT, SEED, sweep, time_row
from app.measure.bench.report import BenchReport, Progress, Row, row
from app.rig.rig_file import RigFile, WorldSection
from app.rig.simulation.processes import drives_of
from app.rig.simulation.settings import EMULATED, own_rig
from app.rig.simulation.timed import timed_rig
from app.settings.defaults import Drives
from hardware.drives.clock import ExchangeTimes
from hardware.interfaces import Command, ServoBus
from hardware.realtime import real_time
from hardware.sim.emulated.answer_times import load_answer_times
from hardware.sim.emulated.ethercat.namespace import privileged

Column = NDArray[np.float64]
Table = NDArray[np.float64]
EXCHANGES: Final = {True: 5_000, False: 30_000}
"""Of the driver alone, by ``quick``."""
FIRST: Final = 500
"""Exchanges that are not counted: caches are cold."""
PRIORITY: Final = 80
"""As the controller's."""
SHARE_LIMIT: Final = {Drives.ETHERCAT: 120.0, Drives.MOTEUS: 300.0}
"""p99 of a driver's share of a tick [µs]."""
_STANDING: Final = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=True, busy=True)


@runtime_checkable
class TimedBus(Protocol):
    """A bus that says when the last exchange began and ended; nothing before the first."""

    times: ExchangeTimes | None


class ExchangeParts(NamedTuple):
    """Where the time of exchanges went, each (n,) [s]; together from a tick's begin until its measurement is known."""

    driver: Column
    """The driver's own work: before it gives the command to the operating system, and after it takes the answer."""
    way: Column
    """Through the operating system, there and back."""
    devices: Column
    """What emulated devices compute before they answer."""

    @property
    def share(self) -> Column:
        """The driver's."""
        return self.driver + self.way


def drives_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure both kinds of drives; without real time nothing is judged.

    Raises:
        UserError: a rig did not start.
    """
    rows: dict[str, Row] = {}
    for kind in EMULATED:
        if kind is Drives.MOTEUS or privileged():
            rows |= share_rows(kind, *driver_share(kind, EXCHANGES[quick], progress))
        else:
            progress("only root can measure the EtherCAT driver by itself: others cannot enter the devices' network")
        rows |= in_motion(kind, DURATION[quick], progress)
    return BenchReport.of("drives", SEED, rows, "real")


def share_rows(kind: Drives, parts: ExchangeParts, period: float, granted: bool) -> dict[str, Row]:
    """Rows of a driver alone; the share is judged where real time was granted."""
    late = {
        "late": parts.share + parts.devices,
        "late_prompt_devices": parts.share,
        "late_no_way": parts.driver,
    }
    return {
        f"{kind}_share": row(1e6 * parts.share, "µs", SHARE_LIMIT[kind] if granted else None, "p99"),
        **{f"{kind}_{name}": row(1e6 * part, "µs") for name, part in parts._asdict().items()},
        **{f"{kind}_{name}": row([100.0 * np.mean(took > period)], "%", n=len(took)) for name, took in late.items()},
    }


def driver_share(kind: Drives, exchanges: int, progress: Progress) -> tuple[ExchangeParts, float, bool]:
    """Exchanges of a driver beside emulated devices: their parts, their period [s], and whether in real time."""
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        world = WorldSection(seed=SEED, cameras=False, realtime=True, linger=1.0)
        rig: RigFile = own_rig(Path(folder) / "run", world, drives=EMULATED[kind])
        with drives_of(rig, progress) as drives:
            bus: ServoBus = drives.open(rig.robot())
            try:
                assert isinstance(bus, TimedBus)
                progress(f"{exchanges} exchanges with {kind} drives")
                times = np.empty((exchanges, 4))
                with real_time("this bench", PRIORITY) as granted:
                    for k in range(-FIRST, exchanges):
                        bus.exchange(_STANDING)
                        if k >= 0:
                            times[k] = bus.times
            finally:
                bus.close()
        answers = load_answer_times(rig.run_dir)
    for note in granted.notes:
        progress(note)
    return parts_of(times, answers), bus.period, granted.granted


def parts_of(times: Table, answers: Table) -> ExchangeParts:
    """Parts of exchanges.

    Args:
        times: of each exchange, as of ``ExchangeTimes``, (n, 4) [s].
        answers: when the devices were asked, and had answered, in order of time, (m, 2) [s]; several to an exchange
            where its commands came to them in pieces, none where they were not heard in time.
    """
    began, sent, came, known = times.T
    total = np.concatenate(([0.0], np.cumsum(answers[:, 1] - answers[:, 0])))
    devices = total[np.searchsorted(answers[:, 0], came)] - total[np.searchsorted(answers[:, 0], sent)]
    devices = np.minimum(devices, came - sent)  # the last answer may be read before its sender goes on
    return ExchangeParts(sent - began + known - came, came - sent - devices, devices)


def in_motion(kind: Drives, duration: float, progress: Progress) -> dict[str, Row]:
    """An arm that moves back and forth through a driver for so long [s]."""
    with timed_rig(SEED, progress, drives=EMULATED[kind]) as timed:
        progress(f"moving the arm through {kind} drives for {duration:g} s")
        stopped = sweep(timed, timed.rig.arm, duration, progress)
        end = timed.finish()
    statistics = end.statistics
    limit = MISSED_LIMIT if statistics.realtime.granted else None
    ticks = statistics.ticks + statistics.skipped
    return {
        f"{kind}_missed_ticks": row([100.0 * statistics.missed], "%", limit, "max", ticks),
        f"{kind}_period_error": time_row(statistics.period_error),
        f"{kind}_lateness": time_row(statistics.lateness),
        f"{kind}_tick_work": time_row(statistics.work),
        f"{kind}_stopped_motions": row([stopped], "motions"),
        f"{kind}_not_at_rest": row([float(not end.at_rest)], "arms", 0.0, "max"),
    }
