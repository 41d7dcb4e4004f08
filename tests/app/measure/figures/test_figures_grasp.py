"""Figures ``6`` and ``7``: both models of the soft grasp, against each other, the closed form and their own steps."""

from __future__ import annotations

import numpy as np
import pytest

from app.measure.figures.figure_6_7_grasp import GAINS, Case, Grasps, bars, both_grasps, figure_7, study
from app.measure.figures.grasp_model import (
    BRISTLE,
    PACE,
    PLACE,
    POINT,
    PRESLIDING,
    STATES,
    Z4,
    Block,
    Grasp,
    GraspedBlock,
    effective_mass,
    run_dae,
    run_mujoco,
    sliding,
)
from controller.law.tactile import grip_force
from controller.model.constants import DeltaModel
from controller.offline.simulation import ConstrainedArm, Moment

MASS = effective_mass(DeltaModel(Grasp(0.0).parameters), POINT)


@pytest.fixture(scope="module")
def grasps() -> Grasps:
    return both_grasps(print)


def test_the_block_slides_4_mm_without_and_less_than_1_mm_with_feedback_in_both_models(grasps: Grasps) -> None:
    found = bars(grasps)
    assert len(found) == 4
    for name, bar in found.items():
        assert bar.holds, f"{name}: {bar}"


def test_the_models_agree_also_on_the_way(grasps: Grasps) -> None:
    for dae, mujoco in zip(grasps["dae"], grasps["mujoco"], strict=True):
        assert mujoco.farthest == pytest.approx(dae.farthest, abs=0.6e-3)
        assert np.abs(dae.arm - mujoco.arm).max() < 1.0e-3
        assert np.abs(dae.right - mujoco.right).max() < 1.0e-3
        assert np.abs(dae.left - mujoco.left).max() < 1.0e-3


def test_the_fingers_end_at_the_block_with_the_force_of_their_servo(grasps: Grasps) -> None:
    """The paper: a final contact force of ṙ4 k_v4."""
    for run in (*grasps["dae"], *grasps["mujoco"]):
        asked = grip_force(run.grasp.parameters.gripper, -run.grasp.finger_speed)
        assert run.forces[-1] == pytest.approx([asked, asked], rel=0.01)
        width = 2.0 * run.grasp.block.half_size[0]
        assert run.right[-1] - run.left[-1] == pytest.approx(width, abs=0.6e-3)
        assert 0.5 * (run.right[-1] + run.left[-1]) - run.grasp.block.offset == pytest.approx(-run.final, abs=0.1e-3)
        assert run.unrest < 30e-6


def test_the_closed_form_is_near(grasps: Grasps) -> None:
    for run in grasps["dae"]:
        final, farthest = sliding(run.grasp, MASS)
        assert run.final == pytest.approx(final, abs=0.4e-3)
        assert run.farthest == pytest.approx(farthest, abs=0.2e-3)


def test_the_closed_forms_limits() -> None:
    """Very fast fingers push the block all the way; slow ones leave it; a heavy block stays."""
    assert sliding(Grasp(0.0, finger_speed=10.0), MASS)[0] == pytest.approx(0.010, rel=1e-3)
    assert sliding(Grasp(0.0, finger_speed=0.01), MASS)[0] == 0.0
    assert sliding(Grasp(0.0, block=Block(mass=5.0)), MASS) == pytest.approx((0.0, 0.0), abs=3e-5)
    assert sliding(Grasp(2.0), MASS)[1] < 0.5 * sliding(Grasp(0.0), MASS)[1]


def test_smaller_steps_and_a_stiffer_bristle_change_nothing(grasps: Grasps) -> None:
    without = grasps["dae"][0]
    finer = run_dae(without.grasp, substeps=16, presliding=PRESLIDING / 2.0)
    assert finer.final == pytest.approx(without.final, abs=0.02e-3)
    for run in grasps["mujoco"]:
        assert run_mujoco(run.grasp, substeps=12).final == pytest.approx(run.final, abs=0.3e-3)


def test_stiction_holds_below_its_limit_and_slips_above() -> None:
    grasp = Grasp(0.0)
    attached, arm = GraspedBlock(grasp), ConstrainedArm(DeltaModel(grasp.parameters))
    own = attached.start()
    assert (own[Z4], own[PLACE]) == (0.020, 0.010)
    q, v = arm.at(POINT)

    def rates(bristle: float, pace: float) -> np.ndarray:
        row = own.copy()
        row[BRISTLE], row[PACE] = bristle, pace
        return attached.rates(Moment(0.0, q, v, row, arm.model))

    at_rest = rates(0.0, 0.0)
    assert (at_rest[PACE], at_rest[BRISTLE]) == (0.0, 0.0)
    slipping = rates(PRESLIDING, 0.01)
    assert slipping[BRISTLE] == pytest.approx(0.0, abs=1e-12)
    assert slipping[PACE] * grasp.block.mass == pytest.approx(-grasp.block.holds)
    held = rates(0.5 * PRESLIDING, 0.0)
    assert held[PACE] * grasp.block.mass == pytest.approx(-0.5 * grasp.block.holds), (
        "deflected half, it pulls back half"
    )
    assert len(own) == STATES + 3


@pytest.mark.slow
def test_finger_speed_and_shaft_friction_decide() -> None:
    """What the figures rest on: slow fingers leave the block in place, fast ones or sticking shafts do not."""
    slow = Grasp(0.0, finger_speed=0.020)
    sticking = Grasp(0.0, joint_friction=0.02, compensated=False)
    (sticking_case,) = study(MASS, print, (("sticking", sticking),))
    assert abs(run_dae(slow).final) < 0.5e-3
    assert abs(run_mujoco(slow).final) < 0.8e-3
    closed_form = [sliding(Grasp(gain, finger_speed=0.020), MASS)[0] for gain in GAINS]
    assert Case("slow", slow, (0.0, 0.0), (0.0, 0.0), tuple(closed_form)).as_json()["closed_form_mm"] == [0.0, 0.0]
    assert min(sticking_case.dae[0], sticking_case.mujoco[0]) > 9.0
    assert min(sticking_case.dae[1], sticking_case.mujoco[1]) > 4.0
    assert sticking_case.as_json()["closed_form_mm"] is None


def test_mujoco_repeats_to_the_bit(grasps: Grasps) -> None:
    again = run_mujoco(grasps["mujoco"][1].grasp)
    assert again.block.tobytes() == grasps["mujoco"][1].block.tobytes()
    assert again.forces.tobytes() == grasps["mujoco"][1].forces.tobytes()


@pytest.mark.slow
def test_figure_7_shows_start_and_ends(grasps: Grasps, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.measure.figures.figure_6_7_grasp.both_grasps", lambda _progress: grasps)
    result = figure_7(print)
    assert result.holds
    assert len(result.pictures[""].axes) == 6
    rendered = [np.asarray(axis.images[0].get_array()) for axis in result.pictures[""].axes if axis.images]
    assert len(rendered) == 4
    assert (rendered[0] == rendered[2]).all(), "both start alike"
    assert (rendered[1] != rendered[3]).any(), "and end differently"
