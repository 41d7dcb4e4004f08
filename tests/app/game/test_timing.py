"""The clock of a running game: whose time runs when, by a wall and a plant that the test moves."""

from __future__ import annotations

import chess
import pytest

from app.game.clock import ChessClock
from app.game.timing import Timing, clock_of
from app.settings.time_control import ArmTime, TimeControl
from app.terminal.shown import ClockShown


class Times:
    """Wall and plant, moved by hand [s]."""

    def __init__(self) -> None:
        self.wall, self.plant = 100.0, 7.0

    def timing(self, control: str | None, arm_time: ArmTime = ArmTime.NOBODY) -> Timing:
        clock = None if control is None else ChessClock.new(TimeControl.parse(control), None, arm_time)
        return Timing(clock, lambda: self.plant, lambda: self.wall)


def move(times: Times, timing: Timing, thought: float, plant: float, wall: float) -> None:
    """White's engine thinks, and the arm moves for so much plant time, in so much wall time."""
    timing.start(chess.WHITE)
    times.wall += thought
    timing.decided()
    with timing.motion():
        times.plant += plant
        times.wall += wall
        timing.arm_clear()


@pytest.mark.parametrize("wall", [0.1, 2.0, 30.0])
def test_nobody_pays_for_the_arm_however_slow_the_machine(wall: float) -> None:
    times = Times()
    timing = times.timing("5+3")
    move(times, timing, 10.0, 2.0, wall)
    left = timing.left()
    assert left == pytest.approx({chess.WHITE: 293.0, chess.BLACK: 300.0})


def test_whose_arm_moves_pays_plant_time_where_that_is_wanted() -> None:
    times = Times()
    timing = times.timing("5+0", ArmTime.OWN)
    timing.start(chess.WHITE)
    times.wall += 10.0
    timing.decided()
    with timing.motion():
        times.plant += 2.0
        times.wall += 0.5
        timing.arm_clear()
    assert timing.left() == pytest.approx({chess.WHITE: 288.0, chess.BLACK: 300.0})
    limit = timing.limit(chess.WHITE)
    assert limit is not None
    assert limit.white_clock is not None
    assert limit.white_clock < 288.0 - 2.0, "the engine is told less than it has, since its arm will move"


@pytest.mark.parametrize(("control", "free"), [("5d3", 3.0), ("5+3", 0.0), ("5b3", 0.0)])
def test_a_clock_with_a_delay_is_shown_to_stand_first(control: str, free: float) -> None:
    times, shown = Times(), list[ClockShown | None]()
    clock = ChessClock.new(TimeControl.parse(control), None, ArmTime.NOBODY)
    timing = Timing(clock, lambda: times.plant, lambda: times.wall, shown.append)
    timing.start(chess.WHITE)
    assert shown[-1] == ClockShown({chess.WHITE: 300.0, chess.BLACK: 300.0}, chess.WHITE, free)
    times.wall += 1.0
    timing.show()
    paid = 0.0 if free else 1.0
    left = {chess.WHITE: 300.0 - paid, chess.BLACK: 300.0}
    assert shown[-1] == ClockShown(left, chess.WHITE, max(0.0, free - 1.0))
    timing.decided()
    assert shown[-1] == ClockShown(left, None)


def test_a_person_pays_until_their_hand_has_left() -> None:
    times = Times()
    timing = times.timing("1+0")
    timing.start(chess.BLACK)
    times.wall += 20.0
    left = timing.now()
    times.wall += 5.0  # the camera looks and looks again
    timing.press(left)
    assert timing.left() == pytest.approx({chess.WHITE: 60.0, chess.BLACK: 40.0})
    assert timing.fallen(chess.Board()) is None


def test_a_pause_costs_nothing_and_a_flag_falls() -> None:
    times = Times()
    timing = times.timing("1+0")
    timing.start(chess.WHITE)
    times.wall += 20.0
    timing.pause()
    times.wall += 1000.0
    assert timing.fallen(chess.Board()) is None
    timing.start(chess.WHITE)
    times.wall += 41.0
    fallen = timing.fallen(chess.Board())
    assert fallen is not None
    assert fallen.result == "0-1"


def test_without_a_clock_nothing_is_counted() -> None:
    times = Times()
    timing = times.timing(None)
    move(times, timing, 10.0, 2.0, 2.0)
    timing.press()
    timing.take_back(2)
    timing.pause()
    assert timing.left() is None
    assert timing.limit(chess.WHITE) is None
    assert clock_of(None, []) is None


@pytest.mark.parametrize("control", ["5+0", "5d10", "5b10"])
def test_an_engine_that_failed_gets_its_time_back(control: str) -> None:
    times = Times()
    timing = times.timing(control)
    timing.start(chess.WHITE)
    times.wall += 40.0
    timing.forget()
    assert timing.left() == pytest.approx({chess.WHITE: 300.0, chess.BLACK: 300.0})
    times.wall += 1000.0
    timing.start(chess.WHITE)
    times.wall += 10.0
    free = 10.0 if control == "5d10" else 0.0
    assert timing.left() == pytest.approx({chess.WHITE: 290.0 + free, chess.BLACK: 300.0})


def test_what_an_engine_has_lost_is_given_back_once() -> None:
    times = Times()
    timing = times.timing("0:04")
    timing.start(chess.WHITE)
    times.wall += 4.4
    assert timing.fallen(chess.Board()) is not None
    timing.give_back(4.1)
    assert timing.fallen(chess.Board()) is None
    timing.decided()
    timing.arm_clear()
    assert timing.left() == pytest.approx({chess.WHITE: 3.7, chess.BLACK: 4.0})
    timing.take_back(1)
    assert timing.left() == pytest.approx({chess.WHITE: 4.0, chess.BLACK: 4.0})


def test_a_hand_that_went_a_while_ago_pressed_the_clock_then() -> None:
    times = Times()
    timing = times.timing("5+0")
    timing.start(chess.WHITE)
    times.wall, times.plant = times.wall + 10.0, times.plant + 10.0
    gone = times.plant
    times.wall, times.plant = times.wall + 0.7, times.plant + 0.7
    timing.press(timing.at(gone))
    assert timing.left() == pytest.approx({chess.WHITE: 290.0, chess.BLACK: 300.0})
    assert timing.at(times.plant + 1.0) == timing.now(), "an instant to come is now"
