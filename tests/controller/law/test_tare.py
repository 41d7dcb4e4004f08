"""The tactile sensors' zeros: found when the fingers are free, kept when they hold, and never taken from a touch."""

from __future__ import annotations

import numpy as np
import pytest

from controller.law.tare import AVERAGE, FREE_AFTER, LARGEST_OFFSET, Tare

PERIOD = 0.00088
OPEN, CLOSING = 0.0, -0.03


def weigh(tare: Tare, said: tuple[float, float], velocity: float, duration: float) -> tuple[float, float]:
    for _ in range(round(duration / PERIOD)):
        felt = tare.weigh(said, velocity)
    return felt


def test_free_fingers_come_to_read_nothing() -> None:
    tare = Tare(PERIOD)
    assert weigh(tare, (0.2, -0.1), OPEN, 2.0 * FREE_AFTER) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert tare.zero == pytest.approx((0.2, -0.1))


def test_noise_is_averaged_away_and_a_drift_is_followed() -> None:
    tare, rng = Tare(PERIOD), np.random.default_rng(3)
    for right, left in (0.1 + 0.05 * rng.standard_normal((3000, 2))).tolist():
        tare.weigh((right, left), OPEN)
    assert tare.zero == pytest.approx((0.1, 0.1), abs=3.0 * 0.05 / np.sqrt(AVERAGE / PERIOD))
    weigh(tare, (0.3, 0.3), OPEN, 6.0 * AVERAGE)
    assert tare.zero == pytest.approx((0.3, 0.3), abs=0.01)


def test_what_is_held_is_felt_without_the_offset_and_does_not_move_the_zero() -> None:
    tare = Tare(PERIOD)
    weigh(tare, (0.2, -0.1), OPEN, 1.0)
    before = tare.zero
    assert weigh(tare, (5.2, 4.9), CLOSING, 5.0) == pytest.approx((5.0, 5.0))
    assert weigh(tare, (5.2, 4.9), OPEN, 5.0) == pytest.approx((5.0, 5.0))  # they still hold while they rest
    assert weigh(tare, (0.3, 0.0), CLOSING, 5.0) == pytest.approx((0.1, 0.1))  # the first gentle touch
    assert tare.zero == before


def test_a_short_moment_of_freedom_is_not_believed() -> None:
    tare = Tare(PERIOD)
    weigh(tare, (0.5, 0.4), OPEN, 0.8 * FREE_AFTER)  # a force that is still fading
    assert tare.zero == (0.0, 0.0)


def test_a_sensor_that_reads_too_much_is_not_zeroed() -> None:
    tare = Tare(PERIOD)
    weigh(tare, (1.1 * LARGEST_OFFSET, 0.0), OPEN, 2.0)
    assert tare.zero == (0.0, 0.0)


def test_perfect_sensors_are_left_as_they_are() -> None:
    tare = Tare(PERIOD)
    weigh(tare, (0.0, 0.0), OPEN, 1.0)
    assert tare.weigh((4.8, 4.7), CLOSING) == (4.8, 4.7)
