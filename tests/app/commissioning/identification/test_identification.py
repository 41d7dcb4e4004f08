"""Robots that nobody knows are found from one motion; what a motion cannot tell is not claimed to be known."""

from __future__ import annotations

import tomllib
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from app.commissioning.identification.estimation import Identification, IdentificationFailed, identify
from app.commissioning.identification.excitation import Borders, Excitation, NoExcitation, find_excitation
from app.commissioning.identification.recording import JointRecord, NoRecord, joint_record, of_flight
from app.commissioning.identification.robot_file import robot_text, write_robot
from app.commissioning.identification.survey import borders_of
from app.measure.bench.beds.unknown_robot import bed_of, recorded, unknown_plant, unknown_robot
from controller.model.base_parameters import base_of
from controller.records.flight_file import FLIGHT, FlightHead, FlightRecord
from hardware.parameters import RobotParameters, load_parameters
from hardware.table import TableSettings

BELIEVED, TABLE = load_parameters(), TableSettings()
SEED = 41


@cache
def excitation() -> Excitation:
    """Searched for less long than a lab's: it tells enough."""
    with pytest.MonkeyPatch.context() as quicker:
        quicker.setattr("app.commissioning.identification.excitation._CHANGES", 400)
        return find_excitation(BELIEVED, borders_of(BELIEVED, TABLE), 24.0)


@cache
def record() -> JointRecord:
    plant = unknown_plant(robot(), TABLE, excitation().middle, SEED)
    return recorded(bed_of(plant, BELIEVED, TABLE), excitation())


@cache
def robot() -> RobotParameters:
    return unknown_robot(BELIEVED, SEED)


@cache
def found() -> Identification:
    return identify(record(), BELIEVED, 5)


def test_the_motion_stays_within_its_borders_and_begins_and_ends_at_rest() -> None:
    borders, table = borders_of(BELIEVED, TABLE), excitation().sampled(BELIEVED.drive.tick)
    assert (table[:, :3] >= borders.low).all()
    assert (table[:, :3] <= borders.high).all()
    assert np.hypot(*table[:, :2].T).max() <= borders.reach
    assert np.linalg.norm(table[:, 3:6], axis=1).max() <= borders.speed
    assert np.linalg.norm(table[:, 6:9], axis=1).max() <= borders.acceleration
    assert not table[[0, -1], 3:].any()
    step = np.diff(table[:, :3], axis=0) - 0.5 * BELIEVED.drive.tick * (table[1:, 3:6] + table[:-1, 3:6])
    assert np.abs(step).max() < 2e-6  # what the controller accepts is ten times as much


@pytest.fixture
def short_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commissioning.identification.excitation._CHANGES", 80)


@pytest.mark.usefixtures("short_search")
def test_the_same_robot_and_limits_have_the_same_motion() -> None:
    borders = borders_of(BELIEVED, TABLE)
    once, again = (find_excitation(BELIEVED, borders, 12.0) for _ in range(2))
    np.testing.assert_array_equal(once.sines, again.sines)
    assert once.condition < 30.0


@pytest.mark.usefixtures("short_search")
def test_where_nothing_fits_it_is_said() -> None:
    borders = Borders((-0.1, -0.1, 0.30), (0.1, 0.1, 0.36), 0.3, 0.5, 10.0, 0.2, 0.1)
    with pytest.raises(NoExcitation, match="give it more room"):
        find_excitation(BELIEVED, borders, 12.0)


def test_each_base_parameter_is_found_within_three_per_cent() -> None:
    true = base_of(robot())
    values = np.array([one.value for one in found().estimates[:10]])
    assert np.abs(values / true - 1.0).max() < 0.03
    assert np.abs(base_of(BELIEVED) / true - 1.0).max() > 0.10  # what was believed was worse
    assert all(one.told for one in found().estimates[:10])


def test_friction_is_found_and_ripple_is_told_from_it() -> None:
    for number in range(3):
        arm = robot().arm(number)
        assert found().value(f"coulomb{number + 1}") == pytest.approx(arm.coulomb, abs=0.002)
        assert found().value(f"viscous{number + 1}") == pytest.approx(arm.viscous, abs=0.0005)
    assert found().ripple == pytest.approx([0.02] * 3, rel=0.1)
    assert found().cogging == pytest.approx([0.015] * 3, rel=0.1)


def test_what_is_not_explained_falls() -> None:
    assert (found().residual < 0.2 * found().before).all()


def test_without_the_number_of_poles_ripple_is_only_noise() -> None:
    without = identify(record(), BELIEVED, None)
    values = np.array([one.value for one in without.estimates[:6]])
    assert np.abs(values / base_of(robot())[:6] - 1.0).max() < 0.06
    assert (without.residual > found().residual).all()


def test_a_short_record_does_not_claim_to_know() -> None:
    """A second of slow motion tells next to nothing; what is not told stays as it was believed."""
    whole = record()
    part = JointRecord(whole.period, whole.angle[600:1800], whole.torque[600:1800])
    poor = identify(part, BELIEVED, None)
    untold = [one for one in poor.estimates if not one.told]
    assert untold
    assert all(one.value == one.believed for one in untold)


def test_a_record_of_rest_is_refused() -> None:
    rest = JointRecord(0.00088, np.full((4000, 3), 0.1), np.ones((4000, 3)))
    with pytest.raises(IdentificationFailed, match="turned fast enough"):
        identify(rest, BELIEVED, None)


def test_the_file_is_read_as_the_robot_that_was_found(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    text = robot_text(found(), datetime(2026, 1, 2, tzinfo=UTC), "in a test")
    write_robot(path, text)
    assert load_parameters(path) == found().parameters
    assert "identified, ±" in text
    assert "The data determined all of them" in text
    assert "assumed" in text
    assert tomllib.loads(text)["geometry"] == BELIEVED.geometry.model_dump()
    assert list(tmp_path.iterdir()) == [path]


def flight(motions: list[int], ticks: list[int]) -> FlightRecord:
    rows = np.zeros(len(ticks), dtype=FLIGHT.dtype)
    rows["motion"], rows["tick"] = motions, ticks
    rows["angle"] = np.arange(len(ticks))[:, None]
    rows["torque"] = 10.0 + np.arange(len(ticks))[:, None]
    return FlightRecord(FlightHead(0.00088, False, (), ()), rows)


def test_of_a_flight_the_motion_counts_and_torques_act_a_tick_later() -> None:
    part = of_flight(flight([0, 7, 7, 7, 0], [1, 2, 3, 4, 5]), 7)
    assert part.angle[:, 0].tolist() == [2.0, 3.0]
    assert part.torque[:, 0].tolist() == [11.0, 12.0]
    assert joint_record(1.0, np.zeros((3, 3)), np.zeros((3, 3))).angle.shape == (2, 3)


@pytest.mark.parametrize(
    ("motions", "ticks", "said"),
    [
        ([1, 1], [1, 2], "motion 7 is not in"),
        ([7] * 3, [1, 2, 4], "missed 1 ticks"),
        ([7] * 999, [1, *range(13, 1011)], "11 of them"),
    ],
)
def test_a_record_that_is_not_whole_is_refused(motions: list[int], ticks: list[int], said: str) -> None:
    with pytest.raises(NoRecord, match=said):
        of_flight(flight(motions, ticks), 7)


def test_ticks_that_were_missed_hardly_count() -> None:
    """One and a half of a hundred, as behind a slow serial port on a busy computer."""
    whole, rng = record(), np.random.default_rng(3)
    rows = np.zeros(len(whole.angle) + 1, dtype=FLIGHT.dtype)
    rows["motion"], rows["tick"] = 7, np.arange(len(rows))
    rows["angle"][1:], rows["torque"][:-1] = whole.angle, whole.torque
    there = rng.random(len(rows)) > 0.015
    part = of_flight(FlightRecord(FlightHead(whole.period, False, (), ()), rows[there]), 7)
    assert abs(len(part.angle) - len(whole.angle)) <= 2
    values = np.array([one.value for one in identify(part, BELIEVED, 5).estimates[:10]])
    # these drives had not kept their torque, so more than is right is asked of them
    assert np.abs(values / base_of(robot()) - 1.0).max() < 0.02


def test_a_clock_that_slips_now_and_then_spoils_nothing() -> None:
    """The drives' clock and the computer's are a few ticks apart for a while, as where either was held up."""
    whole, rng = record(), np.random.default_rng(5)
    angle = whole.angle.copy()
    for moment in rng.integers(2000, len(angle) - 2000, 6):
        angle[moment : moment + 12] = whole.angle[moment - 4 : moment + 8]
    slipped = identify(JointRecord(whole.period, angle, whole.torque), BELIEVED, 5)
    values = np.array([one.value for one in slipped.estimates[:10]])
    assert np.abs(values / base_of(robot()) - 1.0).max() < 0.02
    assert all(one.told for one in slipped.estimates[:10])
