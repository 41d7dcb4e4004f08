"""Contacts are as stiff as they say: at rest, in a blow at any step, and so in the world that is compiled with them."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from hardware.parameters import load_parameters
from hardware.piece_set import Colour, Kind
from hardware.sim.bodies.friction_and_stiffness import (
    FOOT_ON_BOARD,
    PAD_ON_PIECE,
    PAIRS,
    POINTS_OF_A_FOOT,
    TOOL_ON_BOARD,
    Pair,
)
from hardware.sim.bodies.mujoco_contact import Contact
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.table import PieceSpec, TableSettings, square_place

PARAMETERS = load_parameters()
TICK = PARAMETERS.drive.tick
PIECE = 0.045
FELT = FOOT_ON_BOARD.contact
SHARP = Contact(FELT.stiffness, FELT.mass, damping_ratio=0.01, followed=0.02)
SPEEDS = [0.03, 0.1, 0.3]


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
    solver = contact.solver(PIECE, points)
    for i in range(points):
        angle = 2.0 * math.pi * i / points
        at = [0.01 * math.cos(angle), 0.01 * math.sin(angle), 0.0015]
        foot = body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.0015, 0.0, 0.0], pos=at, mass=0.0)
        foot.solref, foot.solimp, foot.priority = list(solver.solref), list(solver.solimp), 1
    model = spec.compile()
    model.body_invweight0[1] = 1.0 / PIECE  # of a piece that is free: the rest of the mass is the arm behind it
    return model, mujoco.MjData(model)


def blow(model: mujoco.MjModel, data: mujoco.MjData, mass: float, speed: float) -> float:
    """Largest force of meeting the plate at a speed."""
    data.qvel[0] = -speed
    before, peak = -speed, 0.0
    for _ in range(round(0.05 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        peak = max(peak, mass * (float(data.qvel[0]) - before) / model.opt.timestep)
        before = float(data.qvel[0])
    return peak


@pytest.mark.parametrize("points", [1, POINTS_OF_A_FOOT])
@pytest.mark.parametrize("contact", [SHARP, FELT])
def test_at_rest_force_is_stiffness_times_depth(contact: Contact, points: int) -> None:
    model, data = standing(contact, FELT.mass, TICK / 4.0, points)
    data.qfrc_applied[0] = -20.0
    for _ in range(round(4.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert -(data.qpos[0] + 1e-6) == pytest.approx(20.0 / contact.met_by(math.inf), rel=0.01)


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("stiffness", [3e4, 1e5, 3e5])
@pytest.mark.parametrize("substeps", [4, 8])
def test_a_blow_peaks_at_speed_times_root_of_stiffness_times_mass(
    speed: float, stiffness: float, substeps: int
) -> None:
    contact = Contact(stiffness, FELT.mass, SHARP.damping_ratio, SHARP.followed)
    model, data = standing(contact, FELT.mass, TICK / substeps, POINTS_OF_A_FOOT)
    assert blow(model, data, FELT.mass, speed) == pytest.approx(speed * math.sqrt(stiffness * FELT.mass), rel=0.05)
    assert contact.peak(speed, FELT.mass) == pytest.approx(speed * math.sqrt(stiffness * FELT.mass))


@pytest.mark.parametrize("substeps", [1, 2])
@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair.what)
def test_every_pair_takes_a_blow_within_15_percent_at_the_games_step_and_at_half_of_it(
    pair: Pair, speed: float, substeps: int
) -> None:
    contact = pair.contact
    model, data = standing(contact, contact.mass, TICK / substeps, 4)
    peak = speed * math.sqrt(contact.stiffness * contact.mass)
    assert blow(model, data, contact.mass, speed) == pytest.approx(peak, rel=0.15)


# ----------------------------------------------------------------------------------------------- in the world itself


def world(substeps: int, height: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The game's world with a queen on d4, the tool above it; legs disconnected and weightless, so that platform and
    gripper fly where they are let go, without gravity."""
    table = TableSettings()
    x, y = table.xy(square_place(27))
    queen = StandingPiece(PieceSpec("queen", Kind.QUEEN, Colour.WHITE, square_place(27)), x, y)
    home = table.base_from_board(np.array([x, y, height]))
    model = build_model(PARAMETERS, table, (queen,), home, TICK / substeps, looks=False)
    model.opt.gravity[:] = 0.0
    model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    model.eq_active0[:] = 0
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.eq_active[:] = 0
    mujoco.mj_forward(model, data)
    return model, data


def fly(model: mujoco.MjModel, data: mujoco.MjData, sensor: str, ticks: int) -> float:
    """The largest force that a sensor says."""
    peak = 0.0
    for _ in range(round(ticks * TICK / model.opt.timestep)):
        mujoco.mj_step(model, data)
        peak = max(peak, float(np.linalg.norm(data.sensor(sensor).data)))
    return peak


def flying_mass() -> float:
    inertia = PARAMETERS.inertia
    return inertia.flange_mass + inertia.gripper_body_mass + 2.0 * inertia.finger_mass


@pytest.mark.parametrize("substeps", [1, 2])
@pytest.mark.parametrize("speed", SPEEDS)
def test_fingers_that_fall_on_the_board_meet_the_stated_stiffness(speed: float, substeps: int) -> None:
    contact, mass = TOOL_ON_BOARD.contact, flying_mass()
    model, data = world(substeps, PARAMETERS.pads.half_height + 0.001)
    data.joint("platform_x").qpos[0] += 0.08  # beside the queen
    data.joint("platform_z").qvel[0] = speed  # z₃ is down
    assert fly(model, data, "force_deck", 60) == pytest.approx(speed * math.sqrt(contact.met_by(mass) * mass), rel=0.15)


@pytest.mark.parametrize("substeps", [1, 2])
@pytest.mark.parametrize("speed", [0.02, 0.05, 0.1])
def test_fingers_that_close_on_a_piece_meet_the_stated_stiffness(speed: float, substeps: int) -> None:
    """Both at once, so that the piece stays and each finger with its gear behind it is the mass."""
    model, data = world(substeps, 0.032)
    mass, contact = PARAMETERS.inertia.finger_mass + PARAMETERS.gripper.reflected_mass, PAD_ON_PIECE.contact
    model.actuator_gainprm[3] = model.actuator_biasprm[3] = 0.0  # no drive: they fly
    for side in ("right", "left"):
        data.joint(f"finger_{side}").qpos[0] = 0.0030
        data.joint(f"finger_{side}").qvel[0] = -speed
    peak = speed * math.sqrt(contact.met_by(mass) * mass)
    assert fly(model, data, "force_right", 80) == pytest.approx(peak, rel=0.15)
