"""What motions through the controller say of the arm: pure functions of measured numbers, and their bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from app.commissioning.bring_up.axis_judgement import Expected
from app.commissioning.check_report import Finding, Judge
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from hardware.parameters import RobotParameters

HELD_ERROR: Final = 1.5e-3
"""Of the tool at rest from where it should be [m]; 20 % of the masses make 0.4 mm."""
TORQUE_SHARE: Final = 1.0
"""Of the rated torque, which holding may take at the workspace's edge."""
ASSUMED: Final = 0.35
"""Share of the largest torque of gravity by which the held torques may differ from the model's, with masses that nobody
has measured: 20 % of all of them, and the shafts' dry friction."""
IDENTIFIED: Final = 0.03
"""The same of an arm that was identified, beyond each shaft's dry friction, as a share of the rated torque: ripple and
cogging of servomotors. A shaft at rest does not tell either from weight."""
STIFF: Final = 4800.0
"""k_p of an axis that is as stiff as in the air [1/s²]."""
IN_AIR: Final = 1.0e-3
"""Largest tracking error in the air [m]: the bar of figure 9 (docs/results.md)."""
TOUCH_FORCE: Final = 13.0
"""Largest force at a touch [N]: what figure touch finds on bare wood, which bare pads on a board are (docs/results.md).
"""
HEIGHT: Final = 3.0e-3
"""Largest error of the board's height [m]: pieces are set down within this."""
_MOVING: Final = 0.02  # reference faster than this [m/s]


@dataclass(frozen=True, slots=True, eq=False)
class HeldPose:
    """An arm at rest at a point."""

    error: float
    """Of the tool from its reference [m]."""
    torque: FloatArray
    """That holds it, (3,) [N m]."""
    gravity: FloatArray
    """The same by the model, (3,) [N m]."""

    @classmethod
    def at(
        cls, model: DeltaModel, point: FloatArray, there: FloatArray, angle: FloatArray, torque: FloatArray
    ) -> HeldPose:
        """At a point, with the tool there, base frame (3,) [m], servomotors at an angle, (3,) [rad]."""
        expected = Expected.at(model, angle)
        assert expected is not None  # the controller holds the arm there
        return cls(float(np.linalg.norm(there - point)), np.asarray(torque), expected.gravity)


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """How the tool followed motions."""

    worst: float
    """Largest error along an axis where all are stiff [m]."""
    mean: float
    """Mean distance there while the reference moved [m]."""
    peak: float
    """Largest torque [N m]."""


def followed_of(rows: NDArray[Any], first: int, last: int) -> Followed:
    """Of a flight's rows, which motions from the first to the last number made."""
    rows = rows[(rows["motion"] >= first) & (rows["motion"] <= last)]
    stiff = (rows["stiffness"] > STIFF).all(axis=1)
    error = np.abs(rows["position"] - rows["reference"])[stiff]
    moving = np.linalg.norm(rows["reference_velocity"][stiff], axis=1) > _MOVING
    distance = np.linalg.norm(error[moving], axis=1)
    return Followed(
        float(error.max(initial=0.0)), float(distance.mean()) if len(distance) else np.nan,
        float(np.abs(rows["torque"]).max(initial=0.0)),
    )  # fmt: skip


def judge_workspace(held: Sequence[HeldPose], parameters: RobotParameters) -> list[Finding]:
    """Home first, then the edges."""
    judge = Judge("arm")
    for what, part in (("home", held[:1]), ("edges", held[1:])):
        worst = max(one.error for one in part)
        judge.judge(
            what, f"{1e3 * worst:.2f} mm off its target, {1e3 * HELD_ERROR:.1f} mm allowed",
            worst <= HELD_ERROR, "the arm is held off its target: check its parameters, and what touches it",
        )  # fmt: skip
    largest = max(float(np.abs(one.torque).max()) for one in held)
    most = TORQUE_SHARE * parameters.drive.rated_torque
    judge.judge(
        "holding torque", f"up to {largest:.2f} N m, {most:.2f} N m allowed", largest <= most,
        "the motors would overheat before the game is over: check what the arm carries, and the torque constants",
    )  # fmt: skip
    return judge.findings


def judge_gravity(held: Sequence[HeldPose], parameters: RobotParameters, *, identified: bool) -> list[Finding]:
    """The residual torques of each axis over all poses; ``identified``: the parameters were measured on this arm."""
    residual = np.array([one.torque - one.gravity for one in held])
    largest = max(float(np.abs(one.gravity).max()) for one in held)
    told = IDENTIFIED * parameters.drive.rated_torque
    found: list[Finding] = []
    for axis in range(3):
        judge, of_axis = Judge(f"axis {axis + 1}"), residual[:, axis]
        worst = float(np.abs(of_axis).max())
        most = told + parameters.arm(axis).coulomb if identified else ASSUMED * largest
        judge.judge(
            "gravity",
            f"{of_axis.mean():+.3f} N m on average of {len(held)} poses, {worst:.3f} at worst, {most:.2f} allowed",
            worst <= most,
            "repeat 'identify' with nothing on the tool" if identified else
            "check the masses in the parameters file, the torque constants, and what hangs on the arm",
        )  # fmt: skip
        found += judge.findings
    return found


def judge_tracking(followed: Followed, height: float, force: float) -> list[Finding]:
    """Motions of a game, and a touch: the board's height over what is believed [m], and the largest force [N]."""
    judge = Judge("arm")
    judge.judge(
        "tracking",
        f"{1e3 * followed.worst:.2f} mm at worst, {1e3 * followed.mean:.2f} mm on average, {1e3 * IN_AIR:.1f} mm "
        f"allowed; peak torque {followed.peak:.1f} N m",
        followed.worst <= IN_AIR, "name the parameters file of 'identify' in the rig file, or repeat 'identify'",
    )  # fmt: skip
    judge.judge(
        "board", f"touched {1e3 * height:+.1f} mm from its believed height, {1e3 * HEIGHT:.0f} mm allowed",
        abs(height) <= HEIGHT,
        f"add {-height:+.4f} to the third number of centre_in_base in [table], which counts downwards [m], then repeat "
        "this step",
    )  # fmt: skip
    judge.judge(
        "touch", f"{force:.1f} N at most, {TOUCH_FORCE:.0f} N allowed", force <= TOUCH_FORCE,
        "something stiffer than a board is below the tool, or the arm is heavier than believed",
    )  # fmt: skip
    return judge.findings
