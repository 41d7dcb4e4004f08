"""In pace fast time stands while nobody needs it, at last also where something never comes to rest."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from hardware.interfaces import Command
from hardware.sim.process import server

IDLE = Command((0.0, 0.0, 0.0), 0.0, False, True, False)
BUSY = IDLE._replace(busy=True)
LONGEST = 40


@pytest.fixture
def world() -> Any:
    """A world in which a piece trembles, as far as whoever asks for time sees it."""
    trembling: Any = object.__new__(server.World)
    trembling.plant = SimpleNamespace(resting=False)
    trembling._clocks = SimpleNamespace(due=server.NEVER)
    trembling._cameras = SimpleNamespace(waiting=False)
    trembling._hand = SimpleNamespace(busy=False)
    trembling._applied, trembling._idle, trembling._longest_idle = IDLE, 0, LONGEST
    return trembling


def ticks(world: Any, command: Command) -> int:
    """So many run until time stands."""
    count = 0
    while world._needs_time(command) and count < 10 * LONGEST:
        world._idle += 1
        count += 1
    return count


def test_what_trembles_keeps_time_running_for_so_long_and_no_longer(world: Any) -> None:
    assert ticks(world, IDLE) == LONGEST
    assert not world._needs_time(IDLE)


def test_who_needs_time_gets_it_and_the_wait_begins_anew(world: Any) -> None:
    ticks(world, IDLE)
    assert world._needs_time(BUSY)
    assert ticks(world, IDLE) == LONGEST
    world._hand.busy = True
    assert ticks(world, IDLE) == 10 * LONGEST, "a hand that is at work is waited for"


def test_what_rests_needs_none(world: Any) -> None:
    world.plant.resting = True
    assert ticks(world, IDLE) == 0
    assert world._needs_time(IDLE._replace(finger_velocity=0.01)), "a new command is carried out"
