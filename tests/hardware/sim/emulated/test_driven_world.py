"""A world whose drives are emulated devices in its own thread: pacing, scales, life and death."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from hardware.drives.clock import tick_now
from hardware.drives.settings import DriveSettings, FingerSettings, ForceSettings, JointSettings
from hardware.interfaces import HardwareError, Pace
from hardware.sim.emulated.pacing import LONGEST_DELAY, FollowingPacer
from hardware.sim.emulated.plant_drives import DrivenWorld, MotorCommand, MotorState, driven_world_of
from hardware.sim.plant.snapshot import STATE_FILE
from hardware.sim.process.settings import WorldSettings, keep_settings

PERIOD = 0.001
HOME = (0.0, 0.075, 0.325)
REST = MotorCommand((0.0, 0.0, 0.0), 0.0, braked=True, powered=False)


class Silent:
    """Devices that nobody commands."""

    numbers = ()
    complete = False
    heard = 0.0
    times = None

    def __init__(self) -> None:
        self.states: list[MotorState] = []
        self.lags: list[int] = []  # of each state behind this computer's clock, in ticks
        self.command = REST

    def hear(self) -> None:
        raise AssertionError("nobody speaks")

    def act(self, now: float) -> MotorCommand:
        return self.command

    def sense(self, state: MotorState) -> None:
        self.states.append(state)
        self.lags.append(tick_now(PERIOD) - state.tick)

    def close(self) -> None:
        pass


def settings(drives: DriveSettings | None = None, **also: object) -> WorldSettings:
    return WorldSettings.model_validate(
        {"pieces": (), "home": HOME, "pace": Pace.REAL, "cameras": False, "drives": drives or DriveSettings(), **also}
    )


def test_scales_are_applied_the_other_way_round(tmp_path: Path) -> None:
    joints = (JointSettings(ratio=6.0, sign=-1, offset=0.2), JointSettings(offset=-0.1), JointSettings(ratio=2.0))
    drives = DriveSettings(joints=joints, finger=FingerSettings(travel=0.005, position_offset=0.001))
    plain, geared = Silent(), Silent()
    with DrivenWorld(tmp_path, settings(), plain).open():
        pass
    (tmp_path / STATE_FILE).unlink()
    world = DrivenWorld(tmp_path, settings(drives), geared)
    said, other = plain.states[-1], geared.states[-1]
    assert other.angle[0] == pytest.approx(-6.0 * (said.angle[0] - 0.2))
    assert other.angle[1:] == pytest.approx((said.angle[1] + 0.1, 2.0 * said.angle[2]))
    assert other.gripper_angle == pytest.approx((0.004 * said.gripper_angle - 0.001) / 0.005)
    # the motor that turns against its joint lifts it with a positive torque
    with world.open():
        for _ in range(30):
            world.drive(MotorCommand((0.5, 0.0, 0.0), 0.0, braked=False, powered=True))
        assert world.state().velocity[0] > 1.0
        assert world.plant.measure(standing=False).velocity[0] < 0.0


def test_force_sensors_read_in_their_own_unit(tmp_path: Path) -> None:
    forces = (ForceSettings(gain=10.0, zero=0.25), ForceSettings(gain=-10.0, zero=0.75))
    devices = Silent()
    with DrivenWorld(tmp_path, settings(DriveSettings(forces=forces)), devices).open():
        pass
    assert devices.states[-1].readings == pytest.approx((0.25, 0.75), abs=1e-6)


def test_ticks_count_from_this_computers_clock_and_go_with_it(tmp_path: Path) -> None:
    devices = Silent()
    world = DrivenWorld(tmp_path, settings(first_controller=0.5), devices)
    world.run()  # nobody comes, so it ends
    assert world.plant.tick > devices.states[0].tick
    later = devices.lags[len(devices.lags) // 2 :]
    assert min(later) <= devices.lags[1] + 2, "it catches up with the clock, however long it was held up"
    assert abs(devices.states[0].tick - tick_now(PERIOD)) * PERIOD < 60.0
    assert (tmp_path / "world_end.json").exists()
    assert all(math.isfinite(one) for one in devices.states[-1].angle)


def test_a_world_in_pace_fast_has_no_bus(tmp_path: Path) -> None:
    keep_settings(settings(pace=Pace.FAST), tmp_path)
    with pytest.raises(HardwareError, match="emulated drives need pace real"):
        driven_world_of(tmp_path, Silent())


# -------------------------------------------------------------------------------------------------------------- pacing


def test_one_tick_for_each_command_in_spite_of_jitter() -> None:
    import random

    rng, now = random.Random(3), 100.0
    pacer, ticks_between = FollowingPacer(PERIOD, now), []
    for k in range(1, 3000):
        command = 100.0003 + k * PERIOD + rng.uniform(-0.25, 0.25) * PERIOD
        ticks = 0
        while pacer.window[1] <= command:  # it does not wait for this one
            pacer.ran(pacer.window[1], commanded=False)
            ticks += 1
        pacer.ran(max(command, pacer.window[0]), commanded=True)
        ticks_between.append(ticks)
    assert sum(ticks_between[100:]) == 0, "once it has found the rhythm"


def test_delays_are_made_up_for_but_not_for_ever() -> None:
    pacer = FollowingPacer(PERIOD, 0.0)
    now, ticks = 3.0, 0
    while pacer.window[1] <= now:
        pacer.ran(now, commanded=False)
        ticks += 1
    assert ticks == pytest.approx(3000, abs=2)
    assert pacer.slipped == 0
    now += LONGEST_DELAY + 20.0
    pacer.ran(now, commanded=False)
    assert pacer.slipped == pytest.approx((LONGEST_DELAY + 20.0) / PERIOD, abs=3)
    assert pacer.window[1] >= now - 2.0 * PERIOD


def test_ticks_of_drivers_are_those_of_the_clock() -> None:
    assert abs(tick_now(PERIOD) * PERIOD - time.monotonic()) < 5.0
