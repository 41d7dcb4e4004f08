"""Bench ``commission``: an unknown robot goes from nothing to its first game; planted faults are told."""

from __future__ import annotations

from functools import partial

import pytest

from app.commissioning import identify
from app.commissioning.bring_up import motions, runs
from app.commissioning.bring_up.steps import CommissionStep, StepState
from app.commissioning.identification import excitation
from app.commissioning.identification.survey import survey
from app.measure.bench.unknown.commission import FAULTS, TOOL_LIMIT, try_fault, whole
from app.settings.defaults import Drives
from hardware.sim.process.planted import PlantedKind


def test_every_fault_is_expected_at_one_of_the_first_two_steps() -> None:
    assert {one.step for one in FAULTS.values()} == {CommissionStep.DEVICES, CommissionStep.AXES}
    assert all(set(one.devices) <= {1, 2, 3} for one in FAULTS.values())


@pytest.mark.slow
def test_an_unknown_robot_is_brought_up_to_its_first_game(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every step, with fewer poses on quicker ways than a lab takes, and a shorter motion, searched for less long."""
    monkeypatch.setattr(motions, "CREEP", motions.CREEP.model_copy(update={"speed": 0.5, "acceleration": 5.0}))
    monkeypatch.setattr(motions, "_AROUND", 1)
    monkeypatch.setattr(excitation, "_CHANGES", 150)
    monkeypatch.setattr(identify, "survey", partial(survey, duration=12.0))
    monkeypatch.setattr(runs, "GAME_PLIES", 1)
    report, _again = whole(Drives.SIM, 77, lambda _: None)
    assert {line.step: line.state for line in report.steps} == dict.fromkeys(CommissionStep, StepState.HELD), report


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("kind", [Drives.MOTEUS, Drives.ETHERCAT])
def test_a_planted_fault_is_told_through_the_driver(kind: Drives) -> None:
    fault = PlantedKind.ENCODER_SIGN
    said: list[str] = []
    for _ in range(20):
        told, moved = try_fault(kind, fault, FAULTS[fault], 77, said.append)
        if told or not any(f"what='{late}'" in said[-1] for late in ("connection", "missed ticks")):
            break  # else a busy machine kept drives waiting, and that was found first, as it should be
    assert told, said
    assert moved < TOOL_LIMIT
