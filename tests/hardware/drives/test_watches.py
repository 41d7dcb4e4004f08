"""Encoders that jump and torques that are not followed: told where they are wrong, silent where motion explains it."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.drives.settings import JointSettings, VelocitySource
from hardware.drives.watches import EncoderReading, EncoderWatch, TorqueWatch
from hardware.interfaces import DriveTrouble
from hardware.parameters import load_parameters

DRIVE = load_parameters().drive
SETTINGS = JointSettings()
TICK = 0.001
RATED = DRIVE.rated_torque


def encoder(settings: JointSettings = SETTINGS) -> EncoderWatch:
    return EncoderWatch(settings, DRIVE)


# ------------------------------------------------------------------------------------------------------------ encoders


@given(
    steps=st.lists(
        st.tuples(
            st.floats(-1.0, 1.0),  # acceleration, of the largest
            st.floats(0.3, 40.0),  # until the next reading, in periods
            st.floats(0.0, 1.0),  # when within the exchange it was made
            st.floats(0.0, 8.0),  # how long the exchange took, in periods
        ),
        min_size=2,
        max_size=40,
    )
)
def test_no_motion_that_a_joint_can_make_is_a_jump(steps: list[tuple[float, float, float, float]]) -> None:
    watch = encoder()
    now = angle = velocity = read = 0.0
    for share, pause, when, took in steps:
        sent = now + pause * TICK
        now = sent + took * TICK
        at = sent + when * (now - sent)
        elapsed, read = at - read, at
        fastest = DRIVE.max_speed
        after = max(-fastest, min(fastest, velocity + share * SETTINGS.acceleration * elapsed))
        acceleration = (after - velocity) / elapsed
        angle += velocity * elapsed + 0.5 * acceleration * elapsed**2
        velocity = after
        assert watch.see(EncoderReading(angle, velocity, sent, now)) is None


@given(
    jump=st.floats(0.02, 3.0).flatmap(lambda size: st.sampled_from([size, -size])),
    velocity=st.floats(-5.0, 5.0),
    took=st.floats(0.0001, 0.0008),
)
def test_a_jump_of_one_degree_is_seen_on_the_way_at_any_speed(jump: float, velocity: float, took: float) -> None:
    watch = encoder()
    for k in range(5):
        assert watch.see(EncoderReading(velocity * k * TICK, velocity, k * TICK, k * TICK + took)) is None
    found = watch.see(EncoderReading(velocity * 5 * TICK + jump, velocity, 5 * TICK, 5 * TICK + took))
    assert found is not None
    assert found.trouble is DriveTrouble.ENCODER_JUMPED
    assert "rad is possible" in found.detail


def test_where_the_drives_velocity_is_not_believed_only_its_speed_limit_counts() -> None:
    watch = encoder(JointSettings(velocity=VelocitySource.POSITION))
    assert watch.see(EncoderReading(0.0, 99.0, 0.0, 0.0)) is None
    assert watch.see(EncoderReading(0.03, -99.0, TICK, TICK)) is None
    found = watch.see(EncoderReading(0.13, 0.0, 2.0 * TICK, 2.0 * TICK))
    assert found is not None
    assert "+0.1000 rad within 1.0 ms, at most 0.0500 rad" in found.detail


def test_a_velocity_that_jumps_along_hides_no_jump() -> None:
    watch = encoder()
    watch.see(EncoderReading(0.0, 0.0, 0.0, 0.0))
    assert watch.see(EncoderReading(0.5, 1000.0, TICK, TICK)) is not None


@given(
    jump=st.floats(0.02, 3.0).flatmap(lambda size: st.sampled_from([size, -size])),
    velocity=st.floats(-5.0, 5.0),
    later=st.integers(1, 30),
)
def test_an_encoder_that_jumped_stays_wrong_until_it_has_jumped_back(jump: float, velocity: float, later: int) -> None:
    watch = encoder()

    def see(tick: int, shift: float) -> bool:
        read = EncoderReading(velocity * tick * TICK + shift, velocity, tick * TICK, tick * TICK + 0.0002)
        return watch.see(read) is not None

    assert not see(0, 0.0)
    for tick in range(1, 1 + later):
        assert see(tick, jump)
    watch.begin_anew()
    assert see(1 + later, jump)
    assert see(2 + later, 0.0)  # back, which is a jump, too
    assert not see(3 + later, 0.0)
    assert see(4 + later, -jump)
    assert see(5 + later, -jump)  # the second time as well


def test_what_was_read_before_a_pause_does_not_count() -> None:
    watch = encoder()
    watch.see(EncoderReading(0.0, 0.0, 0.0, 0.0))
    watch.begin_anew()
    assert watch.see(EncoderReading(1.0, 0.0, TICK, TICK)) is None


# ------------------------------------------------------------------------------------------------------------- torques


def found_after(watch: TorqueWatch, asked: list[float | None], given: list[float], elapsed: float) -> int | None:
    """How many readings it takes."""
    for number, (torque, said) in enumerate(zip(asked, given, strict=True), 1):
        watch.ask(torque)
        if watch.see(said, elapsed) is not None:
            return number
    return None


@given(amplitude=st.floats(0.0, DRIVE.peak_torque), frequency=st.floats(1.0, 150.0), delay=st.integers(0, 2))
def test_a_drive_that_follows_two_commands_late_and_ten_percent_off_is_fine(
    amplitude: float, frequency: float, delay: int
) -> None:
    asked = [amplitude * math.sin(math.tau * frequency * k * TICK) for k in range(400)]
    given = [0.0] * delay + [1.1 * one for one in asked[: 400 - delay]]
    watch = TorqueWatch(SETTINGS, RATED)
    assert found_after(watch, list(asked), given, TICK) is None


@pytest.mark.parametrize(("asked", "given"), [(0.5, 0.0), (8.0, 6.0), (-3.0, 3.0), (0.0, 1.0)])
def test_a_torque_that_is_missing_is_told_after_its_time(asked: float, given: float) -> None:
    watch = TorqueWatch(SETTINGS, RATED)
    number = found_after(watch, [asked] * 100, [given] * 100, TICK)
    assert number == pytest.approx(SETTINGS.torque_time / TICK, abs=1)
    watch.begin_anew()
    watch.ask(asked)
    assert watch.see(given, TICK) is None, "it begins anew"


def test_one_late_reading_is_no_proof_and_its_limit_is_named() -> None:
    watch = TorqueWatch(SETTINGS, RATED)
    watch.ask(8.0)
    assert watch.see(0.0, 1.0) is None
    for _ in range(2):
        assert watch.see(0.0, 1.0, "limited by heat") is None
    found = watch.see(0.0, 1.0, "limited by heat")
    assert found is not None
    assert found.trouble is DriveTrouble.TORQUE_NOT_FOLLOWED
    assert found.detail == "8.00 N m requested at the motor, it reports 0.00 N m, for 20 ms; limited by heat"


def test_who_was_asked_for_nothing_is_not_watched() -> None:
    watch = TorqueWatch(SETTINGS, RATED)
    assert found_after(watch, [None] * 100, [5.0] * 100, TICK) is None
