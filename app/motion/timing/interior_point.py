"""Compiled: the quickest b(u) within bounds that are linear forms of it, by an interior-point method.

b is a quadratic spline with a continuous derivative, and the duration ∫ du/√b is convex in it. It is minimised with a
logarithmic barrier before each bound at the nodes, Newton's method with the Gauss-Newton part of the barrier's
curvature, which is banded, and a line search that never leaves the inside.
"""

import math

import numpy as np

from controller.model.compiled import SCALAR, STATUS, TABLE, TRUTH, FloatArray, compiled, compiled_as

MOST_STEPS = 150
"""Of Newton's method."""


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
    """Write all that is linear in b as forms of the three coefficients of its interval; ``rows`` as of `_spline`.

    ``table`` has r', r'', r''' along one axis by u, and the bounds of acceleration and jerk along it, (m, 5), ``where``
    the interval of each of its rows and how far into it, (m, 2). Written are ``duration``, b at the left end, middle
    and right end of each interval, (n, 9), and ``forms``, of each row of ``table`` b, the acceleration by its bound,
    and the jerk by its bound and √b, (m, 9).
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
        s0, s1, s2 = 1.0 - b0 / caps[k, 0], 1.0 - b1 / caps[k, 1], 1.0 - b2 / caps[k, 2]
        if not (min(b0, b1, b2) > 0.0 and min(s0, s1, s2) > 0.0):
            return math.inf, -math.inf
        total += step[k] / 6.0 * (1.0 / math.sqrt(b0) + 4.0 / math.sqrt(b1) + 1.0 / math.sqrt(b2))
        product *= s0 * s1 * s2
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
            spare = 1.0 / (caps[k, part] - b)
            up, bent = -0.5 * cubed + weight * spare, 0.75 * cubed / b + weight * spare * spare
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
def _descend(
    x: FloatArray, step: FloatArray, caps: FloatArray, where: FloatArray, table: FloatArray, gap: float, end_fixed: bool
) -> int:
    """Minimise the duration in place, as `minimise`, from coefficients x, (n + 2,), strictly inside all bounds."""
    n = step.size
    rows, duration, forms, first = np.empty((n, 6)), np.empty((n, 9)), np.empty((where.shape[0], 9)), np.zeros(n + 1)
    _spline(step, rows)
    _linear(step, rows, where, table, duration, forms)
    for i in range(where.shape[0]):
        first[int(where[i, 0]) + 1] = i + 1.0
    for k in range(n):
        first[k + 1] = max(first[k], first[k + 1])  # an interval without rows
    matrix, slope, trial, direction = np.empty((n + 2, 3)), np.empty(n + 2), np.empty(n + 2), np.empty(n + 2)
    bounds = float(3 * n + 4 * where.shape[0])
    took, logs = _value(x, step, caps, first, duration, forms)
    weight, last = 0.1 * took / bounds, gap * took / bounds
    for made in range(MOST_STEPS):
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
    return MOST_STEPS


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


@compiled_as(STATUS(TABLE, TABLE, TABLE, TABLE, SCALAR, SCALAR, TRUTH))
def minimise(
    rows: FloatArray, caps: FloatArray, where: FloatArray, table: FloatArray, begin: float, gap: float, end_fixed: bool
) -> int:
    """Write the quickest b into the rows of a law; returns the Newton steps made.

    Args:
        rows: n intervals, columns as of `curves.ROWS`; in: their lengths; out: b.
        caps: largest b at the begin, in the middle and at the end of each interval, (n, 3).
        where: as of `_linear`, by rising intervals.
        table: as of `_linear`.
        begin: a constant b that is strictly inside all bounds.
        gap: how far from the optimum the result may be, as a share of the duration.
        end_fixed: at the end b stays what it is, with no acceleration.
    """
    x = np.full(rows.shape[0] + 2, begin)
    made = _descend(x, rows[:, 5].copy(), caps, where, table, gap, end_fixed)
    _write_polynomials(x, rows)
    return made
