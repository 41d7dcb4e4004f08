"""What every servo bus has to do, whatever is behind it: one suite of laws over all of them.

Simulated drives in either pace and in the thread of their controller are the reference; moteus and EtherCAT drives are
their real drivers before emulated devices. All move the same arm.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from hardware.interfaces import BusLost, Command, DriveStatus, DriveTrouble, Measurement, Pace, fault_of
from hardware.sim.process.server import World
from tests.hardware.bus_benches import (
    ALL_KINDS,
    DRIVES,
    ENDED,
    FREE,
    LOCKSTEP,
    POWERED,
    REST,
    ROBOT,
    Bench,
    world_settings,
)

PERIOD = DRIVES.period
PEAK = ROBOT.drive.peak_torque
SECOND = round(1.0 / PERIOD)
SEQUENCE = 120
"""Exchanges of a sequence of torques."""
ANGLE, VELOCITY = 0.01, 0.25
"""How far two buses may be apart after the same torques [rad, rad/s]: two ticks at 5 rad/s, and two of 4 N m."""
AT_REST = 0.01
"""Velocity of a joint on its brakes [rad/s]."""
BRAKING = 0.5
"""Within which an arm that was let go is at rest on its brakes [s]."""


KINDS = [kind if kind in LOCKSTEP else pytest.param(kind, marks=pytest.mark.real_time) for kind in ALL_KINDS]


@pytest.fixture(scope="module", params=KINDS)
def bench(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    one = Bench(request.param, lambda: tmp_path_factory.mktemp("bus"))
    yield one
    if one.is_open:
        one.bus.close()
    one.forget()


def torques(one: float, two: float, three: float) -> Command:
    return FREE._replace(torque=(one, two, three))


def is_sound(said: Measurement) -> bool:
    numbers = (*said.angle, *said.velocity, said.finger_position, *said.tactile)
    kinds = all(type(number) is float for number in numbers) and type(said.tick) is int
    return kinds and isinstance(said.status, DriveStatus) and all(map(math.isfinite, numbers))


# ---------------------------------------------------------------------------------------------------------------- time


def test_it_says_its_period_and_whether_time_waits(bench: Bench) -> None:
    assert bench.bus.period == PERIOD
    assert bench.bus.lockstep == (bench.kind in LOCKSTEP)


def test_measurements_are_sound_and_ticks_go_on(bench: Bench) -> None:
    def law() -> None:
        said = bench.run(POWERED, 300)
        assert all(map(is_sound, said))
        for before, after in itertools.pairwise(said):
            stood = after.tick == before.tick
            assert after.tick >= before.tick
            assert stood == bool(after.status & DriveStatus.STANDING), "only a plant that stands repeats a tick"
            assert not (stood and not bench.bus.lockstep)
        if bench.bus.lockstep:
            assert max(np.diff([one.tick for one in said])) == 1

    bench.calmly(law)


# -------------------------------------------------------------------------------------------------------------- brakes


def test_at_the_start_it_stands_on_its_brakes(bench: Bench) -> None:
    if bench.is_open:
        bench.bus.close()
        bench.forget()
    said = bench.bus.exchange(REST)
    assert said.status & ~DriveStatus.STANDING == DriveStatus.BRAKED
    assert max(map(abs, said.velocity)) < AT_REST


def test_disabled_drives_stand_on_their_brakes(bench: Bench) -> None:
    def law() -> None:
        bench.rest()
        before = bench.exchange(REST)
        said = bench.run(REST._replace(torque=(2.0, -2.0, 2.0)), 200)[-1]
        assert said.status & ~DriveStatus.STANDING == DriveStatus.BRAKED
        assert said.angle == pytest.approx(before.angle, abs=1e-3)

    bench.calmly(law)


def test_enabled_and_released_they_follow(bench: Bench) -> None:
    def law() -> None:
        bench.rest()
        held = torques(-1.1, -1.1, -1.1)
        bench.until(held, lambda said: said.status == DriveStatus.ENABLED, 2 * SECOND)

    bench.calmly(law)


def test_let_go_they_brake_within_the_stated_time(bench: Bench) -> None:
    for ended in (POWERED, REST._replace(busy=True)):

        def law(ended: Command = ended) -> None:
            moved = bench.run_for(torques(2.0, 2.0, 2.0), 40)[-1]
            assert min(moved.velocity) > 0.5
            said = bench.run(ended, 5)[-1]
            assert said.status & DriveStatus.BRAKED
            assert bool(said.status & DriveStatus.ENABLED) == ended.enable
            said = bench.run(ended, round(BRAKING / PERIOD))[-1]
            assert max(map(abs, said.velocity)) < AT_REST

        bench.calmly(law)


# ------------------------------------------------------------------------------------------------------------- torques


@pytest.mark.parametrize("joint", range(3))
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_torque_accelerates_its_joint_its_way(bench: Bench, joint: int, sign: int) -> None:
    def law() -> None:
        hold = [-1.1, -1.1, -1.1]
        hold[joint] += 2.0 * sign
        before = bench.exchange(POWERED)
        said = bench.run_for(torques(*hold), 30)[-1]
        seen = f"{before}, {said}, {bench.told}"
        assert sign * (said.velocity[joint] - before.velocity[joint]) > 0.3, seen
        assert sign * (said.angle[joint] - before.angle[joint]) > 0.003, seen

    bench.calmly(law)


def replayed(folder: Path, commands: Sequence[Command], said: Sequence[Measurement]) -> list[Measurement]:
    """What the plant alone measures under commands that acted for as long as they did on a bus."""
    world = World(folder, world_settings(folder, Pace.FAST))
    plant = world.plant
    with world.open():
        for _ in range(10):
            plant.apply(POWERED)
            plant.step()
        measured = [plant.measure(standing=False)]
        for command, (before, after) in zip(commands, itertools.pairwise(said), strict=False):
            plant.apply(command)
            for _ in range(after.tick - before.tick):
                plant.step()
            measured.append(plant.measure(standing=False))
    return measured


def wave(k: int) -> Command:
    """Torques that keep the arm about where it is, and shake it."""
    one, two, three = (-1.1 + 0.8 * math.sin(math.tau * (k / SEQUENCE + phase / 3.0)) for phase in range(3))
    return torques(one, two, three)


def assert_alike(said: Sequence[Measurement], plain: Sequence[Measurement]) -> None:
    moved = np.array([one.angle for one in said]) - said[0].angle
    expected = np.array([one.angle for one in plain]) - plain[0].angle
    assert np.abs(expected).max() > 0.05, "it moved"
    assert np.abs(moved - expected).max() < ANGLE
    off = np.array([one.velocity for one in said]) - np.array([one.velocity for one in plain])
    assert np.abs(off).max() < VELOCITY


def test_the_same_torques_have_the_same_effect(bench: Bench, tmp_path: Path) -> None:
    commands = [wave(k) for k in range(SEQUENCE)]

    def law() -> list[Measurement]:
        return [bench.exchange(command) for command in commands]

    said = bench.calmly(law)
    assert_alike(said, replayed(tmp_path, commands, said))


def test_a_torque_beyond_the_peak_is_cut_and_told(bench: Bench, tmp_path: Path) -> None:
    beyond, peak = (torques(-share * PEAK, -1.1, -1.1) for share in (3.0, 1.0))

    def law() -> list[Measurement]:
        assert not bench.run(POWERED, 5)[-1].status & DriveStatus.SATURATED
        said = bench.run(beyond, 15)
        assert said[5].status & DriveStatus.SATURATED
        after = bench.run(POWERED, 5)[-1]
        assert not after.status & DriveStatus.SATURATED
        return said

    said = bench.calmly(law)
    plain = replayed(tmp_path, [peak] * len(said), said)
    fastest = max(abs(one.velocity[0]) for one in plain)
    assert fastest > 2.0
    assert max(abs(one.velocity[0]) for one in said) == pytest.approx(fastest, rel=0.25)


@pytest.mark.parametrize(
    "command",
    [torques(0.0, math.nan, 0.0), torques(math.inf, 0.0, 0.0), torques(0.0, 0.0, -math.inf)]
    + [POWERED._replace(finger_velocity=wrong) for wrong in (math.nan, math.inf)],
)
def test_what_is_no_number_brakes_and_is_a_fault_until_disabled(bench: Bench, command: Command) -> None:
    def law() -> None:
        bench.exchange(command)
        for said in bench.run(FREE, 50)[3:]:
            assert said.status & DriveStatus.FAULT
            assert said.status & DriveStatus.BRAKED
            assert not said.status & DriveStatus.ENABLED
            assert fault_of(said.status)[1] in (DriveTrouble.NOT_FINITE, DriveTrouble.UNSPECIFIED)
        assert not bench.run(REST._replace(busy=True), 20)[-1].status & ENDED
        bench.until(POWERED, lambda said: said.status & DriveStatus.ENABLED)

    bench.calmly(law)


# ------------------------------------------------------------------------------------------------------------- silence


def test_silence_longer_than_the_watchdog_brakes_until_disabled(bench: Bench) -> None:
    if bench.bus.lockstep:
        pytest.skip("its time waits")
    for spoken in (torques(-1.1, -1.1, -1.1), POWERED):

        def law(spoken: Command = spoken) -> None:
            bench.run(spoken, 20)
            time.sleep(10.0 * DRIVES.watchdog)
            for _ in range(20):
                said = bench.bus.exchange(spoken)
            assert said.status == DriveStatus.WATCHDOG | DriveStatus.BRAKED
            assert max(map(abs, said.velocity)) < AT_REST
            said = [bench.bus.exchange(REST) for _ in range(200)][-1]
            assert said.status == DriveStatus.BRAKED
            bench.until(POWERED, lambda said: said.status & DriveStatus.ENABLED)

        bench.calmly(law)


# --------------------------------------------------------------------------------------------------------- the gripper


def test_the_fingers_follow_their_velocity_and_stop_at_the_stroke(bench: Bench) -> None:
    stroke = ROBOT.gripper.stroke

    def law() -> None:
        bench.run(POWERED._replace(finger_velocity=-0.03), SECOND)
        before = bench.run(POWERED, 50)[-1]
        bench.run_for(POWERED._replace(finger_velocity=0.03), 100)
        said = bench.run_for(POWERED._replace(finger_velocity=0.03), 200)
        passed = (said[-1].tick - said[0].tick) * PERIOD
        assert said[-1].finger_position - said[0].finger_position == pytest.approx(0.03 * passed, rel=0.1)
        still = bench.run(POWERED, 100)
        assert still[-1].finger_position == pytest.approx(still[50].finger_position, abs=2e-4)
        said = bench.run(POWERED._replace(finger_velocity=0.03), SECOND)
        assert said[-1].finger_position == pytest.approx(stroke, abs=5e-4)
        assert before.finger_position < stroke - 0.005

    bench.calmly(law)


def test_a_gripper_of_drives_with_a_fault_closes_but_opens_no_further(bench: Bench) -> None:
    def law() -> None:
        bench.run(POWERED._replace(finger_velocity=-0.03), SECOND)
        bench.run(POWERED._replace(finger_velocity=0.03), 300)
        before = bench.run(POWERED, 100)[-1]
        bench.exchange(torques(math.nan, 0.0, 0.0))
        said = bench.run(POWERED._replace(finger_velocity=0.03), 200)[-1]
        assert said.status & DriveStatus.FAULT
        assert said.finger_position == pytest.approx(before.finger_position, abs=3e-4)
        said = bench.run(POWERED._replace(finger_velocity=-0.03), 200)[-1]
        assert said.finger_position < before.finger_position - 0.003

    bench.calmly(law)


# ------------------------------------------------------------------------------------------------------------- the end


def test_after_close_it_is_lost_and_a_second_close_does_nothing(bench: Bench) -> None:
    bus = bench.bus
    bus.close()
    bus.close()
    with pytest.raises(BusLost):
        bus.exchange(REST)
    bench.forget()
