"""Bench ``loop``: its rows with and without privileges, its motions, and what it does when something fails.

No test judges a duration: those are for the bench itself.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import app.measure.bench.loop as loop_bench
from app import UserError
from app.commissioning.link_test import ProcessorTime, stolen_share
from app.measure.bench import run_bench
from app.measure.bench.beds.watched_page import Watched
from app.measure.bench.loop import WAY, loop_rows, sweep, sweep_motion, thinking, watched_rows
from app.measure.bench.report import Progress
from app.motion import MotionSettings
from app.motion.plan import Plan
from app.rig.arm import ArmAtRest
from app.rig.simulation.timed import GrantedRealTime, NoStatistics, RunEnd, RunStatistics, Statistics, read_statistics
from controller.records.loop_statistics import STATISTICS_FILE
from controller.wire.errors import ControllerError, ControllerLost
from hardware.table import TableSettings

NONE = Statistics(n=0, mean=0.0, p50=0.0, p99=0.0, max=0.0)


def an_end(granted: bool, skipped: int = 5, p99: float = 250e-6, at_rest: bool = True) -> RunEnd:
    work = Statistics(n=9_994, mean=90e-6, p50=80e-6, p99=p99, max=600e-6)
    given = GrantedRealTime(granted=granted, scheduled=granted, locked=True, pinned=True, awake=True, notes=())
    pulse = RunStatistics(
        period=0.00088, lockstep=False, ticks=9_995, skipped=skipped, period_error=NONE, lateness=NONE, law=NONE,
        work=work, realtime=given,
    )  # fmt: skip
    return RunEnd(pulse, at_rest)


def test_with_real_time_the_bars_are_held_or_not() -> None:
    rows = loop_rows(an_end(True), stopped=2, stolen=0.01)
    assert rows["real_time"].mean == 1.0
    missed, work = rows["missed_ticks"], rows["tick_work"]
    assert (missed.unit, missed.n, missed.limit, missed.holds) == ("%", 10_000, 0.1, True)
    assert missed.max == pytest.approx(0.05)
    assert (work.unit, work.n, work.limit, work.holds) == ("µs", 9_994, 200.0, False)
    assert (work.mean, work.p50, work.p99, work.max) == pytest.approx((90.0, 80.0, 250.0, 600.0))
    assert rows["stopped_motions"].max == 2.0
    assert rows["stolen_time"].max == pytest.approx(1.0)
    assert not loop_rows(an_end(True, skipped=50), 0, 0.0)["missed_ticks"].holds
    assert loop_rows(an_end(True, p99=199e-6), 0, 0.0)["tick_work"].holds


def test_without_real_time_only_the_arm_is_judged() -> None:
    rows = loop_rows(an_end(False, skipped=5000), stopped=0, stolen=0.0)
    assert rows["real_time"].mean == 0.0
    assert rows["missed_ticks"].limit is None
    assert rows["tick_work"].limit is None
    assert all(one.holds for one in rows.values())
    restless = loop_rows(an_end(False, at_rest=False), 0, 0.0)["arm_not_at_rest"]
    assert (restless.limit, restless.holds) == (0.0, False)


def test_the_way_lies_above_every_piece_and_begins_and_ends_at_rest() -> None:
    table, settings = TableSettings(), MotionSettings()
    for start, end in zip(WAY, (*WAY[1:], WAY[0]), strict=True):
        samples = sweep_motion(np.array(start), np.array(end), settings, 0.001).samples
        np.testing.assert_array_equal(samples["position"][0], start)
        np.testing.assert_allclose(samples["position"][-1], end)
        assert not samples["velocity"][[0, -1]].any()
        moved, mean = np.diff(samples["position"], axis=0), 0.5 * (samples["velocity"][1:] + samples["velocity"][:-1])
        np.testing.assert_allclose(moved, 0.001 * mean, atol=1e-6)
        assert np.linalg.norm(samples["velocity"], axis=1).max() <= settings.speed * (1.0 + 1e-9)
        assert (samples["stiffness"] == settings.gains.frequency_in_air**2).all()
        heights = table.board_from_base(samples["position"])[:, 2]
        assert heights.min() > 0.1


class FakeArm:
    """Executes plans, or refuses them."""

    def __init__(self, refused: int, trouble: ControllerError) -> None:
        self.reference, self.refused, self.trouble = np.array((0.0, 0.0, 0.35)), refused, trouble
        self.executed = self.resumed = 0

    def state(self) -> ArmAtRest:
        return ArmAtRest(self.reference, 0.02, 0)

    def execute(self, plan: Plan) -> None:
        self.executed += 1
        if self.executed <= self.refused:
            raise self.trouble
        self.reference = plan.motions[0].samples["position"][-1]

    def resume(self) -> None:
        self.resumed += 1


def a_rig(arm: FakeArm, failure: str | None = None) -> Any:
    return SimpleNamespace(rig=SimpleNamespace(arm=arm, failure=lambda: failure), motion=MotionSettings(), tick=0.001)


def test_a_stopped_motion_is_counted_and_the_next_one_begins_where_the_arm_rests(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = iter(range(1000))
    monkeypatch.setattr("time.monotonic", lambda: float(next(now)))
    monkeypatch.setattr("time.sleep", lambda duration: None)
    arm = FakeArm(2, ControllerError("stopped"))
    said = list[str]()
    assert sweep(a_rig(arm), arm, 6.0, said.append) == 2
    assert said == ["a motion was stopped: stopped"]
    assert (arm.executed, arm.resumed) == (5, 2)
    np.testing.assert_allclose(arm.reference, WAY[0])


def test_a_rig_that_died_ends_the_bench() -> None:
    arm = FakeArm(9, ControllerLost("no telemetry"))
    with pytest.raises(UserError, match=r"^the bench was cut short: the world has ended: why$"):
        sweep(a_rig(arm, "the world has ended: why"), arm, 60.0, lambda _: None)
    assert arm.executed == 1


def test_without_stockfish_the_bench_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda path: None)
    with pytest.raises(UserError, match="install it with 'sudo apt-get install stockfish'"), thinking(print):
        pytest.fail("nothing runs without it")


def test_the_bench_is_put_together(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    @contextmanager
    def fake(name: str, value: Any) -> Iterator[Any]:
        calls.append(f"{name} begins")
        yield value
        calls.append(f"{name} ends")

    def finish() -> RunEnd:
        calls.append("finish")
        end = an_end(False)
        noted = end.statistics.realtime.model_copy(update={"notes": ("no SCHED_FIFO: run as root",)})
        return RunEnd(end.statistics.model_copy(update={"realtime": noted}), True)

    rig = SimpleNamespace(finish=finish, rig=SimpleNamespace(arm=None))
    monkeypatch.setattr(loop_bench, "timed_rig", lambda seed, progress, cameras: fake("rig", rig))
    monkeypatch.setattr(loop_bench, "thinking", lambda progress: fake("thinking", None))
    durations: list[float] = []
    monkeypatch.setattr(loop_bench, "sweep", lambda timed, arm, duration, progress: durations.append(duration) or 0)
    counts = iter([ProcessorTime(0, 0), ProcessorTime(1000, 30)] + [None] * 2)
    monkeypatch.setattr(ProcessorTime, "now", lambda: next(counts))
    said: list[str] = []
    for quick in (True, False):
        report = run_bench("loop", quick, said.append)
    assert durations == [15.0, 60.0]
    assert calls[:5] == ["rig begins", "thinking begins", "finish", "thinking ends", "rig ends"]
    assert "no SCHED_FIFO: run as root" in said
    stolen = [step for step in said if "virtual machine" in step]
    assert stolen == [
        "the host of this virtual machine took 3 % of its processors, at most 0.1 % leaves a loop alone: "
        "measure on a PC of its own"
    ]
    assert (report.bench, report.pace, report.holds) == ("loop", "real", True)
    assert json.loads(report.model_dump_json())["rows"]["missed_ticks"]["limit"] is None


def test_a_killed_controller_leaves_no_statistics(tmp_path: Path) -> None:
    with pytest.raises(NoStatistics, match=r"controller_pulse.json \(FileNotFoundError\): was it killed\? Run it agai"):
        read_statistics(tmp_path)
    (tmp_path / STATISTICS_FILE).write_text("{}")
    with pytest.raises(NoStatistics, match=r"\(ValidationError\): was it killed\?"):
        read_statistics(tmp_path)


def test_stolen_time() -> None:
    assert stolen_share(ProcessorTime(1000, 10), ProcessorTime(2000, 60)) == pytest.approx(0.05)
    assert stolen_share(None, ProcessorTime(1, 1)) == stolen_share(ProcessorTime(1, 1), ProcessorTime(1, 1)) == 0.0
    now = ProcessorTime.now()
    assert now is None or now.total > now.stolen >= 0


def test_with_watchers_no_more_may_be_missed_than_without() -> None:
    def judged(with_them: int, without: int, granted: bool = True) -> bool:
        end = an_end(granted, skipped=with_them)
        unwatched = loop_rows(an_end(granted, skipped=without), 0, 0.0)["missed_ticks"]
        rows = watched_rows(loop_rows(end, 0, 0.0), unwatched, end)
        assert rows["missed_unwatched"] == unwatched
        return rows["missed_ticks"].holds

    assert judged(12, 5)  # of 10,000: 0.12 % against 0.05 %, and runs repeat within 0.1 %
    assert not judged(20, 5)
    assert judged(20, 5, granted=False)


def test_watchers_cost_and_get_so_much_a_second() -> None:
    first = Watched(100.0, 3.0, ((20, 5), (40, 10)))
    rows = first.rows_until(Watched(110.0, 4.2, ((220, 55), (230, 50))))
    assert rows["watchers"].mean == 2.0
    share = rows["page_of_a_core"]
    assert (share.max, share.limit, share.holds) == (pytest.approx(12.0), 15.0, True)
    assert (rows["telemetry"].max, rows["telemetry"].mean) == pytest.approx((20.0, 19.5))
    assert (rows["pictures"].max, rows["pictures"].mean) == pytest.approx((5.0, 4.5))
    assert not first.rows_until(Watched(110.0, 4.6, first.came))["page_of_a_core"].holds


@pytest.mark.slow
@pytest.mark.real_time
def test_the_bench_runs_with_watchers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(loop_bench.DURATION, True, 1.0)
    monkeypatch.setattr("os.cpu_count", lambda: 1)  # so many threads think: what they cost is the bench's business
    measured = loop_bench._measured

    def watched(duration: float, progress: Progress, watchers: int, *, cameras: bool) -> Any:
        """The run without watchers would do nothing else than the one with them does."""
        return measured(duration, progress, watchers, cameras=cameras) if watchers else (an_end(False), 0, 0.0, {})

    monkeypatch.setattr(loop_bench, "_measured", watched)
    report = run_bench("loop", quick=True, progress=lambda step: None, watchers=2)
    rows = report.rows
    assert report.holds == all(one.holds for one in rows.values())
    assert rows["law"].n == rows["lateness"].n > 100
    assert rows["telemetry"].n == 2
    assert rows["telemetry"].mean > 1.0
    assert rows["missed_ticks"].n > 1000
    assert rows["missed_unwatched"].n == 10_000
    assert rows["arm_not_at_rest"].max == 0.0


def test_only_the_loop_is_watched() -> None:
    with pytest.raises(UserError, match="bench 'law' has no page to watch: leave --watchers out, or run bench loop"):
        run_bench("law", quick=True, progress=lambda step: None, watchers=5)
