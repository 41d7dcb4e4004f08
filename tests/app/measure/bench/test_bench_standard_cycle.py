"""The standard cycle is what industry means by it, within the limits it names, and carried out as planned."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.commands import app as command_line
from app.measure.bench.motion.standard_cycle import (
    ACROSS,
    GAME,
    KING,
    LOADS,
    RISE,
    best_middle,
    carry_out,
    planned,
    quickest,
    with_grasps,
)
from app.measure.bench.motion.torques import WINDOW, worst_rms
from hardware.parameters import load_parameters

DRIVE = load_parameters().drive


def test_a_cycle_goes_25_up_305_over_and_25_down_and_back() -> None:
    cycle = planned(best_middle(KING), GAME, KING)
    samples = np.concatenate([cycle.rest, cycle.samples])
    way, speed = samples["position"], np.linalg.norm(samples["velocity"], axis=1)
    first, far, last = np.flatnonzero(speed < 1e-9)
    assert (first, last) == (0, len(way) - 1)
    np.testing.assert_allclose(way[[first, last]], [cycle.start] * 2, atol=1e-9)
    assert way[far, 2] == pytest.approx(way[first, 2], abs=1e-9)
    assert np.linalg.norm(way[far] - way[first]) == pytest.approx(ACROSS, abs=1e-9)
    for leg in (way[first:far], way[far:last]):
        assert np.ptp(leg[:, 2]) == pytest.approx(RISE, abs=1e-6)


@pytest.mark.parametrize("load", LOADS, ids=lambda load: load.name)
def test_the_quickest_cycle_is_at_a_limit_and_one_that_lasts_is_slower(load) -> None:
    middle = best_middle(load)
    lasting, once = (quickest(middle, load, lasting=one) for one in (True, False))
    assert 0.97 < max(lasting.used.values()) <= 1.0 + 1e-6
    assert 0.97 < max(once.used.values()) <= 1.0 + 1e-6
    assert lasting.limited_by == "mean torque"
    assert once.limited_by != "mean torque"
    assert len(once.samples) < len(lasting.samples)


@pytest.mark.parametrize("load", LOADS, ids=lambda load: load.name)
def test_a_cycle_is_carried_out_as_planned(load) -> None:
    cycle = quickest(best_middle(load), load, lasting=True)
    went = carry_out(cycle, load, 2)
    assert len(went.torques) >= 2 * len(cycle.samples)
    assert went.error < 0.0015, "no servomotor is asked for more than it gives"
    planned_speed = float(np.linalg.norm(cycle.samples["velocity"], axis=1).max())
    assert went.speed == pytest.approx(planned_speed, rel=0.05)
    rms = np.sqrt((went.torques**2).mean(axis=0)).max()
    assert rms == pytest.approx(cycle.used["mean torque"] * DRIVE.rated_torque, rel=0.12)
    assert went.slip < 1e-4


def test_grasps_take_longer_than_none() -> None:
    rows = with_grasps()
    assert rows["grasped_way"].mean == pytest.approx(1e3 * ACROSS, abs=1.0)
    assert rows["grasped_cycle"].mean > rows["grasped_moving"].mean + 0.2


def test_a_window_is_looked_at_wherever_it_is_worst_and_never_a_shorter_one() -> None:
    tick, ticks = 0.01, round(WINDOW / 0.01)
    torques = np.zeros((3 * ticks, 3))
    torques[ticks // 2 : ticks // 2 + ticks] = [1.0, -2.0, 3.0]
    assert worst_rms(torques, tick) == pytest.approx([1.0, 2.0, 3.0])
    assert worst_rms(torques[: ticks - 1], tick) == []


def test_only_motion_has_a_standard_cycle() -> None:
    done = CliRunner().invoke(command_line, ["bench", "law", "--standard-cycle"])
    assert done.exit_code != 0
    assert "bench 'law' has no standard cycle: leave --standard-cycle out, or run bench motion" in " ".join(
        done.output.split()
    )
