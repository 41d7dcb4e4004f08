"""Figures ``6`` and ``7``: the soft grasp without and with tactile feedback, on the constrained dynamics and in MuJoCo.

Figure 6 shows arm, fingers and block over time, and what decides it: the grasp with one assumed value changed at a
time. Figure 7 shows block and fingers before and after; white lines on block and surface are aligned at the start, as
in the paper's pictures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from pydantic import JsonValue

import app.measure.figures.grasp_model as soft_grasp
from app.measure.figures.drawing import DARK, GREY, WITH, WITHOUT, axes, label, picture
from app.measure.figures.grasp_model import Block, Grasp, Run, effective_mass, run_dae, run_mujoco, sliding, views
from app.measure.figures.result import Bar, FigureResult, Picture, Progress
from controller.law.tactile import grip_force, least_contact_damping
from controller.model.constants import DeltaModel

GAINS = (0.0, 2.0)  # k* [1/kg]
SPEEDS = (0.020, 0.025, 0.030, 0.040, 0.050)  # of each finger [m/s]
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
FINER = 16
"""Steps a tick of a second run of each model: what its own steps do to the result."""
TITLES = {"dae": "constrained dynamics (2)", "mujoco": "MuJoCo"}
_WOOD = "#b8864e"
_PAD = (0.003, 0.006)  # thickness and half height of a pad as drawn [m]
_ROWS = slice(40, 440)  # of a rendered picture: block and pads


Grasps = dict[str, tuple[Run, Run]]  # the paper's grasp without and with feedback, by model: ``dae``, ``mujoco``


def both_grasps(progress: Progress) -> Grasps:
    """Run both models for both gains."""
    without, fed_back = (Grasp(gain) for gain in GAINS)
    progress("simulating the grasp on the constrained dynamics")
    dae = run_dae(without), run_dae(fed_back)
    progress("simulating the grasp in MuJoCo")
    return {"dae": dae, "mujoco": (run_mujoco(without), run_mujoco(fed_back))}


def bars(grasps: Grasps) -> dict[str, Bar]:
    """What figures 6 and 7 must show in both models."""
    found = {}
    for name, (without, fed_back) in grasps.items():
        found[f"block_without_feedback_{name}"] = Bar(1e3 * without.final, "mm", 3.0, 5.0)
        found[f"block_with_feedback_{name}"] = Bar(1e3 * abs(fed_back.final), "mm", high=1.0)
    return found


def _run_numbers(grasps: Grasps) -> dict[str, JsonValue]:
    """Of each run, by model and gain, in mm and N."""
    return {
        model: {
            f"k*={run.grasp.tactile_gain:g}": {
                "final_mm": 1e3 * run.final,
                "farthest_mm": 1e3 * run.farthest,
                "arm_mm": 1e3 * float(run.arm[-1]),
                "grip_force_N": run.forces[-1].tolist(),
                "still_moving_to_and_fro_um": 1e6 * run.unrest,
            }
            for run in runs
        }
        for model, runs in grasps.items()
    }


def figure_6(progress: Progress) -> FigureResult:
    """Compute and draw arm, fingers and block over time, and what decides it."""
    grasps = both_grasps(progress)
    mass = effective_mass(DeltaModel(Grasp(0.0).parameters), soft_grasp.POINT)
    cases = study(mass, progress)
    title = "Soft grasp of a wooden block, 10 mm off the middle"
    progress("simulating the grasp with smaller steps")
    pictures = {"": _draw_motion(grasps, title), "-sensitivity": _draw_study(cases, mass)}
    return FigureResult(title, bars(grasps), _numbers(grasps, mass, cases), pictures)


def _numbers(grasps: Grasps, mass: float, cases: list[Case]) -> Mapping[str, JsonValue]:
    grasp, names = grasps["dae"][0].grasp, [f"k*={gain:g}" for gain in GAINS]
    finer: list[JsonValue] = [
        [1e3 * run(one.grasp, FINER).final for run in (run_dae, run_mujoco)] for one in grasps["dae"]
    ]
    return {
        "effective_mass_kg": mass,
        "block_friction_N": grasp.block.holds,
        "finger_speed_mm_s": 1e3 * grasp.finger_speed,
        "grip_force_expected_N": grip_force(grasp.parameters.gripper, -grasp.finger_speed),
        "contact_damping_against_hum_N_s_m": {
            "needed": least_contact_damping(
                grasp.parameters, mass, soft_grasp.DAMPING, GAINS[1], 2.0 * soft_grasp.PAD_STIFFNESS
            ),
            "of both pads": 2.0 * soft_grasp.PAD_DAMPING,
        },
        **_run_numbers(grasps),
        "closed_form_mm": {
            name: [1e3 * v for v in sliding(Grasp(g), mass)] for name, g in zip(names, GAINS, strict=True)
        },
        f"final_mm_with_{FINER}_steps_a_tick_dae_mujoco": dict(zip(names, finer, strict=True)),
        "sensitivity": [case.as_json() for case in cases],
    }


def _draw_motion(grasps: Grasps, title: str) -> Picture:
    sheet = picture(9.6, 7.4)
    panels = axes(sheet, 3, 2, sharex=True)
    sheet.suptitle(title, fontsize=11)
    for column, (name, runs) in enumerate(grasps.items()):
        arm, fingers, block = panels[column::2]
        for run, gain, colour in zip(runs, GAINS, (WITHOUT, WITH), strict=True):
            arm.plot(run.time, 1e3 * run.arm, color=colour, lw=1.4, label=f"k* = {gain:g}")
            fingers.plot(run.time, 1e3 * run.right, color=colour, lw=1.4)
            fingers.plot(run.time, 1e3 * run.left, color=colour, lw=1.4, ls="--")
            block.plot(run.time, -1e3 * run.block, color=colour, lw=1.4)
            block.annotate(
                f"{1e3 * run.final:.1f} mm".replace("-", "−"), (float(run.time[-1]), 1e3 * max(run.final, 0.0)),
                xytext=(0, 5), textcoords="offset points", ha="right", fontsize=8, color=colour,
            )  # fmt: skip
        label(fingers, ylabel="right, left (- -) pad [mm]")
        block.axhline(0.0, color=DARK, lw=0.6)
        label(block, ylabel="block, pushed aside [mm]", xlabel="time [s]", ylim=(-1.2, 7.6))
        label(arm, ylabel="arm z₁ [mm]", title=TITLES[name], ylim=(-0.8, 11.5))
        arm.legend(fontsize=8, loc="upper left")
    return sheet


# what decides


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
        both = [replace(grasp, tactile_gain=gain) for gain in GAINS]
        ends = ((run_dae(one).final, run_mujoco(one).final, sliding(one, mass)[0]) for one in both)
        (d0, m0, c0), (d1, m1, c1) = ([1e3 * end for end in one] for one in ends)
        cases.append(Case(name, grasp, (d0, d1), (m0, m1), (c0, c1)))
    return cases


def _draw_study(cases: list[Case], mass: float) -> Picture:
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
    label(left, xlabel="speed of each finger [mm/s]", ylabel="final place of the block [mm]")
    left.legend(fontsize=8, loc="upper left")
    rows = list(range(len(cases)))[::-1]
    _points(right, cases, rows, upright=False)
    right.set_yticks(rows, [case.name for case in cases], fontsize=8)
    right.axvline(0.0, color=DARK, lw=0.8)
    label(right, xlabel="final place of the block [mm]")
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


# before and after


def figure_7(progress: Progress) -> FigureResult:
    """Compute and draw block and fingers before and after."""
    grasps, title = both_grasps(progress), "Block before and after the soft grasp"
    start, *ends = views(
        grasps["mujoco"][0].grasp, [grasps["mujoco"][0].poses[0], *(run.poses[1] for run in grasps["mujoco"])]
    )
    return FigureResult(title, bars(grasps), _run_numbers(grasps), {"": _draw_ends(grasps, start, ends)})


def _draw_ends(grasps: Grasps, start: NDArray[np.uint8], ends: list[NDArray[np.uint8]]) -> Picture:
    sheet = picture(10.6, 5.4)
    grid = sheet.subplots(2, 3, squeeze=False)
    rows = zip(grid, GAINS, ends, grasps["mujoco"], grasps["dae"], strict=True)
    for (before, after, drawn), gain, end, mujoco, dae in rows:
        photos = (before, start, f"k* = {gain:g}: start"), (after, end, f"end, {_moved('MuJoCo', mujoco)}")
        for axis, pixels, title in photos:
            axis.imshow(pixels[_ROWS])
            label(axis, title=title)
            axis.set_axis_off()
        _schematic(drawn, dae)
        drawn.set_title(f"end, {_moved('constrained dynamics', dae)}", fontsize=9)
    return sheet


def _moved(model: str, run: Run) -> str:
    return f"{model}: block moved {1e3 * abs(run.final):.1f} mm"


def _schematic(axis: Axes, run: Run) -> None:
    """Side view to scale in mm, z1 to the right; the surface's line is where the block's was."""
    block = run.grasp.block
    half, _, high = (1e3 * v for v in block.half_size)
    middle = 1e3 * (block.offset + run.block[-1])
    axis.add_patch(Rectangle((middle - half, 0.0), 2 * half, 2 * high, fc=_WOOD, ec=DARK, lw=0.8))
    axis.plot([middle, middle], [0.0, 2 * high], color="white", lw=1.6)
    axis.plot([1e3 * block.offset] * 2, [-7.0, 0.0], color="white", lw=1.6, zorder=3)
    axis.add_patch(Rectangle((-24.0, -7.0), 56.0, 7.0, fc=GREY, ec="none"))
    thickness, half_height = (1e3 * v for v in _PAD)
    for face, outward in ((run.right[-1], 0.0), (run.left[-1], -thickness)):
        corner = (1e3 * face + outward, 1e3 * soft_grasp.HEIGHT - half_height)
        axis.add_patch(Rectangle(corner, thickness, 2 * half_height + 16.0, fc="#e8e6df", ec=DARK, lw=0.8))
    axis.set(xlim=(-24.0, 32.0), ylim=(-7.0, 36.0), aspect="equal", yticks=[])
    axis.tick_params(labelsize=8)
    axis.set_xlabel("z₁ from the gripper's middle at the start [mm]", fontsize=8)
    axis.spines[["top", "right", "left"]].set_visible(False)
