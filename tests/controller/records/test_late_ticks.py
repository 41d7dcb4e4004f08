"""The loop's clock: what it counts, what it forgets, what it says. All times here are made up."""

from __future__ import annotations

import contextlib
import json
import os
import tracemalloc
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.records import stderr
from controller.records.late_ticks import LoopClock
from controller.records.loop_statistics import STATISTICS_FILE, Histogram, LoopStatistics, write_statistics
from controller.records.stderr import say_at_once
from tests.waiting import until

PERIOD = 0.001
LAW, WORK = 20e-6, 100e-6


def run(clock: LoopClock, ticks: Iterable[int], late: Callable[[int], float] = lambda tick: 0.0, rate: float = 1.0,
        work: float = WORK) -> None:  # fmt: skip
    """Ticks whose answers come when they should, but for a delay [s] and a clock that runs at another rate."""
    for tick in ticks:
        answered = 5000.0 + tick * PERIOD * rate + late(tick)
        clock.ran(tick, clock._answered + work, answered, answered + LAW)


# histogram


def test_a_histogram_knows_what_numpy_knows() -> None:
    values = np.random.default_rng(1).gamma(2.0, 60e-6, 20_000)
    found = Histogram()
    for value in values.tolist():
        found.add(value)
    summary = found.summary()
    assert summary["n"] == 20_000
    assert summary["mean"] == pytest.approx(values.mean())
    assert summary["max"] == values.max()
    for name, share in (("p50", 50.0), ("p99", 99.0)):
        assert summary[name] == pytest.approx(np.percentile(values, share), abs=1e-6), name


def test_long_durations_are_counted_more_coarsely_and_none_is_lost() -> None:
    found = Histogram()
    for value in (4.0959e-3, 4.097e-3, 0.0123, 0.3, 7.0):
        found.add(value)
    assert found.n == 5
    assert found.largest == 7.0
    assert found.percentile(0.4) == pytest.approx(4.1e-3, abs=1.01e-4)
    assert found.percentile(0.6) == pytest.approx(0.0123, abs=1.01e-4)
    assert found.percentile(0.8) == pytest.approx(0.3, abs=1.01e-4)
    assert Histogram().summary() == {"n": 0, "mean": 0.0, "p50": 0.0, "p99": 0.0, "max": 0.0}


# the last second


def test_a_perfect_loop_has_a_perfect_pulse() -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    assert clock.statistics() == LoopStatistics()
    run(clock, range(3000))
    statistics = clock.statistics()
    assert statistics.skipped == 0
    assert statistics.period == pytest.approx(PERIOD)
    assert statistics.lateness == pytest.approx(0.0, abs=1e-9)
    assert statistics.work == pytest.approx(WORK)
    assert clock.summary()["law"]["mean"] == pytest.approx(LAW)
    assert clock.summary()["ticks"] == 3000
    assert not clock.warning_due


def test_a_late_answer_counts_for_a_second_and_stays_in_the_statistics() -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    run(clock, range(2000), lambda tick: 3e-4 if tick == 1900 else 0.0)
    assert clock.statistics().lateness == pytest.approx(3e-4)
    run(clock, range(2000, 3500))
    assert clock.statistics().lateness == pytest.approx(0.0, abs=1e-9)
    assert clock.summary()["lateness"]["max"] == pytest.approx(3e-4)
    assert clock.summary()["period_error"]["max"] == pytest.approx(3e-4)


def test_two_clocks_that_drift_apart_are_not_late() -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    run(clock, range(100_000), rate=1.0001)
    assert clock.lateness.largest <= 0.0001 * 0.51
    assert clock.statistics().period == pytest.approx(PERIOD * 1.0001)


def test_a_plant_that_stood_still_is_on_time_again_soon() -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    run(clock, range(1000))
    run(clock, range(1000, 3000), lambda tick: 0.05)
    assert clock.lateness.largest == pytest.approx(0.05)
    assert clock.statistics().lateness == pytest.approx(0.0, abs=1e-9)


def test_ticks_without_an_exchange_are_skipped_ticks() -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    run(clock, [1000, 1001, 1004, 1005, 1007])
    assert clock.statistics().skipped == 3
    assert clock.period_error.largest == pytest.approx(0.0, abs=1e-9)


def test_on_a_lockstep_bus_nothing_is_late_or_skipped() -> None:
    clock = LoopClock(PERIOD, lockstep=True)
    run(clock, range(0, 9000, 3), lambda tick: tick * 1e-3, work=5e-3)
    assert (clock.skipped, clock.statistics().lateness, clock.lateness.n) == (0, 0.0, 0)
    assert clock.statistics().work == pytest.approx(5e-3)
    assert not clock.warning_due


def test_what_passes_while_plant_time_stands_does_not_count() -> None:
    clock = LoopClock(PERIOD, lockstep=True)
    clock.ran(1, 10.0, 10.001, 10.0011)
    clock.stood(10.0012)
    clock.stood(10.5)
    clock.ran(2, 12.0, 12.001, 12.0011)
    assert clock.work.n == 1
    assert clock.work.largest == pytest.approx(0.0002)
    assert clock.period_error.n == 0
    assert clock.statistics().period == 0.0


def test_counting_keeps_no_memory(memory: Callable[[], int]) -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    run(clock, range(2000))
    tracemalloc.start()
    try:
        before = memory()
        run(clock, range(2000, 12_000))
        assert memory() - before < 2000
    finally:
        tracemalloc.stop()


# warnings


@pytest.mark.parametrize(
    ("ticks", "late", "work", "sentence"),
    [
        (range(1500), 7e-4, WORK, "a tick came 0.70 ms late in the last 0.5 s of ticks, at most 0.50 ms is "
                                  "acceptable: "),
        (range(1260), 0.0, 6e-4, "a tick took 0.60 ms in the last 0.2 s of ticks, at most 0.50 ms is acceptable: "),
        ([*range(1400), *range(1402, 1502)], 0.0, WORK,
         "2 ticks passed without an exchange in the last 0.5 s of ticks, at most 0 is acceptable: "),
    ],
)  # fmt: skip
def test_it_warns_with_the_numbers_and_what_to_do(
    ticks: Any, late: float, work: float, sentence: str, capfd: pytest.CaptureFixture[str]
) -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    assert not clock.warning_due
    run(clock, ticks, lambda tick: late if tick == 1450 else 0.0, work=work)
    assert clock.warning_due
    clock.warn()
    end = "end other programs on this PC, or run 'touchmove link-test' to see what to change\n"
    assert capfd.readouterr().err == sentence + end


def test_the_first_second_is_not_complained_about() -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    run(clock, range(0, 2000, 2), lambda tick: 2e-3 if tick < 1000 else 0.0, work=9e-4)
    assert clock.summary()["work"]["max"] == pytest.approx(9e-4)
    run(clock, range(1999, 30_000))
    assert not clock.warning_due


def test_it_warns_at_most_every_ten_seconds() -> None:
    clock, warnings = LoopClock(PERIOD, lockstep=False), []
    for tick in range(0, 44_000, 2):
        run(clock, [tick])
        if clock.warning_due:
            warnings.append(tick)
            clock.warn()
    assert len(warnings) == 3
    assert np.diff(warnings).min() >= 2 * 10_000


def test_nothing_is_said_to_whom_that_would_keep_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    read, write = os.pipe()
    monkeypatch.setattr(stderr, "_STDERR", write)
    try:
        assert say_at_once("heard")
        assert os.read(read, 100) == b"heard\n"
        os.set_blocking(write, False)
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(write, bytes(4096))
        os.set_blocking(write, True)
        assert not say_at_once("not heard")
    finally:
        os.close(read)
    assert not say_at_once("nobody is there")
    os.close(write)
    assert not say_at_once("nor is this")


# the file


def test_the_run_is_left_in_a_file(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    clock = LoopClock(PERIOD, lockstep=False)
    run(clock, range(100))
    write_statistics(tmp_path, clock.summary(), {"granted": False})
    found = json.loads((tmp_path / STATISTICS_FILE).read_text())
    assert list(tmp_path.iterdir()) == [tmp_path / STATISTICS_FILE]
    assert found["realtime"] == {"granted": False}
    assert (found["period"], found["lockstep"], found["ticks"], found["skipped"]) == (PERIOD, False, 100, 0)
    for name in ("period_error", "lateness", "law", "work"):
        assert set(found[name]) == {"n", "mean", "p50", "p99", "max"}, name
    write_statistics(tmp_path / "missing", clock.summary(), {})
    assert "controller_pulse.json cannot be written (No such file or directory): the loop's" in capfd.readouterr().err


# in the loop


def test_the_telemetry_tells_the_pulse(launch: Callable[..., Any], fake_bus: Callable[..., Any]) -> None:
    running = launch(fake_bus(lockstep=False))
    with running.client() as client:
        begun = client.telemetry.tick
        until(lambda: client.telemetry.tick > begun + 300, "some ticks")  # a motion might be held up by another program
        telemetry = client.telemetry
        client.shutdown()
    assert running.join() == 0
    assert telemetry.period > 0.0005
    assert telemetry.work > 0.0
    assert telemetry.lateness > 0.0
    found = json.loads((running.directory / STATISTICS_FILE).read_text())
    assert found["ticks"] > 300
    assert found["lateness"]["n"] == found["ticks"]
    assert found["work"]["max"] >= telemetry.work
    not_asked_for = dict.fromkeys(("granted", "scheduled", "locked", "pinned", "awake"), False)
    assert found["realtime"] == {**not_asked_for, "notes": []}


def test_in_lockstep_the_telemetry_tells_work_alone(launch: Callable[..., Any], line: Any) -> None:
    running = launch()
    home = (0.0, 0.0, 0.35)
    with running.client() as client:
        client.execute(line(home, home, 300))
        telemetry = client.wait_standing()
    assert (telemetry.skipped, telemetry.lateness) == (0, 0.0)
    assert telemetry.work > 0.0
