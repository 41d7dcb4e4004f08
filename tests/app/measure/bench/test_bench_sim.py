"""The bench of the world: what it measures is of the same game, done again and again."""

from __future__ import annotations

import os
from contextlib import nullcontext

import pytest

from app.measure.bench import sim
from app.settings.files import settings_of


@pytest.mark.slow
def test_a_game_repeats_itself_in_one_process_and_in_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the bench's load and its games at once would measure is left out: that is this machine's. So are cameras."""
    core = min(os.sched_getaffinity(0))
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {core})
    monkeypatch.setattr(sim, "_load", nullcontext)
    monkeypatch.setitem(sim.PLIES, True, 1)
    monkeypatch.setattr(sim, "settings_of", lambda given: settings_of({**given, "rig.cameras": False}))
    said: list[str] = []
    report = sim.sim_bench(True, said.append)
    assert len(said) == 4
    assert {name for name, one in report.rows.items() if not one.holds} <= {
        "cost", "over_mujoco", "cost_on_one_core",
    }, "the machine's"  # fmt: skip
    assert report.rows["again_differs"].max == report.rows["second_differs"].max == 0.0
    assert report.rows["closure"].max < 30.0
    assert report.rows["cost"].max == pytest.approx(1.0 / report.rows["speed"].max)
    ratio = report.rows["cost"].max / report.rows["mujoco_alone"].max
    assert report.rows["over_mujoco"].max == pytest.approx(ratio), "by the wall clock: it may be anything"


def test_telemetry_differs_where_both_were_recorded() -> None:
    first = {16: "a", 32: "", 48: "c"}
    assert not sim.telemetry_differs(first, {32: "", 48: "c", 64: "d"})
    assert sim.telemetry_differs(first, {32: "x", 48: "c"})
    assert sim.telemetry_differs(first, {16: "a", 48: "c"})
