"""The quick look says yes exactly where none of the checks that explain themselves has anything to say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from controller.model.state import POSITION, VELOCITY, blank_state
from controller.protection.encoders import ENCODERS_SIZE, Encoders, watch_encoders
from controller.protection.limits import check_joints, check_tracking, default_limits
from controller.protection.monitor import MeanTorque, Protection
from controller.protection.screening import _SQUARES, Screen, arm_well, joints_well
from hardware.interfaces import DriveStatus, Measurement
from hardware.parameters import load_parameters
from hardware.table import TableSettings

PARAMETERS = load_parameters()
TICK = PARAMETERS.drive.tick
LIMITS = replace(default_limits(PARAMETERS, TableSettings()), force_ticks=0)
"""What may be exceeded for a while is told at once."""


ZERO = (0.0, 0.0, 0.0)


def around(*limits: float) -> st.SearchStrategy[float]:
    """Numbers near limits, on them, and anywhere; also none."""
    near = [st.sampled_from([limit, math.nextafter(limit, math.inf), math.nextafter(limit, -math.inf), 0.99 * limit,
                             1.01 * limit, -limit]) for limit in limits]  # fmt: skip
    return st.one_of(*near, st.floats(-1.2 * max(limits), 1.2 * max(limits)), st.just(0.0), st.just(math.nan))


def triple(*limits: float) -> st.SearchStrategy[tuple[float, float, float]]:
    one = around(*limits)
    return st.tuples(one, one, one)


@given(
    offset=triple(0.15, 0.155, 0.33, 0.29),
    error=triple(0.002, 0.015, 0.0024489),
    stiffness=st.sampled_from([0.0, 400.0, 4900.0, 14400.0]),
    velocity=triple(LIMITS.tool_speed, 0.5),
    force=triple(LIMITS.press_force, 10.0),
    tactile=st.tuples(around(LIMITS.tactile, LIMITS.grip_force, 5.0), around(LIMITS.grip_force, 5.0)),
    torque=triple(8.4, 2.4),
    warmth=st.sampled_from([0.0, 2.4**2 - 1e-3, 2.4**2]),
)
@example(ZERO, ZERO, 4900.0, ZERO, ZERO, (0.0, 0.0), (1.0, 1.0, 1.0), 0.0)
@example(ZERO, ZERO, 4900.0, ZERO, ZERO, (math.nextafter(LIMITS.tactile, math.inf), 0.0), ZERO, 0.0)
@example(ZERO, ZERO, 4900.0, ZERO, ZERO, (LIMITS.grip_force + 1e-9, LIMITS.grip_force + 1e-9), ZERO, 0.0)
@example(ZERO, ZERO, 4900.0, ZERO, ZERO, (0.0, 0.0), (0.0, 0.0, 8.4), LIMITS.rms_torque**2)
@example(ZERO, ZERO, 4900.0, ZERO, ZERO, (0.0, 0.0), (8.4, 0.0, math.nan), 0.0)
@example(ZERO, ZERO, 4900.0, ZERO, ZERO, (LIMITS.grip_force, math.nan), ZERO, 0.0)
@example(
    (0.0, 0.15, 0.15), (0.002, 0.002, 0.0), 0.0, ZERO, (0.0, 30.0, 0.0), (40.0, 15.0), (2.4, 4.0, 0.0), 2.4**2 - 1e-3
)
def test_an_arm_is_well_exactly_where_every_check_is_silent(
    offset: tuple[float, float, float], error: tuple[float, float, float], stiffness: float,
    velocity: tuple[float, float, float], force: tuple[float, float, float], tactile: tuple[float, float],
    torque: tuple[float, float, float], warmth: float,
) -> None:  # fmt: skip
    state, row = blank_state(), np.zeros(16)
    state[POSITION] = np.array(LIMITS.centre) + offset
    state[VELOCITY] = velocity
    row[0:3] = state[POSITION] + error
    row[9:12] = stiffness
    position, speed = state[POSITION].tolist(), state[VELOCITY].tolist()
    screen, protection = Screen(LIMITS, TICK), Protection(LIMITS, TICK)
    mean = MeanTorque(LIMITS.rms_torque, LIMITS.rms_window, TICK)
    screen.squares[:] = mean.squares[:] = warmth
    before = screen.squares.copy()
    found = (
        protection.tool(position, speed, force),
        protection.fingers(tactile),
        check_tracking(position, row[0:3].tolist(), row[9:12].tolist(), LIMITS),
        mean.check(torque),
    )
    # a NaN among force, pads or torques is none of these checks' business: measurements and torques are seen before
    if not all(map(math.isfinite, (*force, *tactile, *torque))):
        assert not screen.arm(state, row, force, tactile, torque), "whoever is asked then looks closer"
        np.testing.assert_array_equal(screen.squares, before)
        return
    well = screen.arm(state, row, force, tactile, torque)
    assert well is (not any(found))
    np.testing.assert_array_equal(screen.squares, mean.squares if well else before)
    memory = screen._memory.copy()
    memory[_SQUARES:] = warmth
    assert getattr(arm_well, "py_func", arm_well)(memory, state, row, force, tactile, torque) == int(well)  # type: ignore[attr-defined]


@given(
    before=triple(LIMITS.joint_range, 0.3),
    step=triple(LIMITS.encoder_jump, 0.001),
    slip=triple(LIMITS.encoder_jump, 0.0001),
    fast=st.booleans(),
)
def test_joints_are_well_exactly_where_every_check_is_silent_and_every_encoder_moves(
    before: tuple[float, float, float], step: tuple[float, float, float], slip: tuple[float, float, float], fast: bool
) -> None:
    middle = LIMITS.joint_middle
    first = tuple(m + b for m, b in zip(middle, before, strict=True))
    second = tuple(a + s for a, s in zip(first, step, strict=True))
    velocity = tuple((s + d) / TICK * (2.0 if fast else 1.0) for s, d in zip(step, slip, strict=True))
    measurement = Measurement(1, second, velocity, 0.01, (0.0, 0.0), DriveStatus.ENABLED)  # type: ignore[arg-type]
    memory = np.zeros(ENCODERS_SIZE)
    encoders, still = Encoders(LIMITS, TICK, memory), (0.0, 0.0, 0.0)
    encoders.check(measurement._replace(tick=0, angle=first), still, np.eye(3))  # type: ignore[arg-type]
    before_it = memory.copy()
    found = encoders.check(measurement, still, np.eye(3))
    watched = getattr(watch_encoders, "py_func", watch_encoders)(before_it, 1.0, second, velocity, still, np.eye(3))  # type: ignore[attr-defined]
    assert watched == (0 if found is None else found.value)
    np.testing.assert_array_equal(before_it, memory)
    limits = Screen(LIMITS, TICK)._memory
    well = getattr(joints_well, "py_func", joints_well)(limits, second, velocity)  # type: ignore[attr-defined]
    assert well == joints_well(limits, second, velocity)  # type: ignore[arg-type]
    if all(map(math.isfinite, (*second, *velocity))):
        assert well == (check_joints(measurement, LIMITS) is None)
    else:
        assert not well


def test_an_encoder_that_gets_stuck_is_told_from_the_tick_in_which_it_stood_still() -> None:
    told = Protection(LIMITS, TICK)
    for tick in range(400):
        t = min(tick, 100) * 0.001
        angle = (
            LIMITS.joint_middle[0] + tick * 0.001,
            LIMITS.joint_middle[1] + t,
            LIMITS.joint_middle[2] + tick * 0.001,
        )
        velocity = (0.001 / TICK, 0.001 / TICK if tick <= 100 else 0.0, 0.001 / TICK)
        measurement = Measurement(tick, angle, velocity, 0.01, (0.0, 0.0), DriveStatus.ENABLED)
        found = told.joints(measurement, (tick * 0.001,) * 3, np.eye(3))
        if found is not None:
            assert found.value == 2.0
            assert 120 <= tick <= 122
            return
    raise AssertionError("an encoder that stands still was not told")
