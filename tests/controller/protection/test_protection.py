"""Protection that needs the ticks before: durations, means, encoders against each other."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from controller.protection.encoders import Encoders
from controller.protection.limits import REACTIONS, Limits, Reaction, axis_beyond, check_joints, default_limits
from controller.protection.monitor import MeanTorque, Overload, Protection
from controller.protocol.causes import Cause
from hardware.interfaces import DriveStatus, Measurement, Triple
from hardware.parameters import load_parameters
from hardware.table import TableSettings

PARAMETERS = load_parameters()
TICK = PARAMETERS.drive.tick
LIMITS = default_limits(PARAMETERS, TableSettings())
STILL = (0.0, 0.0, 0.0)


def measured(tick: int, angle: Triple, velocity: Triple = STILL) -> Measurement:
    return Measurement(tick, angle, velocity, 0.01, (0.0, 0.0), DriveStatus.ENABLED)


def test_an_overload_is_told_once_it_has_lasted_too_long_without_a_break() -> None:
    overload = Overload(10.0, ticks=3)
    assert [overload.lasts(value) for value in (11, 11, 11, 10, 11, 11, 11, 11, 11)] == [False] * 7 + [True] * 2
    overload.reset()
    assert not overload.lasts(11)


def run(encoders: Encoders, angle: Callable[[float], Triple], asked: Triple, ticks: int) -> Cause | None:
    """What is found while angles go their way, each velocity being the difference of two angles."""
    before = angle(0.0)
    for k in range(ticks):
        here = angle(k * TICK)
        velocity = tuple((a - b) / TICK for a, b in zip(here, before, strict=True))
        way = (asked[0] * k * TICK, asked[1] * k * TICK, asked[2] * k * TICK)
        found = encoders.check(measured(k, here, (velocity[0], velocity[1], velocity[2])), way, np.eye(3))
        before = here
        if found is not None:
            assert found.cause is Cause.ENCODER
            assert found.value == 2.0
            return found.cause
    return None


def test_an_encoder_that_stands_still_while_another_moves_as_asked_is_broken() -> None:
    asked = (1.0, 1.0, 0.5)
    assert run(Encoders(LIMITS, TICK), lambda t: (t, 0.3, 0.5 * t), asked, 1000) is Cause.ENCODER
    assert run(Encoders(LIMITS, TICK), lambda t: (t, t, 0.5 * t), asked, 1000) is None
    # any other one tells
    assert run(Encoders(LIMITS, TICK), lambda t: (t, 0.3, 0.0), (1.0, 1.0, 0.0), 1000) is Cause.ENCODER
    assert run(Encoders(LIMITS, TICK), lambda t: (0.0, 0.3, t), (0.0, 1.0, 1.0), 1000) is Cause.ENCODER
    # as fast as it gets, and well
    assert run(Encoders(LIMITS, TICK), lambda t: (10.0 * t, -10.0 * t, t), (10.0, -10.0, 1.0), 200) is None
    # blocked: none moves; not asked for: nothing to be seen
    assert run(Encoders(LIMITS, TICK), lambda t: (0.1, 0.2, 0.3), asked, 1000) is None
    assert run(Encoders(LIMITS, TICK), lambda t: (t, 0.3, 0.5 * t), (1.0, 0.0, 0.5), 1000) is None
    # pushed aside: the others move, but not as asked
    assert run(Encoders(LIMITS, TICK), lambda t: (-t, 0.3, 3.0 * t), asked, 1000) is None


def test_an_encoder_that_jumps_is_broken_but_not_after_a_pause() -> None:
    encoders = Encoders(LIMITS, TICK)
    assert encoders.check(measured(5, (0.0, 0.0, 0.0)), STILL, np.eye(3)) is None
    assert encoders.check(measured(6, (0.0, 0.009, 0.0)), STILL, np.eye(3)) is None
    found = encoders.check(measured(7, (0.0, 0.02, 0.0)), STILL, np.eye(3))
    assert found is not None
    assert (found.cause, found.value) == (Cause.ENCODER, 2.0)
    assert encoders.check(measured(9, (0.5, 0.5, 0.5)), STILL, np.eye(3)) is None  # ticks were skipped
    encoders.reset()
    assert encoders.check(measured(10, (0.0, 0.0, 0.0)), STILL, np.eye(3)) is None


def test_the_mean_torque_is_that_of_a_motor_that_cools() -> None:
    mean = MeanTorque(2.4, window=10.0, period=TICK)
    for k in range(round(10.0 / TICK)):
        assert mean.check((3.0 if k % 2 else -3.0, 0.0, 1.0)) is None or k * TICK > 9.0
    assert math.sqrt(mean.squares[0]) == pytest.approx(3.0 * math.sqrt(1.0 - math.exp(-1.0)), rel=1e-3)
    ticks = 0
    while (found := mean.check((3.0, 0.0, 1.0))) is None:
        ticks += 1
    # 3² (1 - e^(-t/10)) = 2.4² at t = 10.2 s
    assert 10.0 + ticks * TICK == pytest.approx(-10.0 * math.log(1.0 - 2.4**2 / 9.0), abs=0.01)
    assert found.cause is Cause.RMS_TORQUE
    for _ in range(3000):
        mean.check(STILL)
    assert mean.check(STILL) is None


def test_joints_are_checked_for_speed_and_range() -> None:
    middle = LIMITS.joint_middle
    assert check_joints(measured(0, middle, (13.9, -13.9, 0.0)), LIMITS) is None
    fast = check_joints(measured(0, middle, (0.0, 0.0, -14.1)), LIMITS)
    assert fast is not None
    assert (fast.cause, fast.value) == (Cause.JOINT_SPEED, 14.1)
    outside = check_joints(measured(0, (middle[0], middle[1] - 2.21, middle[2])), LIMITS)
    assert outside is not None
    assert outside.cause is Cause.JOINT_RANGE
    for bad in (measured(0, (math.nan, 0.0, 0.0)), measured(0, middle, (0.0, math.nan, 0.0))):
        assert check_joints(bad, LIMITS) is not None


@pytest.mark.parametrize(
    ("position", "velocity", "cause"),
    [
        ([0.0, 0.0, 0.4], [0.5, 0.5, 0.5], None),
        ([0.31, 0.0, 0.4], [0.0, 0.0, 0.0], None),
        ([0.34, 0.0, 0.4], [0.0, 0.0, 0.0], Cause.TOOL_OUTSIDE),
        ([0.0, -0.32, 0.4], [0.0, 0.0, 0.0], None),
        ([0.0, -0.34, 0.4], [0.0, 0.0, 0.0], Cause.TOOL_OUTSIDE),
        ([0.0, 0.0, 0.51], [0.0, 0.0, 0.0], Cause.TOOL_OUTSIDE),
        ([0.0, 0.0, 0.4], [1.0, 0.5, 0.5], Cause.TOOL_SPEED),
        ([0.0, math.nan, 0.4], [0.0, 0.0, 0.0], Cause.TOOL_OUTSIDE),
        ([0.0, 0.0, 0.4], [math.nan, 0.0, 0.0], Cause.TOOL_SPEED),
    ],
)
def test_the_tool_is_where_and_as_fast_as_it_may(
    position: list[float], velocity: list[float], cause: Cause | None
) -> None:
    found = Protection(LIMITS, TICK).tool(position, velocity, STILL)
    assert (found and found.cause) is cause


def test_pressing_and_gripping_may_not_last() -> None:
    protection = Protection(LIMITS, TICK)
    for _ in range(LIMITS.force_ticks):
        assert protection.tool([0.0, 0.0, 0.4], [0.0, 0.0, 0.0], (20.0, 20.0, -20.0)) is None
        assert protection.fingers((15.1, 39.0)) is None
    pressing = protection.tool([0.0, 0.0, 0.4], [0.0, 0.0, 0.0], (20.0, 20.0, -20.0))
    gripping = protection.fingers((15.1, 39.0))
    assert pressing is not None
    assert gripping is not None
    assert (pressing.cause, gripping.cause) == (Cause.PRESSING, Cause.GRIP_FORCE)
    assert pressing.value == pytest.approx(math.sqrt(1200.0))
    overload = Protection(LIMITS, TICK).fingers((0.0, 40.1))
    assert overload is not None
    assert overload.cause is Cause.TACTILE_OVERLOAD
    protection.reset()
    assert protection.fingers((15.1, 39.0)) is None


def test_one_finger_alone_does_not_grip() -> None:
    protection = Protection(LIMITS, TICK)
    assert all(protection.fingers((30.0, 1.0)) is None for _ in range(1000))


def test_the_worst_axis_says_how_far_outside() -> None:
    assert axis_beyond([0.0, 0.0, 0.35], LIMITS) == pytest.approx(-0.125)
    assert axis_beyond([0.31, -0.33, 0.35], LIMITS) == pytest.approx(0.03)


def test_every_cause_that_is_no_refusal_has_its_reaction() -> None:
    refusals = {cause for cause in Cause if cause.value < Cause.HOLD_COMMAND.value}
    assert set(REACTIONS) == set(Cause) - refusals
    assert Reaction.REFUSE not in REACTIONS.values()


def test_motors_are_watched_with_the_limits_given() -> None:
    limits: Limits = replace(LIMITS, rms_torque=0.5, rms_window=0.01)
    protection = Protection(limits, TICK)
    found = [protection.motors((1.0, 0.0, 0.0)) for _ in range(50)]
    assert found[0] is None
    assert found[-1] is not None
