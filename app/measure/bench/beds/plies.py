"""Plies of random games, carried out by controller and plant in one process, and what came of them.

Positions are from games of random legal moves. Every piece stands off its place, by up to 3 mm along each axis, and
every mass the controller believes in is wrong by up to 5 %. A world is used for some plies, of which only pieces that
were not moved before count as placed from that offset.
"""

from __future__ import annotations

import random
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import chess
import numpy as np

from app.measure.bench.beds.bed import Bed, plant_of
from app.motion import MotionSettings, Plan
from app.motion.path import Vector
from app.pieces.inventory import Inventory, MoveKind, Ply
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from controller.law.task_space import TaskSpaceController
from controller.model.constants import DeltaModel
from hardware.interfaces import Triple
from hardware.parameters import RobotParameters
from hardware.sim.bodies.placed import StandingPiece
from hardware.table import Kind, PieceSpec, TableSettings

PLIES_A_WORLD = 6
MOST_OPENING = 60
"""Random moves before the plies of a world."""


@dataclass(frozen=True, slots=True)
class Disorder:
    """What is not as the controller believes.

    Attributes:
        offset: pieces stand up to so far off along x and y [m].
        mass_error: masses of the arm are believed wrong by up to this share.
    """

    offset: tuple[float, float] = (0.0, 0.0)
    mass_error: float = 0.0


@dataclass(frozen=True, slots=True)
class Done:
    """One ply.

    Attributes:
        ply: the move.
        plan: how it was planned.
        planning: time that took [s, wall].
        duration: from the first tick to the last [s].
        torques: of each tick, (n, 3) [N m].
        released: how far each piece stands from its place's centre, by name [m]; only of those not moved before.
        tool: how far the tool was from the plan when each piece touched the board, seen from above [m].
        disturbed: how far the farthest of the other pieces was moved [m].
        peak_contact: the largest contact force [N].
    """

    ply: Ply
    plan: Plan
    planning: float
    duration: float
    torques: Vector
    released: dict[str, float]
    kinds: dict[str, Kind]
    tool: tuple[float, ...]
    disturbed: float
    peak_contact: float


class GameBed(Bed):
    """A test bed with pieces set up, and how the game on it stands."""

    def __init__(
        self,
        board: chess.Board,
        settings: MotionSettings,
        parameters: RobotParameters,
        table: TableSettings,
        disorder: Disorder,
        seed: int,
    ) -> None:
        rng = np.random.default_rng(seed)
        self.board, self.settings = board, settings
        self.inventory = Inventory.of(start_layout(board, table), table)
        standing = stand_off(tuple(self.inventory), table, disorder, rng)
        law = TaskSpaceController(DeltaModel(believed(parameters, disorder, rng)))
        super().__init__(plant_of(standing, table, settings, parameters, looks=True), parameters, table, law)
        self.moved: set[str] = set()
        self._torques: list[Triple] = []
        self.watchers.append(lambda: self._torques.append(self.supervisor.torque))

    @property
    def table(self) -> TableSettings:
        """As the planner believes it to be."""
        return self.inventory.table

    def planned(self, move: chess.Move) -> tuple[Ply, Plan, float]:
        """Plan a ply."""
        ply = transfers(self.board, move, self.inventory)
        since = time.perf_counter()
        plan = self.planner(self.settings, self.table).ply(ply.san, ply.transfers, self.inventory)
        return ply, plan, time.perf_counter() - since

    def play(self, move: chess.Move) -> Done:
        """Carry a ply out.

        Raises:
            RuntimeError: a motion did not end as it had to.
        """
        before = self.positions()
        ply, plan, planning = self.planned(move)
        self.plant.truth(reset_peak=True)
        self._torques.clear()
        start, tool = self.plant.tick, list[float]()
        for motion, followed in self.continued(plan):
            self.carry_out(motion, followed)
            if motion.touches:
                target = ply.transfers[motion.transfer or 0].target
                here = self.table.board_from_base(np.array(self.plant.truth(reset_peak=False).tool))
                tool.append(float(np.hypot(*(here[:2] - self.table.xy(target)))))
        duration = (self.plant.tick - start) * self.parameters.drive.tick
        after = self.positions()
        changes = ply.changes()
        fresh = {name: place for name, place in changes.items() if name not in self.moved}
        released = {name: float(np.hypot(*(after[name][:2] - self.table.xy(place)))) for name, place in fresh.items()}
        others = [float(np.linalg.norm(after[n][:2] - before[n][:2])) for n in after if n not in changes]
        self.board.push(move)
        self.inventory = self.inventory.after(ply)
        self.moved |= changes.keys()
        peak = self.plant.truth(reset_peak=False).peak_contact_force
        kinds = {transfer.name: transfer.kind for transfer in ply.transfers}
        return Done(
            ply, plan, planning, duration, np.array(self._torques), released, kinds, tuple(tool),
            max(others, default=0.0), peak,
        )  # fmt: skip


def stand_off(
    pieces: Sequence[PieceSpec], table: TableSettings, disorder: Disorder, rng: np.random.Generator
) -> tuple[StandingPiece, ...]:
    """Every piece off its place, turned at random."""
    standing = []
    for spec in pieces:
        x, y = table.xy(spec.place)
        dx, dy = rng.uniform(-1.0, 1.0, 2) * disorder.offset
        standing.append(StandingPiece(spec, x + float(dx), y + float(dy), float(rng.uniform(-np.pi, np.pi))))
    return tuple(standing)


def believed(parameters: RobotParameters, disorder: Disorder, rng: np.random.Generator) -> RobotParameters:
    """Parameters with every mass wrong by its own share."""
    inertia = parameters.inertia
    masses = ("proximal_mass", "distal_pair_mass", "flange_mass", "gripper_body_mass", "finger_mass")
    wrong = {
        name: getattr(inertia, name) * float(1.0 + disorder.mass_error * rng.uniform(-1.0, 1.0)) for name in masses
    }
    return parameters.model_copy(update={"inertia": inertia.model_copy(update=wrong)})


def positions(seed: int) -> Iterator[chess.Board]:
    """Positions of games of random legal moves, without end, in none of which the game is over."""
    rng = random.Random(seed)
    while True:
        board = chess.Board()
        for _ in range(rng.randrange(MOST_OPENING)):
            if board.is_game_over():
                break
            board.push(rng.choice(list(board.legal_moves)))
        if not board.is_game_over():
            yield board


@dataclass(slots=True)
class Games:
    """Plies of random games under the same circumstances.

    Attributes:
        done: in order; each world's follow each other.
        failures: sentences about plies that were not carried out.
        worlds: how many plies each world did.
    """

    settings: MotionSettings
    parameters: RobotParameters
    table: TableSettings
    disorder: Disorder
    seed: int
    plies: int = PLIES_A_WORLD
    done: list[Done] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    worlds: list[int] = field(default_factory=list)

    def run(self, transfers_wanted: int) -> None:
        """Until so many transfers are done."""
        rng, made = random.Random(self.seed), 0
        for number, board in enumerate(positions(self.seed)):
            if made >= transfers_wanted:
                return
            bed = GameBed(board, self.settings, self.parameters, self.table, self.disorder, self.seed + number)
            self.worlds.append(0)
            for _ in range(self.plies):
                if board.is_game_over() or made >= transfers_wanted:
                    break
                move = rng.choice(list(board.legal_moves))
                try:
                    one = bed.play(move)
                except RuntimeError as error:
                    self.failures.append(f"{board.fen()} {move.uci()}: {error}")
                    made += 1
                    break
                self.done.append(one)
                self.worlds[-1] += 1
                made += len(one.ply.transfers)

    def durations(self, kind: MoveKind) -> list[float]:
        """Of plies of a kind [s]."""
        return [one.duration for one in self.done if one.ply.kind is kind]
