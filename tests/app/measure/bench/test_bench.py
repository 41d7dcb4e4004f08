"""Benches: statistics, the recording of real ticks, what the law bench verifies, and the command's contract.

No test judges a duration: those are for the bench itself, on a quiet machine.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import app.measure.bench.law as law_bench
from app import UserError
from app.cli.commands import app as command_line
from app.measure import names
from app.measure.bench import BENCHES, run_bench
from app.measure.bench.beds.recording import TickRecording, found, record
from app.measure.bench.law import Starts, start_once, tick_parts
from app.measure.bench.report import BenchReport, Row, machine, row
from controller.model.constants import DeltaModel

ROW_KEYS = {"unit", "n", "mean", "p50", "p99", "max", "limit", "holds"}


@pytest.fixture(scope="module")
def recording() -> TickRecording:
    return record(1500, seed=1)


def test_a_row_has_the_statistics_and_judges_the_named_one() -> None:
    values = [1.0, 2.0, 3.0, 100.0]
    assert row(values, "s").model_dump() == {
        "unit": "s", "n": 4, "mean": 26.5, "p50": 2.5, "p99": pytest.approx(97.09), "max": 100.0, "limit": None,
        "holds": True,
    }  # fmt: skip
    assert row(values, "s", 2.5).holds
    assert not row(values, "s", 2.49).holds
    assert not row(values, "s", 99.9, "max").holds
    assert row(values, "s", 26.5, "mean").holds


def test_the_machine_is_described_without_its_name() -> None:
    assert "Python 3." in machine()
    assert " cores, " in machine()


def test_a_recording_is_of_a_working_arm_and_repeats_exactly(recording: TickRecording) -> None:
    assert len(recording.ticks) == 1500
    assert recording.boot
    assert all(tick.reference is None for tick in recording.boot)
    way = np.array([tick.found[:3] for tick in recording.ticks])
    target = np.array([tick.reference[:3] for tick in recording.ticks if tick.reference is not None])
    assert np.ptp(way[:, 2]) > 0.05, "it goes down to a piece and up again"
    assert np.linalg.norm(way - target, axis=1).max() < 2e-3
    assert max(max(tick.tactile) for tick in recording.ticks) > 3.0, "it grips"
    assert max(np.abs(tick.torque).max() for tick in recording.ticks) < 8.4
    again = record(1500, seed=1)
    assert [(t.angle, t.torque) for t in again.ticks] == [(t.angle, t.torque) for t in recording.ticks]
    other = record(1500, seed=2)
    assert [t.angle for t in other.ticks] != [t.angle for t in recording.ticks]


def test_the_law_gives_what_the_supervisor_commanded_to_the_last_bit(recording: TickRecording) -> None:
    model = DeltaModel(recording.parameters)
    rows, _ = law_bench._verified(model, recording)
    assert rows["differing_ticks"].max == 0.0
    assert rows["newton_closure"].holds
    assert rows["newton_closure"].max > 0.0
    assert 1.0 <= rows["newton_steps"].mean <= 2.0
    tick = recording.ticks[700]
    u1, u2, u3 = tick.torque
    nearly = replace(tick, torque=(np.nextafter(u1, 9.0).item(), u2, u3))
    ticks = (*recording.ticks[:700], nearly, *recording.ticks[701:])
    rows, _ = law_bench._verified(model, replace(recording, ticks=ticks))
    assert rows["differing_ticks"].max == 1.0
    assert not rows["differing_ticks"].holds


def test_the_parts_compute_what_the_tick_does(recording: TickRecording) -> None:
    """Each part's sum over some ticks equals the one from the law's own state."""
    model = DeltaModel(recording.parameters)
    _, poses = law_bench._verified(model, recording)
    law = law_bench.replayed(model, recording)
    expected = dict.fromkeys(("newton", "jacobian", "inertia", "gravity", "friction"), 0.0)
    for tick in recording.ticks[:50]:
        law.update(tick.angle, tick.velocity)
        state = law.state
        assert found(law).tobytes() == tick.found.tobytes()
        expected["newton"] += state.quality[2] + state.position[2]
        expected["jacobian"] += state.quality[0]
        expected["inertia"] += state.inertia[0, 0]
        expected["gravity"] += state.gravity[0]
        expected["friction"] += state.friction.sum()
    for name, part in tick_parts(model, poses).items():
        # rods are found anew from the closed chain, within Newton's tolerance of those of the tick
        assert part(slice(0, 50)) == pytest.approx(expected[name], rel=1e-10 if name == "jacobian" else 1e-12), name


def test_ticks_are_timed_one_by_one(recording: TickRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter(range(10**9))
    monkeypatch.setattr(law_bench, "perf_counter_ns", lambda: 1000 * next(ticks))
    rows = law_bench._timed(DeltaModel(recording.parameters), recording, rounds=2)
    assert rows["tick"].n == 3000
    assert rows["update"].mean == rows["torque"].mean == rows["call"].mean == 1.0
    assert rows["tick"].p50 == rows["tick"].max == rows["tick_p99_9"].max == 1.0
    assert rows["tick"].holds
    assert rows["tick"].limit == 3.0
    assert rows["tick_p99_9"].limit == 30.0


@pytest.mark.slow
def test_a_start_from_the_cache_compiles_nothing(tmp_path: Path) -> None:
    def compiled() -> dict[Path, int]:
        return {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.suffix in (".nbc", ".nbi")}

    assert start_once(str(tmp_path)) > 0.0
    after_first = compiled()
    assert len(after_first) > 10
    assert start_once(str(tmp_path)) > 0.0
    assert compiled() == after_first


def test_an_unknown_bench_is_refused_with_the_choices() -> None:
    assert tuple(BENCHES) == names.BENCHES
    with pytest.raises(
        UserError,
        match=r"^there is no bench .speed., choose from: law, .*, recovery, .*, drives, .*, commission, campaign$",
    ):
        run_bench("speed", quick=True, progress=print)
    done = CliRunner().invoke(command_line, ["bench", "speed"])
    assert done.exit_code == 2
    said = (
        "law, loop, finger, kills, motion, sim, grip, fallen, recovery, people, knocks, vision, clock, drives, "
        "pictures, identify, commission, campaign"
    )
    assert done.stderr == f"touchmove: there is no bench 'speed', choose from: {said}\n"
    assert set(BENCHES) == {
        "campaign",
        "commission",
        "law",
        "loop",
        "finger",
        "kills",
        "motion",
        "sim",
        "grip",
        "fallen",
        "recovery",
        "people",
        "knocks",
        "vision",
        "clock",
        "drives",
        "pictures",
        "identify",
    }


def fake_report(holds: bool) -> BenchReport:
    rows = {"tick": row([1.0, 2.0], "µs", 3.0 if holds else 1.0), "steps": row([2.0], "steps")}
    return BenchReport(bench="law", seed=1, pace="fast", machine="a machine", holds=holds, rows=rows)


@pytest.mark.parametrize(("holds", "status"), [(True, 0), (False, 1)])
def test_the_command_reports_in_the_contracts_form(holds: bool, status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "app.measure.bench.run_bench",
        lambda name, quick, progress, photos, watchers, standard_cycle: fake_report(holds),
    )
    done = CliRunner().invoke(command_line, ["bench", "law", "--quick", "--json"])
    assert done.exit_code == status
    report = json.loads(done.stdout)
    assert list(report) == ["bench", "seed", "pace", "machine", "holds", "rows"]
    assert report["holds"] is holds
    assert all(set(one) == ROW_KEYS for one in report["rows"].values())
    shown = CliRunner().invoke(command_line, ["bench", "law"])
    assert shown.exit_code == status
    assert ("does not hold" in shown.stdout) is not holds
    assert "a machine" in shown.stdout


@pytest.mark.slow
def test_the_law_bench_has_its_rows_and_its_outputs_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "app.measure.bench.law.measure_starts", lambda cached: Starts(9.0, [1.0] * cached)
    )  # tested above
    said: list[str] = []
    report = run_bench("law", quick=True, progress=said.append)
    assert len(said) >= 3
    assert any("compiling" in step for step in said)
    assert report.rows["tick"].n == 10_000
    assert {"update", "torque", "newton", "jacobian", "inertia", "gravity", "friction"} < set(report.rows)
    assert {"first_compile", "cached_start", "tick_p99_9"} < set(report.rows)
    for name in ("differing_ticks", "newton_closure"):
        assert report.rows[name].holds, name
    assert report.holds == all(one.holds for one in report.rows.values())
    assert all(isinstance(one, Row) and one.n > 0 for one in report.rows.values())
