"""Step ``axes``: each encoder, motor and brake alone, by openings of the brakes for some milliseconds.

In this order, and each only if the one before it held: closed brakes bear a torque; the arm falls freely for 3 mrad;
all axes are held against some of their gravity meanwhile, each alone against most of it, all against all of it; and the
tool is where the encoders say.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from app.commissioning.bring_up.axis_judgement import (
    Expected,
    coupling_of,
    judge_all_standing,
    judge_bite,
    judge_brake,
    judge_fall,
    judge_floating,
    judge_standing,
    judge_together,
    judge_torque,
    judge_zero,
    most_doubtful,
    ran_on,
    standing_axes,
)
from app.commissioning.bring_up.brake_openings import (
    OPENING_TIME,
    ROOM,
    TOTAL_WAY,
    BrakeOpening,
    BringUpStopped,
    WatchedBus,
    accelerations,
)
from app.commissioning.check_report import CheckState, Finding, Judge
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.reach import PoseError, posture_at, tool_point_at
from hardware.interfaces import BusLost, ServoBus
from hardware.parameters import RobotParameters
from hardware.table import TableSettings

BRAKE_LOAD: Final = 1.3
"""Closed brakes have to bear so many times the largest torque of gravity."""
LARGEST_GRAVITY: Final = 1.76
"""In the workspace, at the corner squares [N m]; computed with the default parameters (docs/motion.md)."""
SUPPORT: Final = 0.6
"""Share of its gravity against which an axis is held: less than all, so that it falls under either and friction cancels
out."""
SUPPORTS: Final = (0.4, 0.6, 0.8)
"""The same of all axes at once: of other sizes, so that exchanged ones show, and are looked at first."""
LEAST_SUPPORT: Final = 0.3
"""[N m]: well above friction and cogging."""


class Onlooker(Protocol):
    """Who sees the arm."""

    def sees_room(self, believed: float, needed: float) -> bool:
        """Whether the tool is so high above the board as is needed, whatever the encoders say; both [m]."""

    def tool(self, believed: FloatArray) -> FloatArray:
        """Given the tool point that the encoders say, where it was measured; both board frame, (3,) [m]."""


Progress = Callable[[str], None]


def try_axes(
    bus: ServoBus, parameters: RobotParameters, table: TableSettings, onlooker: Onlooker, progress: Progress
) -> list[Finding]:
    """Try each axis of a bus that is open; the arm is left on its brakes. The last finding is how far it moved."""
    arm, count = Judge("arm"), 2.0 * np.pi / 2.0**parameters.drive.encoder_bits
    watched: WatchedBus | None = None
    found: list[Finding] = []
    try:
        watched = WatchedBus(bus, count)
        found = _try_all(watched, DeltaModel(parameters), table, onlooker, progress)
        if all(one.state is CheckState.GOOD for one in found):
            found += _try_zero(watched.angle, DeltaModel(parameters), table, onlooker)
    except BringUpStopped as error:
        arm.wrong("stopped", str(error), "fix what it says, then repeat this step")
    except BusLost as error:
        arm.wrong("connection", str(error), "check their power and cables, then start again")
    if watched is not None:
        arm.good("moved", f"{1e3 * watched.farthest:.1f} mrad at most, {1e3 * TOTAL_WAY:.0f} mrad allowed")
    return found + arm.findings


def _try_all(
    watched: WatchedBus, model: DeltaModel, table: TableSettings, onlooker: Onlooker, progress: Progress
) -> list[Finding]:
    expected = Expected.at(model, watched.angle)
    arm = Judge("arm")
    if expected is None:
        arm.wrong("pose", "no tool point exists for its angles", "check the encoders' zeros, ratios and bits")
        return arm.findings
    height = float(table.board_from_base(tool_point_at(model, watched.angle))[2])
    if height < ROOM and not onlooker.sees_room(height, ROOM):
        arm.wrong(
            "room", f"the tool is {1e3 * height:.0f} mm above the board, {1e3 * ROOM:.0f} mm are needed",
            "release the brakes by hand, lift the arm, let them close, then start again",
        )  # fmt: skip
        return arm.findings
    progress(f"loading the closed brakes with up to {BRAKE_LOAD * LARGEST_GRAVITY:.1f} N m: nothing may move")
    found = _try_brakes(watched)
    if not _good(found):
        return found
    progress("opening the brakes for a few milliseconds, six times: the tool drops by a millimetre each time")
    opening = watched.open_briefly(np.zeros(3))
    fall = accelerations(opening)
    standing = standing_axes(opening.angle[-1] - opening.angle[0], watched.count)
    if standing:
        return found + _try_standing(watched, standing, fall, expected)
    found += judge_fall(fall, _velocity_error(opening), expected)
    if not _good(found):
        return found
    found += _try_torques(watched, model, opening, expected)
    return found + (judge_bite(opening.stopping, opening.velocity[-1]) if _good(found) else [])


def _good(found: list[Finding]) -> bool:
    return all(one.state is CheckState.GOOD for one in found)


def _try_brakes(watched: WatchedBus) -> list[Finding]:
    """One after the other, both ways; the first that slips ends it."""
    load = BRAKE_LOAD * LARGEST_GRAVITY
    found: list[Finding] = []
    for axis in range(3):
        turned = max(watched.pull(axis, torque) for torque in (load, -load))
        found.append(judge_brake(axis, turned, load))
        if not _good(found):
            break
    return found


def _try_standing(watched: WatchedBus, standing: list[int], fall: FloatArray, expected: Expected) -> list[Finding]:
    """Where an axis stands though the brakes are told to be open: whether its shaft turns all the same.

    By a single opening, in which it is held: what a shaft turns whose encoder is dead, nobody sees or ends.
    """
    if len(standing) == 3:
        return [judge_all_standing(OPENING_TIME)]
    found = []
    for axis in standing:
        torque = np.where(np.arange(3) == axis, np.sign(expected.gravity), 0.0)
        torque *= np.maximum(np.abs(expected.gravity), LEAST_SUPPORT)
        held = accelerations(watched.open_briefly(torque))
        found.append(judge_standing(axis, coupling_of(axis, held - fall, float(torque[axis]), expected)))
    return found


def _try_torques(watched: WatchedBus, model: DeltaModel, fallen: BrakeOpening, first: Expected) -> list[Finding]:
    """All axes at once, one after the other, then all against their gravity; the first that is wrong ends it, before
    the arm drops any further. ``fallen`` is the opening without torque, where ``first`` was expected.

    A shaft that then ran on while its motor was to hold it until its brake bites is looked at before all of them:
    every opening costs so much way again.
    """
    fall = accelerations(fallen)
    found: list[Finding] = []
    ahead = ran_on(fallen.stopping)
    for axis in ahead:
        found.append(_try_alone(watched, model, axis, fall, first))
        if not _good(found):
            return found
    acting, asked = _pull(watched, model, SUPPORTS, fall, first)
    wrong = judge_together(acting, asked)
    if wrong:
        return found + wrong
    for axis in most_doubtful(acting, asked):
        if axis not in ahead:
            found.append(_try_alone(watched, model, axis, fall, first))
            if not _good(found):
                return found
    here = Expected.at(model, watched.angle) or first
    found.append(judge_floating(accelerations(watched.open_briefly(here.gravity)), here))
    return found


def _try_alone(watched: WatchedBus, model: DeltaModel, axis: int, fall: FloatArray, first: Expected) -> Finding:
    acting, asked = _pull(watched, model, np.where(np.arange(3) == axis, SUPPORT, 0.0), fall, first)
    return judge_torque(axis, acting / asked[axis])


def _pull(
    watched: WatchedBus, model: DeltaModel, shares: ArrayLike, fall: FloatArray, first: Expected
) -> tuple[FloatArray, FloatArray]:
    """Torques that acted on the shafts, and that were asked for: shares of each axis' gravity; (3,) [N m].

    The arm has dropped since ``first``: it falls freely here as much quicker or slower as the model says.
    """
    here, shares = Expected.at(model, watched.angle) or first, np.asarray(shares)
    asked = np.where(shares > 0.0, np.maximum(shares * np.abs(here.gravity), LEAST_SUPPORT), 0.0) * np.sign(
        here.gravity
    )
    free = fall * here.fall / first.fall
    return here.inertia @ (accelerations(watched.open_briefly(asked)) - free), asked


def _velocity_error(opening: BrakeOpening) -> FloatArray:
    """How much the drives' velocities differ from the change of their angles in the last third, as a share of it."""
    late = len(opening.time) // 3 + 1
    changed = (opening.angle[-1] - opening.angle[-late]) / (opening.time[-1] - opening.time[-late])
    return np.asarray(opening.velocity[-late:].mean(axis=0) / changed - 1.0, dtype=np.float64)


def _try_zero(angle: FloatArray, model: DeltaModel, table: TableSettings, onlooker: Onlooker) -> list[Finding]:
    measured = onlooker.tool(table.board_from_base(tool_point_at(model, angle)))
    try:
        there = posture_at(model, table.base_from_board(measured)).y
    except PoseError as error:
        judge = Judge("arm")
        judge.wrong("zero", f"the tool cannot be at the measured point: {error}", "measure it again")
        return judge.findings
    return judge_zero(angle, there)
