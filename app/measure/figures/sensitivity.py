"""What decides figures 6 and 7: the grasp with one assumed value changed at a time, on the DAE and in MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from pydantic import JsonValue

from app.measure.figures.drawing import DARK, WITH, WITHOUT, axes, picture
from app.measure.figures.grasp import Block, Grasp, sliding
from app.measure.figures.grasp_dae import run_dae
from app.measure.figures.grasp_mujoco import run_mujoco
from app.measure.figures.result import Picture, Progress

GAINS = (0.0, 2.0)
"""k* [1/kg]."""
SPEEDS = (0.020, 0.025, 0.030, 0.040, 0.050)
"""Of each finger [m/s]."""
CHANGES: tuple[tuple[str, Grasp], ...] = (
    *((f"fingers {1e3 * speed:g} mm/s", Grasp(0.0, finger_speed=speed)) for speed in SPEEDS),
    *((f"wood friction {friction:g}", Grasp(0.0, block=Block(friction=friction))) for friction in (0.3, 0.5)),
    ("block 10 g", Grasp(0.0, block=Block(mass=0.010))),
    ("shaft friction 0.005 N m, compensated", Grasp(0.0, joint_friction=0.005)),
    ("shaft friction 0.005 N m, not compensated", Grasp(0.0, joint_friction=0.005, compensated=False)),
    ("shaft friction 0.02 N m, compensated", Grasp(0.0, joint_friction=0.02)),
    ("shaft friction 0.02 N m, not compensated", Grasp(0.0, joint_friction=0.02, compensated=False)),
)
"""Beside 30 mm/s, friction 0.4, 15 g and shafts without Coulomb friction, which is what the figures take."""
CAPTION = "Final place of the block with one assumed value changed"


class Case(NamedTuple):
    """Final displacements of the block for both gains [mm]."""

    name: str
    grasp: Grasp
    dae: tuple[float, float]
    mujoco: tuple[float, float]
    closed_form: tuple[float, float]

    def as_json(self) -> dict[str, JsonValue]:
        """With ``k* = 0`` first."""
        return {
            "case": self.name,
            "dae_mm": list(self.dae),
            "mujoco_mm": list(self.mujoco),
            "closed_form_mm": list(self.closed_form) if self.grasp.joint_friction == 0.0 else None,
        }


def study(mass: float, progress: Progress, changes: tuple[tuple[str, Grasp], ...] = CHANGES) -> list[Case]:
    """Run all cases; ``mass``: effective, of the arm along z1 [kg]."""
    cases = []
    for number, (name, grasp) in enumerate(changes, 1):
        progress(f"varying an assumed value, {number} of {len(changes)}: {name}")
        cases.append(_case(name, grasp, mass))
    return cases


def _case(name: str, grasp: Grasp, mass: float) -> Case:
    both = [grasp.with_gain(gain) for gain in GAINS]
    dae = tuple(1e3 * run_dae(one).final for one in both)
    mujoco = tuple(1e3 * run_mujoco(one).run.final for one in both)
    formula = tuple(1e3 * sliding(one, mass)[0] for one in both)
    return Case(name, grasp, (dae[0], dae[1]), (mujoco[0], mujoco[1]), (formula[0], formula[1]))


def draw_study(cases: list[Case], mass: float) -> Picture:
    """Final place over finger speed with the closed form, and all cases as a list."""
    sheet = picture(11.0, 4.4)
    left, right = axes(sheet, 1, 2)
    speeds = np.linspace(0.012, 0.055, 200)
    for gain, colour in zip(GAINS, (WITHOUT, WITH), strict=True):
        ends = [1e3 * sliding(Grasp(gain, finger_speed=float(v)), mass)[0] for v in speeds]
        left.plot(1e3 * speeds, ends, color=colour, lw=1.2, label=f"k* = {gain:g}, closed form")
    swept = [case for case in cases if case.name.startswith("fingers")]
    _points(left, swept, [1e3 * case.grasp.finger_speed for case in swept], upright=True)
    left.axvline(30.0, color="grey", lw=0.8, ls="--")
    left.set_xlabel("speed of each finger [mm/s]", fontsize=9)
    left.set_ylabel("final place of the block [mm]", fontsize=9)
    left.legend(fontsize=8, loc="upper left")
    rows = list(range(len(cases)))[::-1]
    _points(right, cases, rows, upright=False)
    right.set_yticks(rows, [case.name for case in cases], fontsize=8)
    right.axvline(0.0, color=DARK, lw=0.8)
    right.set_xlabel("final place of the block [mm]", fontsize=9)
    right.plot([], [], "o", color="grey", label="DAE")
    right.plot([], [], "x", color="grey", label="MuJoCo")
    right.legend(fontsize=8, loc="upper right")
    sheet.suptitle(f"{CAPTION}; pushed aside is positive, 10 mm aside at the start", fontsize=10)
    return sheet


def _points(axis: Axes, cases: list[Case], places: Sequence[float], upright: bool) -> None:
    """Dots for the DAE and crosses for MuJoCo, the places along x or (not upright) along y."""
    for index, colour in enumerate((WITHOUT, WITH)):
        for found, mark in (([c.dae[index] for c in cases], "o"), ([c.mujoco[index] for c in cases], "x")):
            x, y = (places, found) if upright else (found, places)
            axis.plot(x, y, mark, color=colour, ms=6, mfc="none" if mark == "o" else colour, mew=1.3)
