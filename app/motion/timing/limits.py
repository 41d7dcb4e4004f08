"""Compiled: bounds on speed, acceleration and jerk along a path, by the parameter u of its time law.

With u̇² = b(u) and r(u) the point of the path,

    ṙ = r' √b,    r̈ = r'' b + ½ r' b',    r⃛ = √b (r''' b + 3/2 r'' b' + ½ r' b''),

so bounds on speed and acceleration are linear in b.
"""

import math

import numpy as np

from controller.model.compiled import SCALAR, STATUS, TABLE, FloatArray, compiled, compiled_as

FASTEST = 1e4
"""Largest b anywhere, for where the path rests whatever u does."""
LOOKS = 8
"""Parts of an interval at whose ends the bounds of a whole law are looked at."""
_NEAR_REST = 2
"""So many intervals after a ramp from rest, and before one to it, are looked at as closely as the ramp."""
_PROPORTIONAL = 1e-12
"""Two axes' shares of a path are one but for a factor."""


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
    """Bounds of each piece of a path (`Path.table`): those of its line; of a corner the tighter ones of both its lines.

    ``bounds`` are of each line: speed, acceleration, jerk, downward speed, (l, 4).
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


@compiled_as(STATUS(TABLE, TABLE, TABLE, TABLE, TABLE, TABLE))
def gather(
    path: FloatArray, bounds: FloatArray, rows: FloatArray, caps: FloatArray, where: FloatArray, table: FloatArray
) -> int:
    """All bounds of a law at its nodes; path, bounds and rows are as of `excess`, b is not looked at.

    Where s' changes, b may change quickly: there accelerations are looked at in the middle of an interval, too. Written
    are ``caps``, the largest b at the begin, in the middle and at the end of each interval, (n, 3): at its ends alone a
    spline's coefficients could go up and down in turns, unseen; ``where``, the interval of each row of ``table`` and
    how far into it, (9 n, 2); and ``table``, r', r'', r''' along one axis by u, and the bounds of acceleration and jerk
    along it, (9 n, 5). Returned is how many rows of ``where`` and ``table`` are filled.
    """
    out = np.zeros((3, 3))
    count = 0
    for k in range(rows.shape[0]):
        piece = int(rows[k, 4])
        near_rest = _near_rest(rows, k)
        for part in range(3):
            x = 0.5 * part * rows[k, 5]
            _by_u(path, rows, k, x, out)
            caps[k, part] = _cap(out, bounds[piece, 0], bounds[piece, 3])
            if part == 1 and not near_rest:
                continue
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
    """The top of the parabola through three values next to each other if it lies among them, or the largest of them."""
    bend = before - 2.0 * middle + after
    if abs(before - after) >= -2.0 * bend:
        return max(before, middle, after)
    return middle - (before - after) * (before - after) / (8.0 * bend)


@compiled_as(SCALAR(TABLE, TABLE, TABLE, STATUS))
def excess(path: FloatArray, bounds: FloatArray, rows: FloatArray, parts: int) -> float:
    """By what factor a law must be stretched in time, so that all bounds hold everywhere; below 1 it has to spare.

    ``path`` is `Path.table`; ``bounds`` of each piece are speed, acceleration, jerk, downward speed, (p, 4), and looked
    at at the ends of ``parts`` of each interval of the law, whose rows have columns as of `curves.ROWS`.
    """
    out, seen = np.zeros((3, 3)), np.zeros((parts + 1, 7))
    fast = strong = sharp = 0.0
    for k in range(rows.shape[0]):
        piece = int(rows[k, 4])
        speed, acceleration, jerk, downward = bounds[piece, 0], bounds[piece, 1], bounds[piece, 2], bounds[piece, 3]
        for part in range(parts + 1):
            x = rows[k, 5] * part / parts
            _by_u(path, rows, k, x, out)
            b = rows[k, 6] + x * (rows[k, 7] + x * rows[k, 8])
            d, c = rows[k, 7] + 2.0 * x * rows[k, 8], 2.0 * rows[k, 8]
            seen[part, 6] = b / _cap(out, speed, downward)
            fast = max(fast, seen[part, 6])
            for i in range(3):
                a = abs(out[1, i] * b + 0.5 * out[0, i] * d) / acceleration
                j = abs(math.sqrt(b) * (out[2, i] * b + 1.5 * out[1, i] * d + 0.5 * out[0, i] * c)) / jerk
                strong, sharp = max(strong, a), max(sharp, j)
                seen[part, i], seen[part, 3 + i] = a, j
        for part in range(1, parts):
            fast = max(fast, _peak(seen[part - 1, 6], seen[part, 6], seen[part + 1, 6]))
            for i in range(3):
                strong = max(strong, _peak(seen[part - 1, i], seen[part, i], seen[part + 1, i]))
                sharp = max(sharp, _peak(seen[part - 1, 3 + i], seen[part, 3 + i], seen[part + 1, 3 + i]))
    return float(max(math.sqrt(fast), math.sqrt(strong), sharp ** (1.0 / 3.0)))


@compiled
def _constant_speed(piece: FloatArray, bounds: FloatArray) -> float:
    """At which a whole piece of a path may be passed without acceleration along it [m/s]."""
    speed, acceleration, jerk, downward = bounds
    path, rows, out = piece.reshape((1, piece.size)), np.zeros((1, 4 + 1)), np.zeros((3, 3))
    rows[0, 1] = 1.0
    found: float = speed
    for part in range(33 if piece[6] > 0.0 else 1):
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
def _way(low: float, high: float, acceleration: float, jerk: float) -> float:
    """How long a line must be for a gain in speed, both without acceleration [m]."""
    gain = high - low
    if gain <= acceleration * acceleration / jerk:
        return 0.5 * (low + high) * (2.0 * math.sqrt(gain / jerk))
    return 0.5 * (low + high) * (gain / acceleration + acceleration / jerk)


@compiled_as(SCALAR(SCALAR, SCALAR, SCALAR, SCALAR, SCALAR))
def reachable(low: float, high: float, length: float, acceleration: float, jerk: float) -> float:
    """Largest speed up to ``high`` in a line's length [m] from ``low`` [m/s], both without acceleration along it."""
    if _way(low, high, acceleration, jerk) <= length:
        return high
    floor = low
    while high - floor > 1e-9:
        middle = 0.5 * (floor + high)
        if _way(low, middle, acceleration, jerk) <= length:
            floor = middle
        else:
            high = middle
    return floor


@compiled_as(TABLE(TABLE, TABLE, SCALAR))
def speeds(path: FloatArray, bounds: FloatArray, end_speed: float) -> FloatArray:
    """Speeds of a law that passes corners at constant speeds and is without acceleration where pieces meet.

    Path and bounds are as of `excess`; ``end_speed`` is reached at the end [m/s]. Of each piece the speed at its begin,
    at its end, and the largest along it, (p, 3) [m/s].
    """
    count = path.shape[0]
    out, at = np.empty((count, 3)), np.zeros(count + 1)
    at[count] = end_speed
    for i in range(count):
        out[i, 2] = _constant_speed(path[i], bounds[i])
        if i > 0:
            at[i] = min(out[i - 1, 2], out[i, 2])
    for sweep in range(3):
        for k in range(count):
            i = k if sweep != 1 else count - 1 - k
            low, high = (i, i + 1) if at[i] < at[i + 1] else (i + 1, i)
            if path[i, 6] > 0.0:
                at[high] = at[low]
            elif at[high] > at[low]:
                share = max(abs(path[i, 0]), abs(path[i, 1]), abs(path[i, 2]))
                at[high] = reachable(at[low], at[high], path[i, 8], bounds[i, 1] / share, bounds[i, 2] / share)
    out[:, 0], out[:, 1] = at[:-1], at[1:]
    return out
