"""The transition table: complete where it must be, and safe where it is silent."""

from __future__ import annotations

import pytest

from controller.protocol.states import BRAKED, TRANSITIONS, Event, State, next_state

PAIRS = [(state, event) for state in State for event in Event]


@pytest.mark.parametrize(("state", "event"), PAIRS)
def test_what_is_not_foreseen_stops_the_arm(state: State, event: Event) -> None:
    after, foreseen = next_state(state, event)
    if foreseen:
        assert after is TRANSITIONS[state, event]
    else:
        assert after is (state if state in BRAKED else State.STOPPING)


@pytest.mark.parametrize("state", State)
def test_every_state_knows_stop_and_brake(state: State) -> None:
    assert TRANSITIONS[state, Event.STOP] in BRAKED | {State.HOLD, State.STOPPING}
    assert TRANSITIONS[state, Event.BRAKE] in BRAKED


def test_motions_begin_only_in_hold_and_only_parking_leads_out_of_off() -> None:
    assert [state for state in State if next_state(state, Event.ANNOUNCED)[0] is State.TRACK] == [State.HOLD]
    leaving = {event for event in Event if next_state(State.OFF, event)[0] is not State.OFF}
    assert leaving == {Event.PARKED}, "which the supervisor brings about only where the process stays"


def test_brakes_open_only_by_way_of_boot() -> None:
    opening = [(a, b) for a in BRAKED for event in Event if (b := next_state(a, event)[0]) not in BRAKED]
    assert opening == [(State.BOOT, State.HOLD)]


def test_every_state_can_be_reached() -> None:
    reached, waiting = {State.BOOT}, [State.BOOT]
    while waiting:
        state = waiting.pop()
        for event in Event:
            after = next_state(state, event)[0]
            if after not in reached:
                reached.add(after)
                waiting.append(after)
    assert reached == set(State)
