"""The quickest time law along a path, found numerically by software that shares nothing with `app.motion`.

Every piece of the path is a phase of its own unknown duration with a jerk that is constant in each of its intervals,
so that way, speed and acceleration along the path are integrated exactly. Bounds hold at the ends of the intervals.
CasADi states the problem, IPOPT solves it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from app import UserError
from app.motion.path import Path
from app.motion.timing.time_law import Bounds

INTERVALS: Final = 20  # in each piece
_GUESS: Final = 0.3  # speed with which the search begins [m/s]


class NoOptimum(Exception):
    """IPOPT found none."""


def casadi() -> Any:
    """CasADi, which only benchmarks need.

    Raises:
        UserError: it is not installed.
    """
    try:
        import casadi as module  # noqa: PLC0415 - a dependency of this bench alone
    except ImportError as error:
        raise UserError(
            "this bench compares with CasADi, which is not installed: pip install 'touchmove[bench]'"
        ) from error
    return module


def optimal_duration(path: Path, bounds: Sequence[Bounds], end_speed: float = 0.0, intervals: int = INTERVALS) -> float:
    """How long the quickest motion along a smooth path takes, from rest to a speed [m/s] without acceleration [s];
    ``bounds`` are those of its pieces, ``intervals`` of each piece.

    Raises:
        NoOptimum: the solver gave up.
        UserError: CasADi is not installed.
    """
    ca = casadi()
    problem = ca.Opti()
    total: Any = 0.0
    before: tuple[Any, Any] | None = None
    for piece, bound in enumerate(bounds):
        duration, state = _phase(ca, problem, path, piece, bound, intervals)
        speed, acceleration = state
        if before is None:
            problem.subject_to(speed[0] == 0.0)
            problem.subject_to(acceleration[0] == 0.0)
        else:
            problem.subject_to(speed[0] == before[0])
            problem.subject_to(acceleration[0] == before[1])
        before = speed[intervals], acceleration[intervals]
        total += duration
    assert before is not None
    problem.subject_to(before[0] == end_speed)
    problem.subject_to(before[1] == 0.0)
    problem.minimize(total)
    quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 600}
    problem.solver("ipopt", quiet)
    try:
        return float(problem.solve().value(total))
    except RuntimeError as error:
        raise NoOptimum(str(error)) from error


def _phase(ca: Any, problem: Any, path: Path, piece: int, bound: Bounds, n: int) -> tuple[Any, tuple[Any, Any]]:
    """One piece: its duration, and speed and acceleration along it at the ends of its intervals."""
    length, sharpness, sign = float(path.length[piece]), float(path.sharpness[piece]), float(path.sign[piece])
    duration = problem.variable()
    step = duration / n
    s, v, a = (problem.variable(n + 1) for _ in range(3))
    j = problem.variable(n)
    problem.subject_to(duration >= 1e-5)
    problem.subject_to(s[0] == 0.0)
    problem.subject_to(s[n] == length)
    problem.subject_to(s[1:] == s[:-1] + v[:-1] * step + a[:-1] * step**2 / 2 + j * step**3 / 6)
    problem.subject_to(v[1:] == v[:-1] + a[:-1] * step + j * step**2 / 2)
    problem.subject_to(a[1:] == a[:-1] + j * step)
    problem.subject_to(v >= 0.0)
    problem.subject_to(v <= bound.speed)
    problem.set_initial(duration, length / _GUESS)
    problem.set_initial(s, np.linspace(0.0, length, n + 1))
    problem.set_initial(v, _GUESS)
    sigma = s if sign > 0.0 else length - s
    heading, curvature, rate = sharpness * sigma**2 / 2, sharpness * sigma, sharpness * sign
    for axis in range(3):
        along, across = float(path.tangent[piece, axis]), float(path.normal[piece, axis])
        if abs(along) + abs(across) < 1e-12:
            continue
        t = along * ca.cos(heading) + sign * across * ca.sin(heading)
        m = across * ca.cos(heading) - sign * along * ca.sin(heading)
        acceleration = t * a + m * curvature * v**2
        problem.subject_to(problem.bounded(-1.0, acceleration / bound.acceleration, 1.0))
        for side in (slice(0, n), slice(1, n + 1)):
            jerk = t[side] * (j - curvature[side] ** 2 * v[side] ** 3)
            jerk += m[side] * (rate * v[side] ** 3 + 3 * curvature[side] * v[side] * a[side])
            problem.subject_to(problem.bounded(-1.0, jerk / bound.jerk, 1.0))
        if axis == 2 and np.isfinite(bound.downward):
            problem.subject_to(t * v <= bound.downward)
    return duration, (v, a)
