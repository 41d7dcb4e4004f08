"""Motions that are played slower than they were planned, where nobody says that no person is near."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.law.settings import LawSettings
from controller.law.task_space import TaskSpaceController
from controller.loop.playback import CHANGE, LONGEST, Playback
from controller.loop.supervisor import Supervisor
from controller.loop.telemetry import report
from controller.model.constants import DeltaModel
from controller.model.demand import torque_demand
from controller.model.kinematics import OK
from controller.protection.limits import Violation, default_limits
from controller.protection.monitor import MeanTorque
from controller.protection.reference_check import rows_from_samples
from controller.protection.warm_servomotors import SLOWEST, WARM
from controller.protocol import Guard, MotionFlag, Result
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import DatagramKind
from controller.protocol.messages import AdmitSpeed, Announce, Samples
from controller.protocol.states import State
from controller.records.loop_statistics import LoopStatistics
from controller.settings import ControllerSettings
from hardware.contact_speeds import CONTACT_PROFILES
from hardware.parameters import load_parameters
from hardware.table import TableSettings

TABLE = TableSettings(limits=CONTACT_PROFILES["separation"])
LIMITS = default_limits(load_parameters(), TABLE)
FAST = TableSettings(limits=CONTACT_PROFILES["fast"])
RUBBING, PERIOD = LawSettings().coulomb_speed, load_parameters().drive.tick
HOME, NEAR, FAR = (0.0, 0.0, 0.35), (-0.20, 0.0, 0.35), (0.20, 0.0, 0.35)
TICKS = 284
"""The minimum-jerk line of 0.2 m is as fast as 1.5 m/s then, with 18 m/s² at most."""
EVERYWHERE = (0.0, 0.0, 0.0, 1.0) * 4
"""Borders that nothing is beyond."""


class Arm:
    """A supervisor on a bus of its own; each tick its reference is kept."""

    def __init__(self, bus: Any) -> None:
        self.bus, self.period = bus, bus.period
        law = TaskSpaceController(DeltaModel(load_parameters()))
        self.supervisor = Supervisor(law, LIMITS, ControllerSettings(), bus.period, bus.lockstep)
        self.tick(4)

    def tick(self, count: int = 1) -> None:
        for _ in range(count):
            self.supervisor.advance(self.bus.exchange(self.supervisor.command()))

    def begin(self, samples: NDArray[Any]) -> None:
        """Announce a motion and send all of it."""
        supervisor = self.supervisor
        motion = supervisor.admission.last_motion + 1
        supervisor.announce(Announce(motion, supervisor.measurement.tick + 2, len(samples), MotionFlag.NONE))
        for at in range(0, len(samples), 10):
            supervisor.take_samples(Samples(motion, at, samples[at : at + 10]))

    def play(self, samples: NDArray[Any], admit: Callable[[int], AdmitSpeed | None]) -> NDArray[np.float64]:
        """A whole motion: the references of its ticks, shape (n, 16). ``admit`` is asked before each tick."""
        supervisor = self.supervisor
        self.begin(samples)
        rows = list[NDArray[np.float64]]()
        while supervisor.admission.motion.announced is not None:
            admitted = admit(len(rows))
            if admitted is not None:
                supervisor.admission.playback.admit(admitted, supervisor.measurement.tick)
            self.tick()
            rows.append(supervisor.reference.row.copy())
        assert supervisor.admission.ended.result is Result.DONE
        assert supervisor.state is State.HOLD
        return np.array(rows)

    def tick_now(self) -> int:
        return self.supervisor.measurement.tick

    def soon(self, share: float = 1.0) -> int:
        """The last tick that may be admitted, or a part of the way there."""
        return self.supervisor.measurement.tick + int(share * LONGEST / self.period)


@pytest.fixture
def arm(fake_bus: Callable[..., Any]) -> Arm:
    return Arm(fake_bus())


def nobody_looks(_: int) -> None:
    return None


def speeds(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths: NDArray[np.float64] = np.linalg.norm(rows[:, 3:6], axis=1)
    return lengths


def test_where_nobody_is_near_all_the_time_a_motion_is_as_planned_to_the_last_bit(arm: Arm, line: Any) -> None:
    samples = line(HOME, FAR, TICKS)
    rows = arm.play(samples, lambda _: AdmitSpeed(1.6, arm.soon(), EVERYWHERE))
    assert speeds(rows).max() > 1.3
    planned = np.array([np.concatenate([s["position"], s["velocity"], s["acceleration"]]) for s in samples])
    assert np.array_equal(rows[-len(samples) :, :6], planned[:, :6])
    assert arm.supervisor.admission.ended.end_tick - arm.supervisor.admission.ended.first_tick == len(samples) - 1


def test_where_nobody_looks_the_tool_is_no_faster_than_near_people_and_stays_on_its_way(arm: Arm, line: Any) -> None:
    rows = arm.play(line(HOME, FAR, TICKS), nobody_looks)
    assert LIMITS.shared_speed * 0.98 < speeds(rows).max() <= LIMITS.shared_speed * (1.0 + 1e-9)
    assert np.abs(rows[:, 1:3] - np.array(HOME)[1:]).max() < 1e-9
    assert np.diff(rows[:, 0]).min() >= 0.0
    assert np.allclose(rows[-1, :3], FAR, atol=1e-12)
    # what is called velocity is what the positions do
    steps = np.diff(rows[:, :3], axis=0) - 0.5 * arm.period * (rows[1:, 3:6] + rows[:-1, 3:6])
    assert np.abs(steps).max() < LIMITS.position_step


@pytest.mark.parametrize("when", range(40, 200, 13))
def test_an_admission_that_lapses_slows_the_tool_down_at_a_bounded_rate(arm: Arm, line: Any, when: int) -> None:
    rows = arm.play(
        line(HOME, FAR, TICKS), lambda k: AdmitSpeed(1.6, arm.tick_now() + 1, EVERYWHERE) if k <= when else None
    )
    speed, lapsed = speeds(rows), when + 1
    ramp = math.ceil((1.5 - LIMITS.shared_speed) / CHANGE / arm.period) + 2
    assert speed[lapsed + ramp :].max() <= LIMITS.shared_speed * (1.0 + 1e-9)
    assert np.abs(np.diff(speed)).max() <= (CHANGE + 1.0) * arm.period
    assert np.allclose(rows[-1, :3], FAR, atol=1e-12)


def test_an_admission_for_ever_lasts_a_quarter_of_a_second(arm: Arm, line: Any) -> None:
    arm.play(line(HOME, NEAR, TICKS), nobody_looks)
    late = round(LONGEST / arm.period)
    rows = arm.play(line(NEAR, FAR, 2 * TICKS), lambda k: AdmitSpeed(1.6, 2**60, EVERYWHERE) if k == 0 else None)
    assert speeds(rows[:late]).max() > 1.3
    assert speeds(rows[late + 40 :]).max() <= LIMITS.shared_speed * (1.0 + 1e-9)


def test_beyond_a_border_the_tool_is_slow(arm: Arm, line: Any) -> None:
    border = 0.08
    rows = arm.play(
        line(HOME, FAR, TICKS), lambda _: AdmitSpeed(1.6, arm.soon(), (-1.0, 0.0, 0.0, border, *EVERYWHERE[4:]))
    )
    braking = (1.5**2 - LIMITS.shared_speed**2) / (2.0 * CHANGE)
    beyond = rows[:, 0] > border + braking + 0.004
    assert speeds(rows[~beyond]).max() > 1.1
    assert speeds(rows[beyond]).max() <= LIMITS.shared_speed * (1.0 + 1e-9)


@pytest.mark.parametrize("heat", [0.93, 0.96, 0.99])
@pytest.mark.parametrize("admitted", [False, True], ids=["near people", "nobody near"])
def test_warm_servomotors_are_spared_and_the_tool_stays_on_its_way(
    arm: Arm, line: Any, heat: float, admitted: bool
) -> None:
    squares, rates = arm.supervisor._protection._screen.squares, list[float]()

    def as_warm_as_ever(_: int) -> AdmitSpeed | None:
        squares[:] = heat * LIMITS.rms_torque**2
        rates.append(arm.supervisor.admission.playback.rate)
        return AdmitSpeed(1.6, arm.soon(), EVERYWHERE) if admitted else None

    def told() -> bool:
        return report(arm.supervisor, True, 0, 0, LoopStatistics(), [0] * 6).warm

    assert not told()
    samples = line(HOME, FAR, TICKS)
    rows = arm.play(samples, as_warm_as_ever)
    assert told()
    pace = max(SLOWEST, (1.0 - heat) / (1.0 - WARM))
    assert np.array(rates[5:]).max() <= pace + 1e-9
    assert np.abs(rows[:, 6]).max() <= 1.01 * max(pace**2 * samples["acceleration"].max(), CHANGE * (not admitted))
    if admitted:
        assert len(rows) == pytest.approx(TICKS / pace, rel=0.02)
    steps = np.diff(rows[:, :3], axis=0) - 0.5 * arm.period * (rows[1:, 3:6] + rows[:-1, 3:6])
    assert np.abs(steps).max() < LIMITS.position_step
    assert np.abs(rows[:, 1:3] - np.array(HOME)[1:]).max() < 1e-9
    assert np.allclose(rows[-1, :3], FAR, atol=1e-12)


@pytest.mark.parametrize("heavier", [1.3, 1.5])
def test_an_arm_that_never_rests_is_slowed_down_before_its_servomotors_are_stopped(line: Any, heavier: float) -> None:
    """As fast as it can, there and back for 25 s; each torque is so many times what the model says."""
    rings = [rows_from_samples(line(*ends, TICKS)) for ends in ((HOME, FAR), (FAR, HOME))]
    untamed, _, planned = _never_resting(rings, heavier, spared=False)
    assert max(untamed) > 1.0, "it would be stopped"
    heats, motions, torque = _never_resting(rings, heavier, spared=True)
    assert WARM < max(heats) < 1.0
    assert torque < 1.02 * planned, "nor is slowing down harder than what was planned"
    assert motions * TICKS * PERIOD > 12.0, "and goes on at half its speed at least"


def _never_resting(rings: list[NDArray[np.float64]], heavier: float, *, spared: bool) -> tuple[list[float], int, float]:
    """How warm it is in each tick of 25 s, how many motions these are, and the largest torque [N m]."""
    model = DeltaModel(load_parameters())
    playback = Playback(default_limits(load_parameters(), FAST), PERIOD)
    mean = MeanTorque(math.inf, LIMITS.rms_window, PERIOD)
    row, tail, heats, motions, most = np.zeros(16), np.zeros(3), list[float](), 0, 0.0
    while len(heats) * PERIOD < 25.0:
        ring, executed = rings[motions % 2], 0
        playback.begin()
        announced = Announce(motions, len(heats), len(ring), MotionFlag.NONE)
        while executed < len(ring):
            heats.append(float(mean.squares.max()) / LIMITS.rms_torque**2)
            executed = playback.advance(announced, len(heats) - 1, row, ring, heats[-1] if spared else 0.0)
            playback.follow(ring, row, tail)
            status, _, torque, _ = torque_demand(model.constants, RUBBING, row[None, :9].copy())
            assert status == OK
            mean.check(tuple(heavier * torque[0]))
            most = max(most, heavier * float(np.abs(torque).max()))
        motions += 1
    return heats, motions, most


def test_on_the_brakes_servomotors_cool(arm: Arm) -> None:
    squares = arm.supervisor._protection._screen.squares
    squares[:] = 0.95 * LIMITS.rms_torque**2
    arm.supervisor.machine.brake(Violation(Cause.MODEL, 1.0, 0.0))
    before = squares.copy()
    arm.tick(500)
    assert arm.supervisor.machine.braked
    assert squares == pytest.approx(math.exp(-500 * PERIOD / LIMITS.rms_window) * before, rel=1e-6)


@pytest.mark.parametrize("heat", [0.0, 0.96])
def test_the_fingers_move_as_far_as_planned_and_hold_as_firmly(arm: Arm, line: Any, heat: float) -> None:
    """Near people, and where servomotors are warm as well."""
    supervisor = arm.supervisor
    squares = supervisor._protection._screen.squares

    def ticks(count: int = 1) -> None:
        squares[:] = heat * LIMITS.rms_torque**2
        arm.tick(count)

    for start, end, velocity in ((HOME, FAR, 0.02), (FAR, HOME, -0.02)):
        ways, way = line(start, end, TICKS), 0.0
        ways["finger_velocity"] = velocity
        arm.begin(ways)
        while supervisor.admission.motion.announced is not None:
            ticks()
            way += supervisor.reference.finger_velocity * arm.period
        assert way == pytest.approx(velocity * TICKS * arm.period, rel=0.03)
    holding = line(HOME, FAR, TICKS)
    holding["finger_velocity"], holding["guard"], holding["guard_level"] = -0.03, Guard.HELD, -1.0
    arm.begin(holding)
    ticks(3)
    while supervisor.admission.motion.announced is not None:
        assert supervisor.reference.finger_velocity == pytest.approx(-0.03)
        ticks()


@pytest.mark.parametrize("speed", [math.nan, math.inf, -1.0])
def test_what_cannot_be_meant_is_no_admission(speed: float) -> None:
    assert AdmitSpeed.unpack(AdmitSpeed(speed, 5, EVERYWHERE).pack()) is None
    assert AdmitSpeed.unpack(AdmitSpeed(1.0, 5, (math.nan, *EVERYWHERE[1:])).pack()) is None
    assert AdmitSpeed.unpack(AdmitSpeed(1.0, 5, EVERYWHERE).pack()) == AdmitSpeed(1.0, 5, EVERYWHERE)


def test_over_udp_speed_is_admitted_by_the_client_alone_and_nonsense_is_counted(launch: Any, line: Any) -> None:
    client = launch(limits=LIMITS).client()
    client.connect()
    slow = client.execute(line(HOME, FAR, TICKS)).duration
    client.execute(line(FAR, HOME, TICKS))
    now = client.wait_standing().tick * client.period
    client.admit_speed(1.6, now + LONGEST, EVERYWHERE)
    fast = client.execute(line(HOME, FAR, TICKS)).duration
    planned = (TICKS - 1) * client.period
    assert planned <= fast < slow - 0.02
    before = client.telemetry.bad_content
    client._connected.send(DatagramKind.ADMIT_SPEED, AdmitSpeed(math.nan, 5, EVERYWHERE).pack())
    client.execute(line(FAR, HOME, TICKS))
    assert client.telemetry.bad_content == before + 1
