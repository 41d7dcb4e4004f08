"""Devices that fall short of their data sheets: by as much as was said, every seed another way, and none by default."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.interfaces import Command
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.imperfections import PERFECT, Flaws, Imperfections
from hardware.sim.plant.plant import Plant
from hardware.sim.plant.tick import rippled
from hardware.table import TableSettings

PARAMETERS = load_parameters()
ALL = Imperfections(
    torque_ripple=0.03, cogging=0.02, friction=0.4, tactile_noise=0.05, tactile_offset=0.2, encoder_noise=1e-6,
    finger_noise=1e-5,
)  # fmt: skip


def plant(flaws: Flaws | None) -> Plant:
    table = TableSettings()
    model = build_model(PARAMETERS, table, (), table.base_from_board(np.array([0.0, 0.0, 0.1])), looks=False)
    return Plant(model, PARAMETERS, (), flaws=flaws)


def swing(plant: Plant) -> str:
    """Some torques; the digest of where they lead."""
    for tick in range(200):
        u = 1.2 + math.sin(0.05 * tick)
        plant.apply(Command((u, 1.1, 1.3), 0.0, brake=False, enable=True, busy=True))
        plant.step()
    return plant.digest()


def test_perfect_devices_are_the_default() -> None:
    assert swing(plant(None)) == swing(plant(Flaws(PERFECT, 3)))


def test_the_same_seed_is_the_same_robot_and_another_seed_another_one() -> None:
    first, again, other = (swing(plant(Flaws(ALL, seed))) for seed in (1, 1, 2))
    assert first == again
    assert first != other


@pytest.mark.parametrize("name", ["torque_ripple", "cogging", "friction"])
def test_each_flaw_changes_where_torques_lead(name: str) -> None:
    assert swing(plant(Flaws(Imperfections(**{name: 0.05}), 1))) != swing(plant(None))


def test_ripple_is_a_share_of_the_torque_and_its_mean_over_a_turn_is_the_torque() -> None:
    flaws, counts = Flaws(Imperfections(torque_ripple=0.03, cogging=0.01), 5), range(36000)
    ripples = flaws.ripples(2.0 * np.pi / len(counts))
    made = np.array([rippled((2.0, 0.0, -1.0), np.full(3, float(count)), ripples) for count in counts])
    assert made.mean(axis=0) == pytest.approx([2.0, 0.0, -1.0], abs=1e-6)
    assert np.ptp(made[:, 1]) == pytest.approx(0.02, rel=1e-3)
    assert 0.06 <= np.abs(made[:, 0] - 2.0).max() <= 0.07 + 1e-9  # their peaks need not meet


def test_friction_stays_within_what_was_said() -> None:
    factors = np.array([Flaws(ALL, seed).friction for seed in range(40)])
    assert (np.abs(factors - 1.0) <= 0.4).all()
    assert np.ptp(factors) > 0.7


def test_noise_and_offset_of_the_fingers_are_as_large_as_was_said() -> None:
    flaws = Flaws(ALL, 4)
    right, left = flaws.noise[:20_000, :2].T
    for side in (right, left):
        assert side.std() == pytest.approx(0.05, rel=0.03)
        assert abs(side.mean()) <= 0.2
    assert right.mean() != pytest.approx(left.mean(), abs=1e-3)
    assert abs(np.corrcoef(right, left)[0, 1]) < 0.03


def test_free_fingers_read_noise_and_offset_alone() -> None:
    flaws = Flaws(ALL, 4)
    arm = plant(flaws)
    assert arm.measure(standing=False).tactile == tuple(flaws.noise[0, :2])
    arm.step()
    assert arm.measure(standing=False).tactile == tuple(flaws.noise[1, :2])


def test_encoders_and_fingers_read_what_is_there_and_noise() -> None:
    flaws = Flaws(Imperfections(encoder_noise=1e-5, finger_noise=2e-5), 4)
    quiet, noisy = plant(None), plant(flaws)
    count = 2.0 * math.pi / (1 << PARAMETERS.drive.encoder_bits)
    angles, before = [], noisy.measure(standing=False)
    for tick in range(1, 400):
        for one in (quiet, noisy):
            one.apply(Command((1.2, 1.1, 1.3), 0.0, brake=False, enable=True, busy=True))
            one.step()
        true, read = quiet.measure(standing=False), noisy.measure(standing=False)
        angles.append(np.subtract(read.angle, true.angle))
        assert angles[-1] == pytest.approx(flaws.noise[tick, 2:5], abs=1.01 * count)
        assert read.finger_position - true.finger_position == pytest.approx(flaws.noise[tick, 5], abs=1e-12)
        assert read.velocity == pytest.approx(np.subtract(read.angle, before.angle) / PARAMETERS.drive.tick, abs=1e-9)
        before = read
    assert np.std(angles) == pytest.approx(1e-5, rel=0.1)
    assert quiet.digest() == noisy.digest(), "what is read changes nothing of what is there"
