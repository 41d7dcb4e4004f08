"""Settings of drives, scaling between motor and joint, velocity estimates, ratings, faults."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from hardware.drives.faults import DEVICES, DriveFault
from hardware.drives.joint import FingerScale, JointScale
from hardware.drives.rating import FREE, TorqueRating, allowed, derating
from hardware.drives.settings import DriveSettings, FingerSettings, ForceSettings, JointSettings
from hardware.drives.velocity import BANDWIDTH, Difference, VelocityObserver, estimate_of
from hardware.interfaces import DriveStatus, DriveTrouble, fault_of, status_of
from hardware.parameters import load_parameters

PARAMETERS = load_parameters()
TICK = 0.001


# -------------------------------------------------------------------------------------------------------------- scales


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("ratio", [1.0, 6.0])
def test_motor_and_joint_are_each_others_inverse_and_power_is_kept(sign: int, ratio: float) -> None:
    scale = JointScale.of(JointSettings(ratio=ratio, sign=sign, offset=0.3))
    for motor in np.linspace(-7.0, 7.0, 5).tolist():
        assert scale.motor_angle(scale.angle(motor)) == pytest.approx(motor)
        assert scale.motor_velocity(scale.velocity(motor)) == pytest.approx(motor)
        assert scale.motor_torque(scale.torque(motor)) == pytest.approx(motor)
        assert scale.torque(1.5) * scale.velocity(motor) == pytest.approx(1.5 * motor)
    assert scale.angle(0.0) == 0.3
    assert scale.angle(1.0) == pytest.approx(sign / ratio + 0.3)


def test_fingers() -> None:
    scale = FingerScale.of(FingerSettings(travel=0.004, direction=-1, position_offset=0.01))
    assert scale.position(1.0) == pytest.approx(0.006)
    assert scale.motor_angle(scale.position(2.0)) == pytest.approx(2.0)
    assert scale.motor_velocity(scale.velocity(3.0)) == pytest.approx(3.0)
    assert scale.motor_torque(10.0) == pytest.approx(0.08)


def test_forces() -> None:
    channel = ForceSettings(gain=-40.0, zero=0.9)
    assert channel.force(0.9) == 0.0
    assert channel.force(channel.reading(7.0)) == pytest.approx(7.0)


# ------------------------------------------------------------------------------------------------------------ settings


def test_the_robot_on_a_bus_has_its_period_watchdog_and_coarsest_encoder() -> None:
    fine, coarse = JointSettings(encoder_bits=22), JointSettings(encoder_bits=18)
    drive = DriveSettings(period=0.001, watchdog=0.044, joints=(fine, coarse, fine)).robot(PARAMETERS).drive
    assert (drive.tick, drive.watchdog_ticks, drive.encoder_bits) == (0.001, 44, 18)
    assert drive.peak_torque == PARAMETERS.drive.peak_torque


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (
            {"period": 0.004, "watchdog": 0.01},
            r"a watchdog of 0.01 s trips within 2 exchanges of 0.004 s, and at least",
        ),
        ({"joints": ({"derating_temperature": 90.0}, {}, {})}, r"derating_temperature 90 °C is not below .* 85 °C"),
        ({"joints": ({}, {})}, r"joints"),
        ({"perod": 1.0}, r"perod"),
    ],
)
def test_wrong_settings_are_told(wrong: dict[str, object], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        DriveSettings.model_validate(wrong)


# ------------------------------------------------------------------------------------------------------------ velocity


def test_differences_of_a_fine_encoder() -> None:
    estimate = estimate_of(JointSettings(encoder_bits=22))
    assert isinstance(estimate, Difference)
    assert estimate.take(0.5, TICK) == 0.0
    assert estimate.take(0.502, TICK) == pytest.approx(2.0)
    assert estimate.take(0.504, 2.0 * TICK) == pytest.approx(1.0), "a missed exchange"


def test_an_observer_smooths_a_coarse_encoder_and_comes_late_by_two_over_omega() -> None:
    count = 2.0 * math.pi / (1 << 14)
    estimate = estimate_of(JointSettings(encoder_bits=14))
    assert isinstance(estimate, VelocityObserver)
    time = np.arange(3000) * TICK
    speed = 2.0 * np.sin(2.0 * math.pi * time)
    angle = -2.0 / (2.0 * math.pi) * np.cos(2.0 * math.pi * time)
    counted = np.round(angle / count) * count
    seen = np.array([estimate.take(float(one), TICK) for one in counted])
    late = np.interp(time - 2.0 / BANDWIDTH, time, speed)
    assert np.abs(seen - late)[100:].max() < 0.1
    assert np.abs(np.diff(counted) / TICK - speed[1:]).max() > 0.3, "differences would be this rough"


def test_an_observer_settles_on_an_even_motion_whatever_the_steps() -> None:
    rng, estimate, angle = np.random.default_rng(1), VelocityObserver(), 0.0
    for _ in range(200):
        step = float(rng.uniform(0.2, 3.0)) * TICK
        angle += 3.0 * step
        seen = estimate.take(angle, step)
    assert seen == pytest.approx(3.0, abs=1e-3)
    assert estimate.take(angle + 1.0, 5.0) == 0.0, "after a pause it begins anew"


# -------------------------------------------------------------------------------------------------------------- rating


def test_less_torque_the_warmer_the_drive_and_none_at_the_limit() -> None:
    shares = [derating(at, 70.0, 85.0) for at in (20.0, 70.0, 77.5, 85.0, 120.0)]
    assert shares == [1.0, 1.0, pytest.approx(0.5), 0.0, 0.0]
    assert derating(math.nan, 70.0, 85.0) == 1.0


def test_a_winding_bears_the_peak_for_a_while_and_its_rating_for_ever() -> None:
    drive = PARAMETERS.drive
    settings = JointSettings(thermal_time=10.0)
    rating = TorqueRating(settings, drive)
    given = np.array([rating.rate(100.0, 25.0, 0.01) for _ in range(10_000)])
    assert given[0, 0] == drive.peak_torque
    assert given[:, 1].all(), "all of it was cut"
    assert given[-1, 0] == pytest.approx(drive.rated_torque, rel=0.02)
    assert rating.heat <= 1.0 + 1e-6
    peak_time = np.flatnonzero(given[:, 0] < drive.peak_torque)[0] * 0.01
    full = (drive.peak_torque / drive.rated_torque) ** 2
    assert peak_time == pytest.approx(-10.0 * math.log(1.0 - FREE / full), rel=0.05)
    rating.rest(100.0)
    assert rating.rate(-100.0, 25.0, 0.01) == (-drive.peak_torque, True)
    assert rating.rate(1.0, 25.0, 0.01) == (1.0, False)


def test_a_rating_above_the_peak_cuts_at_the_peak() -> None:
    assert allowed(5.0, 2.0, 3.0) == 2.0


# -------------------------------------------------------------------------------------------------------------- faults


@pytest.mark.parametrize("trouble", list(DriveTrouble))
@pytest.mark.parametrize("device", range(len(DEVICES)))
def test_a_fault_goes_through_the_status_word_and_into_words(device: int, trouble: DriveTrouble) -> None:
    status = status_of(device, trouble)
    assert status & DriveStatus.FAULT
    assert int(status) < 1 << 16
    assert fault_of(int(status | DriveStatus.BRAKED | DriveStatus.WATCHDOG)) == (device, trouble)
    fault = DriveFault(device, trouble, "id 3, 91 °C of at most 85 °C")
    assert fault.status == status
    assert fault.sentence.startswith(DEVICES[device])
    assert "91 °C" in fault.sentence
    assert fault.sentence.endswith(", then clear the fault")
