"""Frames of an episode are moments that were recorded, evenly, and say how far they are from their timestamps."""

from __future__ import annotations

from dataclasses import replace

import chess
import numpy as np
import pytest

from app import UserError
from app.dataset.demonstrations import Demonstration, LeftOut, Moments, demonstrations
from app.dataset.games import RecordedPly
from app.dataset.signals import ACTION, FINGER, REFERENCE, STATE
from app.dataset.told import ToldTicks

TICK = 0.00088
QUICK = 45 * TICK
PLY = RecordedPly("game", 1, 1, "e2e4", chess.STARTING_FEN, "move", 1.0, 3.5, success=True, resumed=False, mended=False)


def told(tick: np.ndarray) -> ToldTicks:
    """A reference that goes 1 m/s along x, and fingers that close with 0.01 m/s."""
    time = tick * TICK
    state, reference = np.zeros((len(tick), len(STATE))), np.zeros((len(tick), len(REFERENCE)))
    state[:, 0], state[:, FINGER], reference[:, 0] = time, 0.02 - 0.01 * time, time
    return ToldTicks(tick, time, state, reference)


GRID = np.arange(0, 6000, 45)


def episode(moments: Moments, ply: RecordedPly = PLY) -> Demonstration:
    found = moments.demonstration(ply)
    assert isinstance(found, Demonstration)
    return found


@pytest.mark.parametrize(("fps", "ticks"), [(25, 45), (5, 225)])
def test_a_rate_near_what_was_recorded_takes_its_moments_evenly(fps: int, ticks: int) -> None:
    found = episode(Moments(told(GRID), GRID, fps))
    assert set(np.diff(found.tick)) == {ticks}
    assert found.time[0] == pytest.approx(1125 * TICK)  # the last before 1.0 s
    assert 0.0 <= 3.5 + QUICK - found.time[-1] < ticks * TICK + QUICK
    assert found.state[:, 0] == pytest.approx(found.time)


@pytest.mark.parametrize("odd", [1130, 1140, 3979])
def test_an_episode_begins_before_the_arm_departs_and_where_steps_are_equal(odd: int) -> None:
    moments = Moments(told(np.union1d(GRID, [odd])), None, 25)
    found = episode(moments)
    assert (found.tick[0], found.tick[-1]) == (1125, 4005), "both ends lie beyond the ply's"
    assert set(np.diff(found.tick)) == {45}


def test_where_nothing_was_recorded_before_the_first_step_alone_is_another() -> None:
    first = np.append(1108, GRID[GRID > 1130])
    found = episode(Moments(told(first), None, 25), replace(PLY, begun=1108 * TICK))
    assert found.tick[0] == 1108
    assert np.diff(found.tick)[0] == 62
    assert set(np.diff(found.tick)[1:]) == {45}


def test_another_rate_takes_the_nearest_moments() -> None:
    found = episode(Moments(told(GRID), GRID, 10))
    due = found.time[0] + np.arange(len(found)) / 10
    assert np.abs(found.time - due).max() <= 0.5 * QUICK + 1e-9
    assert set(np.diff(found.tick)) == {90, 135}


def test_what_is_told_in_between_changes_nothing() -> None:
    both = np.union1d(GRID, np.arange(7, 6000, 101))
    found = episode(Moments(told(both), GRID, 25))
    assert found.tick.tolist() == episode(Moments(told(GRID), GRID, 25)).tick.tolist()
    assert found.state[:, 0] == pytest.approx(found.time)


def test_what_is_commanded_is_the_reference_of_the_next_frame() -> None:
    found = episode(Moments(told(GRID), None, 25))
    by_name = dict(zip([signal.name for signal in ACTION], found.action.T, strict=True))
    assert by_name["reference.x"][:-1] == pytest.approx(found.reference[1:, 0])
    assert by_name["reference_velocity.x"][:-1] == pytest.approx(1.0)
    assert by_name["finger_velocity"][:-1] == pytest.approx(-0.01)
    assert found.action[-1].tolist() == [found.reference[-1, 0], *[0.0] * 6]  # to stay


def test_more_frames_than_were_recorded_are_refused() -> None:
    with pytest.raises(UserError, match=r"--fps 30 is more than was recorded, 25\.3 moments a second: say --fps 25 or"):
        Moments(told(GRID), GRID, 30)
    with pytest.raises(UserError, match="what was recorded is too short for frames"):
        Moments(told(GRID[:1]), GRID[:1], 25)


def test_gaps_are_left_out() -> None:
    holed = np.delete(GRID, slice(40, 44))
    broken_off = GRID[:80]
    not_told = Moments(told(holed), GRID, 25)
    for moments in (Moments(told(GRID), holed, 25), Moments(told(broken_off), broken_off, 25), not_told):
        assert moments.demonstration(PLY) is LeftOut.GAPS
    blind = told(GRID)
    blind.state[50, 0] = np.nan
    assert Moments(blind, GRID, 25).demonstration(PLY) is LeftOut.GAPS


def test_plies_that_went_wrong_only_where_they_are_wanted() -> None:
    moments = Moments(told(GRID), GRID, 25)
    plies = (PLY, replace(PLY, success=False), replace(PLY, resumed=True), replace(PLY, mended=True))
    assert [one for one in demonstrations(plies, moments, failures=False) if isinstance(one, LeftOut)] == [
        LeftOut.FAILED, LeftOut.RESUMED, LeftOut.MENDED,
    ]  # fmt: skip
    assert sum(isinstance(one, Demonstration) for one in demonstrations(plies, moments, failures=True)) == 2


def test_episodes_that_follow_each_other_do_not_overlap() -> None:
    moments = Moments(told(GRID), GRID, 25)
    first, second = (episode(moments, replace(PLY, begun=b, ended=b + 1.17)) for b in (1.0, 2.25))
    assert first.tick[-1] <= second.tick[0]
