"""The controlled stop: laws of motion before samples, and Ruckig as the second opinion."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import ruckig
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from controller.protection.stopping import plan_axis, plan_stop

ACCELERATION, JERK = 25.0, 1000.0
speeds = st.floats(-2.0, 2.0)
accelerations = st.floats(-40.0, 40.0)
vectors = st.tuples(speeds, speeds, speeds).map(np.array)
pushes = st.tuples(accelerations, accelerations, accelerations).map(np.array)


@given(speeds, accelerations)
def test_axis_ends_at_rest_within_its_bounds(velocity: float, acceleration: float) -> None:
    stop = plan_axis(velocity, acceleration, ACCELERATION, JERK)
    last = stop.at(stop.duration - 1e-12)
    assert last.velocity == pytest.approx(0.0, abs=1e-9)
    assert last.acceleration == pytest.approx(0.0, abs=1e-6)
    assert stop.at(stop.duration)[1:] == (0.0, 0.0)
    bound = max(abs(acceleration), ACCELERATION) + 1e-9
    times = np.linspace(0.0, stop.duration, 200)
    assert all(abs(stop.at(time).acceleration) <= bound for time in times)
    assert all(abs(phase.jerk) <= JERK and phase.duration >= 0.0 for phase in stop.phases)


@given(speeds, accelerations)
def test_axis_is_as_quick_and_short_as_ruckig(velocity: float, acceleration: float) -> None:
    stop = plan_axis(velocity, acceleration, ACCELERATION, JERK)
    wanted = ruckig.InputParameter(1)
    wanted.control_interface = ruckig.ControlInterface.Velocity
    wanted.current_velocity, wanted.current_acceleration = [velocity], [acceleration]
    wanted.max_acceleration, wanted.max_jerk = [ACCELERATION], [JERK]
    trajectory = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(wanted, trajectory)
    assert stop.duration == pytest.approx(trajectory.duration, abs=1e-9)
    assert stop.at(stop.duration).way == pytest.approx(trajectory.at_time(trajectory.duration)[0][0], abs=1e-9)


@given(vectors, pushes)
def test_path_starts_from_the_reference_and_never_steps(
    velocity: NDArray[np.float64], push: NDArray[np.float64]
) -> None:
    origin = np.array([0.1, -0.2, 0.4])
    path = plan_stop(origin, velocity, push, ACCELERATION, JERK)
    assert all(
        np.allclose(found, given, atol=1e-9)
        for found, given in zip(path.at(0.0), (origin, velocity, push), strict=False)
    )
    dt = 1e-3
    states = [path.at(time) for time in np.arange(0.0, path.duration + 2 * dt, dt)]
    for (p0, v0, a0), (p1, v1, a1) in itertools.pairwise(states):
        assert np.allclose(p1 - p0, dt * (v0 + v1) / 2, atol=2 * JERK * dt**3)
        assert np.allclose(v1 - v0, dt * (a0 + a1) / 2, atol=2 * JERK * dt**2)
        assert np.linalg.norm(a1 - a0) <= 1.5 * JERK * dt
    position, rest, still = path.at(path.duration)
    assert not rest.any()
    assert not still.any()
    assert np.array_equal(path.at(path.duration + 1.0)[0], position)


def test_straight_travel_stops_on_its_line_in_the_documented_time_and_way() -> None:
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    path = plan_stop(np.zeros(3), 0.8 * direction, np.zeros(3), ACCELERATION, JERK)
    position = path.at(path.duration)[0]
    assert np.allclose(np.cross(position, direction), 0.0, atol=1e-12)
    # v/a + a/j and v/2 times that
    assert path.duration == pytest.approx(0.8 / ACCELERATION + ACCELERATION / JERK)
    assert np.linalg.norm(position) == pytest.approx(0.4 * path.duration)


def test_at_rest_there_is_nothing_to_do() -> None:
    path = plan_stop(np.ones(3), np.zeros(3), np.zeros(3), ACCELERATION, JERK)
    assert path.duration == 0.0
    assert np.array_equal(path.at(0.0)[0], np.ones(3))
