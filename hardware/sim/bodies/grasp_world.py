"""A world for the soft grasp in MuJoCo: the arm of ``hardware.sim.bodies.arm`` with flat pads, a surface and one
block.
"""

from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from hardware.parameters import RobotParameters
from hardware.sim.bodies.arm import SCENE_BITS, TOOL_BITS, add_arm, add_contact_sensors, start_positions
from hardware.sim.bodies.scene import CameraStand, add_camera

SUBSTEPS: Final = 8
"""Steps of MuJoCo in a tick; the light block between stiff pads wants short ones."""
FLAT: Final = 1e-6
"""Angle of the pads' faces against the finger axis: V-grooves this shallow are flat [rad]."""
SURFACE_SOLREF = (0.005, 1.0)
SURFACE_SOLIMP = (0.95, 0.99, 0.0005, 0.5, 2.0)
"""Block on surface: the block sinks in by some µm, as wood on wood would. On a harder one the blow of the second pad
makes it hop by micrometres, which changes its friction by chance from one step size to another."""
_WOOD = (0.72, 0.52, 0.32, 1.0)
_SURFACE = (0.42, 0.43, 0.45, 1.0)
_WHITE = (0.97, 0.97, 0.97, 1.0)
_LINE = 0.0006
"""Half the width of the white lines that show whether the block has moved [m]."""
_VIEW: Final = CameraStand((0.005, -0.42, 0.21), (0.005, -0.01, 0.012), 0.19)
"""Along the fingers' closing plane, a little from above, near the block."""


@dataclass(frozen=True, slots=True)
class BlockWorld:
    """What stands where: board frame as in the game, z up, the surface at z = 0."""

    centre_in_base: tuple[float, float, float]
    """Origin of the board frame in the robot's base frame [m]."""
    tool: tuple[float, float, float]
    """Where the tool starts, base frame [m]."""
    fingers: float
    """Where each finger starts, from the tool's centre [m]."""
    mass: float
    """Of the block [kg]."""
    half_size: tuple[float, float, float]
    """Of the block, along x, y, z [m]."""
    friction: float
    """Between block and surface."""
    offset: float
    """Of the block along x [m]."""


def build_block_world(parameters: RobotParameters, world: BlockWorld, substeps: int = SUBSTEPS) -> mujoco.MjModel:
    """Compile the world; key frame 0 is its start. ``substeps``: steps of MuJoCo in a tick."""
    pads = parameters.pads.model_copy(update={"groove_angle": FLAT})
    parameters = parameters.model_copy(update={"pads": pads})
    spec = mujoco.MjSpec()
    spec.modelname = "grasp"
    option = spec.option
    option.timestep = parameters.drive.tick / substeps
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 20.0
    option.noslip_iterations = 5
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
    spec.visual.map.znear = 0.01
    _add_surface(spec, world)
    x, y, z = world.centre_in_base
    add_arm(spec, parameters, (-x, y, z))
    for side in ("right", "left"):  # the bar carries a pad as wide as itself: the pad alone touches
        bar = spec.geom(f"bar_{side}")
        bar.contype, bar.conaffinity = 0, 0
    _add_block(spec, world)
    add_contact_sensors(spec)
    add_camera(spec, "camera", _VIEW)
    start = start_positions(spec.compile(), parameters, np.array(world.tool), world.fingers)
    spec.add_key(name="start").qpos = start.tolist()
    return spec.compile()


def _add_surface(spec: mujoco.MjSpec, world: BlockWorld) -> None:
    spec.worldbody.add_geom(
        name="deck", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.25, 0.20, 0.01], pos=[0, 0, -0.01], contype=SCENE_BITS,
        conaffinity=SCENE_BITS | TOOL_BITS, friction=[world.friction, 0.005, 0.0001], rgba=list(_SURFACE),
        solref=list(SURFACE_SOLREF), solimp=list(SURFACE_SOLIMP),
    )  # fmt: skip
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[_LINE, 0.12, 0.0001], pos=[world.offset, 0, 0.0001], contype=0,
        conaffinity=0, rgba=list(_WHITE),
    )  # fmt: skip
    spec.add_texture(
        name="room", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.88, 0.90, 0.92], rgb2=[0.62, 0.65, 0.69], width=128, height=768,
    )  # fmt: skip
    for x, y, strength in ((0.25, -0.9, 0.45), (-0.6, -0.5, 0.20)):
        spec.worldbody.add_light(
            pos=[x, y, 0.9], dir=[-x, -y, -0.9], diffuse=[strength] * 3, ambient=[0.25] * 3, specular=[0.1] * 3,
            castshadow=False,
        )  # fmt: skip


def _add_block(spec: mujoco.MjSpec, world: BlockWorld) -> None:
    _, half_y, half_z = world.half_size
    block = spec.worldbody.add_body(name="block", pos=[world.offset, 0.0, half_z])
    block.add_freejoint(name="block")
    block.add_geom(
        name="block", type=mujoco.mjtGeom.mjGEOM_BOX, size=list(world.half_size), mass=world.mass,
        contype=SCENE_BITS, conaffinity=SCENE_BITS | TOOL_BITS, friction=[world.friction, 0.005, 0.0001],
        solref=list(SURFACE_SOLREF), solimp=list(SURFACE_SOLIMP), rgba=list(_WOOD),
    )  # fmt: skip
    for y, z, size in ((-half_y, 0.0, (_LINE, 0.0001, half_z)), (0.0, half_z, (_LINE, half_y, 0.0001))):
        block.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=list(size), pos=[0.0, y, z], contype=0, conaffinity=0, mass=0.0,
            rgba=list(_WHITE),
        )  # fmt: skip
