"""Loops over pixels do what the same formulas do in NumPy, written out here, on any pictures."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vision.hands.arm_mask import Capsules
from vision.loops import (
    changes,
    colour_sums,
    lay_out,
    learn_heights,
    measure_parts,
    slopes_of,
    squares_under,
    stand_out,
    tops,
)
from vision.reading.solids import LOGARITHM

NO_ENDS, NO_RADII = np.zeros((0, 2, 3)), np.zeros(0)
Field = NDArray[np.float32]


@pytest.fixture(params=range(3))
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    return np.random.default_rng(request.param)


def depth_picture(rng: np.random.Generator, shape: tuple[int, int] = (90, 120)) -> Field:
    """Smooth hills, with holes."""
    hills = cv2.GaussianBlur(rng.normal(0.0, 1.0, shape), (0, 0), 6.0)
    depth = (0.6 + 0.5 * hills).astype(np.float32)
    depth[rng.random(shape) < 0.05] = 0.0
    return depth


def rays(shape: tuple[int, int]) -> tuple[Field, Field]:
    """Of a camera that looks straight down from 0.7 m: (3, h, w) and its place (3,)."""
    v, u = np.meshgrid(np.linspace(-0.4, 0.4, shape[0]), np.linspace(-0.5, 0.5, shape[1]), indexing="ij")
    ray = np.stack([u, v, -np.ones(shape)]).astype(np.float32)
    return np.ascontiguousarray(ray), np.array([0.01, -0.02, 0.7], dtype=np.float32)


def test_points_are_laid_out_over_their_squares(rng: np.random.Generator) -> None:
    depth = depth_picture(rng)
    h, w = depth.shape
    rows = np.array([np.zeros(h), np.linspace(-9, 9, h), np.full(h, -1.0)], dtype=np.float32)
    columns = np.array([np.linspace(-9, 9, w), np.zeros(w), np.zeros(w)], dtype=np.float32)
    start = np.array([4.0, 4.0, 0.7], dtype=np.float32)
    square, z, middle = lay_out(depth, rows, columns, start, 0.45)
    x, y, height = ((rows[k][:, None] + columns[k]) * depth + start[k] for k in range(3))
    file, rank = np.floor(x), np.floor(y)
    on = (file >= 0) & (file < 8) & (rank >= 0) & (rank < 8) & (depth > 0.0)
    over = on & (np.abs(x - file - 0.5) < 0.45) & (np.abs(y - rank - 0.5) < 0.45)
    assert 0.2 < on.mean() < 0.99
    np.testing.assert_array_equal(square, np.where(on, 8 * rank + file, 64))
    np.testing.assert_array_equal(middle, over)
    np.testing.assert_array_equal(z, height)


def test_colours_and_tops_are_those_of_each_square(rng: np.random.Generator) -> None:
    square = rng.integers(0, 65, (70, 80)).astype(np.int32)
    where, value = rng.random(square.shape) < 0.4, rng.random(square.shape).astype(np.float32)
    where &= square != 17
    picture = rng.integers(0, 256, (*square.shape, 3)).astype(np.uint8)
    sums, count = colour_sums(picture, LOGARITHM, square, where)
    levels = LOGARITHM[picture].astype(float)
    for one in range(65):
        chosen = where & (square == one)
        assert count[one] == np.count_nonzero(chosen)
        np.testing.assert_allclose(sums[one], levels[chosen].sum(axis=0), rtol=1e-12)
    found = tops(square, where, value, count[:64], 0.9)
    for one in range(64):
        values = np.sort(value[where & (square == one)])
        assert found[one] == (values[int(0.9 * len(values))] if len(values) else 0.0)
    assert found[17] == 0.0


def test_slopes_are_sobels(rng: np.random.Generator) -> None:
    level = rng.normal(-1.0, 0.5, (50, 60, 3)).astype(np.float32)
    slopes, size = slopes_of(level)
    across = cv2.Sobel(level, cv2.CV_32F, 1, 0, scale=1 / 8)
    down = cv2.Sobel(level, cv2.CV_32F, 0, 1, scale=1 / 8)
    both = np.concatenate([across, down], axis=2)
    np.testing.assert_allclose(slopes, both, atol=1e-6)
    np.testing.assert_allclose(size, np.linalg.norm(both, axis=2), atol=1e-6)


def test_changes_are_means_over_the_middle_of_squares(rng: np.random.Generator) -> None:
    margin, side, edge = 24, 24, 2
    shape = (240, 240)
    level, old_level = (rng.normal(size=(*shape, 3)).astype(np.float32) for _ in range(2))
    slopes, old_slopes = (rng.normal(size=(*shape, 6)).astype(np.float32) for _ in range(2))
    size, old_size = (rng.random(shape).astype(np.float32) for _ in range(2))
    got = changes(level, old_level, slopes, old_slopes, size, old_size, margin, side, edge)
    fields = (np.abs(level - old_level).sum(axis=2), np.linalg.norm(slopes - old_slopes, axis=2), size + old_size)
    for square in (0, 7, 20, 56, 63):
        top, left = margin + (7 - square // 8) * side, margin + square % 8 * side
        middle = slice(top + edge, top + side - edge), slice(left + edge, left + side - edge)
        np.testing.assert_allclose(got[square], [field[middle].mean() for field in fields], rtol=1e-5)


def test_what_stands_out_is_tall_or_has_risen_and_lies_within(rng: np.random.Generator) -> None:
    depth = depth_picture(rng)
    ray, position = rays(depth.shape)
    hidden = rng.random(depth.shape) < 0.3
    usual = np.where(rng.random(depth.shape) < 0.5, rng.random(depth.shape) * 0.1, np.inf).astype(np.float32)
    limits, half = np.array([0.078, 0.34, 0.012, 0.02], np.float32), np.array([0.25, 0.2], np.float32)
    found = stand_out(depth, ray, position, hidden, usual, limits, half, NO_ENDS, NO_RADII)
    x, y, z = (depth * ray[k] + position[k] for k in range(3))
    within = (depth > 0.0) & (z < limits[1]) & (np.abs(x) < half[0]) & (np.abs(y) < half[1]) & ~hidden
    tall, low = within & (z > limits[0]), within & (z > limits[2]) & (z - usual > limits[3])
    assert tall.any()
    assert (low & ~tall).any()
    np.testing.assert_array_equal(found, np.where(tall, 2, np.where(low, 1, 0)))


def test_what_the_outline_covers_is_seen_where_nothing_known_is(rng: np.random.Generator) -> None:
    depth = depth_picture(rng)
    ray, position = rays(depth.shape)
    everywhere, nowhere = np.ones(depth.shape, np.bool_), np.zeros(depth.shape, np.bool_)
    usual = np.full(depth.shape, np.inf, np.float32)
    limits, half = np.array([0.078, 0.34, 0.012, 0.02], np.float32), np.array([0.25, 0.2], np.float32)
    bodies = Capsules([[[-0.1, 0.0, 0.1], [0.1, 0.05, 0.2]], [[0.0, -0.1, 0.15], [0.0, -0.1, 0.15]]], [0.06, 0.05])
    free = stand_out(depth, ray, position, nowhere, usual, limits, half, NO_ENDS, NO_RADII)
    seen = stand_out(depth, ray, position, everywhere, usual, limits, half, bodies.ends, bodies.radii)
    points = np.stack([depth * ray[k] + position[k] for k in range(3)], axis=-1).astype(float)
    off = np.full(depth.shape, np.inf)
    for (a, b), radius in zip(bodies.ends, bodies.radii, strict=True):
        along = np.clip((points - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-12), 0.0, 1.0)
        off = np.minimum(off, np.linalg.norm(points - a - along[..., None] * (b - a), axis=-1) - radius)
    assert 0.0 < (seen > 0).sum() < (free > 0).sum()
    np.testing.assert_array_equal(seen, np.where(off < 0.0, 0, free))


def test_parts_are_measured_and_stand_over_squares(rng: np.random.Generator) -> None:
    depth = depth_picture(rng)
    ray, position = rays(depth.shape)
    found = (rng.integers(0, 3, depth.shape) * (depth > 0.0)).astype(np.uint8)
    mask = cv2.morphologyEx(np.minimum(found, 1), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    count, labels = cv2.connectedComponents(mask)
    inner, pixel = np.array([0.2, 0.15], np.float32), 1e-4
    parts: Any = labels.astype(np.int32)
    areas, high, enters = measure_parts(parts, count, found, depth, ray, position, pixel, inner, 3)
    x, y, z = (depth * ray[k] + position[k] for k in range(3))
    rim = (np.abs(x) > inner[0]) | (np.abs(y) > inner[1])
    rim[:3], rim[-3:], rim[:, :3], rim[:, -3:] = True, True, True, True
    of_pixel = (depth * depth * np.float32(pixel)).astype(float)
    chosen = np.zeros(count, np.bool_)
    for part in range(1, count):
        here = labels == part
        chosen[part] = part % 2 == 0
        assert areas[part] == pytest.approx(of_pixel[here].sum(), rel=1e-6)
        assert high[part] == pytest.approx(of_pixel[here & (found == 2)].sum(), rel=1e-6)
        assert enters[part] == rim[here].any()
    counts = squares_under(parts, chosen, depth, ray, position, 0.04, 0.11)
    file, rank = np.floor(x / np.float32(0.04) + 4), np.floor(y / np.float32(0.04) + 4)
    on = chosen[labels] & (file >= 0) & (file < 8) & (rank >= 0) & (rank < 8)
    squares = (file + 8 * rank)[on].astype(int)
    np.testing.assert_array_equal(counts[0], np.bincount(squares, minlength=64))
    np.testing.assert_array_equal(counts[1], np.bincount(squares[z[on] < np.float32(0.11)], minlength=64))


def test_heights_are_learnt_where_they_are_seen(rng: np.random.Generator) -> None:
    depth = depth_picture(rng)
    ray, position = rays(depth.shape)
    hidden = rng.random(depth.shape) < 0.2
    usual = np.where(rng.random(depth.shape) < 0.7, 0.05, np.inf).astype(np.float32)
    before, share = usual.copy(), np.float32(0.2)
    learn_heights(depth, ray[2], hidden, usual, float(position[2]), 0.2)
    z = depth * ray[2] + position[2]
    fresh = np.where(np.isfinite(before), before + share * (z - np.where(np.isfinite(before), before, 0.0)), z)
    np.testing.assert_allclose(usual, np.where((depth > 0.0) & ~hidden, fresh, before), atol=1e-6)
