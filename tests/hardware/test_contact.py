"""Contacts are as stiff as they say: at rest, and in a blow, at any step."""

from __future__ import annotations

import math

import mujoco
import pytest

from hardware.parameters import load_parameters
from hardware.sim.contact import Contact, set_solver
from hardware.sim.scene import FEET, FELT

TICK = load_parameters().drive.tick
PIECE = 0.045
SHARP = Contact(FELT.stiffness, FELT.mass, damping_ratio=0.01, followed=0.02)


def standing(contact: Contact, mass: float, timestep: float, points: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A mass that slides up and down, with feet for a piece of 45 g on it, just over a plate; no gravity."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = timestep, [0.0, 0.0, 0.0]
    spec.option.integrator, spec.option.cone = (
        mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtCone.mjCONE_ELLIPTIC,
    )  # fmt: skip
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.01], pos=[0.0, 0.0, -0.01])
    body = spec.worldbody.add_body(pos=[0.0, 0.0, 1e-6])
    body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, 1.0])
    body.mass, body.inertia, body.explicitinertial = mass, [1e-4] * 3, True
    for i in range(points):
        angle = 2.0 * math.pi * i / points
        at = [0.01 * math.cos(angle), 0.01 * math.sin(angle), 0.0015]
        foot = body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.0015, 0.0, 0.0], pos=at, mass=0.0)
        set_solver(foot, contact.solver(PIECE, points))
    model = spec.compile()
    model.body_invweight0[1] = 1.0 / PIECE  # of a piece that is free: the rest of the mass is the arm behind it
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("points", [1, FEET])
@pytest.mark.parametrize("contact", [SHARP, FELT])
def test_at_rest_force_is_stiffness_times_depth(contact: Contact, points: int) -> None:
    model, data = standing(contact, FELT.mass, TICK / 4.0, points)
    data.qfrc_applied[0] = -20.0
    for _ in range(round(4.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    static = contact.stiffness * (1.0 + contact.followed / contact.mass)
    assert -(data.qpos[0] + 1e-6) == pytest.approx(20.0 / static, rel=0.01)


@pytest.mark.parametrize("speed", [0.01, 0.03, 0.1])
@pytest.mark.parametrize("stiffness", [3e4, 1e5, 3e5])
@pytest.mark.parametrize("substeps", [4, 8])
def test_a_blow_peaks_at_speed_times_root_of_stiffness_times_mass(
    speed: float, stiffness: float, substeps: int
) -> None:
    contact = Contact(stiffness, FELT.mass, SHARP.damping_ratio, SHARP.followed)
    model, data = standing(contact, FELT.mass, TICK / substeps, FEET)
    assert blow(model, data, speed) == pytest.approx(speed * math.sqrt(stiffness * FELT.mass), rel=0.05)
    assert contact.peak(speed, FELT.mass) == pytest.approx(speed * math.sqrt(stiffness * FELT.mass))


@pytest.mark.parametrize("speed", [0.01, 0.03, 0.1])
def test_the_games_feet_take_a_blow_within_15_percent_at_the_games_step(speed: float) -> None:
    model, data = standing(FELT, FELT.mass, TICK, FEET)
    assert blow(model, data, speed) == pytest.approx(FELT.peak(speed, FELT.mass), rel=0.15)


def blow(model: mujoco.MjModel, data: mujoco.MjData, speed: float) -> float:
    """Largest force of meeting the plate at a speed."""
    data.qvel[0] = -speed
    before, peak = -speed, 0.0
    for _ in range(round(0.05 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        peak = max(peak, FELT.mass * (float(data.qvel[0]) - before) / model.opt.timestep)
        before = float(data.qvel[0])
    return peak
