"""The finger in the arm's way: felt and freed with the protection, pressed without."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.measure.bench.finger import PROFILES, RELEASED, WITHIN, FingerTrial, Missed, in_the_air, meet, on_the_board
from controller.protection.limits import Limits, default_limits
from hardware.parameters import load_parameters
from hardware.sim.bodies.finger_world import STIFFNESS, Finger, build_finger_world, finger_force
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings

PARAMETERS = load_parameters()
CLAMPED = FingerTrial(
    np.array([0.0, 0.0, 0.12]), np.array([0.0, 0.0, 0.012]), Finger((0.013, 0.0, 0.008), clamped=True)
)
FREE = FingerTrial(np.array([-0.1, 0.0, 0.10]), np.array([0.1, 0.0, 0.10]), Finger((0.02, 0.0, 0.10), clamped=False))


def test_the_finger_is_a_spring_of_its_stiffness_before_a_mass_that_rests_by_itself() -> None:
    table = TableSettings()
    model = build_finger_world(PARAMETERS, table, np.array([0.0, 0.0, 0.35]), Finger((0.1, 0.1, 0.1), clamped=False))
    plant = Plant(model, PARAMETERS, ())
    for _ in range(200):
        plant.step()
    assert finger_force(model, plant.data) == 0.0
    plant.data.qpos[model.joint("finger_x").qposadr[0]] = 1e-3
    assert finger_force(model, plant.data) == pytest.approx(STIFFNESS * 1e-3)
    np.testing.assert_allclose(plant.data.body("fingertip").xpos, [0.1, 0.1, 0.1], atol=1e-6)


@pytest.mark.parametrize("trial", [CLAMPED, FREE], ids=["clamped", "free"])
@pytest.mark.parametrize("profile", PROFILES)
def test_a_finger_feels_no_more_than_the_profile_says_and_is_freed(trial: FingerTrial, profile: str) -> None:
    limits, most = PROFILES[profile]
    felt = meet(trial, limits)
    assert RELEASED < felt.peak < most
    assert felt.freed < WITHIN
    assert felt.pressing < RELEASED
    assert felt.at_rest


def without_protection(parameters: Any, table: Any) -> Limits:
    return replace(default_limits(parameters, table), tracking_acceleration=1e9, tracking_most=1.0, press_force=1e9)


def test_without_the_protection_it_would_be_pressed(monkeypatch: pytest.MonkeyPatch) -> None:
    """So the bench can fail, and it is the protection that frees."""
    monkeypatch.setattr("app.measure.bench.beds.bed.default_limits", without_protection)
    felt = meet(CLAMPED, PROFILES["default"][0])
    assert felt.pressing > 4.0 * RELEASED
    assert felt.freed > WITHIN


def test_a_finger_elsewhere_is_missed() -> None:
    with pytest.raises(Missed):
        meet(FREE._replace(finger=Finger((0.0, 0.15, 0.02), clamped=False)), PROFILES["default"][0])


def test_a_refused_move_is_told() -> None:
    with pytest.raises(RuntimeError, match="the controller did not carry out the move: a sample lies"):
        meet(FREE._replace(end=np.array([0.35, 0.0, 0.1])), PROFILES["default"][0])


@pytest.mark.parametrize("kind", [in_the_air, on_the_board])
def test_trials_repeat_with_their_seed(kind: Callable[..., FingerTrial]) -> None:
    first, again, other = (kind(PARAMETERS, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.start, again.start)
    assert first.finger == again.finger
    assert first.finger != other.finger
