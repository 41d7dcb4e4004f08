"""Compiled: a time law and its path, evaluated at many times at once."""

from __future__ import annotations

import math

import numpy as np

from controller.model.compiled import ROW, TABLE, FloatArray, compiled, compiled_as

TRACED = 13
"""Columns of a traced path: position, velocity, acceleration; way, speed, acceleration along the path; piece."""


@compiled
def _run(warp: FloatArray, time: float) -> tuple[float, float, float]:
    """x, ẋ and ẍ a time after x = 0, where ẋ² = b0 + b1 x + b2 x²: in closed form, as ẍ is linear in x."""
    start, push, b2 = math.sqrt(warp[0]), 0.5 * warp[1], warp[2]
    omega = math.sqrt(abs(b2))
    z = omega * time
    if z < 1e-5:
        s, c = time, 0.5 * time * time
    elif b2 > 0.0:
        half = math.sinh(0.5 * z) / omega
        s, c = math.sinh(z) / omega, 2.0 * half * half
    else:
        half = math.sin(0.5 * z) / omega
        s, c = math.sin(z) / omega, 2.0 * half * half
    x = start * s + push * c
    return x, start * (1.0 + b2 * c) + push * s, push + b2 * x


@compiled
def _clothoid(sharpness: float, way: float) -> tuple[float, float]:
    """Point of a clothoid that starts straight along x and bends towards y; by its power series, whose terms fall
    quickly while it has turned by less than a right angle.
    """
    heading = 0.5 * sharpness * way * way
    x = y = 0.0
    term = 1.0
    for n in range(12):
        x += term / (4 * n + 1)
        term *= heading / (2 * n + 1)
        y += term / (4 * n + 3)
        term *= -heading / (2 * n + 2)
    return way * x, way * y


@compiled_as(ROW(ROW, TABLE))
def interval_times(step: FloatArray, warp: FloatArray) -> FloatArray:
    """When each interval begins, and the last one ends, (n + 1,) [s].

    In closed form: of a motion with ẍ linear in x the mean of the speeds at both ends is (h / T) (ωT/2) / tan(ωT/2),
    with tanh where b2 > 0.

    Args:
        step: lengths of the intervals in u, (n,).
        warp: coefficients of u̇² by the way into each, (n, 3).
    """
    times = np.zeros(step.size + 1)
    for k in range(step.size):
        b0, b1, b2 = warp[k, 0], warp[k, 1], warp[k, 2]
        ratio = step[k] / (math.sqrt(b0) + math.sqrt(max(b0 + step[k] * (b1 + step[k] * b2), 0.0)))
        omega = math.sqrt(abs(b2))
        z = omega * ratio
        if z < 1e-4:
            took = 2.0 * ratio * (1.0 + math.copysign(z * z / 3.0, b2))
        elif b2 > 0.0:
            took = 2.0 / omega * math.atanh(min(z, 1.0 - 1e-12))
        else:
            took = 2.0 / omega * math.atan(z)
        times[k + 1] = times[k] + took
    return times


@compiled_as(TABLE(ROW, ROW, TABLE, TABLE, ROW, TABLE))
def trace(
    times: FloatArray, begins: FloatArray, ways: FloatArray, warp: FloatArray, piece_of: FloatArray, pieces: FloatArray
) -> FloatArray:
    """A path by its law.

    Args:
        times: at which, rising, (m,) [s].
        begins: of the intervals, and the end of the last one, (n + 1,) [s].
        ways: along the path and its three rates by u, at the begin of each interval, (n, 4).
        warp: coefficients of u̇² by the way into each interval, (n, 3).
        piece_of: each interval, (n,).
        pieces: of the path, (p, 13), as `Path.table`.

    Returns:
        (m, 13), columns as of ``TRACED``.
    """
    out = np.empty((times.size, TRACED))
    last, k = piece_of.size - 1, 0
    for i in range(times.size):
        while k < last and times[i] >= begins[k + 1]:
            k += 1
        x, rate, change = _run(warp[k], max(0.0, times[i] - begins[k]))
        w0, w1, w2, w3 = ways[k, 0], ways[k, 1], ways[k, 2], ways[k, 3]
        first, second = w1 + x * (w2 + 0.5 * x * w3), w2 + x * w3
        way = w0 + x * (w1 + x * (0.5 * w2 + x * w3 / 6.0))
        speed, along = first * rate, second * rate * rate + first * change
        piece = int(piece_of[k])
        row = pieces[piece]
        sharpness, sign = row[6], row[7]
        on = way - row[9]
        sigma = on if sign > 0.0 else row[8] - on
        px, py = _clothoid(sharpness, sigma)
        heading = 0.5 * sharpness * sigma * sigma
        cos, sin = math.cos(heading), sign * math.sin(heading)
        for j in range(3):
            t = cos * row[j] + sin * row[3 + j]
            n = cos * row[3 + j] - sin * row[j]
            out[i, j] = row[10 + j] + sign * px * row[j] + py * row[3 + j]
            out[i, 3 + j] = t * speed
            out[i, 6 + j] = t * along + n * sharpness * sigma * speed * speed
        out[i, 9], out[i, 10], out[i, 11], out[i, 12] = way, speed, along, float(piece)
    return out


@compiled_as(ROW(TABLE, TABLE, ROW, ROW, ROW, ROW))
def highest_needs(
    points: FloatArray,
    centres: FloatArray,
    half_x: FloatArray,
    half_y: FloatArray,
    reach: FloatArray,
    heights: FloatArray,
) -> FloatArray:
    """How high the tool must be over points of the board, 0 where nothing is below it, (n,) [m].

    Args:
        points: (n, 2) [m].
        centres: of pieces, (m, 2) [m].
        half_x: a piece closer along x, and
        half_y: along y, is below the fingers, (m,) [m].
        reach: a piece closer is below the carried foot, (m,) [m]; negative where nothing is carried.
        heights: of the tool over each piece for the fingers, then for the foot, (2m,) [m].
    """
    count = centres.shape[0]
    needed = np.zeros(points.shape[0])
    for i in range(points.shape[0]):
        for j in range(count):
            dx, dy = abs(points[i, 0] - centres[j, 0]), abs(points[i, 1] - centres[j, 1])
            if dx < half_x[j] and dy < half_y[j] and heights[j] > needed[i]:
                needed[i] = heights[j]
            if reach[j] > 0.0 and dx * dx + dy * dy < reach[j] * reach[j] and heights[count + j] > needed[i]:
                needed[i] = heights[count + j]
    return needed
