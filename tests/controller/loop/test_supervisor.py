"""The controller without its socket: boot, motions, guards, stops, faults, the end; tick by tick."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.law.task_space import TaskSpaceController
from controller.loop.supervisor import Supervisor
from controller.loop.telemetry import report
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from controller.protection.limits import Violation, default_limits, nearest_inside
from controller.protocol import CommandCode, Guard, MotionFlag, Result
from controller.protocol.cause_sentences import explain
from controller.protocol.causes import Cause
from controller.protocol.messages import Announce, Samples
from controller.protocol.states import Event, State
from controller.records.loop_statistics import LoopStatistics
from controller.settings import ControllerSettings
from hardware.interfaces import Command, DriveStatus, DriveTrouble, Measurement, status_of
from hardware.parameters import load_parameters
from hardware.table import TableSettings

HOME, AWAY = (0.0, 0.0, 0.35), (0.10, 0.05, 0.40)
Line = Callable[..., NDArray[Any]]
STOP = Violation(Cause.STOP_COMMAND, 0.0, 0.0)


class Rig:
    """A supervisor and a plant in lockstep, driven by the test."""

    def __init__(self, bus: Any, law: TaskSpaceController | None = None) -> None:
        parameters = load_parameters()
        self.bus = bus
        self.supervisor = Supervisor(
            law or TaskSpaceController(DeltaModel(parameters)),
            default_limits(parameters, TableSettings()),
            ControllerSettings(),
            bus.period,
            bus.lockstep,
        )
        self.states: list[State] = []
        self.references: list[NDArray[np.float64]] = []
        self.ticks: list[int] = []
        self.motions = 0
        self.doctor: Callable[[Measurement], Measurement] = lambda measurement: measurement

    @property
    def state(self) -> State:
        return self.supervisor.state

    @property
    def sentence(self) -> str:
        return explain(*self.supervisor.cause[:3])

    @property
    def reason(self) -> str:
        return explain(*self.supervisor.admission.ended.reason[:3])

    def run(self, ticks: int) -> None:
        """Tick; a tick that the supervisor does not ask for is not made."""
        for _ in range(ticks):
            if self.supervisor.may_exchange:
                before = self.supervisor.measurement.tick
                measurement = self.doctor(self.bus.exchange(self.supervisor.command()))
                if measurement.tick != before:
                    self.supervisor.advance(measurement)
                    self.ticks.append(measurement.tick)
                    self.references.append(self.supervisor.reference.row[:9].copy())
            self.states.append(self.state)

    def boot(self) -> Rig:
        self.run(4)
        assert self.state is State.HOLD
        self.references.clear()
        self.ticks.clear()
        return self

    def announce(self, length: int, lead: int = 8, flags: MotionFlag = MotionFlag.NONE) -> int:
        self.motions += 1
        tick = self.supervisor.measurement.tick
        self.supervisor.announce(Announce(self.motions, tick + lead, length, flags))
        return self.motions

    def send(self, samples: NDArray[Any], start: int = 0, end: int | None = None) -> None:
        for at in range(start, len(samples) if end is None else end, 10):
            self.supervisor.take_samples(Samples(self.motions, at, samples[at : at + 10]))

    def begin(self, samples: NDArray[Any], flags: MotionFlag = MotionFlag.NONE) -> None:
        self.announce(len(samples), flags=flags)
        self.send(samples)

    def executed(self) -> NDArray[np.float64]:
        """Reference positions from the last motion's first to its last tick."""
        ended = self.supervisor.admission.ended
        first, last = self.ticks.index(ended.first_tick), self.ticks.index(ended.end_tick)
        return np.array(self.references)[first : last + 1, :3]

    def reference_jumps(self) -> tuple[float, float, float]:
        """Largest position and velocity residual of the trapezoidal rule, and largest step of the acceleration."""
        r = np.array(self.references)
        dt = self.bus.period
        residual = np.abs(r[1:, :6] - r[:-1, :6] - dt / 2 * (r[1:, 3:] + r[:-1, 3:]))
        return residual[:, :3].max(), residual[:, 3:].max(), np.abs(np.diff(r[:, 6:], axis=0)).max()


@pytest.fixture
def rig(fake_bus: Callable[..., Any]) -> Rig:
    return Rig(fake_bus())


@pytest.fixture
def real_time_rig(fake_bus: Callable[..., Any]) -> Rig:
    bus = fake_bus(lockstep=False)
    bus.hurry = 1e9
    return Rig(bus)


# boot


def test_boot_enables_on_the_brakes_and_holds_where_the_arm_is(rig: Rig) -> None:
    rig.run(4)
    commands = [command for _, command in rig.bus.log]
    assert [(c.brake, c.enable) for c in commands] == [(True, False), (True, False), (True, True)]
    assert rig.state is State.HOLD
    assert not rig.supervisor.command().brake
    assert rig.supervisor.reference.position == pytest.approx(HOME)
    assert all(command.busy for command in commands)
    assert not rig.supervisor.command().busy
    gravity = rig.supervisor.law.holding_torque()
    assert rig.supervisor.torque == pytest.approx(gravity, abs=1e-6)


def test_hold_keeps_the_reference(rig: Rig) -> None:
    rig.boot()
    rig.bus.log.clear()
    rig.doctor = lambda measurement: measurement
    for _ in range(200):
        command = rig.supervisor.command()._replace(busy=True)
        rig.supervisor.advance(rig.bus.exchange(command))
    assert rig.supervisor.law.state.position == pytest.approx(HOME, abs=1e-9)


def test_boot_forgives_the_watchdog_of_a_killed_predecessor(rig: Rig) -> None:
    rig.doctor = lambda m: m if m.status & DriveStatus.ENABLED else m._replace(status=m.status | DriveStatus.WATCHDOG)
    rig.boot()


def test_boot_waits_until_the_arm_rests(rig: Rig) -> None:
    rig.doctor = lambda m: m._replace(velocity=(0.5, 0.0, 0.0)) if m.tick < 1100 else m
    rig.run(99)
    assert rig.state is State.BOOT
    assert all(command.brake and not command.enable for _, command in rig.bus.log)
    rig.run(4)
    assert rig.state is State.HOLD


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"velocity": (0.5, 0.0, 0.0)}, "the arm still moved at 0.500 rad/s after 200 ticks on its brakes"),
        ({"angle": (9.0, 0.0, 0.0)}, "the kinematics failed with status"),
        ({"angle": (math.nan, 0.0, 0.0)}, "a measurement is not finite"),
        ({"status": DriveStatus.OK}, "the drives did not enable within 200 ticks"),
        ({"status": DriveStatus.FAULT}, "a drive reports a fault"),
    ],
)
def test_boot_that_cannot_succeed_faults_on_the_brakes(rig: Rig, change: dict[str, Any], message: str) -> None:
    rig.doctor = lambda measurement: measurement._replace(**change)
    rig.run(210)
    assert rig.state is State.FAULT
    assert message in rig.sentence
    assert all(command.brake for _, command in rig.bus.log)
    assert rig.supervisor.command() == Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)


# motions


def test_a_motion_is_followed_tick_by_tick(rig: Rig, line: Line) -> None:
    samples = line(HOME, AWAY, 900)
    rig.boot().begin(samples)
    first = rig.supervisor.measurement.tick + 8
    rig.run(8 + 900)
    assert rig.state is State.HOLD
    ended = rig.supervisor.admission.ended
    assert (ended.result, ended.first_tick, ended.end_tick) == (Result.DONE, first, first + 900)
    assert ended.position == pytest.approx(AWAY, abs=5e-5)
    assert np.array_equal(rig.executed(), samples["position"])
    assert 0.5 < rig.supervisor.admission.peak_torque < 3.0
    assert rig.supervisor.clamped == 0


def test_busy_from_the_announcement_to_the_end(rig: Rig, line: Line) -> None:
    rig.boot().announce(101)
    assert rig.supervisor.command().busy
    rig.send(line(HOME, HOME, 100))
    rig.run(108)
    assert not rig.supervisor.command().busy


def test_in_lockstep_a_missing_sample_costs_no_tick(rig: Rig, line: Line) -> None:
    samples = line(HOME, AWAY, 900)
    rig.boot().announce(len(samples))
    rig.run(100)
    start = rig.supervisor.admission.ended.end_tick or rig.supervisor.measurement.tick
    assert rig.supervisor.measurement.tick == start
    assert not rig.supervisor.may_exchange
    rig.send(samples, 0, 300)
    rig.run(1000)
    assert rig.supervisor.admission.motion.executed == 300
    assert not rig.supervisor.may_exchange
    rig.send(samples, 290)
    rig.run(1000)
    assert rig.supervisor.admission.ended.result is Result.DONE
    assert np.array_equal(rig.executed(), samples["position"])


def test_in_lockstep_a_followed_motion_waits_for_the_next(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, AWAY, 500), MotionFlag.FOLLOWED)
    rig.run(2000)
    tick = rig.supervisor.admission.ended.end_tick
    assert (rig.supervisor.measurement.tick, rig.supervisor.may_exchange) == (tick, False)
    rig.begin(line(AWAY, HOME, 500))
    assert rig.supervisor.may_exchange
    rig.run(508)
    assert rig.supervisor.admission.ended.first_tick == tick + 8
    assert rig.supervisor.may_exchange


@pytest.mark.parametrize("release", ["hold", "stop", "lost", "shutdown"])
def test_a_followed_motion_does_not_wait_for_ever(rig: Rig, line: Line, release: str) -> None:
    rig.boot().begin(line(HOME, HOME, 10), MotionFlag.FOLLOWED)
    rig.run(100)
    assert not rig.supervisor.may_exchange
    if release == "lost":
        rig.supervisor.machine.stop(Violation(Cause.CLIENT_LOST, 1.1, 1.0))
    else:
        rig.supervisor.obey(CommandCode[release.upper()])
    assert rig.supervisor.may_exchange


def test_a_refused_successor_leaves_plant_time_waiting(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, HOME, 10), MotionFlag.FOLLOWED)
    rig.run(100)
    tick = rig.supervisor.measurement.tick
    rig.begin(line(AWAY, HOME, 500))
    rig.run(10)
    assert rig.supervisor.admission.ended.result is Result.REFUSED
    assert (rig.supervisor.measurement.tick, rig.supervisor.may_exchange) == (tick, False)


def test_on_a_real_time_bus_a_followed_motion_just_holds(real_time_rig: Rig, line: Line) -> None:
    rig = real_time_rig
    rig.boot().begin(line(HOME, HOME, 10), MotionFlag.FOLLOWED)
    rig.run(50)
    assert rig.state is State.HOLD
    assert rig.supervisor.may_exchange
    assert rig.supervisor.measurement.tick > rig.supervisor.admission.ended.end_tick + 20


def test_on_a_real_time_bus_a_missing_sample_stops_without_a_step(real_time_rig: Rig, line: Line) -> None:
    rig = real_time_rig
    samples = line(HOME, AWAY, 400)
    rig.boot().announce(len(samples))
    rig.send(samples, 0, 200)
    rig.run(8 + 199)
    assert rig.state is State.TRACK
    rig.run(200)
    assert rig.state is State.HOLD
    assert rig.supervisor.admission.ended.result is Result.STOPPED
    assert "sample 200 was due, but only 200 had arrived" in rig.reason
    position, velocity, acceleration = rig.reference_jumps()
    assert position < 1e-7
    assert velocity < 1e-3
    assert acceleration < 1.5 * 1000.0 * rig.bus.period


def test_a_skipped_tick_skips_its_sample(real_time_rig: Rig, line: Line) -> None:
    rig = real_time_rig
    rig.boot().begin(line(HOME, AWAY, 400))
    shift = 0

    def skip(measurement: Measurement) -> Measurement:
        return measurement._replace(tick=measurement.tick + shift)

    rig.doctor = skip
    rig.run(208)
    executed, shift = rig.supervisor.admission.motion.executed, 3
    rig.run(1)
    assert rig.supervisor.admission.motion.executed == executed + 4
    rig.run(300)
    assert rig.supervisor.admission.ended.result is Result.DONE


def test_grip_ends_the_motion_and_persists(rig: Rig, grip: Line, line: Line) -> None:
    rig.bus.object_at = 0.010
    rig.boot().begin(grip(HOME, 1500), MotionFlag.FOLLOWED)
    rig.run(2000)
    ended = rig.supervisor.admission.ended
    assert ended.result is Result.GRIPPED
    assert ended.finger_position == pytest.approx(0.010)
    assert ended.end_tick < ended.first_tick + 1500
    assert rig.supervisor.admission.peak_tactile == pytest.approx(4.0)
    assert rig.supervisor.command().finger_velocity == pytest.approx(-0.025)
    lift = line(HOME, AWAY, 500)
    lift["finger_velocity"] = -0.025
    rig.begin(lift)
    rig.run(600)
    assert rig.supervisor.admission.ended.result is Result.DONE
    assert rig.supervisor.command().finger_velocity == pytest.approx(-0.025)


def test_grip_needs_both_fingers(rig: Rig, grip: Line) -> None:
    rig.bus.object_at = 0.010
    rig.doctor = lambda measurement: measurement._replace(tactile=(measurement.tactile[0], 1.0))
    rig.boot().begin(grip(HOME, 1500))
    rig.run(1600)
    assert rig.supervisor.admission.ended.result is Result.DONE


def test_a_grip_that_meets_nothing_is_done(rig: Rig, grip: Line) -> None:
    rig.boot().begin(grip(HOME, 600))
    rig.run(700)
    assert rig.supervisor.admission.ended.result is Result.DONE


def test_a_repeated_announcement_changes_nothing(rig: Rig, line: Line) -> None:
    samples = line(HOME, AWAY, 500)
    rig.boot().begin(samples)
    announced = rig.supervisor.admission.motion.announced
    assert announced is not None
    rig.run(100)
    for _ in range(3):
        rig.supervisor.announce(announced)
        rig.supervisor.announce(announced._replace(first_tick=5))
    rig.run(420)
    assert rig.supervisor.admission.ended.result is Result.DONE
    rig.supervisor.announce(announced)
    assert (rig.state, rig.supervisor.admission.ended.result) == (State.HOLD, Result.DONE)


# refusals


def test_an_announcement_in_the_past_is_refused_with_both_ticks(rig: Rig) -> None:
    rig.boot().announce(10, lead=0)
    tick = rig.supervisor.measurement.tick
    assert f"was to start at tick {tick}, but tick {tick} has already begun" in rig.reason
    assert rig.supervisor.admission.ended.result is Result.REFUSED
    rig.announce(10, lead=1)
    assert rig.state is State.TRACK


@pytest.mark.parametrize(
    ("length", "lead", "message"),
    [
        (0, 8, "a motion of 0 samples was announced, 1 to 1000000 are accepted"),
        (1_000_001, 8, "a motion of 1000001 samples was announced"),
        (10, 11365, "was to start 11365 ticks ahead, at most 11364 are accepted"),
    ],
)
def test_an_impossible_announcement_is_refused(rig: Rig, length: int, lead: int, message: str) -> None:
    rig.boot().announce(length, lead)
    assert message in rig.reason
    assert rig.state is State.HOLD


def test_a_second_motion_and_one_during_a_stop_are_refused(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, AWAY, 500))
    rig.run(200)
    rig.announce(10)
    assert "motion 1 is still under way" in rig.reason
    rig.supervisor.machine.stop(STOP)
    rig.announce(10)
    assert "the controller is in state STOPPING, motions are admitted only in state HOLD" in rig.reason


def test_a_hold_admits_nothing_until_resume(rig: Rig, line: Line) -> None:
    rig.boot().supervisor.obey(CommandCode.HOLD)
    rig.announce(10)
    assert "a hold is in force: send resume" in rig.reason
    rig.supervisor.obey(CommandCode.RESUME)
    rig.begin(line(HOME, HOME, 9))
    rig.run(20)
    assert rig.supervisor.admission.ended.result is Result.DONE


def test_a_motion_from_elsewhere_is_refused_before_it_begins(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(AWAY, HOME, 500))
    assert rig.state is State.HOLD
    assert "the motion starts 0.122 m from the present reference, at most 1e-06 m is accepted" in rig.reason
    assert rig.supervisor.admission.ended.result is Result.REFUSED


def test_a_bad_sample_under_way_stops(rig: Rig, line: Line) -> None:
    samples = line(HOME, AWAY, 500)
    samples["position"][300:] += (0.0, 0.0, 0.01)
    rig.boot().announce(len(samples))
    rig.send(samples, 0, 250)
    rig.run(8 + 250)
    rig.send(samples, 250)
    assert rig.state is State.STOPPING
    assert "positions jump by 0.01 m" in rig.reason
    rig.run(200)
    assert rig.state is State.HOLD
    assert rig.reference_jumps()[0] < 1e-7


# stops


@pytest.mark.parametrize("at", [3, 60, 150, 250, 350, 440, 499])
def test_a_stop_anywhere_never_steps_and_rests_on_the_line(rig: Rig, line: Line, at: int) -> None:
    rig.boot().begin(line(HOME, AWAY, 500))
    rig.run(8 + at)
    rig.supervisor.obey(CommandCode.STOP)
    assert rig.supervisor.admission.ended.result is Result.STOPPED
    ticks = 0
    while rig.state is State.STOPPING:
        assert rig.supervisor.command().busy
        rig.run(1)
        ticks += 1
    assert rig.state is State.HOLD
    assert ticks * rig.bus.period < 0.3
    position, velocity, acceleration = rig.reference_jumps()
    assert position < 1e-7
    assert velocity < 1e-3
    assert acceleration < 1.2 * 1000.0 * rig.bus.period
    at_rest = rig.supervisor.reference
    assert not at_rest.row[3:9].any()
    direction = np.subtract(AWAY, HOME) / np.linalg.norm(np.subtract(AWAY, HOME))
    assert np.linalg.norm(np.cross(at_rest.position - HOME, direction)) < 1e-9
    rig.begin(line(tuple(at_rest.position.tolist()), HOME, 500))
    rig.run(600)
    assert rig.supervisor.admission.ended.result is Result.DONE


def test_after_a_stop_fingers_close_but_do_not_open_and_gains_are_firm(rig: Rig, line: Line) -> None:
    for velocity, wanted in ((-0.02, -0.02), (0.02, 0.0)):
        samples = line(HOME, HOME, 50)
        samples["finger_velocity"], samples["stiffness"], samples["damping"] = velocity, (0.0, 1000.0, 50.0), 0.1
        rig = Rig(rig.bus) if rig.motions else rig
        rig.boot().begin(samples)
        rig.run(30)
        rig.supervisor.obey(CommandCode.STOP)
        assert rig.supervisor.command().finger_velocity == pytest.approx(wanted)
        assert rig.supervisor.reference.row[9:15].tolist() == pytest.approx([400.0, 1000.0, 400.0, 40.0, 40.0, 40.0])


def test_gains_of_the_last_sample_stay_in_hold(rig: Rig, line: Line) -> None:
    samples = line(HOME, HOME, 50)
    samples["stiffness"], samples["damping"], samples["tactile_gain"] = (0.0, 100.0, 400.0), (0.1, 20.0, 40.0), 2.0
    rig.boot().begin(samples)
    rig.run(100)
    assert rig.supervisor.reference.row[9:].tolist() == pytest.approx([0.0, 100.0, 400.0, 0.1, 20.0, 40.0, 2.0])


def test_a_hold_during_a_stop_changes_nothing_of_it(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, AWAY, 500))
    rig.run(258)
    rig.supervisor.obey(CommandCode.STOP)
    rig.run(5)
    rig.supervisor.obey(CommandCode.HOLD)
    rig.supervisor.machine.stop(Violation(Cause.CLIENT_LOST, 1.1, 1.0))
    rig.run(200)
    assert rig.state is State.HOLD
    assert rig.reference_jumps()[0] < 1e-7


def test_an_event_that_is_not_foreseen_stops(rig: Rig) -> None:
    rig.boot().supervisor.machine.enter(Event.AT_REST)
    assert rig.state is State.STOPPING
    assert "event AT_REST is not expected in state 1" in rig.sentence
    rig.run(3)
    assert rig.state is State.HOLD


# faults


def test_a_jammed_arm_gives_way_and_admits_nothing_until_resume(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, AWAY, 500))
    rig.run(200)
    rig.bus.jammed = True
    rig.run(30)
    assert rig.state is State.STOPPING
    assert rig.supervisor.admission.ended.reason.cause is Cause.TRACKING
    assert "m from its reference along one axis, at most 0.0024 m is accepted" in rig.sentence
    row = rig.supervisor.reference.row
    assert not row[9:12].any()  # no stiffness
    assert not row[15]  # no tactile feedback
    hold = np.array(rig.supervisor.law.holding_torque())
    np.testing.assert_allclose(rig.supervisor.torque, hold, atol=1e-6)  # gravity only: it does not move
    rig.run(300)
    assert rig.state is State.HOLD
    np.testing.assert_allclose(row[0:3], rig.supervisor.law.state.position, atol=1e-9)
    assert set(row[9:12]) == {400.0}
    rig.bus.jammed = False
    rig.begin(line(tuple(row[0:3].tolist()), AWAY, 500))
    assert rig.supervisor.admission.ended.reason.cause is Cause.NOT_ADMITTED
    rig.supervisor.obey(CommandCode.RESUME)
    rig.begin(line(tuple(row[0:3].tolist()), AWAY, 500))
    rig.run(600)
    assert rig.supervisor.admission.ended.result is Result.DONE


def test_pushed_away_while_holding_it_gives_way(rig: Rig) -> None:
    rig.boot().supervisor.reference.position[2] += 0.02
    measurement = rig.bus.exchange(rig.supervisor.command()._replace(busy=True))
    rig.supervisor.advance(measurement)
    assert rig.state is State.STOPPING
    assert rig.supervisor.busy
    rig.run(400)
    assert rig.state is State.HOLD
    assert rig.supervisor.cause.cause is Cause.TRACKING


@pytest.mark.parametrize("direction", [(0, 1, 0), (1, 0, 0), (-1, -1, 0), (1, -2, 0), (0, 0, -1), (1, 2, -2)])
def test_nobody_pushes_an_arm_that_gives_way_out_of_the_poses_in_which_it_is_controlled(
    rig: Rig, direction: tuple[int, int, int]
) -> None:
    away = np.array(direction) / np.linalg.norm(direction)
    limits = default_limits(load_parameters(), TableSettings())
    rig.boot()
    rig.bus.push = 60.0 * away
    rig.run(60)
    assert rig.supervisor.machine.compliant
    rig.bus.push = 20.0 * away  # on and on, as one whose sleeve is caught

    def outside() -> float:
        position = rig.supervisor.law.state.position.tolist()
        return math.dist(position, nearest_inside(position, limits))

    farthest = 0.0
    for _ in range(2500):
        rig.run(1)
        farthest = max(farthest, outside())
    assert farthest < limits.outside
    assert not rig.supervisor.machine.braked, rig.sentence
    rig.bus.push = np.zeros(3)
    rig.run(1500)
    assert rig.state is State.HOLD
    assert outside() < 0.01


def test_who_pulls_harder_than_the_fence_and_lets_go_sees_the_arm_come_back_slowly(rig: Rig) -> None:
    rig.boot()
    rig.bus.push = np.array([0.0, 60.0, 0.0])
    rig.run(1500)
    assert rig.supervisor.law.state.position[1] > 0.33
    assert rig.supervisor.machine.compliant
    rig.bus.push = np.zeros(3)
    fastest = 0.0
    for _ in range(1500):
        rig.run(1)
        fastest = max(fastest, -float(rig.supervisor.law.state.velocity[1]))
    assert 0.05 < fastest < 0.4
    assert rig.state is State.HOLD


@pytest.mark.parametrize("hot", [True, False])
def test_who_drags_on_and_on_finds_brakes_where_a_motor_is_too_hot_or_the_controller_shall_end(
    rig: Rig, hot: bool
) -> None:
    rig.boot()
    rig.bus.push = np.array([0.0, 60.0, 0.0])
    rig.run(60)
    rig.bus.push = np.array([0.0, 35.0, 0.0])
    rig.run(8000)
    assert rig.supervisor.machine.compliant, "and does not rest meanwhile"
    if hot:
        rig.supervisor.machine.stop(Violation(Cause.RMS_TORQUE, 2.5, 2.4), Event.PROTECTIVE_STOP)
    else:
        rig.supervisor.machine.retire()
    rig.run(400)
    assert rig.supervisor.machine.braked
    if hot:
        assert rig.supervisor.cause.cause is Cause.RMS_TORQUE, "not what it gave way to: that is no reason for brakes"
    assert 0.30 < rig.supervisor.law.state.position[1] < 0.30 + 0.03


def test_an_arm_that_came_onto_its_brakes_far_outside_stops_and_gives_way_again_once_the_fault_is_cleared(
    rig: Rig, line: Line
) -> None:
    rig.boot()
    rig.bus.push = np.array([0.0, 60.0, 0.0])
    rig.run(1500)
    assert rig.supervisor.law.state.position[1] > 0.33, "further out than where a tool gives way"
    rig.supervisor._protection._mean.squares[:] = 2.39**2
    while not rig.supervisor.machine.braked:
        rig.run(1)
    rig.run(5)
    assert (rig.state, rig.supervisor.cause.cause) == (State.FAULT, Cause.RMS_TORQUE)
    rig.supervisor._protection._mean.squares[:] = 0.0
    rig.bus.push = np.zeros(3)
    rig.supervisor.obey(CommandCode.CLEAR_FAULT)
    rig.bus._angle = posture_at(DeltaModel(load_parameters()), np.array(HOME)).y  # somebody moves it back by hand
    rig.supervisor._protection.reset()
    rig.run(2)
    rig.supervisor.obey(CommandCode.ENABLE)
    rig.run(8)
    rig.supervisor.obey(CommandCode.RESUME)
    rig.begin(line(tuple(rig.supervisor.reference.position.tolist()), AWAY, 900))
    rig.run(300)
    assert rig.state is State.TRACK
    rig.supervisor.obey(CommandCode.STOP)
    assert rig.state is State.STOPPING
    rig.run(300)
    assert rig.state is State.HOLD


@pytest.mark.parametrize("push", [0.1, 60.0])
def test_a_controller_ends_where_its_tool_is_far_outside_too(fake_bus: Callable[..., Any], push: float) -> None:
    """Enabled out there, or pushed out all the time."""
    rig = Rig(fake_bus(point=(0.0, 0.345, 0.30))) if push < 1.0 else Rig(fake_bus()).boot()
    rig.bus.push = np.array([0.0, push, 0.0])
    rig.run(1500)
    assert rig.supervisor.law.state.position[1] > 0.33
    rig.supervisor.machine.retire()
    rig.run(2000)
    assert rig.supervisor.brakes.finished


def test_an_arm_that_is_enabled_outside_its_workspace_gives_way_and_is_not_pulled_in(
    fake_bus: Callable[..., Any],
) -> None:
    begun = (0.0, 0.345, 0.30)
    rig = Rig(fake_bus(point=begun))
    rig.bus.push = np.array([0.0, 0.1, 0.0])  # next to nothing: plant time goes on
    rig.run(600)
    assert rig.supervisor.cause.cause is Cause.TOOL_OUTSIDE
    assert not rig.supervisor.machine.braked, rig.sentence
    assert math.dist(rig.supervisor.law.state.position.tolist(), begun) < 0.005


def test_giving_way_is_not_shortened_by_a_stop_and_ends_a_shutdown_too(rig: Rig) -> None:
    rig.boot().supervisor.reference.position[2] += 0.02
    feel(rig)
    rig.supervisor.machine.stop(STOP)
    rig.supervisor.machine.retire()
    rig.supervisor.machine.retire()
    assert rig.supervisor.cause.cause is Cause.TRACKING
    assert not rig.supervisor.reference.stopping
    rig.run(600)
    assert rig.supervisor.brakes.finished
    assert not rig.supervisor.brakes.exhausted


def feel(rig: Rig, **change: Any) -> None:
    """One tick with a changed measurement."""
    healthy = rig.bus.exchange(rig.supervisor.command()._replace(busy=True))
    rig.supervisor.advance(healthy._replace(**change))


def test_too_hard_a_grip_is_let_go_after_a_while(rig: Rig) -> None:
    rig.boot().supervisor.reference.finger_velocity = -0.03
    for _ in range(341):
        feel(rig, tactile=(16.0, 15.5))
    assert rig.supervisor.reference.finger_velocity == -0.03
    feel(rig, tactile=(16.0, 15.5))
    assert rig.supervisor.cause.cause is Cause.GRIP_FORCE
    assert rig.supervisor.reference.finger_velocity == 0.05
    feel(rig, tactile=(6.0, 5.0))
    assert rig.supervisor.reference.finger_velocity == 0.05
    feel(rig, tactile=(0.5, 0.0))
    assert rig.supervisor.reference.finger_velocity == 0.0
    assert not rig.supervisor.admission.admitting


def test_letting_go_ends_even_if_the_force_stays(rig: Rig) -> None:
    rig.boot()
    for _ in range(500):
        feel(rig, tactile=(41.0, 0.0))
    assert rig.supervisor.cause.cause is Cause.TACTILE_OVERLOAD
    opened = []
    for _ in range(500):
        feel(rig, tactile=(8.0, 8.0))
        opened.append(rig.supervisor.reference.finger_velocity)
    assert opened[-1] == 0.0


def test_a_normal_grip_holds_for_ever(rig: Rig) -> None:
    rig.boot().supervisor.reference.finger_velocity = -0.03
    for _ in range(2000):
        feel(rig, tactile=(8.0, 8.0))
    assert rig.supervisor.reference.finger_velocity == -0.03
    assert rig.supervisor.cause.cause is Cause.NONE


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"velocity": (0.0, 14.5, 0.0)}, Cause.ENCODER),
        ({"velocity": (0.0, -12.0, 0.0)}, Cause.ENCODER),
    ],
)
def test_an_encoder_that_contradicts_itself_brakes(rig: Rig, change: dict[str, Any], cause: Cause) -> None:
    rig.boot().run(3)
    feel(rig, **change)
    assert rig.state is State.FAULT
    assert rig.supervisor.cause.cause is cause


def test_a_frozen_encoder_is_noticed_before_the_tool_is_far_off(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, AWAY, 500))
    rig.run(150)
    reference = rig.supervisor.reference
    joint = int(np.argmax(np.abs(rig.supervisor.law.state.jacobian_inverse @ reference.row[3:6])))
    frozen, start = rig.supervisor.measurement.angle[joint], rig.supervisor.reference.position.copy()
    while rig.state is State.TRACK:
        measured = rig.bus.exchange(rig.supervisor.command()._replace(busy=True))
        angle, velocity = list(measured.angle), list(measured.velocity)
        angle[joint], velocity[joint] = frozen, 0.0
        rig.supervisor.advance(measured._replace(angle=tuple(angle), velocity=tuple(velocity)))
    assert rig.supervisor.cause.cause in (Cause.ENCODER, Cause.TRACKING)
    assert np.linalg.norm(rig.supervisor.reference.position - start) < 0.01


def test_a_motor_that_gives_too_much_for_long_is_stopped_and_braked(rig: Rig) -> None:
    rig.boot()
    rig.supervisor._protection._mean.squares[2] = 2.4**2 - 1e-3
    assert rig.state is State.HOLD
    for _ in range(50):
        rig.supervisor._protection._mean.squares[2] += 1e-3
        feel(rig)
    assert State.STOPPING not in rig.states, "at rest there is nothing to stop"
    assert rig.state is State.FAULT
    assert "let it cool" in rig.sentence


def test_a_motor_that_gives_too_much_in_motion_is_stopped_first(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, AWAY, 500))
    rig.run(200)
    rig.supervisor._protection._mean.squares[0] = 2.5**2
    rig.run(1)
    assert rig.state is State.STOPPING
    rig.run(300)
    assert rig.state is State.FAULT
    assert rig.supervisor.cause.cause is Cause.RMS_TORQUE


def push(rig: Rig, lift: float) -> None:
    """From here on the observer says that the tool is pushed so along z3 [N]; no tick is plain then."""

    def tell(*_: object) -> None:
        observer._memory[:3] = 0.0, 0.0, lift

    observer = rig.supervisor._observer
    observer.update = tell  # type: ignore[method-assign, assignment]
    rig.supervisor.plain.take = lambda _measurement: False  # type: ignore[method-assign]


def test_touch_ends_a_motion_in_the_tick_the_force_crosses_its_level(rig: Rig, line: Line) -> None:
    samples = line(HOME, AWAY, 500)
    samples["guard"], samples["guard_level"] = int(Guard.TOUCH), 3.0
    rig.boot().begin(samples)
    rig.run(100)
    assert rig.state is State.TRACK
    baseline = rig.supervisor.admission._guarding[1]
    push(rig, baseline - 2.99)
    rig.run(1)
    assert rig.state is State.TRACK
    push(rig, baseline - 3.01)
    rig.run(1)
    assert rig.supervisor.admission.ended.result is Result.TOUCHED
    assert rig.state is State.HOLD


def test_pressing_for_too_long_gives_way(rig: Rig) -> None:
    rig.boot()
    push(rig, -31.0)
    for _ in range(341):
        feel(rig)
    assert rig.state is State.HOLD
    feel(rig)
    assert rig.state is State.STOPPING
    assert rig.supervisor.cause.cause is Cause.PRESSING


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"status": DriveStatus.ENABLED | DriveStatus.FAULT}, Cause.DRIVE_FAULT),
        ({"status": DriveStatus.WATCHDOG | DriveStatus.BRAKED}, Cause.WATCHDOG),
        ({"status": DriveStatus.ENABLED | DriveStatus.OVERSPEED}, Cause.OVERSPEED),
        ({"angle": (math.nan, 0.0, 0.0)}, Cause.BAD_MEASUREMENT),
        ({"tactile": (math.nan, 0.0)}, Cause.BAD_MEASUREMENT),
        ({"angle": (3.0, -3.0, 0.0)}, Cause.MODEL),
    ],
)
@pytest.mark.parametrize("at", ["hold", "track", "stopping"])
def test_what_cannot_be_controlled_brakes_in_the_same_tick(
    rig: Rig, line: Line, change: dict[str, Any], cause: Cause, at: str
) -> None:
    rig.boot()
    if at != "hold":
        rig.begin(line(HOME, AWAY, 500))
        rig.run(200)
    if at == "stopping":
        rig.supervisor.machine.stop(STOP)
    healthy = rig.bus.exchange(rig.supervisor.command()._replace(busy=True))
    rig.supervisor.advance(healthy._replace(**change))
    assert rig.state is State.FAULT
    assert rig.supervisor.cause.cause is cause
    assert rig.supervisor.command() == Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
    assert rig.supervisor.admission.motion.announced is None
    if at == "track":
        assert (rig.supervisor.admission.ended.result, rig.supervisor.admission.ended.reason.cause) == (
            Result.STOPPED,
            cause,
        )


def test_a_torque_that_is_not_finite_brakes(fake_bus: Callable[..., Any]) -> None:
    class Wild(TaskSpaceController):
        wild = False

        def torque(self, reference: Any, tactile: Any = (0.0, 0.0)) -> Any:
            return (math.nan, 0.0, 0.0) if self.wild else super().torque(reference, tactile)

    law = Wild(DeltaModel(load_parameters()))
    rig = Rig(fake_bus(), law).boot()
    law.wild = True
    rig.supervisor.look_closer(rig.bus.exchange(rig.supervisor.command()._replace(busy=True)))
    assert rig.state is State.FAULT
    assert "the law gave a torque that is not finite" in rig.sentence


def test_a_torque_without_a_number_is_left_to_the_closer_look(fake_bus: Callable[..., Any]) -> None:
    law = TaskSpaceController(DeltaModel(load_parameters()))
    rig = Rig(fake_bus(), law).boot()
    rig.supervisor.reference.row[9] = math.nan
    rig.supervisor.advance(rig.bus.exchange(rig.supervisor.command()._replace(busy=True)))
    assert rig.state is not State.HOLD


def test_a_torque_beyond_the_peak_is_clamped_and_counted(rig: Rig, line: Line) -> None:
    rig.boot()
    rig.supervisor.reference.row[9:12] = 7e5
    rig.supervisor.reference.position[2] += 0.00199
    rig.supervisor.advance(rig.bus.exchange(rig.supervisor.command()._replace(busy=True)))
    assert rig.supervisor.clamped == 1
    assert max(map(abs, rig.supervisor.torque)) < 8.4
    for _ in range(2):
        rig.supervisor.advance(rig.bus.exchange(rig.supervisor.command()._replace(busy=True)))
    assert max(map(abs, rig.supervisor.torque)) == 8.4
    assert report(rig.supervisor, True, 0, 0, LoopStatistics(), [0] * 6).clamped == 3


def test_a_fault_is_cleared_and_enabled_by_two_commands(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, AWAY, 500))
    rig.run(200)
    rig.bus.status = DriveStatus.FAULT
    rig.run(400)
    rig.supervisor.obey(CommandCode.ENABLE)
    assert rig.state is State.FAULT
    rig.bus.status = DriveStatus.OK
    rig.supervisor.obey(CommandCode.CLEAR_FAULT)
    assert rig.state is State.BOOT
    assert not rig.supervisor.busy
    for _ in range(300):
        rig.supervisor.advance(rig.bus.exchange(rig.supervisor.command()._replace(busy=True)))
    assert rig.state is State.BOOT
    rig.supervisor.obey(CommandCode.ENABLE)
    rig.run(5)
    assert rig.state is State.HOLD
    here = tuple(rig.supervisor.law.state.position.tolist())
    assert rig.supervisor.reference.position == pytest.approx(here)
    rig.begin(line(tuple(rig.supervisor.reference.position.tolist()), AWAY, 500))
    rig.run(600)
    assert rig.supervisor.admission.ended.result is Result.DONE


# the end


def test_retiring_in_a_motion_stops_brakes_and_finishes(rig: Rig, line: Line) -> None:
    rig.boot().begin(line(HOME, AWAY, 500))
    rig.run(250)
    rig.supervisor.obey(CommandCode.SHUTDOWN)
    rig.announce(10)
    assert "the controller is shutting down" in rig.reason
    rig.run(400)
    assert rig.supervisor.brakes.finished
    assert not rig.supervisor.brakes.exhausted
    order = [state for state, before in zip(rig.states, [None, *rig.states], strict=False) if state is not before]
    assert order[-3:] == [State.TRACK, State.STOPPING, State.OFF]
    closing = [command for _, command in rig.bus.log if command.brake][3:]
    assert closing[0].enable
    assert not closing[-1].enable
    assert closing[0].torque != (0.0, 0.0, 0.0)


def test_retiring_at_rest_needs_no_new_tick_to_begin(rig: Rig) -> None:
    rig.boot().supervisor.machine.retire()
    assert rig.state is State.OFF
    assert rig.supervisor.command().busy
    rig.run(50)
    assert rig.supervisor.brakes.finished


@pytest.mark.parametrize("event", [Event.BRAKE, None])
def test_retiring_from_the_brakes(rig: Rig, event: Event | None) -> None:
    if event is None:
        rig.run(1)
    else:
        rig.boot().supervisor.machine.enter(event)
    rig.supervisor.machine.retire()
    rig.run(50)
    assert rig.supervisor.brakes.finished
    assert all(not command.enable for _, command in rig.bus.log[-40:])


def test_brakes_that_do_not_hold_are_told(rig: Rig) -> None:
    rig.boot().supervisor.machine.retire()
    rig.doctor = lambda measurement: measurement._replace(velocity=(0.3, 0.0, 0.0))
    rig.run(2400)
    assert rig.supervisor.brakes.finished
    assert rig.supervisor.brakes.exhausted
    assert "still moved at 0.300 rad/s after 2300 ticks on its brakes: check the brakes" in rig.sentence


@pytest.mark.parametrize(
    ("trouble", "words"),
    [
        (DriveTrouble.NO_REPLY, "servomotor 1 does not answer"),
        (DriveTrouble.WRONG_REPLY, "servomotor 1 sends answers that cannot be read"),
        (DriveTrouble.TOO_HOT, "still moved at 3.000 rad/s after 2300 ticks on its brakes: check the brakes"),
    ],
)
@pytest.mark.parametrize("lost", ["before", "meanwhile"])
def test_velocities_that_nobody_knows_are_not_blamed_on_the_brakes(
    rig: Rig, trouble: DriveTrouble, words: str, lost: str
) -> None:
    def turning(measurement: Measurement) -> Measurement:
        return measurement._replace(status=measurement.status | status_of(1, trouble), velocity=(3.0, 0.0, 0.0))

    rig.boot()
    if lost == "before":
        rig.doctor = turning
        rig.bus.push = np.array([0.0, 0.1, 0.0])  # next to nothing: plant time goes on
        rig.run(20)
        assert rig.state is State.FAULT
    rig.supervisor.machine.retire()
    rig.doctor = turning
    rig.run(2400)
    assert rig.supervisor.brakes.exhausted
    assert words in rig.sentence


# --------------------------------------------------------------------------------------------- parking and taking over


def test_a_parked_arm_waits_on_its_brakes_until_it_is_enabled(rig: Rig) -> None:
    rig.boot()
    rig.supervisor.machine.park(31.0)
    rig.run(200)
    assert rig.state is State.BOOT
    assert rig.bus.last.brake
    assert not rig.bus.last.enable
    assert not rig.supervisor.brakes.finished
    assert not rig.supervisor.busy, "plant time may stand"
    assert "no client was connected for 31.0 s" in rig.sentence
    rig.supervisor.obey(CommandCode.ENABLE)
    rig.run(10)
    assert rig.state is State.HOLD
    assert not rig.bus.last.brake


def test_an_arm_goes_on_holding_while_its_brakes_close_for_parking(rig: Rig) -> None:
    rig.boot()
    rig.supervisor.machine.park(31.0)
    rig.run(ControllerSettings().brake_ticks // 2)
    assert rig.state is State.OFF
    assert rig.bus.last.brake
    assert rig.bus.last.enable
    assert max(abs(torque) for torque in rig.bus.last.torque) > 0.5


def test_enabling_while_the_brakes_close_opens_them_as_soon_as_the_arm_is_parked(rig: Rig) -> None:
    rig.boot()
    rig.supervisor.machine.park(31.0)
    rig.run(3)
    rig.supervisor.obey(CommandCode.ENABLE)
    rig.run(200)
    assert rig.state is State.HOLD


def test_only_an_arm_that_holds_is_parked(rig: Rig, line: Line) -> None:
    rig.boot()
    samples = line(HOME, AWAY, 900)
    rig.announce(len(samples))
    rig.send(samples)
    rig.run(20)
    rig.supervisor.machine.park(31.0)
    assert rig.state is State.TRACK


@pytest.mark.parametrize("parked", [False, True])
def test_a_shutdown_ends_an_arm_that_is_parked_or_on_its_way(rig: Rig, parked: bool) -> None:
    rig.boot()
    rig.supervisor.machine.park(31.0)
    rig.run(200 if parked else 3)
    rig.supervisor.machine.retire()
    rig.run(200)
    assert rig.supervisor.brakes.finished
    assert rig.state is State.OFF


@pytest.mark.parametrize(("felt", "pressing"), [((4.0, 3.9), True), ((4.0, 0.1), False), ((0.0, 0.0), False)])
def test_a_controller_that_finds_a_piece_in_its_fingers_goes_on_gripping(
    rig: Rig, felt: tuple[float, float], pressing: bool
) -> None:
    rig.doctor = lambda measurement: measurement._replace(tactile=felt)
    rig.run(6)
    assert rig.state is State.HOLD
    assert (rig.bus.last.finger_velocity == -ControllerSettings().holding_speed) is pressing
    assert (rig.bus.last.finger_velocity == 0.0) is not pressing


def test_a_parked_gripper_does_not_close_on_what_touches_it(rig: Rig) -> None:
    rig.boot()
    rig.supervisor.machine.park(31.0)
    rig.run(200)
    rig.doctor = lambda measurement: measurement._replace(tactile=(2.0, 2.0))
    rig.run(20)
    assert rig.bus.last.finger_velocity == 0.0
    rig.supervisor.obey(CommandCode.ENABLE)
    rig.run(20)
    assert rig.state is State.HOLD
    assert rig.bus.last.finger_velocity == 0.0


def test_a_grip_that_is_lost_at_speed_stops_without_a_jump(rig: Rig, line: Line) -> None:
    samples = line(HOME, AWAY, 560)
    samples["guard"][280:], samples["guard_level"] = int(Guard.HELD), 1.0
    rig.boot().begin(samples)
    rig.run(600)
    assert rig.supervisor.cause.cause is Cause.GRIP_LOST
    assert rig.reference_jumps()[0] < 1e-6


@pytest.mark.parametrize("lost", [(0.0, 4.5), (4.5, 0.3), (0.0, 0.0)])
def test_an_arm_whose_fingers_lose_what_they_carry_stops_and_may_go_on(
    rig: Rig, line: Line, lost: tuple[float, float]
) -> None:
    samples = line(HOME, AWAY, 500)
    samples["guard"], samples["guard_level"] = int(Guard.HELD), 0.5
    rig.boot().begin(samples)
    for _ in range(150):
        feel(rig, tactile=(4.8, 4.7))
    for _ in range(4):  # shorter than it takes
        feel(rig, tactile=lost)
    feel(rig, tactile=(0.6, 0.6))
    assert rig.state is State.TRACK
    for _ in range(4):
        feel(rig, tactile=lost)
    assert rig.state is State.TRACK
    feel(rig, tactile=lost)
    assert rig.state is State.STOPPING
    assert rig.supervisor.cause.cause is Cause.GRIP_LOST
    assert rig.supervisor.admission.ended.result is Result.STOPPED
    rig.run(114)
    assert rig.state is State.HOLD
    reference = tuple(rig.supervisor.reference.position)
    rig.begin(line(reference, HOME, 400))  # type: ignore[arg-type]
    rig.run(300)
    assert rig.state is State.TRACK


def test_what_the_sensors_say_of_free_fingers_is_taken_off_what_they_say_of_held_ones(rig: Rig) -> None:
    """A sensor that reads 0.3 N when nothing touches it says nothing, once the fingers were free for a while."""
    rig.doctor = lambda m: m._replace(tactile=(m.tactile[0] + 0.3, m.tactile[1]))
    rig.boot()
    for tick in range(4, 600):
        measurement = rig.supervisor.measurement._replace(tick=tick, tactile=(0.3, 0.0))
        rig.supervisor.advance(measurement)
    assert rig.supervisor.measurement.tactile == (pytest.approx(0.0, abs=1e-9), 0.0)
    assert rig.state is State.HOLD
