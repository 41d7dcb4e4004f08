"""Ticks of a game as the controller lives them, on a test bed; so they repeat exactly."""

from __future__ import annotations

from dataclasses import dataclass

import chess
import numpy as np

from app.measure.bench.beds.bed import Bed, plant_of
from app.motion import MotionSettings
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.players.given_line import parse_line
from controller.law.task_space import TaskSpaceController
from controller.loop.supervisor import Supervisor
from controller.model.compiled import FloatArray
from hardware.interfaces import Triple
from hardware.parameters import RobotParameters
from hardware.sim.process.settings import WorldSettings, stand_pieces
from hardware.table import TableSettings

LINE = "e4 d5 exd5 Qxd5 Nc3 Qxg2 Bxg2"
"""Quiet moves and captures over near and far squares; as many of its plies are played as ticks are wanted."""


@dataclass(frozen=True, slots=True)
class Tick:
    """What the supervisor asked of the law in one tick, and what it got."""

    angle: Triple  # y [rad]
    velocity: Triple  # ẏ [rad/s]
    reference: FloatArray | None  # shape (16,), None where only the state was estimated
    tactile: tuple[float, float]  # forces on the right and left pad [N]
    torque: Triple  # what the supervisor then commanded [N m]
    found: FloatArray  # shape (7,): tool point [m], its velocity [m/s] and the number of Newton steps


@dataclass(frozen=True, slots=True)
class TickRecording:
    """A run of the supervisor: ticks on the brakes first, in which no torque was asked for, then all others."""

    parameters: RobotParameters
    boot: tuple[Tick, ...]
    ticks: tuple[Tick, ...]


def found(law: TaskSpaceController) -> FloatArray:
    """Shape (7,): tool point [m], its velocity [m/s] and Newton steps of the last ``update``."""
    return np.concatenate([law.state.position, law.state.velocity, law.state.quality[2:]])


def record(ticks: int, seed: int) -> TickRecording:
    """Play the line until so many ticks with torque are recorded; the seed decides how the pieces were set up.

    Raises:
        RuntimeError: the line is too short, or a motion of it failed.
    """
    board, table, motion = chess.Board(), TableSettings(), MotionSettings()
    inventory = Inventory.of(start_layout(board, table), table)
    world = WorldSettings(pieces=tuple(inventory), home=motion.home, table=table, seed=seed, cameras=False)
    heard: list[Tick] = []

    def listen(supervisor: Supervisor) -> None:
        said, law = supervisor.measurement, supervisor.law
        asked = law.state.torque.any()  # on the brakes at first it never was
        row = supervisor.reference.row.copy() if asked else None
        tactile = said.tactile if asked else (0.0, 0.0)
        heard.append(Tick(said.angle, said.velocity, row, tactile, supervisor.torque, found(law)))

    bed = Bed(plant_of(stand_pieces(world), table, motion, looks=True), table, motion, listeners=[listen])
    boot = sum(tick.reference is None for tick in heard)
    for move in parse_line(LINE, board):
        ply = transfers(board, move, inventory)
        bed.execute_plan(bed.planner().ply(ply.san, ply.transfers, inventory), joined=True)
        board.push(move)
        inventory = inventory.after(ply)
        if len(heard) - boot >= ticks:
            return TickRecording(bed.parameters, tuple(heard[:boot]), tuple(heard[boot : boot + ticks]))
    raise RuntimeError(f"the line {LINE} gave {len(heard) - boot} ticks, {ticks} are wanted")
