"""Figure ``newton``: steps of (7) from tick to tick along a fast move, against "1-2 iterations" to 8 decimals."""

from __future__ import annotations

from typing import NamedTuple

import chess
import numpy as np
from pydantic import JsonValue

from app.measure.figures.drawing import DARK, GREY, WITH, WITHOUT, axes, label, picture
from app.measure.figures.move import plan_ply, until_guard
from app.measure.figures.result import Bar, FigureResult, Picture, Progress
from app.motion import MotionSettings
from app.motion.timing.reference import Vector
from controller.model.constants import DeltaModel
from controller.model.kinematics import TOLERANCE, newton_step
from controller.model.reach import posture_at
from hardware.contact_speeds import ContactSpeeds
from hardware.parameters import load_parameters

POSITION = "7r/8/8/8/8/8/8/Q1K4k w - - 0 1"
MOVE = "a1h8"
"""The longest way over the board, and a capture, so that a tray is visited too."""
SPEED, ACCELERATION, JERK = 1.5, 25.0, 1000.0  # [m/s, m/s², m/s³] as docs/results.md says
DECIMALS = 1e-8  # what the paper iterates to, 8 decimals; here of |h| [m]
MOVING = 0.05  # a tool faster than this moves [m/s]
ENOUGH = 6


class Steps(NamedTuple):
    """Newton along a motion, one row a tick."""

    residual: Vector  # |h| that the last tick's solution leaves at this tick's angles, then after each step, (n, 6) [m]
    to_decimals: Vector  # steps until |h| <= 1e-8 m, shape (n,)
    to_tolerance: Vector  # steps until |h| <= 1e-10 m, what the law asks for, shape (n,)


def fast_way() -> Vector:
    """The tool's way in a fast ply, shape (n, 3), one row a tick, base frame [m]."""
    settings = MotionSettings(speed=SPEED, acceleration=ACCELERATION, jerk=JERK)
    board, move = chess.Board(POSITION), chess.Move.from_uci(MOVE)
    _, plan, _ = plan_ply(board, move, settings, ContactSpeeds(tool_speed=SPEED), 0.01)
    return np.concatenate([samples["position"] for samples in until_guard(plan, grips=False)])


def counted(model: DeltaModel, way: Vector) -> Vector:
    """Servomotor angles along a way as the encoders give them, shape (n, 3) [rad]."""
    count = 2.0 * np.pi / 2**model.parameters.drive.encoder_bits
    angles = np.array([posture_at(model, point).y for point in way])
    return np.asarray(np.round(angles / count) * count)


def newton_along(model: DeltaModel, angles: Vector, start: Vector) -> Steps:
    """Iterate (7) at angles y, shape (n, 3) [rad], from the last tick's solution; ``start``: the first, shape (6,)."""
    residual = np.zeros((len(angles), ENOUGH))
    x = start.copy()
    for k, y in enumerate(angles):
        for step in range(ENOUGH):
            residual[k, step] = newton_step(model.constants, y, x)[1]
            if residual[k, step] <= TOLERANCE:
                break
    return Steps(residual, (residual > DECIMALS).sum(axis=1), (residual > TOLERANCE).sum(axis=1))


def newton(progress: Progress) -> FigureResult:
    """Compute and draw."""
    progress("planning a fast move and iterating along it")
    model = DeltaModel(load_parameters())
    tick = model.parameters.drive.tick
    way = fast_way()
    angles = counted(model, way)
    steps = newton_along(model, angles, posture_at(model, way[0]).x)
    speed = np.linalg.norm(np.gradient(way, tick, axis=0), axis=1)
    moving = speed > MOVING
    bars = {
        "most_steps_to_8_decimals": Bar(float(steps.to_decimals.max()), "steps", high=2.0),
        "fewest_steps_while_moving": Bar(float(steps.to_decimals[moving].min()), "steps", low=1.0),
    }
    numbers: dict[str, JsonValue] = {
        "ticks": len(way),
        "ticks_moving": int(moving.sum()),
        "tool_speed_max_m_s": float(speed.max()),
        "servo_speed_max_rad_s": float(np.abs(np.diff(angles, axis=0)).max() / tick),
        "ticks_by_steps_to_1e-8_m": _counted_steps(steps.to_decimals[moving]),
        "ticks_by_steps_to_1e-10_m": _counted_steps(steps.to_tolerance[moving]),
        "mean_steps_to_1e-8_m": float(steps.to_decimals[moving].mean()),
        "closure_before_first_step_max_m": float(steps.residual[:, 0].max()),
        "closure_after_one_step_max_m": float(steps.residual[:, 1].max()),
        "closure_after_two_steps_max_m": float(steps.residual[:, 2].max()),
    }
    title = "Newton steps of (7) along a fast move, from tick to tick"
    return FigureResult(title, bars, numbers, {"": _draw(steps, speed, tick, title)})


def _counted_steps(values: Vector) -> dict[str, JsonValue]:
    return {str(n): int(v) for n, v in enumerate(np.bincount(values, minlength=4))}


def _draw(steps: Steps, speed: Vector, tick: float, title: str) -> Picture:
    sheet = picture(8.2, 5.6)
    top, middle, bottom = axes(sheet, 3, 1, sharex=True)
    time = np.arange(len(speed)) * tick
    top.plot(time, speed, color=DARK, lw=1.0)
    label(top, ylabel="tool speed [m/s]")
    top.set_title(f"{title} ({MOVE}, capturing)", fontsize=10)
    labels = ("start: solution of the last tick", "after 1 step", "after 2 steps")
    for column, (name, colour) in enumerate(zip(labels, (GREY, WITHOUT, WITH), strict=True)):
        shown = np.where(steps.residual[:, column] > 0.0, steps.residual[:, column], np.nan)
        middle.semilogy(time, shown, ".", ms=1.6, color=colour, label=name)
    middle.axhline(DECIMALS, color=DARK, lw=0.8, ls="--")
    label(middle, ylabel="|h| [m]")
    middle.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, markerscale=5, frameon=False)
    bottom.plot(time, steps.to_decimals, ".", ms=1.6, color=WITHOUT)
    label(bottom, yticks=[0, 1, 2, 3], ylim=(-0.3, 3.3), ylabel="steps to 1e-8 m", xlabel="time [s]")
    return sheet
