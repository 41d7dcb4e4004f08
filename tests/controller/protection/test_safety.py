"""Protection: each limit has a reason and holds; refusals name the number and the limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from controller.protection.limits import (
    WHY,
    Limits,
    check_drives,
    check_limits,
    check_measurement,
    check_tracking,
    clamp_torque,
    default_limits,
)
from controller.protection.reference_check import COLUMNS, SampleCheck, rows_from_samples
from controller.protocol import SAMPLE
from controller.protocol.cause_sentences import explain, template
from controller.protocol.causes import Cause
from hardware.interfaces import DriveStatus, Measurement
from hardware.parameters import load_parameters
from hardware.table import TableSettings

PERIOD = 0.00088
START = (0.0, 0.0, 0.40)
Line = Callable[..., NDArray[Any]]


@pytest.fixture
def limits() -> Limits:
    return default_limits(load_parameters(), TableSettings())


@pytest.fixture
def check(limits: Limits) -> SampleCheck:
    made = SampleCheck(limits, PERIOD)
    made.begin(np.array(START))
    return made


def test_every_limit_has_a_reason_and_is_sound(limits: Limits) -> None:
    assert [field.name for field in fields(limits)] == list(WHY)
    check_limits(limits)


@pytest.mark.parametrize(("name", "value"), [("speed", -1.0), ("torque", math.nan), ("half_size", (0.3, 0.0, 0.1))])
def test_limits_that_cannot_be_meant_are_refused(limits: Limits, name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"limit {name} is .*, it must be finite and positive: correct it"):
        check_limits(replace(limits, **{name: value}))


def test_the_board_the_trays_and_all_grips_lie_inside(check: SampleCheck, limits: Limits) -> None:
    table = TableSettings()
    places = [table.xy(place) for place in table.tray_places()]
    places += [(x * 0.140, y * 0.140) for x in (-1, 1) for y in (-1, 1)]
    for x, y in places:
        for height in (0.0, 0.019, 0.15):
            point = table.base_from_board(np.array([x, y, height]))
            samples = np.zeros(1, SAMPLE)
            samples["position"] = point
            assert check.rows(rows_from_samples(samples), None) is None, point


def test_rows_keep_every_field() -> None:
    rng = np.random.default_rng(3)
    samples = np.frombuffer(rng.integers(0, 127, 5 * SAMPLE.itemsize, dtype=np.uint8).tobytes(), SAMPLE)
    rows = rows_from_samples(samples)
    assert rows.shape == (5, COLUMNS)
    for row, sample in zip(rows, samples, strict=True):
        assert row.tolist() == np.concatenate([np.atleast_1d(value) for value in sample.tolist()]).tolist()


def test_a_smooth_motion_passes(check: SampleCheck, line: Line) -> None:
    rows = rows_from_samples(line(START, (0.1, -0.1, 0.35), 600))
    assert check.rows(rows, None) is None
    assert check.start(rows[0]) is None
    assert check.end(rows[-1]) is None
    assert check.rows(rows[300:], rows[299]) is None


FAULTS: list[tuple[str, Any, Cause, str]] = [
    ("position", (0.0, 0.0, math.nan), Cause.NOT_FINITE, "sample 300 holds a number that is not finite"),
    ("stiffness", math.inf, Cause.NOT_FINITE, "sample 300 holds a number that is not finite"),
    ("position", (0.301, 0.0, 0.4), Cause.WORKSPACE, "0.3010 m from the middle of the workspace box .* 0.3000 m"),
    ("position", (0.0, 0.0, 0.476), Cause.WORKSPACE, "0.1260 m from the middle of the workspace box .* 0.1250 m"),
    ("position", (0.22, 0.22, 0.4), Cause.REACH, "0.3111 m from the base's axis, at most 0.3100 m is accepted"),
    ("velocity", (0.0, -0.9, 0.0), Cause.SPEED, "-0.900 m/s, at most 0.816 m/s is accepted: slow the motion down"),
    ("velocity", (0.7, 0.7, 0.0), Cause.SPEED, "0.990 m/s, at most 0.816 m/s is accepted: slow the motion down"),
    ("velocity", (0.0, 0.0, 0.5), Cause.DOWNWARD_SPEED, "goes down at 0.500 m/s near the board, at most 0.459 m/s"),
    ("acceleration", (0.0, 46.0, 0.0), Cause.ACCELERATION, r"46.00 m/s², at most 45.00 m/s² is accepted"),
    ("acceleration", (35.0, 35.0, 0.0), Cause.ACCELERATION, r"49.50 m/s², at most 45.00 m/s² is accepted"),
    ("position", (0.0, 0.0, 0.41), Cause.POSITION_STEP, "positions jump by 0.01 m .* at most 2e-05 m is accepted"),
    ("velocity", (0.2, 0.0, 0.0), Cause.POSITION_STEP, "positions jump by 8.8e-05 m .* one continuous path"),
    ("velocity", (0.04, 0.0, 0.0), Cause.VELOCITY_STEP, "velocities jump by 0.04 m/s .* at most 0.03 m/s is accepted"),
    (
        "stiffness",
        (4900.0, 15000.0, 4900.0),
        Cause.STIFFNESS,
        r"stiffness of 1.5e\+04 1/s² was requested, 0 to 1.44e\+04",
    ),
    ("stiffness", (4900.0, -1.0, 4900.0), Cause.STIFFNESS, "stiffness of -1 1/s² was requested"),
    ("damping", (-0.1, 140.0, 140.0), Cause.DAMPING, "damping of -0.1 1/s was requested, 0 to 240 1/s are accepted"),
    ("tactile_gain", 11.0, Cause.TACTILE_GAIN, "tactile gain of 11 1/kg was requested, 0 to 10 1/kg are accepted"),
    ("finger_velocity", -0.13, Cause.FINGER_SPEED, "finger velocity of -0.130 m/s was requested, at most 0.120 m/s"),
    ("guard", 4, Cause.GUARD, "guard 4 is not known, 0 to 3 are"),
]


@pytest.mark.parametrize(("field", "value", "cause", "message"), FAULTS)
def test_a_bad_sample_is_found_and_named(
    check: SampleCheck, line: Line, field: str, value: Any, cause: Cause, message: str
) -> None:
    samples = line(START, START, 600)
    samples[field][300] = value
    found = check.rows(rows_from_samples(samples), None)
    assert found is not None
    assert (found.cause, found.offset) == (cause, 300)
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(explain(*found[:3]))


def test_a_jump_between_datagrams_is_found(check: SampleCheck, line: Line) -> None:
    rows = rows_from_samples(line(START, (0.1, -0.1, 0.35), 600))
    found = check.rows(rows[310:320], rows[300])
    assert found is not None
    assert (found.cause, found.offset) == (Cause.POSITION_STEP, 0)


@pytest.mark.parametrize(
    ("field", "value", "cause", "message"),
    [
        (
            "position",
            (0.0, 2e-6, 0.4),
            Cause.START_POSITION,
            "starts 2e-06 m from the present reference, at most 1e-06 m",
        ),
        ("velocity", (0.0, 0.0, 1e-5), Cause.START_VELOCITY, "starts with 1e-05 m/s, at most 1e-06 m/s .* at rest"),
        ("acceleration", (0.1, 0.0, 0.0), Cause.START_ACCELERATION, "starts with 0.1 m/s², at most 0.001 m/s²"),
    ],
)
def test_a_motion_must_continue_the_reference(
    check: SampleCheck, line: Line, field: str, value: Any, cause: Cause, message: str
) -> None:
    samples = line(START, START, 1)
    samples[field][0] = value
    found = check.start(rows_from_samples(samples)[0])
    assert found is not None
    assert found.cause is cause
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(explain(*found[:3]))


def test_a_motion_must_end_at_rest(check: SampleCheck, line: Line) -> None:
    found = check.end(rows_from_samples(line(START, (0.1, 0.0, 0.4), 600)[:590])[-1])
    assert found is not None
    assert found.cause is Cause.ENDS_MOVING
    assert "end at rest" in explain(*found[:3])


def test_from_outside_the_box_the_way_back_is_open_and_no_way_further_out(check: SampleCheck, line: Line) -> None:
    outside, inside, beyond = (0.0, 0.0, 0.485), (0.0, 0.0, 0.40), (0.0, 0.0, 0.490)
    assert check.rows(rows_from_samples(line(outside, inside, 800)), None) is not None
    check.begin(np.array(outside))
    assert check.rows(rows_from_samples(line(outside, inside, 800)), None) is None
    found = check.rows(rows_from_samples(line(outside, beyond, 800)), None)
    assert found is not None
    assert found.cause is Cause.WORKSPACE
    check.begin(np.array(inside))
    assert check.rows(rows_from_samples(line(outside, inside, 800)), None) is not None


torques = st.tuples(*[st.floats(-100.0, 100.0)] * 3)
within = st.tuples(*[st.floats(-8.4, 8.4)] * 3)


@given(torques, within)
def test_clamped_torques_hold_both_bounds_and_are_told(torque: Any, previous: Any) -> None:
    clamped, told = clamp_torque(torque, previous, 8.4, 4.2)
    assert all(abs(value) <= 8.4 for value in clamped)
    assert all(abs(value - before) <= 4.2 + 1e-12 for value, before in zip(clamped, previous, strict=True))
    assert told == (clamped != torque)


@given(within)
def test_a_torque_within_its_bounds_is_left_alone(torque: Any) -> None:
    assert clamp_torque(torque, torque, 8.4, 4.2) == (torque, False)


MEASURED = Measurement(7, (0.1, 0.2, 0.3), (0.0, 0.0, 0.0), 0.02, (0.0, 0.0), DriveStatus.ENABLED)


@pytest.mark.parametrize(
    "change",
    [
        {"angle": (0.1, math.nan, 0.3)},
        {"velocity": (math.inf, 0.0, 0.0)},
        {"velocity": (math.inf, -math.inf, 0.0)},
        {"finger_position": math.nan},
        {"tactile": (0.0, -math.inf)},
    ],
)
def test_a_measurement_that_is_not_finite_is_found(change: dict[str, Any]) -> None:
    assert check_measurement(MEASURED) is None
    found = check_measurement(MEASURED._replace(**change))
    assert found is not None
    assert found.cause is Cause.BAD_MEASUREMENT


@pytest.mark.parametrize(
    ("status", "cause", "message"),
    [
        (DriveStatus.FAULT | DriveStatus.WATCHDOG, Cause.DRIVE_FAULT, "a drive reports a fault (WATCHDOG|FAULT)"),
        (DriveStatus.ENABLED | DriveStatus.WATCHDOG, Cause.WATCHDOG, "no command came in time (ENABLED|WATCHDOG)"),
        (DriveStatus.OVERSPEED, Cause.OVERSPEED, "exceeded its speed limit (OVERSPEED)"),
    ],
)
def test_what_the_drives_say_is_heard(status: DriveStatus, cause: Cause, message: str) -> None:
    found = check_drives(int(status))
    assert found is not None
    assert found.cause is cause
    assert message in explain(*found[:3])


def test_healthy_drives_are_fine() -> None:
    assert check_drives(int(DriveStatus.ENABLED | DriveStatus.SATURATED | DriveStatus.STANDING)) is None


def test_the_tool_must_be_near_its_reference_nearer_where_it_is_stiff(limits: Limits) -> None:
    stiff, soft = [4900.0] * 3, [400.0] * 3
    assert check_tracking([0.0, 0.0, 0.4], [0.0, -0.0024, 0.4024], stiff, limits) is None
    found = check_tracking([0.0, 0.0, 0.4], [0.0, 0.0, 0.4025], stiff, limits)
    assert found is not None
    assert "0.0025 m from its reference along one axis, at most 0.0024 m is accepted" in explain(*found[:3])
    assert check_tracking([0.0, 0.0, 0.4], [0.0, 0.0, 0.4149], soft, limits) is None
    assert check_tracking([0.0, 0.0, 0.4], [0.0, 0.0151, 0.4], soft, limits) is not None
    assert check_tracking([0.0, 0.0, 0.4], [0.0151, 0.0, 0.4], [0.0, 4900.0, 4900.0], limits) is not None
    assert check_tracking([0.0, 0.0, 0.4], [0.0019, 0.0, 0.4], [14400.0] * 3, limits) is None
    assert check_tracking([0.0, 0.0, 0.4], [0.0021, 0.0, 0.4], [14400.0] * 3, limits) is not None
    assert check_tracking([0.0, 0.0, math.nan], [0.0, 0.0, 0.0], stiff, limits) is not None


@pytest.mark.parametrize("cause", list(Cause))
def test_every_cause_has_a_sentence_with_a_next_step(cause: Cause) -> None:
    sentence = explain(cause, 1.0, 2.0)
    assert "{" not in sentence
    assert not sentence.endswith(".")
    assert cause is Cause.NONE or ": " in sentence
    assert template(cause).count("{") == template(cause).count("}")


def test_a_workspace_out_of_reach_has_no_limits() -> None:
    with pytest.raises(ValueError, match=r"the middle of the workspace .* m is out of reach of arm 1"):
        default_limits(load_parameters(), TableSettings(centre_in_base=(0.0, 0.0, 1.0)))
