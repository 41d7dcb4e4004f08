"""STOP in the controller without its socket: from every state the arm comes to rest, until RELEASE lets it go on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from controller.law.task_space import TaskSpaceController
from controller.loop.admission import Latch
from controller.loop.supervisor import Supervisor
from controller.loop.telemetry import report
from controller.model.constants import DeltaModel
from controller.protection.limits import Limits, Violation, default_limits
from controller.protocol import CommandCode, MotionFlag, Result
from controller.protocol.causes import Cause
from controller.protocol.messages import AdmitSpeed, Announce, Samples, Telemetry
from controller.protocol.states import BRAKED, Event, State
from controller.records.loop_statistics import LoopStatistics
from controller.settings import ControllerSettings
from hardware.contact_speeds import CONTACT_PROFILES
from hardware.interfaces import DriveStatus
from hardware.parameters import load_parameters
from hardware.table import TableSettings

HOME, AWAY = (0.0, 0.0, 0.35), (0.10, 0.05, 0.40)
Line = Callable[..., NDArray[Any]]
MakeBus = Callable[..., Any]
LIMITS = default_limits(load_parameters(), TableSettings())
SHARED = default_limits(load_parameters(), TableSettings(limits=CONTACT_PROFILES["separation"]))
REST = 0.3 / 0.00088
"""So many ticks after STOP the arm rests."""


class Arm:
    """A supervisor and a plant that ticks whether or not it is asked for."""

    def __init__(self, bus: Any, limits: Limits = LIMITS) -> None:
        self.bus = bus
        law = TaskSpaceController(DeltaModel(load_parameters()))
        self.supervisor = Supervisor(law, limits, ControllerSettings(), bus.period, bus.lockstep)

    def tick(self, count: int = 1, **change: Any) -> None:
        for _ in range(count):
            measured = self.bus.exchange(self.supervisor.command()._replace(busy=True))
            self.supervisor.advance(measured._replace(**change))

    def announce(self, length: int) -> int:
        supervisor = self.supervisor
        motion = supervisor.admission.last_motion + 1
        supervisor.announce(Announce(motion, supervisor.measurement.tick + 8, length, MotionFlag.NONE))
        return motion

    def begin(self, samples: NDArray[Any]) -> None:
        motion = self.announce(len(samples))
        for at in range(0, len(samples), 10):
            self.supervisor.take_samples(Samples(motion, at, samples[at : at + 10]))

    @property
    def telemetry(self) -> Telemetry:
        return report(self.supervisor, True, 0, 0, LoopStatistics(), [0] * 6)

    @property
    def rests(self) -> bool:
        """Nothing moves, and nothing is about to."""
        reference, motion = self.supervisor.reference, self.supervisor.admission.motion
        speed = float(np.abs(reference.row[3:6]).max())
        state = self.supervisor.state
        return motion.announced is None and (state in BRAKED or (state is State.HOLD and speed < 1e-9))


@pytest.fixture
def arm(fake_bus: MakeBus) -> Arm:
    return Arm(fake_bus())


def booted(arm: Arm, line: Line) -> None:
    pass


def holding(arm: Arm, line: Line) -> None:
    arm.tick(6)


def announced(arm: Arm, line: Line) -> None:
    arm.tick(6)
    arm.begin(line(HOME, AWAY, 400))
    arm.tick(2)


def moving(arm: Arm, line: Line) -> None:
    arm.tick(6)
    arm.begin(line(HOME, AWAY, 400))
    arm.tick(200)


def starved(arm: Arm, line: Line) -> None:
    """The client hangs in the middle of a motion: on a lockstep bus plant time stands."""
    arm.tick(6)
    samples = line(HOME, AWAY, 400)
    motion = arm.announce(len(samples))
    for at in range(0, 200, 10):
        arm.supervisor.take_samples(Samples(motion, at, samples[at : at + 10]))
    while arm.supervisor.may_exchange:
        arm.tick()


def stopping(arm: Arm, line: Line) -> None:
    moving(arm, line)
    arm.supervisor.obey(CommandCode.HOLD)
    arm.tick(20)


def stopping_for_protection(arm: Arm, line: Line) -> None:
    moving(arm, line)
    arm.supervisor.machine.stop(Violation(Cause.RMS_TORQUE, 2.6, 2.4), Event.PROTECTIVE_STOP)
    arm.tick(20)


def compliant(arm: Arm, line: Line) -> None:
    moving(arm, line)
    arm.supervisor.reference.position[2] += 0.02
    arm.supervisor._watch(arm.supervisor.measurement)
    assert arm.supervisor.cause.cause is Cause.TRACKING


def letting_go(arm: Arm, line: Line) -> None:
    arm.tick(6)
    for _ in range(2):
        arm.tick(tactile=(41.0, 41.0))
    assert arm.supervisor.cause.cause is Cause.TACTILE_OVERLOAD


def faulted(arm: Arm, line: Line) -> None:
    moving(arm, line)
    arm.tick(status=DriveStatus.FAULT)


def retiring(arm: Arm, line: Line) -> None:
    moving(arm, line)
    arm.supervisor.machine.retire()
    while arm.supervisor.state is not State.OFF:
        arm.tick()


def parked(arm: Arm, line: Line) -> None:
    arm.tick(6)
    arm.supervisor.machine.park(31.0)
    arm.tick(200)


WAYS: dict[Callable[[Arm, Line], None], tuple[State, Cause, State]] = {
    booted: (State.BOOT, Cause.NONE, State.HOLD),
    holding: (State.HOLD, Cause.STOP_PRESSED, State.HOLD),
    announced: (State.TRACK, Cause.STOP_PRESSED, State.HOLD),
    moving: (State.TRACK, Cause.STOP_PRESSED, State.HOLD),
    starved: (State.TRACK, Cause.STOP_PRESSED, State.HOLD),
    stopping: (State.STOPPING, Cause.HOLD_COMMAND, State.HOLD),
    stopping_for_protection: (State.STOPPING, Cause.RMS_TORQUE, State.FAULT),
    compliant: (State.STOPPING, Cause.TRACKING, State.HOLD),
    letting_go: (State.HOLD, Cause.TACTILE_OVERLOAD, State.HOLD),
    faulted: (State.FAULT, Cause.DRIVE_FAULT, State.FAULT),
    retiring: (State.OFF, Cause.SHUTDOWN, State.OFF),
    parked: (State.BOOT, Cause.PARKED, State.BOOT),
}
"""How the arm comes there; the state when STOP comes, the cause told afterwards, and where it has come to rest."""


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_stop_brings_the_arm_to_rest_in_every_state_and_hides_no_other_cause(arm: Arm, line: Line, way: Any) -> None:
    before, cause, after = WAYS[way]
    way(arm, line)
    supervisor = arm.supervisor
    assert supervisor.state is before
    running = supervisor.admission.motion.announced
    supervisor.machine.press_stop()
    assert arm.telemetry.latched
    assert supervisor.cause.cause is cause
    assert supervisor.may_exchange, "plant time goes on, so that it can come to rest"
    if running is not None:
        ended = supervisor.admission.ended
        assert (ended.motion, ended.result, ended.reason.cause) == (running.motion, Result.STOPPED, Cause.STOP_PRESSED)
    ticks = 0
    while not arm.rests:
        arm.tick()
        ticks += 1
    assert ticks < (REST if way is not compliant else 2 * REST), "compliant mode lasts 0.2 s at least"
    arm.tick(300)
    assert supervisor.state is after
    assert arm.telemetry.latched


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_stop_opens_no_brake_and_no_finger(arm: Arm, line: Line, way: Any) -> None:
    way(arm, line)
    supervisor = arm.supervisor
    before = supervisor.command()
    supervisor.machine.press_stop()
    after = supervisor.command()
    assert (after.brake, after.enable) == (before.brake, before.enable)
    assert after.finger_velocity <= before.finger_velocity
    assert supervisor.state in {State.STOPPING, *BRAKED, State.HOLD}


@pytest.mark.parametrize("way", [holding, moving, stopping, compliant, letting_go], ids=lambda way: way.__name__)
def test_what_the_hand_guard_sends_lifts_no_stop_and_only_release_does(arm: Arm, line: Line, way: Any) -> None:
    way(arm, line)
    supervisor = arm.supervisor
    supervisor.machine.press_stop()
    arm.tick(700)
    reference = tuple(supervisor.reference.position.tolist())
    for code in (CommandCode.HOLD, CommandCode.STOP, CommandCode.RESUME, CommandCode.ENABLE, CommandCode.CLEAR_FAULT):
        supervisor.obey(code)
        arm.begin(line(reference, HOME, 300))
        assert supervisor.admission.ended.result is Result.REFUSED
        assert supervisor.admission.ended.reason.cause is Cause.STOP_PRESSED
    assert not arm.telemetry.admitting
    supervisor.admission.latch.release(1)
    supervisor.obey(CommandCode.RESUME)
    assert arm.telemetry.admitting
    arm.begin(line(reference, HOME, 400))
    arm.tick(420)
    assert supervisor.admission.ended.result is Result.DONE


def test_a_hold_outlives_release(arm: Arm, line: Line) -> None:
    """A hand that came while the arm was stopped is still over the board."""
    moving(arm, line)
    arm.supervisor.machine.press_stop()
    arm.tick(200)
    arm.supervisor.obey(CommandCode.HOLD)
    arm.supervisor.admission.latch.release(1)
    arm.announce(10)
    assert arm.supervisor.admission.ended.reason.cause is Cause.NOT_ADMITTED


def test_an_arm_that_gave_way_and_was_stopped_still_says_that_it_gave_way(arm: Arm, line: Line) -> None:
    compliant(arm, line)
    arm.tick(600)
    assert arm.supervisor.state is State.HOLD
    arm.supervisor.machine.press_stop()
    arm.supervisor.admission.latch.release(1)
    assert arm.supervisor.cause.cause is Cause.TRACKING
    arm.announce(10)
    assert arm.supervisor.admission.ended.reason.cause is Cause.NOT_ADMITTED


def test_a_stop_at_stretched_time_is_as_smooth_as_any(fake_bus: MakeBus, line: Line) -> None:
    arm = Arm(fake_bus(), SHARED)
    arm.tick(6)
    arm.begin(line((0.0, 0.0, 0.35), (0.20, 0.0, 0.35), 284))
    everywhere = (0.0, 0.0, 0.0, 1.0) * 4
    while arm.supervisor.admission.playback.rate >= 0.9:
        arm.tick()
    playback, tick = arm.supervisor.admission.playback, arm.supervisor.measurement.tick
    playback.admit(AdmitSpeed(1.5, tick + 200, everywhere), tick)
    arm.tick(5)
    assert playback.rate < 1.0, "time is stretched"
    assert playback.slope != 0.0, "and changes its rate"
    rows = [arm.supervisor.reference.row[:9].copy()]
    arm.supervisor.machine.press_stop()
    for _ in range(200):
        arm.tick()
        rows.append(arm.supervisor.reference.row[:9].copy())
    assert arm.rests
    r, dt = np.array(rows), arm.bus.period
    residual = np.abs(r[1:, :6] - r[:-1, :6] - dt / 2 * (r[1:, 3:] + r[:-1, 3:]))
    assert residual[:, :3].max() < 1e-7
    assert residual[:, 3:].max() < 1e-3
    assert np.abs(np.diff(r[:, 6:], axis=0)).max() < 1.5 * ControllerSettings().stop_jerk * dt


def test_a_piece_in_the_fingers_stays_there(arm: Arm, line: Line) -> None:
    arm.bus.object_at = 0.020
    arm.tick(6)
    lift = line(HOME, AWAY, 400)
    lift["finger_velocity"] = -0.025
    arm.begin(lift)
    arm.tick(300)
    assert min(arm.supervisor.measurement.tactile) > 3.0
    arm.supervisor.machine.press_stop()
    arm.tick(400)
    assert arm.rests
    assert arm.supervisor.command().finger_velocity == pytest.approx(-0.025)
    assert min(arm.supervisor.measurement.tactile) > 3.0


def test_fingers_that_were_opening_stand(arm: Arm, line: Line) -> None:
    arm.tick(6)
    opening = line(HOME, HOME, 400)
    opening["finger_velocity"] = 0.02
    arm.begin(opening)
    arm.tick(100)
    assert arm.supervisor.command().finger_velocity > 0.0
    arm.supervisor.machine.press_stop()
    assert arm.supervisor.command().finger_velocity == 0.0


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_stop_keeps_nobody_from_shutting_down(arm: Arm, line: Line, way: Any) -> None:
    way(arm, line)
    arm.supervisor.machine.press_stop()
    arm.supervisor.obey(CommandCode.SHUTDOWN)
    for _ in range(1200):
        if not arm.supervisor.brakes.finished:
            arm.tick()
    assert arm.supervisor.brakes.finished
    assert not arm.supervisor.brakes.exhausted
    assert arm.bus.last.brake


@pytest.mark.parametrize("way", [faulted, parked], ids=lambda way: way.__name__)
def test_brakes_may_be_opened_and_the_latch_stays(arm: Arm, line: Line, way: Any) -> None:
    way(arm, line)
    arm.supervisor.machine.press_stop()
    arm.supervisor.obey(CommandCode.CLEAR_FAULT)
    arm.supervisor.obey(CommandCode.ENABLE)
    arm.tick(20)
    assert arm.supervisor.state is State.HOLD
    arm.announce(10)
    assert arm.supervisor.admission.ended.reason.cause is Cause.STOP_PRESSED


# the latch by itself


@given(st.lists(st.none() | st.integers(0, 6), max_size=12))
def test_only_a_release_that_knows_of_every_press_opens_the_latch(asked: list[int | None]) -> None:
    """None: a press; a number: a RELEASE of who has seen so many."""
    latch, pressed, closed = Latch(), 0, False
    for one in asked:
        if one is None:
            latch.press()
            pressed, closed = pressed + 1, True
        else:
            latch.release(one)
            closed = closed and one != pressed
        assert (latch.closed, latch.presses) == (closed, pressed)


# whatever happens


ANY = st.sampled_from(["press", "announce", "tick", "ticks", "many", *(code.name for code in CommandCode), "release"])


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(ANY, max_size=14))
def test_while_it_is_in_force_nothing_begins_whatever_the_client_asks_for(
    fake_bus: MakeBus, line: Line, asked: list[str]
) -> None:
    """``release`` is a late one here, of a client that has not seen the last press."""
    arm = Arm(fake_bus())
    arm.tick(6)
    supervisor = arm.supervisor
    for one in asked:
        latched = supervisor.admission.latch.closed
        before = supervisor.state
        if one == "press":
            supervisor.machine.press_stop()
            assert supervisor.state is not State.TRACK
        elif one == "announce":
            arm.begin(line(tuple(supervisor.reference.position.tolist()), AWAY, 400))
        elif one == "release":
            supervisor.admission.latch.release(supervisor.admission.latch.presses - 1)
        elif one in CommandCode.__members__:
            supervisor.obey(CommandCode[one])
        elif not supervisor.brakes.finished:
            arm.tick({"tick": 1, "ticks": 30, "many": 250}[one])
        if latched:
            assert supervisor.admission.latch.closed
            assert supervisor.state is not State.TRACK
            assert supervisor.state is not State.STOPPING or before is State.STOPPING
            assert math.hypot(*supervisor.reference.row[3:6]) == 0.0 or supervisor.state is State.STOPPING
