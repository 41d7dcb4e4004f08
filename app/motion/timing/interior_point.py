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

FASTEST = 1e4
"""Largest b anywhere, for where the path rests whatever u does."""
_NEAR_REST = 2
"""So many intervals after a ramp from rest, and before one to it, are looked at as closely as the ramp."""
_PROPORTIONAL = 1e-12
"""Two axes' shares of a path are one but for a factor."""
_LOOKS = 8
"""Parts of an interval at whose ends the bounds are looked at in the end."""
_SPARE = 0.8
"""The refinement begins so much slower than the bounds admit."""


@compiled
def _by_u(path: FloatArray, rows: FloatArray, k: int, x: float, out: FloatArray) -> None:
    """r', r'', r''' by u, a way x into interval k, as rows of ``out`` (3, 3)."""
    piece = int(rows[k, 4])
    s1 = rows[k, 1] + x * (rows[k, 2] + 0.5 * x * rows[k, 3])
    s2 = rows[k, 2] + x * rows[k, 3]
    s3 = rows[k, 3]
    way = rows[k, 0] + x * (rows[k, 1] + x * (0.5 * rows[k, 2] + x * rows[k, 3] / 6.0))
    sharpness, sign = path[piece, 6], path[piece, 7]
    if sharpness == 0.0:
        for i in range(3):
            t = path[piece, i]
            out[0, i], out[1, i], out[2, i] = t * s1, t * s2, t * s3
        return
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


@compiled_as(TABLE(TABLE, TABLE))
def limits(path: FloatArray, bounds: FloatArray) -> FloatArray:
    """Bounds of each piece of a path: those of its line; of a corner the tighter ones of both its lines.

    Args:
        path: `Path.table`.
        bounds: of each line: speed, acceleration, jerk, downward speed, (l, 4).
    """
    table = np.empty((path.shape[0], 4))
    for i in range(path.shape[0]):
        other = i
        if path[i, 6] > 0.0:
            other = i + 1 if path[i, 7] > 0.0 else i - 1
        for j in range(4):
            table[i, j] = min(bounds[int(path[i, 13]), j], bounds[int(path[other, 13]), j])
    return table


@compiled
def _near_rest(rows: FloatArray, k: int) -> bool:
    """Whether an interval belongs to a ramp, on which the way is not u, or is next to one."""
    near = False
    for other in range(max(0, k - _NEAR_REST), min(rows.shape[0], k + _NEAR_REST + 1)):
        near = near or rows[other, 3] != 0.0
    return near


@compiled
def _leads(path: FloatArray, piece: int, axis: int) -> bool:
    """Whether an axis has a say on a piece: not where all its rates are a share of another one's."""
    for other in range(3):
        t, n = path[piece, other], path[piece, 3 + other]
        own_t, own_n = path[piece, axis], path[piece, 3 + axis]
        if other == axis or abs(own_t * n - own_n * t) > _PROPORTIONAL:
            continue
        own, others = own_t * own_t + own_n * own_n, t * t + n * n
        if others > own or (others == own and other < axis):
            return False
    return True


@compiled
def _gather(
    path: FloatArray, bounds: FloatArray, rows: FloatArray, caps: FloatArray, where: FloatArray, table: FloatArray
) -> int:
    """Fill the rows of all bounds; returns how many there are.

    At rest r' and r'' vanish and b may change quickly: there the middle of an interval is looked at, too.
    """
    out = np.zeros((3, 3))
    count = 0
    for k in range(rows.shape[0]):
        piece = int(rows[k, 4])
        near_rest = _near_rest(rows, k)
        for part in range(3):
            if part == 1 and not near_rest:
                continue
            x = 0.5 * part * rows[k, 5]
            _by_u(path, rows, k, x, out)
            if part != 1:
                caps[k, part // 2] = _cap(out, bounds[piece, 0], bounds[piece, 3])
            for i in range(3):
                if not _leads(path, piece, i) or abs(out[0, i]) + abs(out[1, i]) + abs(out[2, i]) < 1e-9:
                    continue
                where[count, 0], where[count, 1] = k, x
                table[count, 0], table[count, 1], table[count, 2] = out[0, i], out[1, i], out[2, i]
                table[count, 3], table[count, 4] = bounds[piece, 1], bounds[piece, 2]
                count += 1
    return count


@compiled
def _peak(before: float, middle: float, after: float) -> float:
    """The top of the parabola through three values next to each other, or the largest of them."""
    bend = before - 2.0 * middle + after
    if middle < before or middle < after or bend >= 0.0:
        return max(before, middle, after)
    return middle - (before - after) * (before - after) / (8.0 * bend)


@compiled
def _excess(path: FloatArray, bounds: FloatArray, rows: FloatArray, parts: int) -> float:
    """By what factor the law must be stretched in time, so that all bounds hold; looks at so many parts an interval."""
    out, seen = np.zeros((3, 3)), np.zeros((parts + 1, 6))
    fast = strong = sharp = 0.0
    for k in range(rows.shape[0]):
        piece = int(rows[k, 4])
        speed, acceleration, jerk, downward = bounds[piece, 0], bounds[piece, 1], bounds[piece, 2], bounds[piece, 3]
        for part in range(parts + 1):
            x = rows[k, 5] * part / parts
            _by_u(path, rows, k, x, out)
            b = rows[k, 6] + x * (rows[k, 7] + x * rows[k, 8])
            d, c = rows[k, 7] + 2.0 * x * rows[k, 8], 2.0 * rows[k, 8]
            fast = max(fast, b / _cap(out, speed, downward))
            for i in range(3):
                a = abs(out[1, i] * b + 0.5 * out[0, i] * d) / acceleration
                j = abs(math.sqrt(b) * (out[2, i] * b + 1.5 * out[1, i] * d + 0.5 * out[0, i] * c)) / jerk
                strong, sharp = max(strong, a), max(sharp, j)
                seen[part, i], seen[part, 3 + i] = a, j
        for part in range(1, parts):
            for i in range(3):
                strong = max(strong, _peak(seen[part - 1, i], seen[part, i], seen[part + 1, i]))
                sharp = max(sharp, _peak(seen[part - 1, 3 + i], seen[part, 3 + i], seen[part + 1, 3 + i]))
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
    path, rows, out = piece.reshape((1, piece.size)), np.zeros((1, 4 + 1)), np.zeros((3, 3))
    rows[0, 1] = 1.0
    found = speed
    for part in range(33):
        _by_u(path, rows, 0, piece[8] * part / 32.0, out)
        if out[0, 2] > 0.0:
            found = min(found, downward / out[0, 2])
        for i in range(3):
            if out[1, i] != 0.0:
                found = min(found, math.sqrt(acceleration / abs(out[1, i])))
            if out[2, i] != 0.0:
                found = min(found, (jerk / abs(out[2, i])) ** (1.0 / 3.0))
    return found


@compiled
def _spline(step: FloatArray, rows: FloatArray) -> None:
    """How b and b' at both ends of each interval follow from its three coefficients, (n, 6): b at its left end is
    rows[0]·x0 + rows[1]·x1, at its right end rows[2]·x1 + rows[3]·x2; b' there rows[4]·(x1 - x0), rows[5]·(x2 - x1).
    """
    n = step.size
    for k in range(n):
        before = step[k - 1] if k > 0 else 0.0
        after = step[k + 1] if k + 1 < n else 0.0
        h = step[k]
        p, q = 1.0 / (before + h), 1.0 / (h + after)
        rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3] = h * p, before * p, after * q, h * q
        rows[k, 4], rows[k, 5] = 2.0 * p, 2.0 * q


@compiled
def _linear(
    step: FloatArray, rows: FloatArray, where: FloatArray, table: FloatArray, duration: FloatArray, forms: FloatArray
) -> None:
    """Write all that is linear in b as forms of the three coefficients of its interval.

    Args:
        step: lengths of the n intervals.
        rows: as of `_spline`.
        where: interval of each row of ``table``, and how far into it, (m, 2).
        table: r', r'', r''' along one axis by u, and the bounds of acceleration and jerk along it, (m, 5).
        duration: out, b at the left end, middle and right end of each interval, (n, 9).
        forms: out, of each row of ``table`` b, the acceleration by its bound, and the jerk by its bound and √b, (m, 9).
    """
    for k in range(step.size):
        h = step[k]
        duration[k, 0], duration[k, 1], duration[k, 2] = rows[k, 0], rows[k, 1], 0.0
        duration[k, 3] = 0.5 * rows[k, 0] - 0.125 * h * rows[k, 4]
        duration[k, 4] = 0.5 * (rows[k, 1] + rows[k, 2]) + 0.125 * h * (rows[k, 4] + rows[k, 5])
        duration[k, 5] = 0.5 * rows[k, 3] - 0.125 * h * rows[k, 5]
        duration[k, 6], duration[k, 7], duration[k, 8] = 0.0, rows[k, 2], rows[k, 3]
    bend, slope = np.zeros(3), np.zeros(3)
    for i in range(where.shape[0]):
        k, way = int(where[i, 0]), where[i, 1]
        h = step[k]
        bend[0], bend[1], bend[2] = rows[k, 4] / h, -(rows[k, 4] + rows[k, 5]) / h, rows[k, 5] / h
        slope[0], slope[1], slope[2] = -rows[k, 4] + way * bend[0], rows[k, 4] + way * bend[1], way * bend[2]
        forms[i, 0] = rows[k, 0] - way * rows[k, 4] + 0.5 * way * way * bend[0]
        forms[i, 1] = rows[k, 1] + way * rows[k, 4] + 0.5 * way * way * bend[1]
        forms[i, 2] = 0.5 * way * way * bend[2]
        r1, r2, r3 = table[i, 0], table[i, 1], table[i, 2]
        for j in range(3):
            forms[i, 3 + j] = (r2 * forms[i, j] + 0.5 * r1 * slope[j]) / table[i, 3]
            forms[i, 6 + j] = (r3 * forms[i, j] + 1.5 * r2 * slope[j] + 0.5 * r1 * bend[j]) / table[i, 4]


@compiled
def _value(
    x: FloatArray, step: FloatArray, caps: FloatArray, first: FloatArray, duration: FloatArray, forms: FloatArray
) -> tuple[float, float]:
    """The duration, by Simpson's rule, and the sum of the logarithms of all bounds' slacks; infinite outside."""
    total, logs, product = 0.0, 0.0, 1.0
    for k in range(step.size):
        x0, x1, x2 = x[k], x[k + 1], x[k + 2]
        b0 = duration[k, 0] * x0 + duration[k, 1] * x1
        b1 = duration[k, 3] * x0 + duration[k, 4] * x1 + duration[k, 5] * x2
        b2 = duration[k, 7] * x1 + duration[k, 8] * x2
        s0, s2 = 1.0 - b0 / caps[k, 0], 1.0 - b2 / caps[k, 1]
        if not (b0 > 0.0 and b1 > 0.0 and b2 > 0.0 and s0 > 0.0 and s2 > 0.0):
            return math.inf, -math.inf
        total += step[k] / 6.0 * (1.0 / math.sqrt(b0) + 4.0 / math.sqrt(b1) + 1.0 / math.sqrt(b2))
        product *= s0 * s2
        for i in range(int(first[k]), int(first[k + 1])):
            b = forms[i, 0] * x0 + forms[i, 1] * x1 + forms[i, 2] * x2
            a = forms[i, 3] * x0 + forms[i, 4] * x1 + forms[i, 5] * x2
            if not b > 0.0:
                return math.inf, -math.inf
            j = math.sqrt(b) * (forms[i, 6] * x0 + forms[i, 7] * x1 + forms[i, 8] * x2)
            s, w = (1.0 - a) * (1.0 + a), (1.0 - j) * (1.0 + j)
            if not (s > 0.0 and w > 0.0):
                return math.inf, -math.inf
            product *= s * w
        if product < 1e-100:
            logs += math.log(product)
            product = 1.0
    return total, logs + math.log(product)


@compiled
def _newton(
    x: FloatArray, step: FloatArray, caps: FloatArray, first: FloatArray, duration: FloatArray, forms: FloatArray,
    weight: float, matrix: FloatArray, slope: FloatArray,
) -> None:  # fmt: skip
    """Gradient, and banded curvature without that of the jerks themselves, of duration - weight · barrier.

    Every term is a function of one form g·x: it adds f' g to the gradient and f'' g gᵀ to the curvature.
    """
    matrix[:] = 0.0
    slope[:] = 0.0
    for k in range(step.size):
        x0, x1, x2 = x[k], x[k + 1], x[k + 2]
        f0 = f1 = f2 = m00 = m01 = m02 = m11 = m12 = m22 = 0.0
        for part in range(3):
            g0, g1, g2 = duration[k, 3 * part], duration[k, 3 * part + 1], duration[k, 3 * part + 2]
            b = g0 * x0 + g1 * x1 + g2 * x2
            scale = step[k] / 6.0 if part != 1 else step[k] / 1.5
            cubed = scale / (b * math.sqrt(b))
            up, bent = -0.5 * cubed, 0.75 * cubed / b
            if part != 1:
                spare = 1.0 / (caps[k, part // 2] - b)
                up, bent = up + weight * spare, bent + weight * spare * spare
            f0, f1, f2 = f0 + up * g0, f1 + up * g1, f2 + up * g2
            m00, m01, m02 = m00 + bent * g0 * g0, m01 + bent * g0 * g1, m02 + bent * g0 * g2
            m11, m12, m22 = m11 + bent * g1 * g1, m12 + bent * g1 * g2, m22 + bent * g2 * g2
        for i in range(int(first[k]), int(first[k + 1])):
            g0, g1, g2 = forms[i, 3], forms[i, 4], forms[i, 5]
            a = g0 * x0 + g1 * x1 + g2 * x2
            spare = 1.0 / ((1.0 - a) * (1.0 + a))
            up, bent = 2.0 * weight * a * spare, 2.0 * weight * (1.0 + a * a) * spare * spare
            f0, f1, f2 = f0 + up * g0, f1 + up * g1, f2 + up * g2
            m00, m01, m02 = m00 + bent * g0 * g0, m01 + bent * g0 * g1, m02 + bent * g0 * g2
            m11, m12, m22 = m11 + bent * g1 * g1, m12 + bent * g1 * g2, m22 + bent * g2 * g2
            root = math.sqrt(forms[i, 0] * x0 + forms[i, 1] * x1 + forms[i, 2] * x2)
            inner = forms[i, 6] * x0 + forms[i, 7] * x1 + forms[i, 8] * x2
            j, by_b = root * inner, 0.5 * inner / root
            g0 = by_b * forms[i, 0] + root * forms[i, 6]
            g1 = by_b * forms[i, 1] + root * forms[i, 7]
            g2 = by_b * forms[i, 2] + root * forms[i, 8]
            spare = 1.0 / ((1.0 - j) * (1.0 + j))
            up, bent = 2.0 * weight * j * spare, 2.0 * weight * (1.0 + j * j) * spare * spare
            f0, f1, f2 = f0 + up * g0, f1 + up * g1, f2 + up * g2
            m00, m01, m02 = m00 + bent * g0 * g0, m01 + bent * g0 * g1, m02 + bent * g0 * g2
            m11, m12, m22 = m11 + bent * g1 * g1, m12 + bent * g1 * g2, m22 + bent * g2 * g2
        slope[k] += f0
        slope[k + 1] += f1
        slope[k + 2] += f2
        matrix[k, 0] += m00
        matrix[k, 1] += m01
        matrix[k, 2] += m02
        matrix[k + 1, 0] += m11
        matrix[k + 1, 1] += m12
        matrix[k + 2, 0] += m22


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
def _minimise(
    x: FloatArray, step: FloatArray, caps: FloatArray, where: FloatArray, table: FloatArray, gap: float,
    end_fixed: bool, most: int,
) -> int:  # fmt: skip
    """Minimise the duration in place.

    Args:
        x: coefficients of b, (n + 2,), strictly inside all bounds; out: the result.
        step: lengths of the n intervals in u.
        caps: largest b at both ends of each interval, (n, 2).
        where: as of `_linear`, by rising intervals.
        table: as of `_linear`.
        gap: how far from the optimum it may stop, as a share of the duration.
        end_fixed: b is given at the end, with no acceleration.
        most: Newton steps.

    Returns:
        Newton steps made.
    """
    n = step.size
    rows, duration, forms, first = np.empty((n, 6)), np.empty((n, 9)), np.empty((where.shape[0], 9)), np.zeros(n + 1)
    _spline(step, rows)
    _linear(step, rows, where, table, duration, forms)
    for i in range(where.shape[0]):
        first[int(where[i, 0]) + 1] = i + 1.0
    for k in range(n):
        first[k + 1] = max(first[k], first[k + 1])  # an interval without rows
    matrix, slope, trial, direction = np.empty((n + 2, 3)), np.empty(n + 2), np.empty(n + 2), np.empty(n + 2)
    bounds = float(2 * n + 4 * where.shape[0])
    took, logs = _value(x, step, caps, first, duration, forms)
    weight, last = 0.1 * took / bounds, gap * took / bounds
    for made in range(most):
        _newton(x, step, caps, first, duration, forms, weight, matrix, slope)
        if end_fixed:
            _fix_end(matrix, slope)
        direction[:] = slope
        _solve(matrix, direction)
        decrement = 0.0
        for i in range(n + 2):
            decrement += direction[i] * slope[i]
        # as far as the inside reaches and it is of use
        share, accepted, before = 1.0, False, took - weight * logs
        for _ in range(30):
            for i in range(n + 2):
                trial[i] = x[i] - share * direction[i]
            took_then, logs_then = _value(trial, step, caps, first, duration, forms)
            if took_then < math.inf and took_then - weight * logs_then <= before - 1e-4 * share * decrement:
                x[:] = trial
                took, logs, accepted = took_then, logs_then, True
                break
            share *= 0.5
        if not accepted or decrement < 0.7 * weight * bounds:
            if weight <= last:
                return made + 1
            weight = max(0.2 * weight, 0.999 * last)
    return most


@compiled
def _write_polynomials(x: FloatArray, rows: FloatArray) -> None:
    """B of each interval by the way into it, from the spline's coefficients."""
    n = rows.shape[0]
    for k in range(n):
        step = rows[k, 5]
        before = rows[k - 1, 5] if k > 0 else 0.0
        after = rows[k + 1, 5] if k + 1 < n else 0.0
        left = 2.0 * (x[k + 1] - x[k]) / (before + step)
        right = 2.0 * (x[k + 2] - x[k + 1]) / (step + after)
        rows[k, 6] = (step * x[k] + before * x[k + 1]) / (before + step)
        rows[k, 7] = left
        rows[k, 8] = 0.5 * (right - left) / step


@compiled_as(SCALAR(TABLE, TABLE, TABLE, SCALAR, SCALAR))
def quickest(path: FloatArray, bounds: FloatArray, rows: FloatArray, end_speed: float, gap: float) -> float:
    """The quickest b(u) within all bounds at the nodes.

    Args:
        path: `Path.table`.
        bounds: of each piece: speed, acceleration, jerk, downward speed, (p, 4).
        rows: intervals, columns as of `curves.ROWS`; in: all but b; out: b.
        end_speed: u̇ at the end, where there is no acceleration [m/s]; 0: at rest.
        gap: how far from the optimum the result may be, as a share of the duration.

    Returns:
        What `excess` does.
    """
    n = rows.shape[0]
    slow = end_speed
    if slow == 0.0:
        for k in range(n):
            rows[k, 6], rows[k, 7], rows[k, 8] = 1.0, 0.0, 0.0
        slow = _SPARE / _excess(path, bounds, rows, 2)
    caps, where, table = np.empty((n, 2)), np.empty((9 * n, 2)), np.empty((9 * n, 5))
    count = _gather(path, bounds, rows, caps, where, table)
    x = np.full(n + 2, slow * slow)
    _minimise(x, rows[:, 5].copy(), caps, where[:count], table[:count], gap, end_speed > 0.0, 150)
    _write_polynomials(x, rows)
    return _excess(path, bounds, rows, _LOOKS)


@compiled_as(SCALAR(TABLE, TABLE, TABLE))
def excess(path: FloatArray, bounds: FloatArray, rows: FloatArray) -> float:
    """By what factor a law must be stretched in time, so that all bounds hold everywhere; below 1 it has to spare.

    Args:
        path: as of `quickest`.
        bounds: as of `quickest`.
        rows: with b, as of `quickest`.
    """
    return _excess(path, bounds, rows, _LOOKS)
