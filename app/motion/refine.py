"""Compiled: the time law along a path, warped until it is as quick as the bounds allow.

Given is a way s(u) along the path, cubic between nodes: the way itself, but flat of third order where the path begins
or ends at rest. It is sought how fast u runs: u̇² = b(u), b a quadratic spline with a continuous derivative. With r(u)
the point of the path,

    ṙ = r' √b,    r̈ = r'' b + ½ r' b',    r⃛ = √b (r''' b + 3/2 r'' b' + ½ r' b''),

so bounds on speed and acceleration are linear in b, and r̈ is continuous. The duration ∫ du/√b is convex. It is
minimised by an interior-point method: a logarithmic barrier before each bound at the nodes, Newton's
method with the Gauss-Newton part of the barrier's curvature, which is banded, and a line search that never leaves the
inside. So every result obeys the bounds at the nodes, however early it stops; by what they are exceeded between them,
some tenths of a percent, `excess` finds.
"""

from __future__ import annotations

import math

import numpy as np

from controller.model.compiled import ROW, SCALAR, TABLE, FloatArray, compiled, compiled_as

LAW = 5
"""Columns of s(u) by interval: way along the piece, its three rates by u, number of the piece."""
FASTEST = 1e4
"""Largest b anywhere, for where the path rests whatever u does."""


@compiled
def _by_u(path: FloatArray, law: FloatArray, k: int, x: float, out: FloatArray) -> None:
    """r', r'', r''' by u, a way x into interval k, as rows of ``out`` (3, 3)."""
    piece = int(law[k, 4])
    s1 = law[k, 1] + x * (law[k, 2] + 0.5 * x * law[k, 3])
    s2 = law[k, 2] + x * law[k, 3]
    s3 = law[k, 3]
    way = law[k, 0] + x * (law[k, 1] + x * (0.5 * law[k, 2] + x * law[k, 3] / 6.0))
    sharpness, sign = path[piece, 6], path[piece, 7]
    sigma = way if sign > 0.0 else path[piece, 8] - way
    heading = 0.5 * sharpness * sigma * sigma
    cos, sin = math.cos(heading), sign * math.sin(heading)
    curvature, rate = sharpness * sigma, sharpness * sign
    for i in range(3):
        t = cos * path[piece, i] + sin * path[piece, 3 + i]
        n = cos * path[piece, 3 + i] - sin * path[piece, i]
        out[0, i] = t * s1
        out[1, i] = curvature * n * s1 * s1 + t * s2
        out[2, i] = (rate * n - curvature * curvature * t) * s1**3 + 3.0 * curvature * n * s1 * s2 + t * s3


@compiled
def _cap(out: FloatArray, speed: float, downward: float) -> float:
    """Largest b for speed and downward speed."""
    squared = out[0, 0] * out[0, 0] + out[0, 1] * out[0, 1] + out[0, 2] * out[0, 2]
    cap = FASTEST
    if squared > speed * speed / FASTEST:
        cap = speed * speed / squared
    if out[0, 2] > downward / math.sqrt(cap):
        cap = downward * downward / (out[0, 2] * out[0, 2])
    return cap


@compiled
def _gather(
    path: FloatArray, bounds: FloatArray, law: FloatArray, step: FloatArray, near_rest: FloatArray, caps: FloatArray,
    where: FloatArray, table: FloatArray,
) -> int:  # fmt: skip
    """Fill the rows of all bounds; returns how many there are.

    On a line all axes say the same, and the one that moves most says it. At rest r' and r'' vanish and b may change
    quickly, and in a corner much changes: there the middle of an interval is looked at, too.
    """
    out = np.zeros((3, 3))
    count = 0
    for k in range(step.size):
        piece = int(law[k, 4])
        straight = path[piece, 6] == 0.0
        strongest = 0
        for i in range(1, 3):
            if abs(path[piece, i]) > abs(path[piece, strongest]):
                strongest = i
        for part in range(3):
            if part == 1 and straight and near_rest[k] == 0.0:
                continue
            x = 0.5 * part * step[k]
            _by_u(path, law, k, x, out)
            if part != 1:
                caps[k, part // 2] = _cap(out, bounds[piece, 0], bounds[piece, 3])
            for i in range(3):
                if straight and i != strongest:
                    continue
                if abs(out[0, i]) + abs(out[1, i]) + abs(out[2, i]) < 1e-9:
                    continue
                where[count, 0], where[count, 1] = k, x
                table[count, 0], table[count, 1], table[count, 2] = out[0, i], out[1, i], out[2, i]
                table[count, 3], table[count, 4] = bounds[piece, 1], bounds[piece, 2]
                count += 1
    return count


@compiled
def _excess(
    path: FloatArray, bounds: FloatArray, law: FloatArray, step: FloatArray, warp: FloatArray, parts: int
) -> float:
    """By what factor the law must be stretched in time, so that all bounds hold at so many points an interval."""
    out = np.zeros((3, 3))
    fast = strong = sharp = 0.0
    for k in range(step.size):
        piece = int(law[k, 4])
        speed, acceleration, jerk, downward = bounds[piece, 0], bounds[piece, 1], bounds[piece, 2], bounds[piece, 3]
        for part in range(parts + 1):
            x = step[k] * part / parts
            _by_u(path, law, k, x, out)
            b = warp[k, 0] + x * (warp[k, 1] + x * warp[k, 2])
            d, c = warp[k, 1] + 2.0 * x * warp[k, 2], 2.0 * warp[k, 2]
            fast = max(fast, b / _cap(out, speed, downward))
            for i in range(3):
                a = abs(out[1, i] * b + 0.5 * out[0, i] * d) / acceleration
                j = abs(math.sqrt(b) * (out[2, i] * b + 1.5 * out[1, i] * d + 0.5 * out[0, i] * c)) / jerk
                strong, sharp = max(strong, a), max(sharp, j)
    return float(max(math.sqrt(fast), math.sqrt(strong), sharp ** (1.0 / 3.0)))


@compiled_as(SCALAR(ROW, SCALAR, SCALAR, SCALAR, SCALAR))
def constant_speed(piece: FloatArray, speed: float, acceleration: float, jerk: float, downward: float) -> float:
    """At which a whole piece of a path may be passed without acceleration along it [m/s].

    Args:
        piece: a row of `Path.table`.
        speed: bound [m/s].
        acceleration: bound [m/s²].
        jerk: bound [m/s³].
        downward: bound of the speed towards +z3 [m/s].
    """
    path, law, out = piece.reshape((1, piece.size)), np.zeros((1, LAW)), np.zeros((3, 3))
    law[0, 1] = 1.0
    found = speed
    for part in range(33):
        _by_u(path, law, 0, piece[8] * part / 32.0, out)
        if out[0, 2] > 0.0:
            found = min(found, downward / out[0, 2])
        for i in range(3):
            if out[1, i] != 0.0:
                found = min(found, math.sqrt(acceleration / abs(out[1, i])))
            if out[2, i] != 0.0:
                found = min(found, (jerk / abs(out[2, i])) ** (1.0 / 3.0))
    return found


@compiled
def _spline(step: FloatArray, k: int, row: FloatArray) -> None:
    """How b and b' at both ends of interval k follow from its three coefficients: b at its left end is
    row[0]·x0 + row[1]·x1, at its right end row[2]·x1 + row[3]·x2; b' there row[4]·(x1 - x0), row[5]·(x2 - x1).
    """
    n = step.size
    before = step[k - 1] if k > 0 else 0.0
    after = step[k + 1] if k + 1 < n else 0.0
    h = step[k]
    p, q = 1.0 / (before + h), 1.0 / (h + after)
    row[0], row[1], row[2], row[3] = h * p, before * p, after * q, h * q
    row[4], row[5] = 2.0 * p, 2.0 * q


@compiled
def _objective(x: FloatArray, step: FloatArray, rows: FloatArray) -> float:
    """Duration by Simpson's rule; infinite where b is not positive."""
    total = 0.0
    for k in range(step.size):
        b0 = rows[k, 0] * x[k] + rows[k, 1] * x[k + 1]
        b2 = rows[k, 2] * x[k + 1] + rows[k, 3] * x[k + 2]
        d0 = rows[k, 4] * (x[k + 1] - x[k])
        d2 = rows[k, 5] * (x[k + 2] - x[k + 1])
        b1 = 0.5 * (b0 + b2) - 0.125 * step[k] * (d2 - d0)
        if not (b0 > 0.0 and b1 > 0.0 and b2 > 0.0):
            return math.inf
        total += step[k] / 6.0 * (1.0 / math.sqrt(b0) + 4.0 / math.sqrt(b1) + 1.0 / math.sqrt(b2))
    return total


@compiled
def _barrier(
    x: FloatArray, step: FloatArray, rows: FloatArray, caps: FloatArray, where: FloatArray, table: FloatArray
) -> float:
    """Sum of the logarithms of all bounds' slacks; minus infinity outside."""
    total, product = 0.0, 1.0
    for k in range(step.size):
        b0 = rows[k, 0] * x[k] + rows[k, 1] * x[k + 1]
        b2 = rows[k, 2] * x[k + 1] + rows[k, 3] * x[k + 2]
        s0, s2 = 1.0 - b0 / caps[k, 0], 1.0 - b2 / caps[k, 1]
        if not (s0 > 0.0 and s2 > 0.0 and b0 > 0.0 and b2 > 0.0):
            return -math.inf
        product *= s0 * s2
        if product < 1e-200:
            total += math.log(product)
            product = 1.0
    for i in range(where.shape[0]):
        k, way = int(where[i, 0]), where[i, 1]
        d0 = rows[k, 4] * (x[k + 1] - x[k])
        c = (rows[k, 5] * (x[k + 2] - x[k + 1]) - d0) / step[k]
        b = rows[k, 0] * x[k] + rows[k, 1] * x[k + 1] + way * (d0 + 0.5 * way * c)
        d = d0 + way * c
        if not b > 0.0:
            return -math.inf
        g = table[i, 1] * b + 0.5 * table[i, 0] * d
        z = math.sqrt(b) * (table[i, 2] * b + 1.5 * table[i, 1] * d + 0.5 * table[i, 0] * c)
        g, z = g / table[i, 3], z / table[i, 4]
        s = (1.0 - g) * (1.0 + g)
        w = (1.0 - z) * (1.0 + z)
        if not (s > 0.0 and w > 0.0):
            return -math.inf
        product *= s * w
        if product < 1e-200:
            total += math.log(product)
            product = 1.0
    return total + math.log(product)


@compiled
def _add(matrix: FloatArray, slope: FloatArray, k: int, g: FloatArray, first: float, second: float) -> None:
    """A term's share in gradient and banded matrix: slope += first·g, matrix += second·g gᵀ."""
    for i in range(3):
        slope[k + i] += first * g[i]
        s = second * g[i]
        for j in range(i, 3):
            matrix[k + i, j - i] += s * g[j]


@compiled
def _newton_of_duration(
    x: FloatArray, step: FloatArray, rows: FloatArray, caps: FloatArray, weight: float, matrix: FloatArray,
    slope: FloatArray,
) -> None:  # fmt: skip
    """Gradient and banded curvature of duration - weight · barrier of speeds."""
    matrix[:] = 0.0
    slope[:] = 0.0
    g = np.zeros(3)
    for k in range(step.size):
        h = step[k]
        b0 = rows[k, 0] * x[k] + rows[k, 1] * x[k + 1]
        b2 = rows[k, 2] * x[k + 1] + rows[k, 3] * x[k + 2]
        d0 = rows[k, 4] * (x[k + 1] - x[k])
        d2 = rows[k, 5] * (x[k + 2] - x[k + 1])
        b1 = 0.5 * (b0 + b2) - 0.125 * h * (d2 - d0)
        for part in range(3):
            if part == 0:
                b, w = b0, h / 6.0
                g[0], g[1], g[2] = rows[k, 0], rows[k, 1], 0.0
            elif part == 1:
                b, w = b1, 4.0 * h / 6.0
                g[0] = 0.5 * rows[k, 0] - 0.125 * h * rows[k, 4]
                g[1] = 0.5 * (rows[k, 1] + rows[k, 2]) + 0.125 * h * (rows[k, 4] + rows[k, 5])
                g[2] = 0.5 * rows[k, 3] - 0.125 * h * rows[k, 5]
            else:
                b, w = b2, h / 6.0
                g[0], g[1], g[2] = 0.0, rows[k, 2], rows[k, 3]
            root = math.sqrt(b)
            _add(matrix, slope, k, g, -0.5 * w / (b * root), 0.75 * w / (b * b * root))
        g[0], g[1], g[2] = rows[k, 0], rows[k, 1], 0.0
        s = 1.0 / (caps[k, 0] - b0)
        _add(matrix, slope, k, g, weight * s, weight * s * s)
        g[0], g[1], g[2] = 0.0, rows[k, 2], rows[k, 3]
        s = 1.0 / (caps[k, 1] - b2)
        _add(matrix, slope, k, g, weight * s, weight * s * s)


@compiled
def _newton_of_bounds(
    x: FloatArray, step: FloatArray, rows: FloatArray, where: FloatArray, table: FloatArray, weight: float,
    matrix: FloatArray, slope: FloatArray,
) -> None:  # fmt: skip
    """What the barriers of acceleration and jerk add to it."""
    g, q, bend = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(where.shape[0]):
        k, way = int(where[i, 0]), where[i, 1]
        h = step[k]
        bend[0], bend[1], bend[2] = rows[k, 4] / h, -(rows[k, 4] + rows[k, 5]) / h, rows[k, 5] / h
        q[0], q[1], q[2] = -rows[k, 4] + way * bend[0], rows[k, 4] + way * bend[1], way * bend[2]
        g[0] = rows[k, 0] - way * rows[k, 4] + 0.5 * way * way * bend[0]
        g[1] = rows[k, 1] + way * rows[k, 4] + 0.5 * way * way * bend[1]
        g[2] = 0.5 * way * way * bend[2]
        b = g[0] * x[k] + g[1] * x[k + 1] + g[2] * x[k + 2]
        d = q[0] * x[k] + q[1] * x[k + 1] + q[2] * x[k + 2]
        c = bend[0] * x[k] + bend[1] * x[k + 1] + bend[2] * x[k + 2]
        r1, r2, r3 = table[i, 0], table[i, 1], table[i, 2]
        value = (r2 * b + 0.5 * r1 * d) / table[i, 3]
        root = math.sqrt(b)
        inner = r3 * b + 1.5 * r2 * d + 0.5 * r1 * c
        jerk = root * inner / table[i, 4]
        # acceleration: gradient (r2 g + r1/2 q) / A; both signs share it
        up, down = 1.0 / (1.0 - value), 1.0 / (1.0 + value)
        first, second = weight * (up - down), weight * (up * up + down * down)
        a0 = (r2 * g[0] + 0.5 * r1 * q[0]) / table[i, 3]
        a1 = (r2 * g[1] + 0.5 * r1 * q[1]) / table[i, 3]
        a2 = (r2 * g[2] + 0.5 * r1 * q[2]) / table[i, 3]
        # jerk: the same with inner, and b'' = (d2 - d0) / h
        by_b = (0.5 * inner / root + root * r3) / table[i, 4]
        by_d = 1.5 * root * r2 / table[i, 4]
        by_c = 0.5 * root * r1 / table[i, 4]
        j0 = by_b * g[0] + by_d * q[0] + by_c * bend[0]
        j1 = by_b * g[1] + by_d * q[1] + by_c * bend[1]
        j2 = by_b * g[2] + by_d * q[2] + by_c * bend[2]
        g[0], g[1], g[2] = a0, a1, a2
        _add(matrix, slope, k, g, first, second)
        up, down = 1.0 / (1.0 - jerk), 1.0 / (1.0 + jerk)
        g[0], g[1], g[2] = j0, j1, j2
        _add(matrix, slope, k, g, weight * (up - down), weight * (up * up + down * down))


@compiled
def _solve(matrix: FloatArray, vector: FloatArray) -> None:
    """Solve a symmetric positive definite system of bandwidth 3 in place (LDLᵀ)."""
    n = vector.size
    for i in range(n):
        pivot = matrix[i, 0]
        for j in range(1, min(3, n - i)):
            factor = matrix[i, j] / pivot
            for m in range(j, min(3, n - i)):
                matrix[i + j, m - j] -= factor * matrix[i, m]
            vector[i + j] -= factor * vector[i]
    for i in range(n - 1, -1, -1):
        total = vector[i]
        for j in range(1, min(3, n - i)):
            total -= matrix[i, j] * vector[i + j]
        vector[i] = total / matrix[i, 0]


@compiled
def _fix_end(matrix: FloatArray, slope: FloatArray) -> None:
    """Take the last two coefficients out of the system."""
    n = slope.size
    for i in range(n - 2, n):
        slope[i] = 0.0
        for j in range(3):
            matrix[i, j] = 0.0
            matrix[i - j, j] = 0.0
        matrix[i, 0] = 1.0


@compiled
def _go(
    x: FloatArray, direction: FloatArray, trial: FloatArray, step: FloatArray, rows: FloatArray, caps: FloatArray,
    where: FloatArray, table: FloatArray, weight: float, decrement: float,
) -> bool:  # fmt: skip
    """Go against a direction, as far as the inside reaches and it is of use; false where it is of none."""
    before = _objective(x, step, rows) - weight * _barrier(x, step, rows, caps, where, table)
    share = 1.0
    for _ in range(30):
        for i in range(x.size):
            trial[i] = x[i] - share * direction[i]
        after = _objective(trial, step, rows)
        if after < math.inf:
            wall = _barrier(trial, step, rows, caps, where, table)
            if wall > -math.inf and after - weight * wall <= before - 1e-4 * share * decrement:
                x[:] = trial
                return True
        share *= 0.5
    return False


@compiled
def _minimise(
    x: FloatArray,
    step: FloatArray,
    caps: FloatArray,
    where: FloatArray,
    table: FloatArray,
    gap: float,
    end_fixed: float,
    most: int,
) -> int:
    """Minimise the duration in place.

    Args:
        x: coefficients of b, (n + 2,), strictly inside all bounds; out: the result.
        step: lengths of the n intervals in u.
        caps: largest b at both ends of each interval, (n, 2).
        where: interval of each row of ``table``, and how far into it, by u, (m, 2).
        table: r', r'', r''' along one axis by u, and the bounds of acceleration and jerk along it, (m, 5).
        gap: how far from the optimum it may stop, as a share of the duration.
        end_fixed: 1 if b is given at the end, with no acceleration; else 0.
        most: Newton steps.

    Returns:
        Newton steps made.
    """
    n = step.size
    rows = np.zeros((n, 6))
    for k in range(n):
        _spline(step, k, rows[k])
    matrix, slope, trial = np.zeros((n + 2, 3)), np.zeros(n + 2), np.zeros(n + 2)
    bounds = float(2 * n + 4 * where.shape[0])
    duration = _objective(x, step, rows)
    weight = 0.1 * duration / bounds
    last = gap * duration / bounds
    made = 0
    while made < most:
        _newton_of_duration(x, step, rows, caps, weight, matrix, slope)
        _newton_of_bounds(x, step, rows, where, table, weight, matrix, slope)
        if end_fixed == 1.0:
            _fix_end(matrix, slope)
        decrement = 0.0
        trial[:] = slope
        _solve(matrix, trial)
        for i in range(n + 2):
            decrement += trial[i] * slope[i]
        made += 1
        accepted = _go(x, trial, slope, step, rows, caps, where, table, weight, decrement)
        if not accepted or decrement < 0.7 * weight * bounds:
            if weight <= last:
                break
            weight = max(0.2 * weight, 0.999 * last)
    return made


@compiled
def _polynomials(x: FloatArray, step: FloatArray, warp: FloatArray) -> None:
    """B of each interval by the way into it, (n, 3), from the spline's coefficients."""
    n = step.size
    for k in range(n):
        before = step[k - 1] if k > 0 else 0.0
        after = step[k + 1] if k + 1 < n else 0.0
        left = 2.0 * (x[k + 1] - x[k]) / (before + step[k])
        right = 2.0 * (x[k + 2] - x[k + 1]) / (step[k] + after)
        warp[k, 0] = (step[k] * x[k] + before * x[k + 1]) / (before + step[k])
        warp[k, 1] = left
        warp[k, 2] = 0.5 * (right - left) / step[k]


@compiled_as(TABLE(TABLE, TABLE, TABLE, ROW, ROW, SCALAR, SCALAR, SCALAR))
def quickest(
    path: FloatArray, bounds: FloatArray, law: FloatArray, step: FloatArray, near_rest: FloatArray, slow: float,
    end_fixed: float, gap: float,
) -> FloatArray:  # fmt: skip
    """The quickest b(u) within all bounds at the nodes.

    Args:
        path: `Path.table`.
        bounds: of each piece: speed, acceleration, jerk, downward speed, (p, 4).
        law: s(u) of the n intervals, columns as of ``LAW``.
        step: lengths of the intervals in u.
        near_rest: 1 for intervals near an end at rest.
        slow: a constant u̇ at which all bounds hold with something to spare.
        end_fixed: 1 if u̇ stays ``slow`` at the end, with no acceleration; else 0.
        gap: how far from the optimum the result may be, as a share of the duration.

    Returns:
        b of each interval by the way into it, polynomials of second degree, (n, 3).
    """
    n = step.size
    caps, where, table = np.empty((n, 2)), np.empty((9 * n, 2)), np.empty((9 * n, 5))
    count = _gather(path, bounds, law, step, near_rest, caps, where, table)
    x = np.full(n + 2, slow * slow)
    _minimise(x, step, caps, where[:count], table[:count], gap, end_fixed, 150)
    warp = np.empty((n, 3))
    _polynomials(x, step, warp)
    return warp


@compiled_as(SCALAR(TABLE, TABLE, TABLE, ROW, TABLE))
def excess(path: FloatArray, bounds: FloatArray, law: FloatArray, step: FloatArray, warp: FloatArray) -> float:
    """By what factor a law must be stretched in time, so that all bounds hold everywhere; below 1 it has to spare.

    Args:
        path: as of `quickest`.
        bounds: as of `quickest`.
        law: as of `quickest`.
        step: as of `quickest`.
        warp: b, as `quickest` returns it.
    """
    return _excess(path, bounds, law, step, warp, 12)
