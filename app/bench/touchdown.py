"""How hard a piece is set down where the board is higher or lower than believed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from app.bench.cell import LEAD, Cell
from app.manipulation import Inventory, Stage, Transfer
from app.motion import Motion, MotionSettings, plan_ply
from controller.protocol import Guard
from hardware.parameters import RobotParameters
from hardware.sim.arm import SCENE_BITS, TOOL_BITS
from hardware.sim.contact import Contact
from hardware.sim.plant import Plant
from hardware.sim.scene import FELT, FOOT_FRICTION, StandingPiece, build_model
from hardware.table import Colour, Kind, PieceSpec, Place, TableSettings, square_place

SUBSTEPS: Final = 8
"""Steps of MuJoCo in a tick: a blow on bare wood takes 3 ms."""
FOLLOWED: Final = 0.02
"""Mass that moves along with the surface; with steps so short it need not be larger [kg]."""
WOOD: Final = 1.0e6
"""A piece without felt on a wooden board [N/m]."""
SOURCE, TARGET = square_place(27), square_place(36)
_LASTING: Final = 0.01
"""The end of the motion, over which the force is averaged [s]."""
_SIDE: Final = 0.018
"""Half a side of what stands out of the board [m]."""


@dataclass(frozen=True, slots=True)
class Touchdown:
    """One trial.

    Attributes:
        error: the target square is so much higher than believed [m].
        stiffness: of the piece's foot on the board [N/m].
        guard: the touch guard ends the way down.
        schedule: z₃ is soft near the board, else as stiff as in the air.
        kind: of the piece.
        target: where it is set down.
    """

    error: float
    stiffness: float = FELT.stiffness
    guard: bool = True
    schedule: bool = True
    kind: Kind = Kind.KING
    target: Place = TARGET


class Pressed(NamedTuple):
    """How a piece was set down: the largest force between foot and board, and the mean one in the end [N]."""

    peak: float
    lasting: float


def set_down(trial: Touchdown, settings: MotionSettings, parameters: RobotParameters) -> Pressed:
    """Set a piece down in the world.

    The piece comes from a square of the believed height, so that it hangs in the fingers as it should: what is wrong is
    the height of the target alone.

    Raises:
        RuntimeError: the piece was not gripped, or never met the board.
    """
    nominal = TableSettings()
    x, y, z = nominal.centre_in_base
    believed = nominal.model_copy(update={"centre_in_base": (x, y, z - max(0.0, -trial.error))})
    spec = PieceSpec("piece", trial.kind, Colour.WHITE, SOURCE)
    transfer = Transfer(spec.name, spec.kind, spec.colour, SOURCE, trial.target)
    plan = plan_ply(
        "", [transfer], Inventory.of([spec], believed), np.array(settings.home), parameters.gripper.stroke / 2.0,
        settings, parameters, LEAD,
    )  # fmt: skip
    plant = Plant(_world(trial, spec, nominal, settings, parameters), parameters, (spec.name,))
    cell = Cell(plant, parameters, believed)
    cell.boot()
    ways = {motion.stage: motion for motion in plan.motions}
    cell.carry_out(ways[Stage.APPROACH])
    cell.carry_out(ways[Stage.GRASP], followed=True)
    forces: list[float] = []
    plant.watch_step = lambda: forces.append(_force(plant, trial.error))
    cell.execute(_as_asked(ways[Stage.CARRY], trial, settings), followed=True)
    left = np.flatnonzero(np.array(forces) == 0.0)
    if not left.size:
        raise RuntimeError("the piece was not lifted")
    felt = np.array(forces[left[0] :])
    if not felt.any():
        raise RuntimeError("the piece never met the board")
    return Pressed(float(felt.max()), float(felt[-round(_LASTING / plant.model.opt.timestep) :].mean()))


def _world(
    trial: Touchdown, spec: PieceSpec, table: TableSettings, settings: MotionSettings, parameters: RobotParameters
) -> mujoco.MjModel:
    """Board and piece; what is higher, the target or where the piece comes from, stands out of the board."""
    x, y = table.xy(SOURCE)
    raised = table.xy(trial.target) if trial.error > 0.0 else (x, y)
    height = abs(trial.error)

    def add_plate(world: mujoco.MjSpec) -> None:
        if height == 0.0:
            return
        world.worldbody.add_geom(
            name="plate", type=mujoco.mjtGeom.mjGEOM_BOX, size=[_SIDE, _SIDE, height / 2.0],
            pos=[*raised, height / 2.0], contype=SCENE_BITS, conaffinity=SCENE_BITS | TOOL_BITS,
            friction=[FOOT_FRICTION, 0.005, 0.0001],
        )  # fmt: skip
        world.add_sensor(
            name="force_plate", type=mujoco.mjtSensor.mjSENS_CONTACT, objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname="plate", reftype=mujoco.mjtObj.mjOBJ_UNKNOWN, intprm=[2, 3, 1],
        )  # fmt: skip

    feet = Contact(trial.stiffness, FELT.mass, FELT.damping_ratio, FOLLOWED)
    piece = StandingPiece(spec, x, y, height=max(0.0, -trial.error))
    timestep = parameters.drive.tick / SUBSTEPS
    home = np.array(settings.home)
    return build_model(parameters, table, (piece,), home, timestep, looks=False, feet=feet, add=add_plate)


def _force(plant: Plant, error: float) -> float:
    """On what the piece comes from or is set down on [N]: either is board, or stands out of it."""
    names = ["force_deck", "force_plate"] if error else ["force_deck"]
    return max(float(np.linalg.norm(plant.data.sensor(name).data)) for name in names)


def _as_asked(carry: Motion, trial: Touchdown, settings: MotionSettings) -> NDArray[Any]:
    samples = carry.samples.copy()
    if not trial.guard:
        samples["guard"] = Guard.NONE
    if not trial.schedule:
        frequency = settings.gains.frequency_in_air
        samples["stiffness"][:, 2] = frequency**2
        samples["damping"][:, 2] = 2.0 * settings.gains.damping_ratio * frequency
    return samples
