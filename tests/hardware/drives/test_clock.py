"""The clock of a bus that has none, on a computer whose time is a number."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.drives import clock
from hardware.drives.clock import TickClock, periods_moved, tick_now
from hardware.interfaces import Triple

PERIOD = 0.001


class Time:
    """``time`` of a computer on which each look at the clock takes 1 µs, and sleeps are exact."""

    def __init__(self) -> None:
        self.now = 1000.00025

    def monotonic(self) -> float:
        self.now += 1e-6
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds


@pytest.fixture
def time(monkeypatch: pytest.MonkeyPatch) -> Time:
    one = Time()
    monkeypatch.setattr(clock, "time", SimpleNamespace(monotonic=one.monotonic, sleep=one.sleep))
    return one


def test_ticks_begin_at_whole_periods_and_none_is_left_out(time: Time) -> None:
    ticks, first = TickClock(PERIOD), tick_now(PERIOD)
    for k in range(1, 1000):
        due = ticks.due()
        began = ticks.next()
        assert due <= began < due + 3e-6, "it is known before it is waited for"
        assert ticks.tick == first + k
        assert began == pytest.approx(ticks.tick * PERIOD, abs=3e-6)
        time.now += 0.9e-3  # what is done in a tick


def test_whoever_is_late_leaves_ticks_out_and_comes_back_to_whole_periods(time: Time) -> None:
    ticks, first = TickClock(PERIOD), tick_now(PERIOD)
    ticks.next()
    time.now += 0.0305
    began = ticks.next()
    assert ticks.tick == first + 31
    assert began == pytest.approx(time.now)  # at once
    assert ticks.next() == pytest.approx((first + 32) * PERIOD, abs=3e-6)


def test_a_shift_moves_all_ticks_to_come_and_not_their_number(time: Time) -> None:
    ticks, first = TickClock(PERIOD), tick_now(PERIOD)
    for k in range(1, 2001):
        ticks.shift(-1e-6 if k <= 1500 else 1e-6)  # by more than a period altogether
        shifted = -k * 1e-6 if k <= 1500 else (k - 3000) * 1e-6
        assert ticks.next() == pytest.approx((first + k) * PERIOD + shifted, abs=3e-6)
        assert ticks.tick == first + k


@pytest.mark.parametrize("held", [0.0004, 0.0009, 0.0012, 0.0031, 0.0061])
@pytest.mark.parametrize("before", [False, True], ids=["late-to-take-the-answer", "late-to-ask"])
def test_a_late_measurement_is_told_with_the_tick_in_which_the_arm_was_there(
    time: Time, held: float, before: bool
) -> None:
    ticks, speed, place = TickClock(PERIOD), (1.5, -2.0, 0.5), (0.1, 0.2, 0.3)

    def at(tick: int) -> Triple:
        one, two, three = (x + v * tick * PERIOD for x, v in zip(place, speed, strict=True))
        return one, two, three

    first = ticks.told(ticks.next(), lambda: math.nan)
    began = ticks.next()
    made = int((began + held) / PERIOD) if before else first + 1  # asked for late, or at once and taken late
    time.now = began + held
    told = ticks.told(time.now, lambda: periods_moved(at(first), speed, at(made), PERIOD))
    assert told == made
    after = ticks.next()
    assert ticks.tick == max(made + 1, int(after / PERIOD))
    late = after - ticks.tick * PERIOD
    assert late < 5e-6 if before or held < PERIOD else 0.0 < late < PERIOD, "it goes on at once, and leaves no tick out"


def test_an_arm_that_hardly_moves_is_told_with_the_tick_in_which_it_answered(time: Time) -> None:
    ticks = TickClock(PERIOD)
    began = ticks.next()
    told = ticks.told(began + 0.0042, lambda: periods_moved((0.0,) * 3, (0.2, 0.1, 0.0), (0.0,) * 3, PERIOD))
    assert told == int((began + 0.0042) / PERIOD)


@given(moved=st.floats(-100.0, 100.0), held=st.floats(0.0, 0.02))
def test_a_late_measurement_is_never_told_with_a_tick_outside_its_exchange(moved: float, held: float) -> None:
    ticks = TickClock(PERIOD)
    ticks.tick += 1
    asked = ticks.tick
    answered = asked * PERIOD + held
    assert asked <= ticks.told(answered, lambda: moved) <= max(asked, int(answered / PERIOD))
