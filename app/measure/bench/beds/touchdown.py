"""How hard a piece is set down where the board is higher or lower than believed."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.measure.bench.beds.bed import LEAD, Bed
from app.motion import PROFILES, Motion, MotionSettings, Planner, Profile
from app.pieces.inventory import Inventory, Stage, Transfer
from controller.protocol import Guard
from hardware.parameters import load_parameters
from hardware.piece_set import Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.touchdown_world import FELT_STIFFNESS, WOOD_STIFFNESS, board_force, build_touchdown_world
from hardware.sim.plant.plant import Plant
from hardware.table import PieceSpec, Place, TableSettings, square_place

FELT, WOOD = FELT_STIFFNESS, WOOD_STIFFNESS
SOURCE, TARGET = square_place(27), square_place(36)
_LASTING: Final = 0.01
"""The end of the motion, over which the force is averaged [s]."""


class Touchdown(NamedTuple):
    """One trial."""

    error: float  # the target square is so much higher than believed [m]
    stiffness: float = FELT  # of the piece's foot on the board [N/m]
    guard: bool = True  # the touch guard ends the way down
    schedule: bool = True  # z₃ is soft near the board, else as stiff as in the air
    kind: Kind = Kind.KING
    target: Place = TARGET


class Pressed(NamedTuple):
    """How a piece was set down: the largest force between foot and board, and the mean one in the end [N]."""

    peak: float
    lasting: float


def set_down(trial: Touchdown, settings: MotionSettings = PROFILES[Profile.DEFAULT]) -> Pressed:
    """Set a piece down in the world.

    The piece comes from a square of the believed height, so that it hangs in the fingers as it should: what is wrong is
    the height of the target alone.

    Raises:
        RuntimeError: the piece was not gripped, or never met the board.
    """
    parameters = load_parameters()
    nominal = TableSettings()
    z1, z2, z3 = nominal.centre_in_base
    believed = nominal.model_copy(update={"centre_in_base": (z1, z2, z3 - max(0.0, -trial.error))})
    spec = PieceSpec("piece", trial.kind, Colour.WHITE, SOURCE)
    home, finger = np.array(settings.home), parameters.gripper.stroke / 2.0
    planner = Planner.of(settings, parameters, believed, home, finger, LEAD)
    plan = planner.ply("", [Transfer.of(spec, trial.target)], Inventory.of([spec], believed))
    x, y = nominal.xy(SOURCE)
    piece = StandingPiece(spec, x, y, height=max(0.0, -trial.error))
    raised = nominal.xy(trial.target) if trial.error > 0.0 else (x, y), abs(trial.error)
    world = build_touchdown_world(parameters, nominal, piece, raised, home, trial.stiffness)
    plant = Plant(world, parameters, (spec.name,))
    bed = Bed(plant, believed)
    ways = {motion.stage: motion for motion in plan.motions}
    bed.carry_out(ways[Stage.APPROACH])
    bed.carry_out(ways[Stage.GRASP], followed=True)
    forces: list[float] = []
    plant.watch_step = lambda: forces.append(board_force(plant.data, raised=trial.error != 0.0))
    bed.execute(_as_asked(ways[Stage.CARRY], trial, settings), followed=True)
    left = np.flatnonzero(np.array(forces) == 0.0)
    if not left.size:
        raise RuntimeError("the piece was not lifted")
    felt = np.array(forces[left[0] :])
    if not felt.any():
        raise RuntimeError("the piece never met the board")
    return Pressed(float(felt.max()), float(felt[-round(_LASTING / plant.model.opt.timestep) :].mean()))


def _as_asked(carry: Motion, trial: Touchdown, settings: MotionSettings) -> NDArray[Any]:
    samples = carry.samples.copy()
    if not trial.guard:
        samples["guard"] = Guard.NONE
    if not trial.schedule:
        frequency = settings.gains.frequency_in_air
        samples["stiffness"][:, 2] = frequency**2
        samples["damping"][:, 2] = 2.0 * settings.gains.damping_ratio * frequency
    return samples
