"""A world for trying the protection: the arm, the board, and a person's finger in the way.

The finger is ISO/TS 15066's: a mass of 0.6 kg behind a spring of 75 N/mm. Free, the mass gives way as a hand in the air
does; clamped, it cannot move, as a hand on the table.
"""

from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.parameters import RobotParameters
from hardware.sim.bodies.arm import TOOL_BITS
from hardware.sim.bodies.scene import build_model
from hardware.table import TableSettings

STIFFNESS: Final = 75e3
"""Of the finger, ISO/TS 15066 [N/m]."""
MASS: Final = 0.6
"""Of the hand behind it, likewise [kg]."""
RADIUS: Final = 0.008
"""Of the fingertip [m]."""
SUBSTEPS: Final = 8
"""Steps of MuJoCo in a tick: an impact lasts 11 ms, but the tip alone swings in 2 ms."""
_TIP_MASS: Final = 0.01
_DAMPING: Final = 10.0
"""Of the spring; 1 % of what would keep the tip from swinging matters to no impact [N s/m]."""
_SOLREF = (0.002, 1.0)
_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""A hard skin: what gives is the spring."""
_HAND_DAMPING: Final = 10.0
"""Of the hand in the air [N s/m], assumed; an impact is over before it matters. Without any a hand that was knocked
away would float on, and sooner or later hit the resting arm by itself."""
_SLIDE: Final = mujoco.mjtJoint.mjJNT_SLIDE
_AXES: Final = dict(zip("xyz", np.eye(3).tolist(), strict=True))


@dataclass(frozen=True, slots=True)
class Finger:
    """Where a finger is: centre of its tip in the board frame [m], and whether it is clamped."""

    position: tuple[float, float, float]
    clamped: bool


def build_finger_world(
    parameters: RobotParameters, table: TableSettings, home: NDArray[np.float64], finger: Finger
) -> mujoco.MjModel:
    """Arm, board without pieces, and finger; key frame 0 is the start, with the tool at ``home``, base frame [m]."""

    def add_finger(spec: mujoco.MjSpec) -> None:
        hand = spec.worldbody.add_body(name="hand", pos=list(finger.position), gravcomp=1.0)
        if not finger.clamped:
            hand.mass, hand.inertia, hand.explicitinertial = MASS, [1e-3] * 3, True
            for name, axis in _AXES.items():
                hand.add_joint(name=f"hand_{name}", type=_SLIDE, axis=axis, damping=_HAND_DAMPING)
        # it meets the tool alone: pressed on the board it is the spring that must give, not the board
        tip = hand.add_body(name="fingertip", gravcomp=1.0)
        for name, axis in _AXES.items():
            tip.add_joint(name=f"finger_{name}", type=_SLIDE, axis=axis, stiffness=STIFFNESS, damping=_DAMPING)
        tip.add_geom(
            name="fingertip", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], mass=_TIP_MASS,
            contype=0, conaffinity=TOOL_BITS, priority=1, solref=list(_SOLREF), solimp=list(_SOLIMP),
            friction=[0.5, 0.005, 0.0001],
        )  # fmt: skip

    timestep = parameters.drive.tick / SUBSTEPS
    return build_model(parameters, table, (), home, timestep, looks=False, add=add_finger)


def finger_force(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """What the finger feels: the force of its spring [N]."""
    places = [int(model.joint(f"finger_{name}").qposadr[0]) for name in "xyz"]
    return STIFFNESS * float(np.linalg.norm(data.qpos[places]))
