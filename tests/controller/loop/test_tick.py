"""A tick in one compiled call comes to the same as one that is looked at step by step, in every bit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.law.task_space import TaskSpaceController
from controller.loop.supervisor import Supervisor
from controller.loop.tick import FlightRing, plain_tick
from controller.model.constants import DeltaModel
from controller.protection.limits import Limits, default_limits
from controller.protocol import Guard
from controller.protocol.datagram_fields import CommandCode, MotionFlag
from controller.protocol.messages import AdmitSpeed, Announce, Samples
from controller.protocol.states import State
from controller.settings import ControllerSettings
from hardware.contact_speeds import CONTACT_PROFILES
from hardware.interfaces import DriveStatus, Measurement
from hardware.parameters import load_parameters
from hardware.table import TableSettings
from tests.controller.conftest import FakeBus, line_samples

PARAMETERS = load_parameters()
ALONE, NEAR_PEOPLE = (
    default_limits(PARAMETERS, TableSettings(limits=CONTACT_PROFILES[name])) for name in ("default", "separation")
)
EVERYWHERE = (0.0, 0.0, 0.0, 1.0) * 4
"""Planes that a speed is admitted between: all space."""


class Arm:
    """A supervisor with a plant of its own; ``closely``: none of its ticks is plain."""

    def __init__(self, closely: bool, limits: Limits = ALONE) -> None:
        self.bus = FakeBus(PARAMETERS)
        law = TaskSpaceController(DeltaModel(PARAMETERS))
        self.supervisor = Supervisor(law, limits, ControllerSettings(), self.bus.period, lockstep=True)
        self.ring, self.plain, self.closely = FlightRing(4000), 0, closely
        self.supervisor.plain.note_into(self.ring)

    def tick(self, noise: tuple[float, float], status: DriveStatus) -> Measurement:
        supervisor = self.supervisor
        measurement = self.bus.exchange(supervisor.command())
        right, left = measurement.tactile
        measurement = measurement._replace(
            tactile=(right + noise[0], left + noise[1]), status=measurement.status | status
        )
        if measurement.tick == supervisor.measurement.tick:
            supervisor.told_again(measurement)
            return measurement
        taken = self.ring.count
        if self.closely:
            supervisor.look_closer(measurement)
        else:
            supervisor.advance(measurement)
            self.plain += self.ring.count - taken
        return measurement

    def all_it_knows(self) -> tuple[Any, ...]:
        one = self.supervisor
        return (
            one._memory.block.tobytes(), one.law.memory.tobytes(), one.state, one.cause, one.measurement, one.torque,
            one.force, one.admission.ended, one.clamped, one.reference.finger_velocity, one.may_exchange, one.busy,
        )  # fmt: skip


EVENTS = st.sampled_from(["push", "stop", "hold", "resume", "admit", "warm", "fault", "nothing", "nothing"])


@settings(max_examples=25)
@given(
    draws=st.lists(st.tuples(st.integers(1, 60), EVENTS), min_size=1, max_size=8),
    guard=st.sampled_from([Guard.NONE, Guard.GRIP, Guard.TOUCH, Guard.HELD]),
    level=st.sampled_from([0.5, 3.0]),
    way=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-0.05, 0.02)),
    length=st.integers(60, 300), fingers=st.sampled_from([-0.03, 0.0, 0.02]), seed=st.integers(0, 1000),
    limits=st.sampled_from([ALONE, NEAR_PEOPLE]),
)  # fmt: skip
def test_whatever_happens_both_know_the_same_after_each_tick(
    draws: list[tuple[int, str]], guard: Guard, level: float, way: tuple[float, float, float], length: int,
    fingers: float, seed: int, limits: Limits,
) -> None:  # fmt: skip
    rng = np.random.default_rng(seed)
    arms = Arm(closely=False, limits=limits), Arm(closely=True, limits=limits)
    for arm in arms:
        arm.bus.object_at = 0.006
        for _ in range(4):
            arm.tick((0.0, 0.0), DriveStatus.OK)
        assert arm.supervisor.state is State.HOLD
    start = arms[0].supervisor.reference.position.copy()
    samples = line_samples(tuple(start), tuple(start + way), length, PARAMETERS.drive.tick)
    samples["guard"], samples["guard_level"], samples["finger_velocity"] = int(guard), level, fingers
    for arm in arms:
        supervisor = arm.supervisor
        supervisor.announce(Announce(1, supervisor.measurement.tick + 3, length + 1, MotionFlag.NONE))
        for at in range(0, length + 1, 10):
            supervisor.take_samples(Samples(1, at, samples[at : at + 10]))
    for ticks, event in draws:
        push = (9.0, 9.0) if event == "push" else (0.0, 0.0)
        status = DriveStatus.OVERSPEED if event == "fault" else DriveStatus.OK
        for arm in arms:
            supervisor = arm.supervisor
            if event == "stop":
                supervisor.machine.press_stop()
            elif event in ("hold", "resume"):
                supervisor.obey(CommandCode[event.upper()])
            elif event == "admit":
                until = supervisor.measurement.tick + 100
                supervisor.admission.playback.admit(AdmitSpeed(0.5, until, EVERYWHERE), supervisor.measurement.tick)
            elif event == "warm":
                supervisor._protection._screen.squares[1] = 0.96 * PARAMETERS.drive.rated_torque**2
        for _ in range(ticks):
            noise = rng.normal(0.0, 0.02, 2)
            seen = (float(noise[0]) + push[0], float(noise[1]) + push[1])
            if not arms[0].supervisor.may_exchange:
                assert not arms[1].supervisor.may_exchange
                break
            told = {arm.tick(seen, status) for arm in arms}
            assert len(told) == 1
            assert arms[0].all_it_knows() == arms[1].all_it_knows()
            status = DriveStatus.OK
    assert arms[1].plain == 0


def test_an_arm_that_moves_is_nearly_always_plain_and_its_rows_say_what_the_recorder_would() -> None:
    arm = Arm(closely=False)
    for _ in range(4):
        arm.tick((0.0, 0.0), DriveStatus.OK)
    start = arm.supervisor.reference.position.copy()
    samples = line_samples(tuple(start), (start[0] + 0.03, start[1], start[2]), 500, PARAMETERS.drive.tick)
    arm.supervisor.announce(Announce(1, arm.supervisor.measurement.tick + 3, 501, MotionFlag.NONE))
    for at in range(0, 501, 10):
        arm.supervisor.take_samples(Samples(1, at, samples[at : at + 10]))
    for _ in range(400):
        arm.tick((0.0, 0.0), DriveStatus.OK)
    assert arm.plain >= 399
    one, row = arm.supervisor, arm.ring.rows[arm.ring.count - 1]
    assert (row["tick"], row["state"], row["motion"]) == (one.measurement.tick, State.TRACK, 1)
    assert row["index"] == one.admission.motion.executed
    np.testing.assert_array_equal(row["torque"], one.torque)
    np.testing.assert_array_equal(row["reference"], one.reference.position)
    np.testing.assert_array_equal(row["position"], one.law.state.position)
    np.testing.assert_array_equal(row["velocity"], one.law.state.velocity)
    np.testing.assert_array_equal(row["force"], one.force)
    np.testing.assert_array_equal(row["angle"], one.measurement.angle)
    np.testing.assert_array_equal(row["torque_asked"], one.law.state.torque)
    assert row["drive_status"] == one.measurement.status


@pytest.mark.parametrize("sick", ["angle", "velocity", "tactile", "finger_position"])
def test_a_sensor_without_a_number_is_never_plain_and_changes_nothing(sick: str) -> None:
    arm = Arm(closely=False)
    for _ in range(6):
        said = arm.tick((0.0, 0.0), DriveStatus.OK)
    values = {"angle": (math.nan, 0.0, 0.0), "velocity": (0.0, math.inf, 0.0), "tactile": (math.nan, 0.0),
              "finger_position": math.nan}  # fmt: skip
    before = arm.all_it_knows()
    assert arm.supervisor.plainly
    assert not arm.supervisor.plain.take(said._replace(tick=said.tick + 1, **{sick: values[sick]}))
    assert arm.all_it_knows() == before


def test_the_interpreted_tick_is_the_compiled_one() -> None:
    """What the coverage of lines sees is what runs."""
    interpreted = getattr(plain_tick, "py_func", plain_tick)
    arms = Arm(closely=False), Arm(closely=False)
    for arm in arms:
        for _ in range(5):
            arm.tick((0.0, 0.0), DriveStatus.OK)
    said, again = (arm.bus.exchange(arm.supervisor.command()) for arm in arms)
    assert said == again
    one, other = (arm.supervisor for arm in arms)
    assert one.plainly
    assert other.plainly
    assert one.plain.take(said)
    ring, plain = arms[1].ring, other.plain
    found = interpreted(
        other.law.memory, other._memory.block, other.admission.motion.rows, ring.floats, ring.wholes, plain._saved,
        ring.notes, float(said.tick), said.angle, said.velocity, said.finger_position, said.tactile, int(said.status),
    )  # fmt: skip
    assert found == 0
    assert one._memory.block.tobytes() == other._memory.block.tobytes()
    assert arms[0].ring.floats.tobytes() == ring.floats.tobytes()
