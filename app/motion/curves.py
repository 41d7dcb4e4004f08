"""Compiled: lines and clothoids, made from a polygon, fitted over what stands there, and evaluated by a time law.

Pieces of a path are rows of 14 numbers: tangent and normal at the flat end, sharpness, sign, length, way at the begin,
flat end, and the line of the polygon; see `app.motion.path.Path`.
"""

import math

import numpy as np

from controller.model.compiled import ROW, SCALAR, TABLE, FloatArray, compiled, compiled_as

STRAIGHT = 1e-6
"""Lines that turn by less are one line [rad]."""
TRACED = 12
"""Columns of a traced path: position, velocity, acceleration; way and speed along the path; piece."""
PIECE = 14
"""Columns of a piece of a path."""
ROWS = 9
"""Columns of an interval of a time law: way along the piece and its three rates by u, piece, length in u, and the
coefficients of u̇² by the way into it."""
_ASIDE = 0.001
"""A tool that is less than this beside a place is over it [m]."""
_HALF_CORNER = 24
"""Parts of half a corner that are looked at."""


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


@compiled_as(ROW(TABLE))
def turns(points: FloatArray) -> FloatArray:
    """How far a polygon (n, 3) turns at each of its inner points, (n - 2,) [rad]."""
    found = np.zeros(max(0, points.shape[0] - 2))
    for i in range(found.size):
        ax, ay, az = (
            points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1], points[i + 1, 2] - points[i, 2],
        )  # fmt: skip
        bx, by, bz = (
            points[i + 2, 0] - points[i + 1, 0], points[i + 2, 1] - points[i + 1, 1],
            points[i + 2, 2] - points[i + 1, 2],
        )  # fmt: skip
        u, v, w = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        found[i] = math.atan2(math.sqrt(u * u + v * v + w * w), ax * bx + ay * by + az * bz)
    return found


@compiled
def _tangent(turn: float) -> float:
    """How far before its point a corner begins whose clothoids are each 1 m long."""
    x, y = _clothoid(turn, 1.0)
    return x + y * math.tan(0.5 * turn)


@compiled_as(TABLE(TABLE, ROW))
def pieces(points: FloatArray, tangents: FloatArray) -> FloatArray:
    """Pieces of a path along a polygon (n, 3) [m] with blended corners; none if corners do not fit.

    ``tangents`` say how far before each inner point its corner begins, (n - 2,) [m].
    """
    count, turn = points.shape[0], turns(points)
    table = np.zeros((3 * count, PIECE))
    made, before, begin = 0, 0.0, 0.0
    way, onwards = np.zeros(3), np.zeros(3)
    for k in range(count - 1):
        length = 0.0
        for j in range(3):
            way[j] = points[k + 1, j] - points[k, j]
            length += way[j] * way[j]
        length = math.sqrt(length)
        bends = k < count - 2 and turn[k] > STRAIGHT
        after = tangents[k] if bends else 0.0
        left = length - before - after
        if left < -1e-9 or (bends and after <= 0.0) or length <= 0.0:
            return np.zeros((0, PIECE))
        way /= length
        if left > 1e-9:
            table[made, 0:3] = way
            table[made, 7], table[made, 8], table[made, 9], table[made, 13] = 1.0, left, begin, k
            table[made, 10:13] = points[k] + before * way
            made, begin = made + 1, begin + left
        if bends:
            onward = 0.0
            for j in range(3):
                onwards[j] = points[k + 2, j] - points[k + 1, j]
                onward += onwards[j] * onwards[j]
            onwards /= math.sqrt(onward)
            cos = onwards[0] * way[0] + onwards[1] * way[1] + onwards[2] * way[2]
            aside, back = onwards - cos * way, cos * onwards - way
            size = math.sqrt(aside[0] * aside[0] + aside[1] * aside[1] + aside[2] * aside[2])
            half = after / _tangent(turn[k])
            for first in range(2):
                row = made + first
                table[row, 0:3], table[row, 3:6] = (way, aside / size) if first == 0 else (onwards, back / size)
                table[row, 6], table[row, 7], table[row, 8] = turn[k] / (half * half), 1.0 - 2.0 * first, half
                table[row, 9], table[row, 13] = begin + first * half, k + first
                table[row, 10:13] = points[k + 1] - after * way if first == 0 else points[k + 1] + after * onwards
            made, begin = made + 2, begin + 2.0 * half
        before = after
    return table[:made].copy()


@compiled_as(SCALAR(ROW, ROW, SCALAR, SCALAR, SCALAR, ROW))
def widest_corner(
    at: FloatArray, needed: FloatArray, height: float, slope: float, turn: float, sizes: FloatArray
) -> float:
    """The first size of a corner between an upright line and one over the board that passes over all that it must; 0:
    none.

    ``at`` are ways over the board from the corner's point, rising, and ``needed`` the heights that the tool needs
    there, (n,) [m]; the corner's point has a ``height`` [m]. ``slope`` is of the line over the board, upwards positive,
    and ``turn`` between both lines [rad]. Sizes are how far before its point the corner may begin, (m,) [m].
    """
    along, scale = math.sqrt(1.0 + slope * slope), 1.0 / _tangent(turn)
    # a corner with tangents of 1 m, by the ways along both lines; its second half is the first one mirrored
    rises, asides = np.zeros(2 * _HALF_CORNER + 1), np.zeros(2 * _HALF_CORNER + 1)
    for m in range(_HALF_CORNER + 1):
        x, y = _clothoid(turn, m / _HALF_CORNER)
        onwards = scale * y / math.sin(turn)
        back = scale * x - 1.0 - onwards * math.cos(turn)
        mirrored = 2 * _HALF_CORNER - m
        rises[m], asides[m] = back + onwards * slope / along, onwards / along
        rises[mirrored], asides[mirrored] = -onwards - back * slope / along, -back / along
    for size in sizes:
        free, m = True, 0
        for k in range(at.size):
            here = max(at[k], _ASIDE)
            if k > 0 and at[k] <= _ASIDE:
                continue
            while m < rises.size - 1 and size * asides[m + 1] < here:
                m += 1
            if m == rises.size - 1:
                break
            share = (here - size * asides[m]) / (size * (asides[m + 1] - asides[m]))
            level = height + size * (rises[m] + share * (rises[m + 1] - rises[m]))
            # what is needed between two points is not more than at either of them; the first one is the place itself
            wanted = max(needed[max(k, 1)], needed[max(k - 1, 1)], needed[min(k + 1, at.size - 1)])
            free = free and level >= wanted - 1e-9
        if free:
            return float(size)
    return 0.0


@compiled
def _run(b0: float, b1: float, b2: float, time: float) -> tuple[float, float, float]:
    """x, ẋ and ẍ a time after x = 0, where ẋ² = b0 + b1 x + b2 x²: in closed form, as ẍ is linear in x."""
    start, push = math.sqrt(b0), 0.5 * b1
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
def _took(length: float, b0: float, b1: float, b2: float) -> float:
    """How long an interval takes, in closed form: of a motion with ẍ linear in x the mean of the speeds at both ends is
    (h / T) (ωT/2) / tan(ωT/2), with tanh where b2 > 0.
    """
    ratio = length / (math.sqrt(b0) + math.sqrt(max(b0 + length * (b1 + length * b2), 0.0)))
    omega = math.sqrt(abs(b2))
    z = omega * ratio
    if z < 1e-4:
        return 2.0 * ratio * (1.0 + math.copysign(z * z / 3.0, b2))
    if b2 > 0.0:
        return 2.0 / omega * math.atanh(min(z, 1.0 - 1e-12))
    return 2.0 / omega * math.atan(z)


@compiled_as(ROW(TABLE))
def begins(rows: FloatArray) -> FloatArray:
    """When each interval of a law (rows as of ``ROWS``) begins, and the last one ends, (n + 1,) [s]."""
    times = np.zeros(rows.shape[0] + 1)
    for k in range(rows.shape[0]):
        times[k + 1] = times[k] + _took(rows[k, 5], rows[k, 6], rows[k, 7], rows[k, 8])
    return times


@compiled_as(TABLE(ROW, SCALAR, ROW, TABLE, TABLE))
def trace(times: FloatArray, factor: float, starts: FloatArray, rows: FloatArray, path: FloatArray) -> FloatArray:
    """A path by its law, (m, 12), columns as of ``TRACED``.

    Args:
        times: at which, rising, (m,) [s].
        factor: the law is stretched by this; all that follows is not.
        starts: of the intervals, and the end of the last one, (n + 1,) [s].
        rows: intervals of the law, columns as of ``ROWS``.
        path: its pieces, columns as of ``PIECE``.
    """
    out = np.empty((times.size, TRACED))
    last, k = rows.shape[0] - 1, 0
    for i in range(times.size):
        time = times[i] / factor
        while k < last and time >= starts[k + 1]:
            k += 1
        x, rate, change = _run(rows[k, 6], rows[k, 7], rows[k, 8], max(0.0, time - starts[k]))
        rate, change = rate / factor, change / (factor * factor)
        w0, w1, w2, w3 = rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3]
        first, second = w1 + x * (w2 + 0.5 * x * w3), w2 + x * w3
        on = w0 + x * (w1 + x * (0.5 * w2 + x * w3 / 6.0))
        speed, along = first * rate, second * rate * rate + first * change
        row = path[int(rows[k, 4])]
        sharpness, sign = row[6], row[7]
        sigma = on if sign > 0.0 else row[8] - on
        if sharpness > 0.0:
            px, py = _clothoid(sharpness, sigma)
        else:
            px, py = sigma, 0.0
        heading = 0.5 * sharpness * sigma * sigma
        cos, sin = math.cos(heading), sign * math.sin(heading)
        for j in range(3):
            t = cos * row[j] + sin * row[3 + j]
            n = cos * row[3 + j] - sin * row[j]
            out[i, j] = row[10 + j] + sign * px * row[j] + py * row[3 + j]
            out[i, 3 + j] = t * speed
            out[i, 6 + j] = t * along + n * sharpness * sigma * speed * speed
        out[i, 9], out[i, 10], out[i, 11] = row[9] + on, speed, rows[k, 4]
    return out
