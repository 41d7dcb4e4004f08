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
SCALE: Final = (0.7, 1.4)
"""Encoders: share of the expected fall. Masses of 20 % and a zero 5° off change it by up to 15 %, a wrong ratio or a
bit of the encoder by a factor of two."""
GAIN: Final = (0.66, 1.5)
"""Torques: share of the expected. Masses and inertias of 20 % are in it; a wrong constant is a factor of two."""
FLOATS: Final = 0.5
"""Share of the free fall that gravity compensation may leave: masses of 20 % leave 0.2, a missing torque 1."""
COUPLED: Final = 0.3
"""Share of the expected coupling with which a shaft counts as free, though its own encoder stands."""


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


def judge_brake(axis: int, pulled: float, torque: float, slip: float) -> Finding:
    """Of one axis, 0 to 2: how far its closed brake let it turn [rad] under a torque [N m]."""
    judge = Judge(f"axis {axis + 1}")
    judge.judge(
        "brake holds", f"turned by {1e3 * pulled:.2f} mrad under {torque:.1f} N m, {1e3 * slip:.1f} mrad allowed",
        pulled <= slip,
        "a closed brake does not hold: secure the arm, then see to the brakes and their supply before anything else",
    )  # fmt: skip
    return judge.findings[0]


def standing_axes(turned: FloatArray, count: float) -> list[int]:
    """Axes that stood while the brakes were open: how far each turned, (3,), and a count of their encoders [rad]."""
    return [axis for axis in range(3) if abs(turned[axis]) < max(STANDS, 1.5 * count)]


def judge_fall(fall: FloatArray, velocity: FloatArray, expected: Expected) -> list[Finding]:
    """Encoders: whether they count downwards, and as far as the servomotors fall.

    Args:
        fall: measured accelerations, (3,) [rad/s²].
        velocity: as the drives say it, less the change of their own angles over the last ticks, as a share of it, (3,).
        expected: by the model.
    """
    found: list[Finding] = []
    for axis in range(3):
        judge, share = Judge(f"axis {axis + 1}"), float(fall[axis] / expected.fall[axis])
        said = f"falls at {fall[axis]:.0f} rad/s², {expected.fall[axis]:.0f} expected"
        if share < 0.0:
            advice = f"the encoder counts upwards: change the sign of joint {axis + 1} in [drives], or its direction"
            judge.wrong("encoder", said, advice)
        elif not SCALE[0] <= share <= SCALE[1]:
            judge.wrong(
                "encoder", f"{said}: it reads {share:.2f} of the motion",
                f"see to the ratio of joint {axis + 1} and its encoder_bits: a bit is a factor of two",
            )  # fmt: skip
        elif abs(velocity[axis]) > 0.5:
            judge.wrong(
                "velocity", f"the drive tells {1.0 + velocity[axis]:.2f} of the rate at which its angle changes",
                f"see to the velocity's scale and sign in drive {axis + 1}",
            )  # fmt: skip
        else:
            judge.good("encoder", said)
        found += judge.findings
    return found


def judge_standing(axis: int, coupling: float) -> Finding:
    """Of an axis that stood while others fell.

    ``coupling``: how the others answered a torque on it, as a share of what the model says of a free shaft.
    """
    judge = Judge(f"axis {axis + 1}")
    if coupling > COUPLED:
        judge.wrong(
            "encoder", "stands still, but the other axes feel that its shaft turns",
            f"the encoder is dead: see to its cable and supply at drive {axis + 1}",
        )  # fmt: skip
    else:
        judge.wrong(
            "brake opens", "its shaft does not turn while the others fall, nor do they feel a torque on it",
            f"the brake of axis {axis + 1} stays closed: see to its cable and supply, then whether the shaft jams",
        )  # fmt: skip
    return judge.findings[0]


def judge_all_standing(longest: float) -> Finding:
    """Nothing moved within so long [s]."""
    judge = Judge("brakes")
    judge.wrong(
        "open", f"no axis moved while they were told to be open for {1e3 * longest:.0f} ms",
        "the brakes stay closed: see to their supply, relay and the emergency stop",
    )  # fmt: skip
    return judge.findings[0]


def coupling_of(axis: int, up: FloatArray, down: FloatArray, torque: float, expected: Expected) -> float:
    """How the other axes answered a torque on one that stood, as a share of what its free shaft would do.

    ``up`` and ``down`` are accelerations under the torque against and with its gravity, (3,) [rad/s²].
    """
    others = [other for other in range(3) if other != axis]
    answered = np.linalg.inv(expected.inertia)[others, axis] * 2.0 * torque
    measured = np.abs(up - down)[others]
    return float(measured.sum() / np.abs(answered).sum())


def torque_gain(axis: int, fall: FloatArray, free: FloatArray, torque: float, expected: Expected) -> FloatArray:
    """Column ``axis`` of K in ``u_acting = K u_asked``, (3,); a column of the identity where all is right.

    Args:
        axis: 0 to 2.
        fall: accelerations under a torque on this axis, (3,) [rad/s²].
        free: without any torque, (3,) [rad/s²].
        torque: asked of it [N m].
        expected: by the model.
    """
    return np.asarray(expected.inertia @ (fall - free) / torque, dtype=np.float64)


def judge_torque(axis: int, gains: FloatArray) -> Finding:
    """A motor: which axis its torque reaches, with which sign, and how strongly; gains as of ``torque_gain``."""
    judge = Judge(f"axis {axis + 1}")
    reached = int(np.abs(gains).argmax())
    gain = float(gains[reached])
    said = f"{gain:.2f} of the torque asked for"
    if abs(gain) < 0.2:
        judge.wrong(
            "torque", f"{said} reaches it",
            f"the motor has no power: see to the cable and the fuses of axis {axis + 1}",
        )  # fmt: skip
    elif reached != axis:
        judge.wrong(
            "cables", f"a torque on axis {axis + 1} moves encoder {reached + 1}",
            f"the cables of axes {axis + 1} and {reached + 1} are exchanged, of the motors or of the encoders",
        )  # fmt: skip
    elif gain < 0.0:
        judge.wrong(
            "torque", f"{said}: it pulls the wrong way",
            f"turn the torque's sign in drive {axis + 1}: its angle already counts as it should",
        )  # fmt: skip
    elif not GAIN[0] <= gain <= GAIN[1]:
        judge.wrong(
            "torque", f"{said}, {GAIN[0]:g} to {GAIN[1]:g} are allowed",
            f"see to the torque constant, or the rated torque, of joint {axis + 1}, and to its ratio",
        )  # fmt: skip
    else:
        judge.good("torque", said)
    return judge.findings[0]


def judge_floating(left: FloatArray, expected: Expected) -> Finding:
    """Accelerations that gravity compensation leaves, (3,) [rad/s²]."""
    judge = Judge("arm")
    share = float(np.abs(left / expected.fall).max())
    judge.judge(
        "floats", f"gravity compensation leaves {100.0 * share:.0f} % of the fall, {100.0 * FLOATS:.0f} % allowed",
        share <= FLOATS, "the masses of the robot's parameters are far off, or a weight hangs at the tool: see to them",
    )  # fmt: skip
    return judge.findings[0]


def judge_zero(angle: FloatArray, measured: FloatArray, tolerance: float) -> list[Finding]:
    """Zeros of the encoders.

    Args:
        angle: as the encoders say, (3,) [rad].
        measured: as they would be with the tool where a person measured it, (3,) [rad].
        tolerance: what the person's measuring leaves open [rad].
    """
    for order in ((1, 0, 2), (0, 2, 1), (2, 1, 0)):
        off = np.abs(measured[list(order)] - angle).max()
        if off <= tolerance and np.abs(measured - angle).max() > tolerance:
            judge = Judge("arm")
            one, other = (axis + 1 for axis in range(3) if order[axis] != axis)
            judge.wrong(
                "arms", f"the tool is where it would be if arms {one} and {other} changed places",
                f"both cables of arms {one} and {other} are exchanged, or the arms are numbered otherwise: change them",
            )  # fmt: skip
            return judge.findings
    found: list[Finding] = []
    for axis, off in enumerate((measured - angle).tolist()):
        judge = Judge(f"axis {axis + 1}")
        judge.judge(
            "zero",
            f"{math.degrees(off):+.1f}° from where the tool was measured, {math.degrees(tolerance):.1f}° allowed",
            abs(off) <= tolerance, f"add {off:+.4f} rad ({math.degrees(off):+.1f}°) to the offset of joint {axis + 1}",
        )  # fmt: skip
        found += judge.findings
    return found
