"""Steps ``devices`` and ``axes`` on a robot with planted faults: each is stopped at its step, with its sentence, and
nothing moves more than stated; a robot without is let pass, whatever it weighs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from app.commissioning.bring_up.axes import try_axes
from app.commissioning.bring_up.axis_judgement import (
    Expected,
    coupling_of,
    judge_bite,
    judge_together,
    judge_torque,
    judge_zero,
    most_doubtful,
    ran_on,
)
from app.commissioning.bring_up.brake_openings import OPENING_WAY, TOTAL_WAY, BrakeOpening, WatchedBus, accelerations
from app.commissioning.check_drives import check_bus
from app.commissioning.check_report import CheckState, Finding
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from hardware.interfaces import DriveStatus
from tests.app.commissioning.bring_up.faulty_bus import BELIEVED, HOME, PERIOD, TABLE, Fault, FaultyBus, Wall

COUNT = 2.0 * math.pi / 2.0**BELIEVED.drive.encoder_bits
FIVE = math.radians(5.0)
ASIDE = (0.1, 0.08, 0.38)
TOOL_WAY = 0.006  # nothing of one fault drops the tool further; see docs/commissioning.md [m]
JOINT_WAY = 0.025  # the same of a shaft, where a brake bites at once [rad]


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    wall = Wall()
    monkeypatch.setattr("app.commissioning.check_drives.DURATION", 0.15)
    monkeypatch.setattr("app.commissioning.check_drives.time", wall)
    return wall


@dataclass
class Looking:
    """Somebody who sees where the tool is."""

    bus: FaultyBus

    def sees_room(self, believed: float, needed: float) -> bool:
        return float(self.bus.tool()[2]) >= needed

    def tool(self, believed: np.ndarray) -> np.ndarray:
        return self.bus.tool()


def axes(bus: FaultyBus) -> list[Finding]:
    return try_axes(bus, BELIEVED, TABLE, Looking(bus), lambda _: None)


def devices(bus: FaultyBus) -> list[Finding]:
    return check_bus(bus, BELIEVED, TABLE)


def wrong(findings: list[Finding]) -> list[Finding]:
    return [one for one in findings if one.state is CheckState.WRONG]


AXES: list[tuple[str, Fault, str, str, str]] = [
    ("encoder sign", Fault(reads=(1.0, -1.0, 1.0)), "axis 2", "falls at -", "sign of joint 2"),
    ("torque sign", Fault(pulls=(1.0, 1.0, -1.0)), "axis 3", "pulls the wrong way", "torque's sign in drive 3"),
    ("motor cables", Fault(motors=(1, 0, 2)), "axis", "moves encoder", "axes 1 and 2 are exchanged"),
    ("encoder cables", Fault(encoders=(0, 2, 1)), "axis", "moves encoder", "axes 2 and 3 are exchanged"),
    ("brake stuck", Fault(stuck=0), "axis 1", "does not turn while the others fall", "brake of axis 1 stays closed"),
    ("brake slack", Fault(slack=2), "axis 3", "turned by", "does not hold"),
    ("zero", Fault(zero=(0.0, FIVE, 0.0)), "axis 2", "-5.0°", "add -0.08"),
    ("encoder dead", Fault(frozen=1), "axis 2", "the other axes feel that its shaft turns", "encoder is dead"),
    ("torque doubled", Fault(pulls=(2.0, 1.0, 1.0)), "axis 1", "of the commanded torque, 0.66", "torque constant"),
    ("torque halved", Fault(pulls=(1.0, 1.0, 0.5)), "axis 3", "of the commanded torque, 0.66", "torque constant"),
    ("ratio", Fault(reads=(0.5, 1.0, 1.0)), "axis 1", "of the motion", "ratio of joint 1"),
    ("a bit", Fault(reads=(1.0, 2.0, 1.0)), "axis 2", "of the motion", "encoder_bits"),
    ("motor off", Fault(pulls=(1.0, 0.0, 1.0)), "axis 2", "reaches it", "no power"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("fault", "device", "found", "advice"), [row[1:] for row in AXES], ids=[row[0] for row in AXES]
)
@pytest.mark.parametrize(("seed", "place"), [(None, HOME), (8, ASIDE)])
def test_each_planted_fault_is_stopped_with_its_sentence(
    wall: Wall, fault: Fault, device: str, found: str, advice: str, seed: int | None, place: tuple[float, float, float]
) -> None:
    bus = FaultyBus(wall, fault, seed, place)
    before = wrong(devices(bus))
    assert not before
    first = wrong(axes(bus))[0]
    assert first.device.startswith(device)
    assert found in first.found
    assert advice in first.advice
    assert bus.tool_way < TOOL_WAY
    assert bus.joint_way < JOINT_WAY < TOTAL_WAY
    assert bus.plant.braked
    assert not bus.commands[-1].enable


@pytest.mark.parametrize(
    ("seed", "place"), [(None, HOME), (None, ASIDE), *((seed, (HOME, ASIDE)[seed % 2]) for seed in range(1, 9))]
)
def test_a_robot_without_faults_passes_whatever_it_weighs(
    wall: Wall, seed: int | None, place: tuple[float, float, float]
) -> None:
    bus = FaultyBus(wall, Fault(), seed, place)
    assert not wrong(devices(bus))
    found = axes(bus)
    assert {one.state for one in found} == {CheckState.GOOD}, wrong(found)
    assert bus.tool_way < TOOL_WAY
    assert bus.joint_way < JOINT_WAY
    assert bus.plant.braked


@pytest.mark.parametrize(
    ("fault", "what", "advice"),
    [
        (Fault(gone=1), "brakes", "do not hold"),
        (Fault(watchdog=False), "watchdog", "44 ms after the last command"),
        (Fault(pads=(0.8, 0.0)), "right pad", "set the sensor's zero"),
        (Fault(dead_pad=1), "left sensor", "dead"),
    ],
)
def test_devices_names_what_the_drives_and_sensors_lack(wall: Wall, fault: Fault, what: str, advice: str) -> None:
    bus = FaultyBus(wall, fault)
    first = wrong(devices(bus))[0]
    assert first.what == what
    assert advice in first.advice
    assert bus.plant.braked
    assert all(command.brake for command in bus.commands)


def test_the_watchdog_is_measured(wall: Wall) -> None:
    found = next(one for one in devices(FaultyBus(wall, Fault())) if one.what == "watchdog")
    assert found.state is CheckState.GOOD
    assert "trips after 39 to 44 ms" in found.found


def test_whole_arms_that_changed_places_show_in_the_measured_tool(wall: Wall) -> None:
    """Motor and encoder of one axis agree then, and only a pose that is not symmetric tells."""
    bus = FaultyBus(wall, Fault(encoders=(0, 2, 1), motors=(0, 2, 1)), None, ASIDE)
    first = wrong(axes(bus))[0]
    assert "arms 2 and 3 were exchanged" in first.found


def test_coarse_scales_of_all_encoders_end_by_time(wall: Wall) -> None:
    """No encoder tells then how far the arm falls: the openings' length does."""
    bus = FaultyBus(wall, Fault(reads=(1 / 16, 1 / 16, 1 / 16)), None)
    assert "encoder_bits" in wrong(axes(bus))[0].advice
    assert bus.joint_way < TOTAL_WAY


def test_a_tool_near_the_board_is_not_dropped(wall: Wall) -> None:
    bus = FaultyBus(wall, Fault(), None, (0.0, 0.0, 0.43))
    first = wrong(axes(bus))[0]
    assert first.what == "room"
    assert bus.joint_way < 1e-4


def test_brakes_as_slow_as_those_of_servomotors_are_allowed_for(wall: Wall) -> None:
    """20 ms to open and to bite: the arm falls on meanwhile, and what is measured stays right."""
    bus = FaultyBus(wall, Fault(slow=round(0.02 / PERIOD)), None, ASIDE)
    assert not wrong(axes(bus))
    assert JOINT_WAY < bus.joint_way < TOTAL_WAY


def test_slower_brakes_end_the_step_before_the_whole_way_is_used_up(wall: Wall) -> None:
    bus = FaultyBus(wall, Fault(slow=round(0.04 / PERIOD)), None, ASIDE)
    found = wrong(axes(bus))
    assert "the brakes are too slow" in found[0].found
    assert bus.joint_way < TOTAL_WAY
    assert bus.plant.braked


def test_drives_that_trip_meanwhile_end_the_step_on_the_brakes(wall: Wall) -> None:
    bus = FaultyBus(wall, Fault(), None)
    opened = 0
    exchange = bus.exchange

    def trip(command):  # type: ignore[no-untyped-def]
        nonlocal opened
        opened += not command.brake
        said = exchange(command)
        return said._replace(status=said.status | DriveStatus.FAULT) if opened == 3 else said

    bus.exchange = trip  # type: ignore[method-assign]
    found = wrong(axes(bus))
    assert [one.what for one in found] == ["stopped"]
    assert "fault" in found[0].found
    assert bus.plant.braked
    assert opened == 3


def test_amplifiers_that_do_not_switch_on_end_the_step_with_closed_brakes(wall: Wall) -> None:
    bus = FaultyBus(wall, Fault(), None)
    exchange = bus.exchange

    def off(command):  # type: ignore[no-untyped-def]
        said = exchange(command)
        return said._replace(status=said.status & ~DriveStatus.ENABLED)

    bus.exchange = off  # type: ignore[method-assign]
    assert "do not switch on" in wrong(axes(bus))[0].found
    assert all(command.brake for command in bus.commands)


def test_an_interrupt_leaves_the_arm_on_its_brakes(wall: Wall) -> None:
    bus = FaultyBus(wall, Fault(), None)
    watched = WatchedBus(bus, COUNT)
    exchange = bus.exchange

    def interrupted(command):  # type: ignore[no-untyped-def]
        said = exchange(command)
        if not command.brake:
            raise KeyboardInterrupt
        return said

    bus.exchange = interrupted  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        watched.open_briefly(np.zeros(3))
    assert bus.plant.braked
    assert not bus.commands[-1].enable


@pytest.mark.parametrize("held_up", [1, 2, 9])
def test_an_opening_with_a_tick_that_was_none_is_done_again(wall: Wall, held_up: int) -> None:
    """After its fifth tick ticks are counted one too far; of the first so many openings."""
    bus = FaultyBus(wall, Fault(), None)
    exchange, openings, opened, ahead = bus.exchange, [0], [0], [0]

    def late(command):  # type: ignore[no-untyped-def]
        said = exchange(command)
        opened[0] = 0 if command.brake else opened[0] + 1
        openings[0] += opened[0] == 1
        ahead[0] += opened[0] == 5 and openings[0] <= held_up
        return said._replace(tick=said.tick + ahead[0])

    bus.exchange = late  # type: ignore[method-assign]
    whole = WatchedBus(FaultyBus(wall, Fault(), None), COUNT).open_briefly(np.zeros(3))
    opening = WatchedBus(bus, COUNT).open_briefly(np.zeros(3))
    assert openings[0] == min(held_up + 1, 3)
    off = np.abs(accelerations(opening) / accelerations(whole) - 1.0).max()
    assert off < 0.01 if held_up < 3 else off > 0.1


# ------------------------------------------------------------------------------------------------------ pure functions


def falling(acceleration: list[float], delay: float) -> BrakeOpening:
    time = np.arange(30) * BELIEVED.drive.tick
    angle = 0.3 + 0.5 * np.array(acceleration) * np.maximum(time - delay, 0.0)[:, None] ** 2
    return BrakeOpening(np.zeros(3), time, angle, np.zeros((30, 3)), np.zeros(3))


@pytest.mark.parametrize("delay", [0.0, 0.0066, 0.0132])
def test_accelerations_do_not_count_the_brakes_own_delay(delay: float) -> None:
    asked = [40.0, -20.0, 0.0]
    assert accelerations(falling(asked, delay)) == pytest.approx(asked, abs=1e-6)


def test_an_opening_that_is_too_short_tells_nothing() -> None:
    whole = falling([40.0, 40.0, 40.0], 0.0)
    short = BrakeOpening(whole.torque, whole.time[:5], whole.angle[:5], whole.velocity[:5], whole.stopping)
    assert not accelerations(short).any()


def expected() -> Expected:
    found = Expected.at(DeltaModel(BELIEVED), posture_at(DeltaModel(BELIEVED), np.array(ASIDE)).y)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("gains", "what"), [([0.0, 1.0, 0.1], "cables"), ([-1.0, 0.1, 0.0], "torque"), ([0.1, 0.0, 0.1], "torque")]
)
def test_of_a_motor_is_told_whom_it_reaches_and_how(gains: list[float], what: str) -> None:
    said = judge_torque(0, np.array(gains))
    assert (said.what, said.state) == (what, CheckState.WRONG)


def test_signs_show_in_one_opening_and_what_is_doubtful_is_looked_at_first() -> None:
    asked = np.array([-0.5, -0.75, -1.0])
    assert judge_together(0.8 * asked, asked) == []
    (sign,) = judge_together(asked * (1.0, -1.0, 1.0), asked)
    assert "torque's sign in drive 2" in sign.advice
    assert most_doubtful(asked * (1.2, 1.2, 0.5), asked)[0] == 2
    assert most_doubtful(asked[[1, 0, 2]], asked)[-1] == 2


def test_the_weaker_brake_is_the_one_that_gives_way() -> None:
    velocity = np.array([0.6, 0.3, 0.3])
    assert all(one.state is CheckState.GOOD for one in judge_bite(np.array([0.012, 0.006, 0.009]), velocity))
    said = judge_bite(np.array([0.001, 0.0015, 0.0005]), velocity)
    assert [one.device for one in said if one.state is CheckState.WRONG] == ["axis 2"]


def test_a_shaft_that_its_motor_did_not_hold_is_looked_at_before_all_others() -> None:
    assert ran_on(np.array([0.013, 0.005, 0.085])) == [2]
    assert ran_on(np.array([0.005, 0.001, 0.001])) == []  # little
    assert ran_on(np.array([0.05, 0.04, 0.04])) == []  # all brakes are slow


def test_the_free_shaft_of_a_dead_encoder_is_felt_by_the_others() -> None:
    model = expected()
    answer = np.linalg.solve(model.inertia, np.array([0.0, 0.5, 0.0]))
    assert coupling_of(1, answer, 0.5, model) == pytest.approx(1.0)
    assert coupling_of(1, np.zeros(3), 0.5, model) == 0.0


def test_zeros_are_told_as_the_offset_to_add() -> None:
    believed = np.array([0.1, 0.2, 0.3])
    found = judge_zero(believed, believed + np.array([0.0, 0.02, -FIVE]))
    assert [one.state for one in found] == [CheckState.GOOD, CheckState.GOOD, CheckState.WRONG]
    assert "add -0.0873 rad (-5.0°) to the offset of joint 3" in found[2].advice


def test_an_opening_ends_as_soon_as_the_arm_has_come_far_enough(wall: Wall) -> None:
    opening = WatchedBus(FaultyBus(wall, Fault(), None), COUNT).open_briefly(np.zeros(3))
    turned = np.abs(opening.angle - opening.angle[0]).max(axis=1)
    assert turned[-2] < OPENING_WAY <= turned[-1]
