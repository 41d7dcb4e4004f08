"""How long a search may take."""

from __future__ import annotations

import chess
import chess.engine
from hypothesis import given
from hypothesis import strategies as st

from engine.budget import LEAST_MARGIN, MARGIN, give_up_after, less, still_holds, stop_after, thinking_time, told

Limit = chess.engine.Limit
W, B = chess.WHITE, chess.BLACK
SECONDS = st.floats(0.001, 5000.0)


def test_thinking_time_is_the_shortest_time_named() -> None:
    assert thinking_time(Limit(nodes=5), W) is None
    assert thinking_time(Limit(time=2.0), B) == 2.0
    assert thinking_time(Limit(time=2.0, white_clock=1.0, black_clock=9.0), W) == 1.0
    assert thinking_time(Limit(time=2.0, white_clock=1.0, black_clock=9.0), B) == 2.0
    assert thinking_time(Limit(black_clock=-0.5), B) == 0.0


def test_nothing_is_stopped_that_names_no_time() -> None:
    assert stop_after(Limit(nodes=5), W) is None
    assert stop_after(Limit(black_clock=5.0), W) is None
    assert give_up_after(Limit(nodes=5), W, 30.0) == 30.0


def test_an_engine_is_told_one_time() -> None:
    both = Limit(time=2.0, white_clock=100.0, black_clock=50.0, white_inc=1.0)
    assert told(both, W) == Limit(white_clock=100.0, black_clock=50.0, white_inc=1.0)
    assert stop_after(both, W) == 2.0
    assert told(Limit(time=2.0, nodes=5), W) == Limit(time=2.0, nodes=5)


def test_the_last_move_of_a_period_may_take_nearly_all() -> None:
    assert stop_after(Limit(white_clock=100.0, remaining_moves=1), W) == 90.0
    assert stop_after(Limit(white_clock=100.0, remaining_moves=2), W) == 50.0
    assert stop_after(Limit(white_clock=100.0, white_inc=5.0), W) == 55.0
    assert stop_after(Limit(white_clock=2.0, white_inc=30.0), W) == 1.8


@given(clock=SECONDS, inc=st.floats(0.0, 60.0), to_go=st.sampled_from([None, 1, 2, 40]), deadline=SECONDS)
def test_no_flag_falls_by_an_engine_that_heeds_no_clock(
    clock: float, inc: float, to_go: int | None, deadline: float
) -> None:
    limit = Limit(black_clock=clock, black_inc=inc, white_clock=1.0, remaining_moves=to_go)
    stopped, given_up = stop_after(limit, B), give_up_after(limit, B, deadline)
    assert stopped is not None
    assert 0.0 < stopped < clock
    assert stopped < given_up <= max(clock, stopped + LEAST_MARGIN) + 1e-9
    assert given_up <= stopped + min(deadline, MARGIN) + 1e-9


@given(clock=SECONDS, gone=st.floats(-1.0, 6000.0))
def test_what_is_left_after_a_failure_is_less_but_something(clock: float, gone: float) -> None:
    rest = less(Limit(white_clock=clock, black_clock=7.0), W, gone)
    assert rest.black_clock == 7.0
    assert rest.white_clock is not None
    assert 0.0 < rest.white_clock <= clock
    assert less(Limit(time=3.0), W, gone) == Limit(time=3.0)


def test_a_ponder_search_counts_only_if_it_does_not_think_that_it_has_more_time() -> None:
    now = Limit(white_clock=60.0, black_clock=60.0)
    assert still_holds(Limit(white_clock=61.0, black_clock=5.0), now, W)
    assert still_holds(Limit(white_clock=30.0), now, W)
    assert not still_holds(Limit(white_clock=70.0), now, W)
    assert not still_holds(Limit(time=1.0), now, W)
    assert still_holds(Limit(time=1.0), Limit(time=1.0), W)
    assert not still_holds(Limit(time=2.0), Limit(time=1.0), W)
    assert not still_holds(Limit(white_clock=60.0, remaining_moves=2), Limit(white_clock=60.0, remaining_moves=1), W)
