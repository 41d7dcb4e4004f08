"""The clock of a bus that has none, on a computer whose time is a number."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from hardware.drives import clock
from hardware.drives.clock import TickClock, tick_now

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


@pytest.mark.parametrize(("took", "gap"), [(0.0004, 0), (0.0009, 0), (0.0012, 1), (0.0061, 6)])
def test_what_was_measured_late_follows_no_neighbour(time: Time, took: float, gap: int) -> None:
    ticks = TickClock(PERIOD)
    before = ticks.told(ticks.next())
    began = ticks.next()
    time.now = began + took
    told = ticks.told(time.now)
    assert told == before + 1 + gap
    after = ticks.told(ticks.next())
    assert after == told + (2 if gap else 1)
