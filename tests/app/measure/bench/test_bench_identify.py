"""Bench ``identify``: what it says of a robot is so, and a law that knows nothing of it is told from one that does."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.commissioning.identification.estimation import identify
from app.commissioning.identification.excitation import Excitation, find_excitation
from app.commissioning.identification.survey import borders_of
from app.measure.bench.beds.unknown_robot import bed_of, recorded, unknown_plant, unknown_robot
from app.measure.bench.report import Tally
from app.measure.bench.unknown import identify as bench
from hardware.parameters import load_parameters
from hardware.table import TableSettings

BELIEVED, TABLE = load_parameters(), TableSettings()
ROBOT = 91


@cache
def excitation() -> Excitation:
    """Searched for less long than a lab's: it tells enough."""
    with pytest.MonkeyPatch.context() as quicker:
        quicker.setattr("app.commissioning.identification.excitation._CHANGES", 400)
        return find_excitation(BELIEVED, borders_of(BELIEVED, TABLE), 24.0)


def test_a_law_that_knows_the_robot_tracks_better_and_the_same_game_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "LINE", "e4")
    true = unknown_robot(BELIEVED, ROBOT)
    known, again = (bench.track(true, true, TABLE, ROBOT) for _ in range(2))
    assert known.stopped is None
    assert len(known.game) == len(known.air) == 1
    np.testing.assert_array_equal(known.game[0], again.game[0])
    assert 0 < len(known.air[0]) < len(known.game[0])
    believed = bench.track(true, BELIEVED, TABLE, ROBOT)
    assert believed.stopped is not None or bench._rms(believed.game) > 1.5 * bench._rms(known.game)


@pytest.mark.slow
def test_the_bars_hold_for_a_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "LINE", "e4 d5")
    monkeypatch.setattr(bench, "find_excitation", lambda *_: excitation())
    monkeypatch.setitem(bench.ROBOTS, True, 1)
    said: list[str] = []
    report = bench.identify_bench(True, said.append)
    assert report.holds
    assert said[0].startswith(f"robot {bench.SEED}: worst base parameter ")
    rows = report.rows
    assert 0.0 < rows["base"].max < bench.BASE_LIMIT < rows["base_nominal"].max
    assert rows["game_ratio"].max == pytest.approx(rows["game_identified"].max / rows["game_true"].max)


def test_what_was_not_told_is_counted_and_not_judged() -> None:
    true = unknown_robot(BELIEVED, ROBOT)
    plant = unknown_plant(true, TABLE, excitation().middle, ROBOT)
    found = identify(recorded(bed_of(plant, BELIEVED, TABLE), excitation()), BELIEVED, 5)
    first, *others = found.estimates
    tally = Tally(list)
    bench._compare(found, BELIEVED, true, tally)
    bench._compare(replace(found, estimates=(replace(first, value=9.0, told=False), *others)), BELIEVED, true, tally)
    bench._compare(replace(found, estimates=(replace(first, value=9.0), *others)), BELIEVED, true, tally)
    assert tally["untold"] == [0.0, 1.0, 0.0]
    assert tally["base"][1] < bench.BASE_LIMIT < tally["base"][2]
