"""How long a search may take: when it is stopped, and when an engine that does not answer is given up."""

from dataclasses import replace
from typing import Final

import chess
import chess.engine

GRACE: Final = 0.5
"""An engine may be so late against a time that it was told, before it is stopped [s]."""
MARGIN: Final = 5.0
"""An engine that was stopped answers within this, however busy the machine [s]."""
LEAST_MARGIN: Final = 1.0
"""And is granted at least this, also when its clock has less [s]."""
SHARE: Final = 0.5
"""Of the clock: what one move may take before it is stopped. Engines that heed their clock take a third at most."""
LAST_SHARE: Final = 0.9
"""The same for the last move before time is added."""
TOLERANCE: Final = 0.05
"""A ponder search may think that it has so much more of its clock than it has, as a share."""


def clock_of(limit: chess.engine.Limit, turn: chess.Color) -> float | None:
    """What the limit says that the side to move has on its clock [s]; None: nothing."""
    return limit.white_clock if turn == chess.WHITE else limit.black_clock


def thinking_time(limit: chess.engine.Limit, turn: chess.Color) -> float | None:
    """Longest time [s] that a limit leaves to the side to move; None where it names no time."""
    named = [max(0.0, seconds) for seconds in (limit.time, clock_of(limit, turn)) if seconds is not None]
    return min(named, default=None)


def told(limit: chess.engine.Limit, turn: chess.Color) -> chess.engine.Limit:
    """What is told to the engine: with a clock no other time, as engines differ in which of them they heed."""
    return limit if clock_of(limit, turn) is None else replace(limit, time=None)


def stop_after(limit: chess.engine.Limit, turn: chess.Color) -> float | None:
    """When to stop a search that still runs [s]; None where the limit names no time."""
    clock = clock_of(limit, turn)
    if clock is None:
        return None if limit.time is None else limit.time + GRACE
    added = limit.white_inc if turn == chess.WHITE else limit.black_inc
    most = LAST_SHARE * max(0.0, clock)
    if limit.remaining_moves != 1:
        most = min(most, SHARE * max(0.0, clock) + (added or 0.0))
    return most if limit.time is None else min(most, limit.time)


def give_up_after(limit: chess.engine.Limit, turn: chess.Color, deadline: float) -> float:
    """When a search that still runs has hung [s].

    The deadline is in all where the limit names no time; where it does, at most so much beyond it [s].
    """
    stopped = stop_after(limit, turn)
    if stopped is None:
        return deadline
    clock = clock_of(limit, turn)
    margin = MARGIN if clock is None else min(MARGIN, max(LEAST_MARGIN, clock - stopped))
    return stopped + min(deadline, margin)


def less(limit: chess.engine.Limit, turn: chess.Color, seconds: float) -> chess.engine.Limit:
    """The limit after so many seconds of the clock of the side to move are gone; a tenth of it stays [s]."""
    clock = clock_of(limit, turn)
    if clock is None or seconds <= 0.0:
        return limit
    rest = max(clock - seconds, 0.1 * clock)
    return replace(limit, white_clock=rest) if turn == chess.WHITE else replace(limit, black_clock=rest)


def still_holds(pondered: chess.engine.Limit, now: chess.engine.Limit, turn: chess.Color) -> bool:
    """Whether a search that was begun with one limit may count as one with another.

    UCI has no word for a changed clock in ``ponderhit``: a search that thinks it has more than there is must be begun
    anew. One that thinks it has less is only a little hasty.
    """
    before, clock = clock_of(pondered, turn), clock_of(now, turn)
    if before is None or clock is None:
        return before is clock and pondered.time == now.time and pondered.depth == now.depth
    return before <= clock * (1.0 + TOLERANCE) and pondered.remaining_moves == now.remaining_moves
