"""Bench ``drives``: what a driver costs of a tick, and how regularly the arm moves through it.

For each kind of drives twice: the driver alone exchanges with emulated devices, which run in a process of their own;
then a controller moves the arm through it back and forth, as games do. Nobody else is busy.
"""

import tempfile
from pathlib import Path
from typing import Final, Protocol, runtime_checkable

import numpy as np

from app.measure.bench.loop import DURATION, MISSED_LIMIT, SEED, sweep, time_row
from app.measure.bench.report import BenchReport, Progress, Row, row
from app.rig.rig_file import RigFile, WorldSection
from app.rig.simulation.processes import drives_of
from app.rig.simulation.settings import EMULATED, own_rig
from app.rig.simulation.timed import timed_rig
from app.settings.tree import Drives
from hardware.interfaces import Command, ServoBus
from hardware.realtime import real_time
from hardware.sim.emulated.ethercat.namespace import privileged

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
    """A bus that says how long its last exchange took without waiting for its tick [s]."""

    took: float


def drives_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure both kinds of drives; without real time nothing is judged.

    Raises:
        UserError: a rig did not start.
    """
    rows: dict[str, Row] = {}
    for kind in EMULATED:
        if kind is Drives.MOTEUS or privileged():
            share, granted = driver_share(kind, EXCHANGES[quick], progress)
            rows[f"{kind}_share"] = row(1e6 * share, "µs", SHARE_LIMIT[kind] if granted else None, "p99")
        else:
            progress("only root can measure the EtherCAT driver by itself: others cannot enter the devices' network")
        rows |= in_motion(kind, DURATION[quick], progress)
    return BenchReport.of("drives", SEED, rows, "real")


def driver_share(kind: Drives, exchanges: int, progress: Progress) -> tuple[np.ndarray, bool]:
    """What each exchange took beside emulated devices [s], without the wait for its tick; whether in real time."""
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        world = WorldSection(seed=SEED, cameras=False, realtime=True, linger=1.0)
        rig: RigFile = own_rig(Path(folder) / "run", world, drives=EMULATED[kind])
        with drives_of(rig, progress) as drives:
            bus: ServoBus = drives.open(rig.robot())
            try:
                assert isinstance(bus, TimedBus)
                progress(f"{exchanges} exchanges with {kind} drives")
                took = np.empty(exchanges)
                with real_time("this bench", PRIORITY) as granted:
                    for k in range(-FIRST, exchanges):
                        bus.exchange(_STANDING)
                        if k >= 0:
                            took[k] = bus.took
            finally:
                bus.close()
    for note in granted.notes:
        progress(note)
    return took, granted.granted


def in_motion(kind: Drives, duration: float, progress: Progress) -> dict[str, Row]:
    """An arm that moves back and forth through a driver for so long [s]."""
    with timed_rig(SEED, progress, drives=EMULATED[kind]) as timed:
        progress(f"moving the arm through {kind} drives for {duration:g} s")
        stopped = sweep(timed, timed.rig.arm, duration)
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
