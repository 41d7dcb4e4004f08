"""Paths are smooth; time laws keep every bound everywhere, lose little, and end where they must."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.special import fresnel

from app.motion.curves import widest_corner
from app.motion.path import blend, turns
from app.motion.settings import Law
from app.motion.timing.limits import reachable
from app.motion.timing.reference import Bounds, along, glide, line
from app.motion.timing.time_law import time_law

TICK = 0.00088
BOUNDS = Bounds(0.8, 15.0, 500.0)

coordinate = st.floats(-0.2, 0.2)
point = st.tuples(coordinate, coordinate, st.floats(0.25, 0.47)).map(np.array)
bounds = st.builds(Bounds, st.floats(0.1, 1.6), st.floats(2.0, 30.0), st.floats(100.0, 1500.0), st.floats(0.1, 0.6))


@st.composite
def polygons(draw):
    """Ways over pieces, and others of up to four lines that turn by less than 150°."""
    count = draw(st.integers(2, 5))
    points = [draw(point)]
    for _ in range(count - 1):
        points.append(draw(point))
    polygon = np.array(points)
    lengths = np.linalg.norm(np.diff(polygon, axis=0), axis=1)
    assume(lengths.min() > 0.012)
    turn = turns(polygon) if count > 2 else np.zeros(0)
    assume((turn < math.radians(150.0)).all() and (turn > 0.02).all())
    room = np.minimum(lengths[:-1], lengths[1:]) / 2.0
    shares = np.array([draw(st.floats(0.15, 0.9)) for _ in turn])
    tangents = np.minimum(shares * room, 0.05) if len(turn) else np.zeros(0)
    return polygon, tangents


def dense(path, law, count=3000):
    """The path by its law, the jerk by differences, and their step."""
    time = np.linspace(0.0, law.duration, count)
    at = law.trace(path, time)
    return at, np.diff(at.acceleration, axis=0) / (time[1] - time[0]), time[1]


def clothoid(sharpness, way):
    """Point of a clothoid that starts straight along x and bends towards y, after a way from its start [m]."""
    scale = np.sqrt(np.pi / sharpness)
    sine, cosine = fresnel(way / scale)
    return scale * cosine, scale * sine


def positions(path, way):
    """Points (n, 3) at ways (n,) along the path [m]."""
    piece = path.piece_at(way)
    on = np.clip(way - path.begins[piece], 0.0, path.length[piece])
    sigma = np.where(path.sign[piece] > 0.0, on, path.length[piece] - on)
    sharpness = path.sharpness[piece]
    x, y = np.array(sigma), np.zeros_like(sigma)
    bent = sharpness > 0.0
    x[bent], y[bent] = clothoid(sharpness[bent], sigma[bent])
    along = (path.sign[piece] * x)[:, None] * path.tangent[piece]
    return path.flat[piece] + along + y[:, None] * path.normal[piece]


def corner_shape(turn):
    """Of a corner whose clothoids are 1 m long: where it begins before its point, and how far its middle stays off."""
    x, y = clothoid(np.array([turn]), np.array([1.0]))
    half = 0.5 * turn
    return float(x[0] + y[0] * np.tan(half)), float(y[0] / np.cos(half))


def derivatives(path, way):
    """By the way along the path, (n, 3) each: unit tangent and curvature vector [1/m]."""
    piece = path.piece_at(way)
    on = np.clip(way - path.begins[piece], 0.0, path.length[piece])
    sigma = np.where(path.sign[piece] > 0.0, on, path.length[piece] - on)
    sharpness, sign = path.sharpness[piece], path.sign[piece]
    heading = 0.5 * sharpness * sigma * sigma
    cos, sin = np.cos(heading)[:, None], (np.sin(heading) * sign)[:, None]
    tangent, normal = path.tangent[piece], path.normal[piece]
    return cos * tangent + sin * normal, (sharpness * sigma)[:, None] * (cos * normal - sin * tangent)


@settings(max_examples=30)
@given(polygons())
def test_a_path_is_smooth_and_stays_near_its_polygon(polygon):
    points, tangents = polygon
    path = blend(points, tangents)
    ways = np.linspace(0.0, path.total, 4001)
    first, second = derivatives(path, ways)
    np.testing.assert_allclose(positions(path, np.array([0.0, path.total])), points[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(first, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.einsum("ij,ij->i", first, second), 0.0, atol=1e-9)
    step = ways[1] - ways[0]
    moved = np.diff(positions(path, ways), axis=0)
    np.testing.assert_allclose(moved, 0.5 * step * (first[1:] + first[:-1]), atol=1e-6 * step + 30 * step**3 / 1e-5)
    bend = np.diff(second, axis=0)  # curvature is continuous: it changes by no more than its rate
    sharpest = path.sharpness.max() + (path.sharpness * path.length).max() ** 2
    assert np.linalg.norm(bend, axis=1).max() <= 1.01 * sharpest * step + 1e-9
    for k, tangent in enumerate(tangents):
        begins, deviation = corner_shape(float(turns(points)[k]))
        (middle,) = path.ends[(path.sharpness > 0.0) & (path.sign > 0.0) & (path.line == k)]
        away = float(np.linalg.norm(positions(path, np.array([middle])) - points[k + 1]))
        assert away == pytest.approx(deviation * tangent / begins, abs=1e-9)


def test_a_clothoid_bends_as_it_must():
    ways = np.linspace(0.0, 0.03, 3001)
    x, y = clothoid(np.full(3001, 2000.0), ways)
    heading = np.arctan2(np.gradient(y, ways), np.gradient(x, ways))
    np.testing.assert_allclose(heading[1:-1], 1000.0 * ways[1:-1] ** 2, atol=1e-6)


@settings(max_examples=60)
@given(st.floats(-0.6, 0.6), st.integers(0, 10**6))
def test_a_corner_is_as_wide_as_what_stands_below_admits(slope, seed):
    """Its path, built and sampled apart from that, clears every height that is needed; that of the next size does not.

    Between the points at which corners are looked at a clothoid rises by 0.3 mm more or less than straight.
    """
    rng, height = np.random.default_rng(seed), 0.10
    at = np.linspace(0.0, 0.2, 134)
    needed = np.zeros(134)
    for _ in range(3):
        first = rng.integers(1, 134)
        needed[first : first + 20] = np.maximum(needed[first : first + 20], rng.uniform(0.0, 0.1))
    needed = np.minimum(needed, height + slope * at - abs(slope) * at[1])  # the line itself is free
    along, sizes = math.hypot(1.0, slope), 0.08 * np.array([1.0, 0.7, 0.45, 0.25, 0.1])
    corner = np.array([[0.0, 0.0, -0.15], [0.0, 0.0, 0.0], [0.3 / along, 0.0, 0.3 * slope / along]])
    found = widest_corner(at, needed, height, slope, math.acos(slope / along), sizes)
    for size in sizes[sizes >= found]:
        path = blend(corner, np.array([size]))
        points = positions(path, np.linspace(0.15 - size, path.total - 0.3 + size, 2000))
        index = np.clip(np.searchsorted(at, points[:, 0]), 1, 133)
        wanted = np.maximum(needed[index], needed[np.maximum(index - 1, 1)])
        short = float(np.where(points[:, 0] > 0.001, wanted - points[:, 2] - height, 0.0).max())
        assert short < 3e-4 if size == found else short > -3e-4


@settings(max_examples=40)
@given(polygons(), st.data(), st.sampled_from(Law))
@example(
    (np.array([(0.0, 0.03125, 0.375), (0.0, 0.125, 0.4375), (0.125, 0.0, 0.25)]), np.array([0.02816837])),
    [Bounds(1.0, 4.0, 100.0, 0.5), Bounds(1.0, 5.0, 1086.0, 0.5)], Law.TIME_OPTIMAL,
)  # fmt: skip
def test_no_law_exceeds_a_bound_anywhere(polygon, data, law):
    """In the example the jerk is largest before the second point of an interval at which it is looked at."""
    points, tangents = polygon
    path = blend(points, tangents)
    each = data if isinstance(data, list) else [data.draw(bounds) for _ in range(len(points) - 1)]
    found = time_law(path, each, law)
    at, jerk, step = dense(path, found)
    position, velocity, acceleration = at.position, at.velocity, at.acceleration
    line_of = path.line[at.piece]
    # a corner belongs to two lines; the loosest bounds of all are what holds wherever it is
    loosest = Bounds(*(max(getattr(b, n) for b in each) for n in ("speed", "acceleration", "jerk", "downward")))
    tight = np.array([[b.speed, b.acceleration, b.jerk, b.downward] for b in each])[line_of]
    straight = path.sharpness[at.piece] == 0.0
    limit = np.where(straight[:, None], tight, [loosest.speed, loosest.acceleration, loosest.jerk, loosest.downward])
    more = 1.0 + 1e-6
    assert (np.linalg.norm(velocity, axis=1) <= more * limit[:, 0]).all()
    assert (velocity[:, 2] <= more * limit[:, 3]).all()
    assert (np.abs(acceleration) <= more * limit[:, 1:2]).all()
    around = np.maximum(limit[1:, 2], limit[:-1, 2])[:, None]
    rounding = 1e-9 * acceleration.max() / step
    assert (np.abs(jerk) <= more * around + rounding).all()
    np.testing.assert_allclose(position[[0, -1]], points[[0, -1]], atol=1e-9)
    assert np.abs(velocity[[0, -1]]).max() < 1e-4
    moved = np.diff(position, axis=0) / step
    trapezoidal = np.abs(jerk).max() * step**2 / 6.0
    mean = 0.5 * (velocity[1:] + velocity[:-1])
    np.testing.assert_allclose(moved, mean, atol=trapezoidal + 2e-6 + 1e-3 * np.abs(velocity).max())


@settings(max_examples=60)
@given(polygons(), st.data(), st.sampled_from((0.0, 0.03)))
@example((np.array([(0.0, 0.0, 0.3125), (0.125, 0.0, 0.25), (0.1875, 0.0, 0.25)]), np.array([0.0234375])), None, 0.0)
def test_the_refined_law_is_never_slower_than_ruckigs(polygon, data, end_speed):
    points, tangents = polygon
    path = blend(points, tangents)
    each = [BOUNDS if data is None else data.draw(bounds) for _ in range(len(points) - 1)]
    first = time_law(path, each, Law.RUCKIG, end_speed).duration
    law = time_law(path, each, end_speed=end_speed)
    assert law.duration <= first
    (speed,) = law.trace(path, np.array([law.duration])).speed
    assert speed == pytest.approx(end_speed, rel=0.1, abs=1e-6)


def test_a_law_that_cannot_reach_the_end_speed_is_not_offered_as_quicker():
    """Of the last line 1 mm is left, which is too short for Ruckig to accelerate on."""
    path = blend(np.array([(0.0, 0.0, 0.3), (0.05, 0.0, 0.3), (0.05, 0.01, 0.3)]), np.array([0.009]))
    each = [BOUNDS] * 2
    first, law = time_law(path, each, Law.RUCKIG, 0.4), time_law(path, each, end_speed=0.4)
    assert first.trace(path, np.array([first.duration])).speed[0] < 0.3
    assert law.duration > first.duration


@settings(max_examples=20)
@given(polygons())
def test_ruckigs_law_is_quicker_than_stopping_at_every_corner_or_hardly_slower(polygon):
    points, tangents = polygon
    first = time_law(blend(points, tangents), [BOUNDS] * (len(points) - 1), Law.RUCKIG).duration
    assert first <= 1.5 * sum(len(line(a, b, BOUNDS, TICK)) for a, b in pairwise(points)) * TICK


@pytest.mark.parametrize(("tangent", "optimum"), [(0.008, 0.3996), (0.012, 0.3859), (0.02, 0.3642), (0.03, 0.3585)])
def test_a_gentle_corner_is_passed_as_quickly_as_is_possible(tangent, optimum):
    """Optima by CasADi and IPOPT on the same path with the same bounds [s]; at the widest corner Ruckig's is one."""
    path = blend(np.array([(0.0, 0.0, 0.3), (0.12, 0.0, 0.3), (0.21, 0.052, 0.3)]), np.array([tangent]))
    law = time_law(path, [BOUNDS] * 2)
    assert 0.999 * optimum < law.duration < 1.006 * optimum
    assert (time_law(path, [BOUNDS] * 2, Law.RUCKIG).duration < 1.006 * optimum) is (tangent == 0.03)


def test_a_right_angle_is_passed_almost_as_quickly_as_is_possible():
    """Optimum by CasADi and IPOPT on the same path with the same bounds: 0.4702 s; Ruckig at constant speed 0.518 s."""
    reach = 0.02 * corner_shape(math.pi / 2)[0]
    corners = np.array([[0, 0, -0.02], [0, 0, -0.08], [0.12, 0, -0.08], [0.12, 0, -0.022]])
    path = blend(corners, np.array([reach, reach]))
    each = [BOUNDS, Bounds(0.8, 15.0, 500.0, 0.45), Bounds(0.8, 15.0, 500.0, 0.45)]
    law = time_law(path, each, end_speed=0.03)
    assert 0.470 < law.duration < 1.03 * 0.4702
    assert time_law(path, each, Law.RUCKIG, end_speed=0.03).duration > 1.07 * law.duration
    at, _, _ = dense(path, law)
    np.testing.assert_allclose(at.velocity[-1], [0.0, 0.0, 0.03], atol=1e-4)
    assert np.abs(at.acceleration[-1]).max() < 1e-6


def test_one_line_is_ruckigs():
    """Trapezoid of acceleration: distance v·(T − v/a − a/j)."""
    segment = line(np.zeros(3), np.array([0.5, 0.0, 0.0]), BOUNDS, TICK)
    expected = 0.5 / 0.8 + 0.8 / 15.0 + 15.0 / 500.0
    assert len(segment) * TICK == pytest.approx(expected, abs=TICK)
    assert len(line(np.zeros(3), np.zeros(3), BOUNDS, TICK)) == 0


def test_the_quintic_law_has_the_quintics_peaks():
    """Of s = L (10τ³ - 15τ⁴ + 6τ⁵): 15/8 of the mean speed, 10/√3 L/T² and 60 L/T³."""
    path = blend(np.array([[0, 0, 0], [0.1, 0, 0.0]]), np.zeros(0))
    law = time_law(path, [Bounds(10.0, 1e4, 500.0)], Law.MINIMUM_JERK)
    assert law.duration == pytest.approx((60.0 * 0.1 / 500.0) ** (1 / 3), rel=0.02)
    at, _, _ = dense(path, law)
    position, velocity, acceleration = at.position, at.velocity, at.acceleration
    assert velocity[:, 0].max() == pytest.approx(15 / 8 * 0.1 / law.duration, rel=1e-3)
    assert acceleration[:, 0].max() == pytest.approx(10 / 3**0.5 * 0.1 / law.duration**2, rel=1e-3)
    tau = np.linspace(0.0, 1.0, len(position))
    np.testing.assert_allclose(position[:, 0], 0.1 * tau**3 * (10 - 15 * tau + 6 * tau**2), atol=2e-6)


@settings(max_examples=20)
@given(polygons(), st.sampled_from(Law))
def test_samples_end_exactly_at_the_end_and_follow_from_each_other(polygon, law):
    points, tangents = polygon
    path = blend(points, tangents)
    segment = along(path, time_law(path, [BOUNDS] * (len(points) - 1), law), TICK)
    np.testing.assert_allclose(segment.position[-1], points[-1], atol=1e-12)
    assert not segment.velocity[-1].any()
    assert not segment.acceleration[-1].any()
    moved = np.diff(np.vstack([points[:1], segment.position]), axis=0)
    mean = 0.5 * (segment.velocity + np.vstack([np.zeros((1, 3)), segment.velocity[:-1]])) * TICK
    # by the trapezoidal rule, whose error is jerk·tick³/12 on each axis
    assert np.abs(moved - mean).max() <= 1.01 * 500.0 * TICK**3 / 12 + 1e-12
    steps = np.diff(np.vstack([np.zeros(3), segment.acceleration]), axis=0)
    assert np.abs(steps).max() <= 500.0 * TICK * (1 + 1e-6)


def test_a_glide_goes_on_straight_and_stops():
    segment = glide(np.zeros(3), np.array([0.0, 0.0, 0.03]), 0.015, BOUNDS, TICK)
    np.testing.assert_allclose(segment.position[-1], [0.0, 0.0, 0.015], atol=1e-12)
    assert np.abs(segment.velocity[:-30, 2] - 0.03).max() < 1e-4
    assert not segment.velocity[-1].any()


@given(st.floats(0.0, 0.5), st.floats(0.01, 1.0), st.floats(0.001, 0.3))
def test_a_reachable_speed_needs_no_more_than_the_line(low, more, length):
    speed = reachable(low, low + more, length, 15.0, 500.0)
    assert low <= speed <= low + more
    gain = speed - low
    time = 2 * math.sqrt(gain / 500.0) if gain <= 15.0**2 / 500.0 else gain / 15.0 + 15.0 / 500.0
    assert 0.5 * (low + speed) * time <= length + 1e-9
