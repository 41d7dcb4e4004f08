"""The force on the tool from torques and motion: against forces that are known, on the constrained dynamics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from controller.law.force_observer import ForceObserver
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.kinematics import OK
from controller.offline.simulation import ConstrainedArm, Moment
from hardware.interfaces import Triple
from hardware.parameters import load_parameters

PARAMETERS = load_parameters()
MODEL = DeltaModel(PARAMETERS)
TICK = PARAMETERS.drive.tick
COUNT = 2.0 * np.pi / 2**PARAMETERS.drive.encoder_bits
CENTRE = (0.0, 0.0, 0.45)
NOTHING = (0.0, 0.0, 0.0)


def triple(values: FloatArray) -> Triple:
    a, b, c = (float(v) for v in values)
    return a, b, c


class GuardFeed:
    """The law with an observer beside it, as in the controller: encoders, velocity by differences, a late torque.

    Attributes:
        told: the force that the observer told in each tick.
    """

    def __init__(self, model: DeltaModel, reference: Callable[[float], FloatArray], start: FloatArray) -> None:
        self.law, self.observer = TaskSpaceController(model), ForceObserver(TICK)
        self.told: list[Triple] = []
        self._reference = reference
        self._angle = np.round(start / COUNT) * COUNT
        self._given: list[Triple | None] = [None, None]

    def __call__(self, moment: Moment) -> Triple:
        angle = np.round(np.array(moment.angle) / COUNT) * COUNT
        velocity = triple((angle - self._angle) / TICK)
        self._angle = angle
        self.told.append(self.observer.update(self.law.memory, velocity, self._given.pop(0)))
        assert self.law.update(triple(angle), velocity) == OK
        torque = self.law.torque(self._reference(moment.time))
        self._given.append(torque)
        return torque


def stay(point: Triple, omega: float) -> Callable[[float], FloatArray]:
    row = pack_reference(point, stiffness=(omega**2,) * 3, damping=(2.0 * omega,) * 3)
    return lambda time: row


def swing(time: float) -> FloatArray:
    """An ellipse over the board at up to 0.8 m/s."""
    w = 8.0
    centre, a, b = np.array(CENTRE), np.array([0.10, 0.02, 0.0]), np.array([0.0, 0.06, 0.03])
    c, s = np.cos(w * time), np.sin(w * time)
    return pack_reference(
        triple(centre + a * c + b * s), velocity=triple(w * (b * c - a * s)),
        acceleration=triple(-(w**2) * (a * c + b * s)), stiffness=(4900.0,) * 3, damping=(140.0,) * 3,
    )  # fmt: skip


def watch(
    reference: Callable[[float], FloatArray],
    ticks: int,
    force: Callable[[float], Triple],
    model: DeltaModel = MODEL,
) -> FloatArray:
    """What the observer tells in each tick, shape (ticks, 3) [N]."""
    arm = ConstrainedArm(MODEL)
    row = reference(0.0)
    start = arm.at(row[:3], row[3:6])
    watched = GuardFeed(model, reference, start.q[[0, 3, 6]])
    arm.simulate_sampled(start, watched, ticks, lambda moment: force(moment.time))
    return np.array(watched.told)


@pytest.mark.parametrize("point", [CENTRE, (0.14, -0.14, 0.44), (-0.2, 0.15, 0.40)])
def test_a_steady_push_is_told_in_size_and_direction(point: Triple) -> None:
    push = (4.0, -3.0, -6.0)
    told = watch(stay(point, 70.0), 400, lambda time: push if time > 0.1 else NOTHING)
    np.testing.assert_allclose(told[60:110].mean(axis=0), NOTHING, atol=0.05)
    np.testing.assert_allclose(told[-100:].mean(axis=0), push, atol=0.05)
    print(f"noise at rest at {point} m: {told[60:110].std(axis=0).max():.3f} N")
    assert told[60:110].std(axis=0).max() < 0.2


def test_a_step_of_force_is_told_within_milliseconds() -> None:
    told = watch(stay(CENTRE, 20.0), 200, lambda time: (0.0, 0.0, -10.0) if time >= 100 * TICK else NOTHING)
    half = int(np.argmax(told[:, 2] < -5.0))
    assert np.argmax(told[:, 2] < -9.0) - 100 < 20
    print(f"half of a step is told after {(half - 100) * TICK * 1e3:.1f} ms")
    assert 100 < half <= 106


def test_a_free_motion_feels_no_force() -> None:
    told = watch(swing, 1500, lambda time: NOTHING)[50:]
    print(f"told on an ellipse at up to 0.8 m/s: at most {np.abs(told).max():.2f} N")
    assert np.abs(told).max() < 0.3


def test_a_force_in_motion_is_told() -> None:
    told = watch(swing, 1000, lambda time: (0.0, 0.0, -5.0) if time > 0.4 else NOTHING)
    np.testing.assert_allclose(told[600:].mean(axis=0), (0.0, 0.0, -5.0), atol=0.1)


def test_a_payload_that_the_model_has_weighs_nothing() -> None:
    told = watch(stay(CENTRE, 70.0), 300, lambda time: NOTHING, DeltaModel(PARAMETERS, 0.05))
    np.testing.assert_allclose(told[-50:].mean(axis=0), (0.0, 0.0, -0.05 * 9.80665), atol=0.05)


def test_on_the_brakes_and_without_a_pose_nothing_is_told() -> None:
    observer, law = ForceObserver(TICK), TaskSpaceController(MODEL)
    start = ConstrainedArm(MODEL).at(CENTRE)
    angle = triple(start.q[[0, 3, 6]])
    assert observer.update(law.memory, NOTHING, (5.0, 5.0, 5.0)) == NOTHING  # no pose yet
    law.update(angle, NOTHING)
    hold = law.holding_torque()
    twice = (2.0 * hold[0], 2.0 * hold[1], 2.0 * hold[2])
    assert observer.update(law.memory, NOTHING, None) == NOTHING
    assert observer.update(law.memory, NOTHING, twice) == NOTHING  # the mean with what was not known
    assert not observer.known
    assert observer.update(law.memory, NOTHING, twice)[2] > 0.1  # what keeps it from rising pushes down
    assert observer.known
    assert observer.update(law.memory, NOTHING, None) == NOTHING
    assert not observer.known
