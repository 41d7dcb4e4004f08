"""States of the controller and the one table of their transitions."""

from __future__ import annotations

from enum import IntEnum, unique


@unique
class State(IntEnum):
    """What the controller is doing; its number goes over the wire."""

    BOOT = 0
    """On the brakes: finding the arm's pose, waiting for enable, enabling."""
    HOLD = 1
    """Keeps its reference at rest; the only state that admits a motion."""
    TRACK = 2
    """A motion was admitted; follows its samples from their first tick on."""
    STOPPING = 3
    """Controlled, jerk-limited stop along the direction of travel; or compliant mode, without stiffness."""
    FAULT = 4
    """On the brakes until the fault is cleared."""
    OFF = 5
    """Going on the brakes; as soon as the arm rests there, the process ends, or waits for another client (parking)."""


@unique
class Event(IntEnum):
    """What can happen to the controller."""

    ENABLED = 0
    """The drives follow and the reference is the measured pose."""
    ANNOUNCED = 1
    """A motion was admitted."""
    ENDED = 2
    """The motion's last sample or its guard was reached, or it was refused before its start."""
    STOP = 3
    """Hold, stop, underrun, sample out of limits, client lost."""
    PROTECTIVE_STOP = 4
    """A limit that wants the brakes once the stop is over."""
    COMPLIANT = 10
    """Something is in the way: no stiffness, gravity and damping only, until the arm rests."""
    AT_REST = 5
    """The controlled stop is over."""
    PROTECTIVE_STOP_AT_REST = 6
    """The controlled stop that a PROTECTIVE_STOP began is over."""
    BRAKE = 7
    """Something that cannot be controlled any more: brakes at once."""
    CLEAR = 8
    """The fault was cleared by command."""
    RETIRE = 9
    """Shutdown, or parking, and nothing moves."""
    PARKED = 11
    """The arm rests on its brakes, and the controller waits for another client to enable it."""


TRANSITIONS: dict[tuple[State, Event], State] = {
    (State.BOOT, Event.ENABLED): State.HOLD,
    (State.BOOT, Event.STOP): State.BOOT,
    (State.BOOT, Event.COMPLIANT): State.BOOT,
    (State.BOOT, Event.BRAKE): State.FAULT,
    (State.BOOT, Event.RETIRE): State.OFF,
    (State.HOLD, Event.ANNOUNCED): State.TRACK,
    (State.HOLD, Event.STOP): State.HOLD,
    (State.HOLD, Event.PROTECTIVE_STOP): State.FAULT,
    (State.HOLD, Event.COMPLIANT): State.STOPPING,
    (State.HOLD, Event.BRAKE): State.FAULT,
    (State.HOLD, Event.RETIRE): State.OFF,
    (State.TRACK, Event.ENDED): State.HOLD,
    (State.TRACK, Event.STOP): State.STOPPING,
    (State.TRACK, Event.PROTECTIVE_STOP): State.STOPPING,
    (State.TRACK, Event.COMPLIANT): State.STOPPING,
    (State.TRACK, Event.BRAKE): State.FAULT,
    (State.STOPPING, Event.STOP): State.STOPPING,
    (State.STOPPING, Event.PROTECTIVE_STOP): State.STOPPING,
    (State.STOPPING, Event.COMPLIANT): State.STOPPING,
    (State.STOPPING, Event.AT_REST): State.HOLD,
    (State.STOPPING, Event.PROTECTIVE_STOP_AT_REST): State.FAULT,
    (State.STOPPING, Event.BRAKE): State.FAULT,
    (State.FAULT, Event.STOP): State.FAULT,
    (State.FAULT, Event.PROTECTIVE_STOP): State.FAULT,
    (State.FAULT, Event.COMPLIANT): State.FAULT,
    (State.FAULT, Event.BRAKE): State.FAULT,
    (State.FAULT, Event.CLEAR): State.BOOT,
    (State.FAULT, Event.RETIRE): State.OFF,
    (State.OFF, Event.STOP): State.OFF,
    (State.OFF, Event.PROTECTIVE_STOP): State.OFF,
    (State.OFF, Event.COMPLIANT): State.OFF,
    (State.OFF, Event.BRAKE): State.OFF,
    (State.OFF, Event.RETIRE): State.OFF,
    (State.OFF, Event.PARKED): State.BOOT,
}
"""Every foreseen pair of state and event."""

BRAKED = frozenset({State.BOOT, State.FAULT, State.OFF})
"""States in which the brakes are closed, so that there is nothing to stop."""


def next_state(state: State, event: Event) -> tuple[State, bool]:
    """Where an event leads, and whether the table foresees it.

    An event the table does not foresee stops the arm; a state on the brakes stays as it is.
    """
    known = TRANSITIONS.get((state, event))
    if known is not None:
        return known, True
    return (state if state in BRAKED else State.STOPPING), False
