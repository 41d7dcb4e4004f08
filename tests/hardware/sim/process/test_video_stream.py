"""Frames for those who watch: exposed at a steady rate, delivered late by the latency, and waited for in pace fast."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import pytest

from hardware.sim.process.cameras import video_stream as watchers
from hardware.sim.process.cameras.video_stream import StreamClient
from hardware.sim.process.connections import Visitor


class Person:
    """A visitor who notes what it is told."""

    def __init__(self) -> None:
        self.told: list[dict[str, Any]] = []
        self.dismissed = False

    def tell(self, answer: dict[str, Any]) -> None:
        self.told.append(answer)

    def dismiss(self) -> None:
        self.dismissed = True


def watcher(every: int = 10, latency: int = 18, slots: int = 4) -> tuple[StreamClient, Person]:
    person = Person()
    return StreamClient(
        cast("Visitor", person), "camera", True, every, latency, list(range(slots)), exposes=every
    ), person


def waits(one: StreamClient, tick: int, listen: Callable[[], None], present: Callable[[], bool] = lambda: True) -> bool:
    """Deliver in pace fast, hearing visitors whenever plant time waits; whether it did."""
    waited = False
    for _ in one.deliver(tick, True, present):
        waited = True
        listen()
    return waited


def goes_on(one: StreamClient, tick: int) -> None:
    """Deliver in pace real, where plant time does not wait."""
    assert not list(one.deliver(tick, False, lambda: True))


def test_frames_come_at_a_steady_rate_and_late_by_the_latency() -> None:
    one, person = watcher()
    for tick in range(1, 100):
        flight = one.expose(tick)
        if flight is not None:
            one.drawn(flight.slot)
        waits(one, tick, one.take)
        one.take()
    assert [answer["exposed"] for answer in person.told] == [10, 20, 30, 40, 50, 60, 70, 80]
    assert all(answer["tick"] - answer["exposed"] == 18 for answer in person.told)
    assert len(one.free) + len(one.flights) == 4


def test_a_frame_is_never_drawn_over_one_that_is_read_or_under_way() -> None:
    one, person = watcher()
    for tick in range(1, 200):
        flight = one.expose(tick)
        if flight is not None:
            busy = [other.slot for other in one.flights if other is not flight]
            assert flight.slot not in [*busy, one.held]
            one.drawn(flight.slot)
        goes_on(one, tick)
        if tick % 50 == 0:
            one.take()
    assert 3 <= len(person.told) <= 5  # in pace real a slow reader gets fewer


def test_in_pace_fast_plant_time_waits_for_the_picture_and_then_for_its_taker() -> None:
    one, person = watcher()
    flight = one.expose(10)
    assert flight is not None
    heard: list[str] = []

    def listen() -> None:
        if flight.drawing:
            heard.append("drawn")
            one.drawn(flight.slot)
        else:
            assert person.told
            heard.append("taken")
            one.take()

    assert waits(one, 28, listen)
    assert heard == ["drawn", "taken"]
    assert one.held is None


def test_who_never_takes_is_dismissed_and_who_leaves_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watchers, "PATIENCE", 0.01)
    one, person = watcher()
    one.expose(10)
    left = 40

    def listen() -> None:
        nonlocal left
        watchers.time.sleep(0.002)
        left -= 1

    assert waits(one, 28, listen, lambda: left > 0)
    assert person.dismissed


def test_pace_real_delivers_late_what_is_drawn_late() -> None:
    one, person = watcher()
    flight = one.expose(10)
    assert flight is not None
    goes_on(one, 28)
    assert not person.told
    one.drawn(flight.slot)
    goes_on(one, 40)
    assert person.told == [{"exposed": 10, "tick": 40, "slot": flight.slot, "colour": True}]
