"""A world for setting down a piece where the board is not as high as believed: one square stands out of it."""

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.parameters import RobotParameters
from hardware.sim.bodies.arm import SCENE_BITS, TOOL_BITS, add_contact_sensor
from hardware.sim.bodies.friction_and_stiffness import FOOT_FRICTION, FOOT_ON_BOARD
from hardware.sim.bodies.mujoco_contact import Contact
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.table import TableSettings

SUBSTEPS: Final = 8
"""Steps of MuJoCo in a tick: a blow on bare wood takes 3 ms."""
FOLLOWED: Final = 0.02
"""Mass that moves along with the surface; with steps so short it need not be larger [kg]."""
_FELT: Final = FOOT_ON_BOARD.contact
FELT_STIFFNESS: Final = _FELT.stiffness
WOOD_STIFFNESS: Final = 1.0e6
"""A piece without felt on a wooden board [N/m]."""
_SIDE: Final = 0.018
"""Half a side of what stands out of the board [m]."""


def build_touchdown_world(
    parameters: RobotParameters,
    table: TableSettings,
    piece: StandingPiece,
    raised: tuple[tuple[float, float], float],
    home: NDArray[np.float64],
    stiffness: float,
) -> mujoco.MjModel:
    """Arm, board and one piece; key frame 0 is the start, with the tool at ``home``, base frame [m].

    ``raised`` is the centre (x, y) of what stands out of the board, and how far [m], ``stiffness`` that of the foot on
    it [N/m].
    """
    (x, y), height = raised

    def add_plate(world: mujoco.MjSpec) -> None:
        if height == 0.0:
            return
        world.worldbody.add_geom(
            name="plate", type=mujoco.mjtGeom.mjGEOM_BOX, size=[_SIDE, _SIDE, height / 2.0], pos=[x, y, height / 2.0],
            contype=SCENE_BITS, conaffinity=SCENE_BITS | TOOL_BITS, friction=[FOOT_FRICTION, 0.005, 0.0001],
        )  # fmt: skip
        add_contact_sensor(world, "force_plate", "plate", mujoco.mjtObj.mjOBJ_GEOM)

    feet = Contact(stiffness, _FELT.mass, _FELT.damping_ratio, FOLLOWED)
    timestep = parameters.drive.tick / SUBSTEPS
    return build_model(parameters, table, (piece,), home, timestep, looks=False, feet=feet, add=add_plate)


def board_force(data: mujoco.MjData, *, raised: bool) -> float:
    """On the board, or on what stands out of it, whichever is more [N]."""
    names = ["force_deck", "force_plate"] if raised else ["force_deck"]
    return max(float(np.linalg.norm(data.sensor(name).data)) for name in names)
