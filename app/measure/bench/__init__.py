"""Measurements that say whether a bar is held: ``touchmove bench NAME``. One module for each bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from app import UserError
from app.measure.bench.campaign import campaign_bench
from app.measure.bench.clock import clock_bench
from app.measure.bench.drives import drives_bench
from app.measure.bench.fallen import fallen_bench
from app.measure.bench.finger import finger_bench
from app.measure.bench.grip import grip_bench
from app.measure.bench.kills import kills_bench
from app.measure.bench.law import law_bench
from app.measure.bench.loop import loop_bench
from app.measure.bench.motion.rows import motion_bench
from app.measure.bench.motion.standard_cycle import standard_cycle_bench
from app.measure.bench.people import knocks_bench, people_bench
from app.measure.bench.recovery import recovery_bench
from app.measure.bench.report import BenchReport, Progress
from app.measure.bench.sim import sim_bench
from app.measure.bench.unknown.commission import commission_bench
from app.measure.bench.unknown.identify import identify_bench
from app.measure.bench.vision.pictures import pictures_bench
from app.measure.bench.vision.rows import vision_bench
from app.measure.names import require_name

Bench = Callable[[bool, Progress], BenchReport]

BENCHES: Mapping[str, Bench] = MappingProxyType({
    "law": law_bench, "loop": loop_bench, "finger": finger_bench, "kills": kills_bench, "motion": motion_bench,
    "sim": sim_bench, "grip": grip_bench, "fallen": fallen_bench, "recovery": recovery_bench, "people": people_bench,
    "knocks": knocks_bench, "vision": vision_bench, "clock": clock_bench, "drives": drives_bench,
    "pictures": pictures_bench, "identify": identify_bench, "commission": commission_bench,
    "campaign": campaign_bench,
})  # fmt: skip
"""By name; each takes ``quick`` and a function that is told what is being done."""


def run_bench(
    name: str, quick: bool, progress: Progress, photos: Path | None = None, watchers: int = 0, *,
    standard_cycle: bool = False,
) -> BenchReport:  # fmt: skip
    """Run one of ``BENCHES``.

    Args:
        name: of the bench.
        quick: fewer repetitions.
        progress: told what is being done.
        photos: folder with labelled photographs, for ``vision``.
        watchers: so many browsers watch the page, for ``loop``.
        standard_cycle: industry's pick cycle instead of games, for ``motion``.

    Raises:
        UserError: there is no such bench, or photographs are given that are not there or not looked at, or watchers
            where there is no page, or another bench than motion is asked for the standard cycle.
    """
    require_name("bench", name, tuple(BENCHES))
    if standard_cycle:
        if name != "motion":
            raise UserError(f"bench '{name}' has no standard cycle: leave --standard-cycle out, or run bench motion")
        return standard_cycle_bench(progress)
    if watchers:
        if name != "loop":
            raise UserError(f"bench '{name}' has no page to watch: leave --watchers out, or run bench loop")
        return loop_bench(quick, progress, watchers)
    if photos is not None:
        if name != "vision":
            raise UserError(f"bench '{name}' uses no photographs: leave --photos out, or run bench vision")
        if not photos.is_dir():
            raise UserError(f"{photos} is not a folder: name the one with the labelled photographs")
        return vision_bench(quick, progress, photos)
    return BENCHES[name](quick, progress)
