"""A simulated rig in pace real with a punctual world: what benches and tests of time measure a controller on."""

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app import UserError
from app.motion import MotionSettings
from app.rig.rig_file import DrivesSection, WorldSection
from app.rig.simulation.settings import own_rig
from app.rig.simulation.sim import SimRig
from controller.records.loop_statistics import STATISTICS_FILE
from hardware.frozen import Frozen

_OWN_DRIVES: Final = DrivesSection()


class Statistics(Frozen):
    """Of one duration over a whole run [s]."""

    n: int
    mean: float
    p50: float
    p99: float
    max: float


class GrantedRealTime(Frozen):
    """What the controller got of the operating system; see ``hardware.realtime.RealTime``."""

    granted: bool
    scheduled: bool
    locked: bool
    pinned: bool
    awake: bool
    notes: tuple[str, ...]


class RunStatistics(Frozen):
    """A controller's statistics of its whole run, as it leaves them in the run directory."""

    period: float
    lockstep: bool
    ticks: int
    skipped: int
    period_error: Statistics
    lateness: Statistics
    law: Statistics
    work: Statistics
    realtime: GrantedRealTime

    @property
    def missed(self) -> float:
        """Share of the ticks that went by without an exchange, 0 to 1."""
        return self.skipped / max(1, self.ticks + self.skipped)


class NoStatistics(UserError):
    """The controller left no statistics, or none of this version."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"the controller left no statistics at {path} ({reason}): was it killed? Run it again")


@dataclass(frozen=True, slots=True)
class RunEnd:
    """How a run ended: the loop's statistics, and whether the arm rested on its brakes."""

    statistics: RunStatistics
    at_rest: bool


class TimedRig:
    """Devices for measurements of time, their rig file, tick [s], and how the arm moves on them; see ``timed_rig``."""

    def __init__(
        self, run_dir: Path, seed: int, progress: Callable[[str], None], *, cameras: bool, drives: DrivesSection
    ) -> None:
        self.motion = MotionSettings()
        self._started = False
        world = WorldSection(seed=seed, cameras=cameras, realtime=True, linger=1.0)
        self.file = own_rig(run_dir, world, {"linger": 5.0}, drives=drives)
        # not what each of hundreds of motions does
        self.tick = self.file.robot().drive.tick
        self.rig = SimRig(self.file, lambda step: None if self._started else progress(step))
        self._started = True

    def finish(self) -> RunEnd:
        """End all processes and read what they left; raises ``NoStatistics`` if the controller was killed."""
        last = self.rig.close()
        return RunEnd(read_statistics(self.file.run_dir), last is not None and last.at_rest)


@contextmanager
def timed_rig(
    seed: int, progress: Callable[[str], None], *, cameras: bool = False, drives: DrivesSection = _OWN_DRIVES
) -> Iterator[TimedRig]:
    """A rig in a temporary folder: all pieces on the board, cameras or none, all as punctual as the PC allows.

    The seed decides how the pieces stand. Raises ``RigFailed`` if a process did not start.
    """
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        timed = TimedRig(Path(folder) / "run", seed, progress, cameras=cameras, drives=drives)
        with timed.rig:
            yield timed


def read_statistics(run_dir: Path) -> RunStatistics:
    """The statistics that a controller left in its run directory; raises ``NoStatistics`` if it left none."""
    path = run_dir / STATISTICS_FILE
    try:
        return RunStatistics.model_validate(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise NoStatistics(path, type(error).__name__) from error
