"""Faults between emulated drives and the plant: they begin, act on one device alone, and end."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from hardware.drives.joint import JointScale
from hardware.interfaces import Triple
from hardware.sim.emulated.planting import Planting
from hardware.sim.process.planted import ON_DEVICE, PlantedFault, PlantedKind

ANGLE, VELOCITY, READINGS = (0.1, 0.2, 0.3), (1.0, 2.0, 3.0), (0.5, 0.6)
SCALES = (JointScale(1.0, 0.0), JointScale(-0.5, 0.1), JointScale(1.0, 0.0))
"""The second motor turns twice for its joint, the other way round."""


class Devices:
    """Remembers what was planted."""

    def __init__(self) -> None:
        self.done: list[tuple[str, PlantedKind, int]] = []

    def plant(self, kind: PlantedKind, device: int, amount: float) -> None:
        assert amount >= 0.0
        self.done.append(("plant", kind, device))

    def mend(self, kind: PlantedKind, device: int) -> None:
        self.done.append(("mend", kind, device))


class Brakes:
    """Remembers the last shares."""

    def __init__(self) -> None:
        self.opened, self.closed = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)

    def __call__(self, opened: Triple, closed: Triple) -> None:
        self.opened, self.closed = opened, closed


def planting(*faults: PlantedFault) -> tuple[Planting, Devices, Brakes]:
    devices, brakes = Devices(), Brakes()
    return Planting(faults, SCALES, (2.0, 2.0), brakes, devices), devices, brakes


def test_nothing_planted_changes_nothing() -> None:
    one, devices, _ = planting()
    one.turn(1.0, driven=True)
    assert tuple(map(tuple, one.shown(ANGLE, VELOCITY, READINGS))) == (ANGLE, VELOCITY, READINGS)
    assert one.given(ANGLE) == ANGLE
    assert not devices.done


def test_it_begins_after_so_much_driving_and_ends_after_so_much_time() -> None:
    fault = PlantedFault(kind=PlantedKind.ENCODER_JUMP, device=3, amount=0.05, at=1.0, lasts=0.5)
    one, _, _ = planting(fault)

    def off() -> float:
        return one.shown(ANGLE, VELOCITY, READINGS).angle[2] - ANGLE[2]

    one.turn(10.0, driven=False)
    assert off() == 0.0
    one.turn(0.75, driven=True)
    assert off() == 0.0
    one.turn(0.25, driven=True)
    assert off() == pytest.approx(0.05)
    one.turn(0.25, driven=False)
    assert off() == pytest.approx(0.05)
    one.turn(0.25, driven=False)
    assert off() == 0.0


@pytest.mark.parametrize(
    ("kind", "amount", "angle", "velocity"),
    [
        (PlantedKind.ENCODER_SIGN, None, -0.2, -2.0),
        (PlantedKind.ENCODER_SCALE, 0.5, 0.1, 1.0),
        (PlantedKind.ZERO, 0.1, 0.0, 2.0),
        (PlantedKind.EXCHANGED, 3.0, 0.3, 3.0),
        (PlantedKind.ENCODERS_EXCHANGED, 3.0, 0.3, 3.0),
        (PlantedKind.ENCODER_DEAD, None, 0.2, 0.0),
    ],
)
def test_what_an_encoder_says(kind: PlantedKind, amount: float | None, angle: float, velocity: float) -> None:
    one, _, _ = planting(PlantedFault(kind=kind, device=2, amount=amount))
    one.turn(0.0, driven=False)
    said = one.shown(ANGLE, VELOCITY, READINGS)
    assert said.angle[1] == pytest.approx(angle)
    assert said.velocity[1] == pytest.approx(velocity)
    assert said.angle[0] == ANGLE[0]
    later = one.shown((0.1, 0.9, 0.3), VELOCITY, READINGS).angle[1]
    assert (later == said.angle[1]) == (kind in (PlantedKind.ENCODER_DEAD, PlantedKind.EXCHANGED,
                                                 PlantedKind.ENCODERS_EXCHANGED))  # fmt: skip


def test_what_motors_give_and_pads_read_and_brakes_do() -> None:
    one, devices, brakes = planting(
        PlantedFault(kind=PlantedKind.TORQUE_SIGN, device=1), PlantedFault(kind=PlantedKind.TORQUE_SCALE, device=2),
        PlantedFault(kind=PlantedKind.FORCE_DEAD, device=1), PlantedFault(kind=PlantedKind.FORCE_OFFSET, device=2),
        PlantedFault(kind=PlantedKind.BRAKE_STUCK, device=1), PlantedFault(kind=PlantedKind.BRAKE_SLIPS, device=3),
    )  # fmt: skip
    one.turn(0.0, driven=False)
    assert one.given((1.0, 2.0, 3.0)) == (-1.0, 1.0, 3.0)
    assert one.shown(ANGLE, VELOCITY, READINGS).readings == pytest.approx([0.0, 0.6 + 2.0 * 2.0])
    assert (brakes.opened, brakes.closed) == ((1.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    assert not devices.done


@pytest.mark.parametrize("kind", sorted(ON_DEVICE))
def test_faults_of_devices_are_theirs(kind: PlantedKind) -> None:
    one, devices, _ = planting(PlantedFault(kind=kind, device=3, lasts=1.0))
    one.turn(0.0, driven=False)
    one.turn(1.0, driven=False)
    assert devices.done == [("plant", kind, 3), ("mend", kind, 3)]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"kind": "too-hot", "amount": 3.0}, "too-hot has no amount"),
        ({"kind": "zero", "device": 4}, "of a servomotor, 1 to 3"),
        ({"kind": "exchanged", "amount": 2.5}, "give amount 1, 2 or 3"),
        ({"kind": "force-dead", "device": 3}, "of pad 1, right, or 2, left"),
    ],
)
def test_impossible_faults_are_refused(fields: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        PlantedFault.model_validate(fields)
