"""Compiled: where along a path its time law has nodes.

Of a `grid` the law's parameter u is the way itself, but for ramps where the path begins and ends at rest: s' runs
from 0 to 1 there with s''' constant on either half. Intervals are fine at the ends of lines, where acceleration
changes most. That suits corners that the tool slows down for. Past gentle ones it moves nearly as
on a line, and the time of such a motion is the better parameter: its intervals are `divided`.
"""

import numpy as np

from controller.model.compiled import SCALAR, TABLE, FloatArray, compiled, compiled_as

_CORNER_PARTS = 8
"""Intervals of each half of a corner."""
_RAMP = 0.008
"""Over so much of u the way begins to run as u does, from rest [m]."""
_RAMP_PARTS = 4
"""Intervals of each half of it."""
_FINEST = 0.0012
"""First interval at either end of a line [m] …"""
_SLOWEST = 0.0002
"""… where the tool is slow at the end of it [m] …"""
_COARSEST = 0.006
"""… and the longest [m] …"""
_GROWTH = 1.3
"""… and how they grow."""
_COLUMNS = 9
_END = 1e-9


@compiled
def _plain(rows: FloatArray, made: int, way: float, piece: int, step: float) -> int:
    rows[made, 0], rows[made, 1], rows[made, 4], rows[made, 5] = way, 1.0, piece, step
    return made + 1


@compiled
def _ramp(rows: FloatArray, made: int, ramp: float, piece: int) -> int:
    """From s' = 0 to s' = 1, at the begin of a line."""
    jerk, half = 4.0 / ramp**2, ramp / 2.0
    step = half / _RAMP_PARTS
    for m in range(2 * _RAMP_PARTS):
        x = (m % _RAMP_PARTS) * step
        s0, s1, s2, s3 = 0.0, 0.0, 0.0, jerk
        if m >= _RAMP_PARTS:
            s0, s1, s2, s3 = jerk * half**3 / 6.0, 0.5, jerk * half, -jerk
        rows[made, 0] = s0 + x * (s1 + x * (s2 / 2.0 + x * s3 / 6.0))
        rows[made, 1], rows[made, 2], rows[made, 3] = s1 + x * (s2 + x * s3 / 2.0), s2 + x * s3, s3
        rows[made, 4], rows[made, 5] = piece, step
        made += 1
    return made


@compiled
def _mirror(rows: FloatArray, first: int, end: float) -> None:
    """Turn what was written from a row on round in time, to end at a way."""
    last = rows.shape[0]
    back = rows[first:last].copy()
    for m in range(last - first):
        s0, s1, s2, s3, step = (
            back[m, 0], back[m, 1], back[m, 2], back[m, 3], back[m, 5],
        )  # fmt: skip
        row = last - 1 - m
        rows[row] = back[m]
        rows[row, 0] = end - (s0 + step * (s1 + step * (s2 / 2.0 + step * s3 / 6.0)))
        rows[row, 1], rows[row, 2] = s1 + step * (s2 + step * s3 / 2.0), -(s2 + step * s3)


@compiled
def _graded(rows: FloatArray, made: int, start: float, end: float, last: float, piece: int) -> int:
    """Parts of a line, fine at both ends, where the last one has a length."""
    middle = 0.5 * (start + end)
    at, size = start, _FINEST
    while middle - at > _END:
        step = size if middle - at > 1.5 * size else middle - at
        made = _plain(rows, made, at, piece, step)
        at, size = at + step, min(size * _GROWTH, _COARSEST)
    begin, at, size = made, end, last
    while at - middle > _END:
        step = size if at - middle > 1.5 * size else at - middle
        at, size = at - step, min(size * _GROWTH, _COARSEST)
        made = _plain(rows, made, at, piece, step)
    rows[begin:made] = rows[begin:made][::-1].copy()
    return made


@compiled_as(TABLE(TABLE, SCALAR))
def grid(path: FloatArray, end_speed: float) -> FloatArray:
    """Intervals of u along a path (`Path.table`) from rest, columns as of `curves.ROWS` with u̇ = 1, (n, 9).

    The tool reaches ``end_speed`` at the end [m/s]; 0: it rests.
    """
    count = path.shape[0]
    room = 4 * _RAMP_PARTS
    for i in range(count):
        room += _CORNER_PARTS + 40 + int(path[i, 8] / _COARSEST)
    rows = np.zeros((room, _COLUMNS))
    made = 0
    for i in range(count):
        length = path[i, 8]
        if path[i, 6] > 0.0:
            part = length / _CORNER_PARTS
            for m in range(_CORNER_PARTS):
                made = _plain(rows, made, m * part, i, part)
            continue
        ramp = min(_RAMP, length if count == 1 else 1.9 * length)
        before = ramp / 2.0 if i == 0 else 0.0
        rests = i == count - 1 and end_speed == 0.0
        after = ramp / 2.0 if rests else 0.0
        if before > 0.0:
            made = _ramp(rows, made, ramp, i)
        slow = _SLOWEST if i == count - 1 and end_speed > 0.0 else _FINEST
        made = _graded(rows, made, before, length - after, slow, i)
        if rests:
            begin, made = made, _ramp(rows, made, ramp, i)
            _mirror(rows[:made], begin, length)
    rows[:made, 6] = 1.0
    return rows[:made].copy()


@compiled_as(TABLE(TABLE, SCALAR))
def divided(rows: FloatArray, longest: float) -> FloatArray:
    """The same law (columns as of `curves.ROWS` with u̇ = 1) in intervals of at most a length [u]."""
    parts = np.ceil(rows[:, 5] / longest)
    out = np.empty((int(parts.sum()), _COLUMNS))
    made = 0
    for k in range(rows.shape[0]):
        step = rows[k, 5] / parts[k]
        s0, s1, s2, s3 = rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3]
        for m in range(int(parts[k])):
            x = m * step
            out[made] = rows[k]
            out[made, 0] = s0 + x * (s1 + x * (s2 / 2.0 + x * s3 / 6.0))
            out[made, 1], out[made, 2], out[made, 5] = s1 + x * (s2 + x * s3 / 2.0), s2 + x * s3, step
            made += 1
    return out
