"""What openings of the brakes say of encoders, motors, brakes and cables: pure functions of measured numbers.

An arm that falls freely falls as its geometry has it, whatever it weighs: so encoders are judged before any torque is
believed. A torque on one axis then changes its fall by ``M⁻¹ u``: so the torque's sign, its size, and which axis it
reaches are judged against the model's inertia.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.commissioning.check_report import Finding, Judge
from controller.law.task_space import TaskSpaceController
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel

STANDS: Final = 1e-4
"""An axis that has turned by less while the brakes were open stands [rad], unless its encoder is coarser."""
SLIP: Final = 5e-4
"""Of a closed brake [rad]: a hundred times what its spring gives in simulation."""
SCALE: Final = (0.7, 1.4)
"""Encoders: share of the expected fall. Masses of 20 % and a zero 5° off change it by up to 15 %, a wrong ratio or a
bit of the encoder by a factor of two."""
GAIN: Final = (0.66, 1.5)
"""Torques: share of the expected. Masses and inertias of 20 % are in it; a wrong constant is a factor of two."""
SWAPS: Final = ((1, 0, 2), (0, 2, 1), (2, 1, 0))
"""Orders in which two of three axes have changed places."""
BACKWARDS: Final = 0.2
"""A torque that acts the other way by more than this share of it has the wrong sign."""
STOPPING: Final = 3e-3
"""A brake that stops its shaft within the way of so long is good [s], however well the others do."""
UNEVEN: Final = 2.2
"""Else it may take so many times as long as the others; one of 8 N m that is left with 2 takes three times as long."""
RAN_ON: Final = 0.02
"""A shaft that turns on by more [rad] and much more than the others was not held by its motor, or has a weak brake."""
FLOATS: Final = 0.5
"""Share of the free fall that gravity compensation may leave: masses of 20 % leave 0.2, a missing torque 1."""
ZERO_OFFSET: Final = 0.026
"""Of an encoder's zero [rad], 1.5°: a tool point that a person measures to 3 mm leaves 1°."""
COUPLED: Final = 0.5
"""Share of the expected coupling from which on a shaft counts as free, though its own encoder stands: one that is stuck
shows none, but for what a bus measures wrongly."""


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """What the model has the arm do in its pose."""

    inertia: FloatArray
    """M_y, (3, 3) [kg m²]."""
    gravity: FloatArray
    """Torques that hold the arm, (3,) [N m]."""
    fall: FloatArray
    """Accelerations without any torque, brakes open, (3,) [rad/s²]."""

    @classmethod
    def at(cls, model: DeltaModel, angle: FloatArray) -> Expected | None:
        """At servomotor angles, (3,) [rad]; None: no pose belongs to them."""
        law = TaskSpaceController(model)
        a, b, c = angle.tolist()
        if law.update((a, b, c), (0.0, 0.0, 0.0)) != 0:
            return None
        inertia, gravity = law.state.inertia.copy(), law.state.gravity.copy()
        friction = np.array([model.parameters.arm(axis).coulomb for axis in range(3)])
        return cls(inertia, gravity, np.linalg.solve(inertia, -gravity - friction))


def judge_brake(axis: int, pulled: float, torque: float) -> Finding:
    """Of one axis, 0 to 2: how far its closed brake let it turn [rad] under a torque [N m]."""
    judge = Judge(f"axis {axis + 1}")
    judge.judge(
        "brake holds", f"turned by {1e3 * pulled:.2f} mrad under {torque:.1f} N m, {1e3 * SLIP:.1f} mrad allowed",
        pulled <= SLIP,
        "a closed brake does not hold: secure the arm, then check the brakes and their supply before anything else",
    )  # fmt: skip
    return judge.findings[0]


def standing_axes(turned: FloatArray, count: float) -> list[int]:
    """Axes that stood while the brakes were open: how far each turned, (3,), and a count of their encoders [rad]."""
    return [axis for axis in range(3) if abs(turned[axis]) < max(STANDS, 1.5 * count)]


def judge_fall(fall: FloatArray, velocity: FloatArray, expected: Expected) -> list[Finding]:
    """Encoders: whether they count downwards, and as far as the servomotors fall.

    An encoder that counts wrongly has the arm believed in another pose, in which all axes fall otherwise: so a wrong
    sign is told before any scale is judged, and of several scales the one that is farthest off.

    Args:
        fall: measured accelerations, (3,) [rad/s²].
        velocity: as the drives say it, less the change of their own angles over the last ticks, as a share of it, (3,).
        expected: by the model.
    """
    share = fall / expected.fall
    said = [f"falls at {a:.0f} rad/s², {b:.0f} expected" for a, b in zip(fall, expected.fall, strict=True)]
    judges = [Judge(f"axis {axis + 1}") for axis in range(3)]
    for axis in np.flatnonzero(share < 0.0).tolist():
        advice = f"the encoder counts upwards: change the sign of joint {axis + 1} in [drives], or its direction"
        judges[axis].wrong("encoder", said[axis], advice)
    if (share < 0.0).any():
        return [finding for judge in judges for finding in judge.findings]
    farthest = int(np.abs(np.log(np.maximum(share, 1e-6))).argmax())
    if not SCALE[0] <= share[farthest] <= SCALE[1]:
        judges[farthest].wrong(
            "encoder", f"{said[farthest]}: it reads {share[farthest]:.2f} of the motion",
            f"check the ratio of joint {farthest + 1} and its encoder_bits: a bit is a factor of two",
        )  # fmt: skip
        return judges[farthest].findings
    for axis, judge in enumerate(judges):
        if abs(velocity[axis]) > 0.5:
            judge.wrong(
                "velocity", f"the drive tells {1.0 + velocity[axis]:.2f} of the rate at which its angle changes",
                f"check the velocity's scale and sign in drive {axis + 1}",
            )  # fmt: skip
        else:
            judge.good("encoder", said[axis])
    return [finding for judge in judges for finding in judge.findings]


def judge_standing(axis: int, coupling: float) -> Finding:
    """Of an axis that stood while others fell.

    ``coupling``: how the others answered a torque on it, as a share of what the model says of a free shaft.
    """
    judge = Judge(f"axis {axis + 1}")
    if coupling > COUPLED:
        judge.wrong(
            "encoder", "reads no motion, but the other axes feel that its shaft turns",
            f"the encoder is dead: check its cable and supply at drive {axis + 1}",
        )  # fmt: skip
    else:
        judge.wrong(
            "brake opens", "its shaft does not turn while the others fall, and they feel no torque on it",
            f"the brake of axis {axis + 1} stays closed: check its cable and supply, then whether the shaft jams",
        )  # fmt: skip
    return judge.findings[0]


def judge_all_standing(longest: float) -> Finding:
    """Nothing moved within so long [s]."""
    judge = Judge("brakes")
    judge.wrong(
        "open", f"no axis moved while the brakes were told to open for {1e3 * longest:.0f} ms",
        "the brakes stay closed: check their supply, relay and the emergency stop",
    )  # fmt: skip
    return judge.findings[0]


def coupling_of(axis: int, change: FloatArray, torque: float, expected: Expected) -> float:
    """How the other axes answered a torque on one that stood [N m], as a share of what its free shaft would do.

    ``change`` is what it made of their accelerations, (3,) [rad/s²].
    """
    others = [other for other in range(3) if other != axis]
    answer = np.linalg.inv(expected.inertia)[others, axis] * torque
    return float(change[others] @ answer / (answer @ answer))


def judge_torque(axis: int, gains: FloatArray) -> Finding:
    """A motor: which axis its torque reaches, with which sign, and how strongly.

    ``gains``: torques that acted on the shafts, as shares of what was asked of this axis alone, (3,).
    """
    judge = Judge(f"axis {axis + 1}")
    reached = int(np.abs(gains).argmax())
    gain = float(gains[reached])
    said = f"{gain:.2f} of the commanded torque"
    if abs(gain) < 0.2:
        judge.wrong(
            "torque", f"{said} reaches it",
            f"the motor has no power: check the cable and the fuses of axis {axis + 1}",
        )  # fmt: skip
    elif reached != axis:
        one, other = sorted((axis + 1, reached + 1))
        judge.wrong(
            "cables", f"a torque on axis {axis + 1} moves encoder {reached + 1}",
            f"the cables of axes {one} and {other} are exchanged, of the motors or of the encoders",
        )  # fmt: skip
    elif gain < 0.0:
        judge.wrong(
            "torque", f"{said}: it pulls the wrong way",
            f"invert the torque's sign in drive {axis + 1}: its angle already counts as it should",
        )  # fmt: skip
    elif not GAIN[0] <= gain <= GAIN[1]:
        judge.wrong(
            "torque", f"{said}, {GAIN[0]:g} to {GAIN[1]:g} are allowed",
            f"check the torque constant, or the rated torque, of joint {axis + 1}, and its ratio",
        )  # fmt: skip
    else:
        judge.good("torque", said)
    return judge.findings[0]


def judge_together(acting: FloatArray, asked: FloatArray) -> list[Finding]:
    """Signs, of torques on all axes at once, both (3,) [N m]: nothing but what is wrong.

    It needs one opening of the brakes, where an axis after the other would need three: a motor that pulls the wrong way
    may also be what holds the arm until its brakes bite.
    """
    share = acting / asked
    return [judge_torque(axis, share[axis] * np.eye(3)[axis]) for axis in range(3) if share[axis] < -BACKWARDS]


def most_doubtful(acting: FloatArray, asked: FloatArray) -> list[int]:
    """Axes in the order in which they are to be looked at alone: those that differ most from what they all share."""
    share = np.log(np.maximum(acting / asked, 0.01))
    order = np.argsort(-np.abs(share - np.median(share)), kind="stable")
    return [int(axis) for axis in order]


def judge_bite(stopping: FloatArray, velocity: FloatArray) -> list[Finding]:
    """Brakes that are told to close: which is weaker than the others.

    Args:
        stopping: how far each servomotor turned on until it stood, (3,) [rad].
        velocity: of each as they were told, (3,) [rad/s]. All of them are as slow as their relay; a weak one also takes
            its time to stop its shaft.
    """
    took = stopping / np.abs(velocity)
    found: list[Finding] = []
    for axis in range(3):
        judge, others = Judge(f"axis {axis + 1}"), float(np.delete(took, axis).max())
        judge.judge(
            "brake bites", f"its way to a stop is that of {1e3 * took[axis]:.1f} ms, the others' {1e3 * others:.1f} ms",
            took[axis] <= max(STOPPING, UNEVEN * others),
            f"a closed brake does not hold as the others do: check the brake of axis {axis + 1} and its supply",
        )  # fmt: skip
        found += judge.findings
    return found


def ran_on(stopping: FloatArray) -> list[int]:
    """Axes, at most one, that turned on much farther than the others until they stood, (3,) [rad]."""
    farthest = int(stopping.argmax())
    others = float(np.delete(stopping, farthest).max())
    return [farthest] if stopping[farthest] > max(RAN_ON, UNEVEN * others) else []


def judge_floating(left: FloatArray, expected: Expected) -> Finding:
    """Accelerations that gravity compensation leaves, (3,) [rad/s²]."""
    judge = Judge("arm")
    share = float(np.abs(left / expected.fall).max())
    judge.judge(
        "floats", f"gravity compensation leaves {100.0 * share:.0f} % of the fall, {100.0 * FLOATS:.0f} % allowed",
        share <= FLOATS, "the masses of the robot's parameters are far off, or a weight hangs on the tool: check both",
    )  # fmt: skip
    return judge.findings[0]


def judge_zero(angle: FloatArray, measured: FloatArray) -> list[Finding]:
    """Zeros of the encoders.

    Args:
        angle: as the encoders say, (3,) [rad].
        measured: as they would be with the tool where a person measured it, (3,) [rad].
    """
    for order in SWAPS:
        off = np.abs(measured[list(order)] - angle).max()
        if off <= ZERO_OFFSET and np.abs(measured - angle).max() > ZERO_OFFSET:
            judge = Judge("arm")
            one, other = (axis + 1 for axis in range(3) if order[axis] != axis)
            judge.wrong(
                "arms", f"the tool is where it would be if arms {one} and {other} were exchanged",
                f"both cables of arms {one} and {other} are exchanged, or the arms are numbered differently: correct "
                "this",
            )  # fmt: skip
            return judge.findings
    found: list[Finding] = []
    for axis, off in enumerate((measured - angle).tolist()):
        judge = Judge(f"axis {axis + 1}")
        judge.judge(
            "zero",
            f"{math.degrees(off):+.1f}° from where the tool was measured, {math.degrees(ZERO_OFFSET):.1f}° allowed",
            abs(off) <= ZERO_OFFSET,
            f"add {off:+.4f} rad ({math.degrees(off):+.1f}°) to the offset of joint {axis + 1}",
        )
        found += judge.findings
    return found
