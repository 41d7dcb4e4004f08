"""Figure ``6``: arm, fingers and block over time in the soft grasp, without and with feedback, in both models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from matplotlib.axes import Axes
from pydantic import JsonValue

from app.measure.figures.drawing import DARK, WITH, WITHOUT, axes, picture
from app.measure.figures.grasp import DAMPING, POINT, Grasp, Run, sliding
from app.measure.figures.grasp_dae import PAD_DAMPING, PAD_STIFFNESS, run_dae
from app.measure.figures.grasp_mujoco import MujocoRun, run_mujoco
from app.measure.figures.gripper import effective_mass
from app.measure.figures.result import Bar, FigureResult, Picture, Progress
from app.measure.figures.sensitivity import GAINS, Case, draw_study, study
from controller.law.tactile import grip_force, least_contact_damping
from controller.model.constants import DeltaModel

FINER = 16
"""Steps a tick of a second run of each model: what its own steps do to the result."""


class Grasps(NamedTuple):
    """The grasp of the paper without and with feedback."""

    dae: tuple[Run, Run]
    mujoco: tuple[MujocoRun, MujocoRun]


def both_grasps(progress: Progress) -> Grasps:
    """Run both models for both gains."""
    without, fed_back = (Grasp(gain) for gain in GAINS)
    progress("simulating the grasp on the constrained dynamics")
    dae = run_dae(without), run_dae(fed_back)
    progress("simulating the grasp in MuJoCo")
    return Grasps(dae, (run_mujoco(without), run_mujoco(fed_back)))


def bars(grasps: Grasps) -> dict[str, Bar]:
    """What figures 6 and 7 must show in both models."""
    found = {}
    for name, (without, fed_back) in (("dae", grasps.dae), ("mujoco", tuple(one.run for one in grasps.mujoco))):
        found[f"block_without_feedback_{name}"] = Bar(1e3 * without.final, "mm", 3.0, 5.0)
        found[f"block_with_feedback_{name}"] = Bar(1e3 * abs(fed_back.final), "mm", high=1.0)
    return found


def run_numbers(run: Run) -> dict[str, JsonValue]:
    """Of one run, in mm and N."""
    return {
        "final_mm": 1e3 * run.final,
        "farthest_mm": 1e3 * run.farthest,
        "arm_mm": 1e3 * float(run.arm[-1]),
        "grip_force_N": run.forces[-1].tolist(),
        "still_moving_to_and_fro_um": 1e6 * run.unrest,
    }


def figure_6(progress: Progress) -> FigureResult:
    """Compute and draw."""
    grasps = both_grasps(progress)
    mass = effective_mass(DeltaModel(Grasp(0.0).parameters), POINT)
    cases = study(mass, progress)
    title = "Soft grasp of a wooden block, 10 mm off the middle"
    progress("simulating the grasp with smaller steps")
    numbers = _numbers(grasps, mass, cases)
    return FigureResult(
        title, bars(grasps), numbers, {"": _draw(grasps, title), "-sensitivity": draw_study(cases, mass)}
    )


def _numbers(grasps: Grasps, mass: float, cases: list[Case]) -> Mapping[str, JsonValue]:
    grasp = grasps.dae[0].grasp
    names = [f"k*={gain:g}" for gain in GAINS]
    finer = [
        (1e3 * run_dae(one.grasp, FINER).final, 1e3 * run_mujoco(one.grasp, FINER).run.final) for one in grasps.dae
    ]
    return {
        "effective_mass_kg": mass,
        "block_friction_N": grasp.block.holds,
        "finger_speed_mm_s": 1e3 * grasp.finger_speed,
        "grip_force_expected_N": grip_force(grasp.parameters.gripper, -grasp.finger_speed),
        "contact_damping_against_hum_N_s_m": {
            "needed": least_contact_damping(grasp.parameters, mass, DAMPING, GAINS[1], 2.0 * PAD_STIFFNESS),
            "of both pads": 2.0 * PAD_DAMPING,
        },
        "dae": {name: run_numbers(run) for name, run in zip(names, grasps.dae, strict=True)},
        "mujoco": {name: run_numbers(one.run) for name, one in zip(names, grasps.mujoco, strict=True)},
        "closed_form_mm": {
            name: [1e3 * v for v in sliding(Grasp(g), mass)] for name, g in zip(names, GAINS, strict=True)
        },
        f"final_mm_with_{FINER}_steps_a_tick_dae_mujoco": {n: list(pair) for n, pair in zip(names, finer, strict=True)},
        "sensitivity": [case.as_json() for case in cases],
    }


def _draw(grasps: Grasps, title: str) -> Picture:
    sheet = picture(9.6, 7.4)
    panels = axes(sheet, 3, 2, sharex=True)
    sheet.suptitle(title, fontsize=11)
    models = {"constrained dynamics (2)": grasps.dae, "MuJoCo": tuple(one.run for one in grasps.mujoco)}
    for column, (name, runs) in enumerate(models.items()):
        arm, fingers, block = panels[column::2]
        arm.set_title(name, fontsize=9)
        for run, gain, colour in zip(runs, GAINS, (WITHOUT, WITH), strict=True):
            arm.plot(run.time, 1e3 * run.arm, color=colour, lw=1.4, label=f"k* = {gain:g}")
            fingers.plot(run.time, 1e3 * run.right, color=colour, lw=1.4)
            fingers.plot(run.time, 1e3 * run.left, color=colour, lw=1.4, ls="--")
            block.plot(run.time, -1e3 * run.block, color=colour, lw=1.4)
            _final(block, run, colour)
        arm.set_ylabel("arm z₁ [mm]", fontsize=9)
        fingers.set_ylabel("right, left (- -) pad [mm]", fontsize=9)
        block.set_ylabel("block, pushed aside [mm]", fontsize=9)
        block.set_xlabel("time [s]", fontsize=9)
        block.axhline(0.0, color=DARK, lw=0.6)
        block.set_ylim(-1.2, 7.6)
        arm.set_ylim(-0.8, 11.5)
        arm.legend(fontsize=8, loc="upper left")
    return sheet


def _final(axis: Axes, run: Run, colour: str) -> None:
    axis.annotate(
        f"{1e3 * run.final:.1f} mm".replace("-", "−"), (float(run.time[-1]), 1e3 * max(run.final, 0.0)), xytext=(0, 5),
        textcoords="offset points", ha="right", fontsize=8, color=colour,
    )  # fmt: skip
