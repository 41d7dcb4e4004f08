"""Plies of random games, carried out by controller and plant in one process, and what came of them.

Positions are from games of random legal moves. Every piece stands off its place, by up to 3 mm along each axis, and
every mass the controller believes in is wrong by up to 5 %. A world is used for some plies, of which only pieces that
were not moved before count as placed from that offset.
"""

from __future__ import annotations

import random
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import chess
import numpy as np

from app.measure.bench.beds.bed import Bed, plant_of
from app.measure.bench.beds.parts import Part, time_by_part
from app.measure.bench.report import Progress
from app.motion import MotionSettings, Plan
from app.motion.path import Vector
from app.pieces.inventory import Inventory, MoveKind, Ply
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from controller.law.task_space import TaskSpaceController
from controller.model.constants import DeltaModel
from hardware.interfaces import Triple
from hardware.parameters import load_parameters
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.process.randomisation import weighed
from hardware.table import PieceSpec, TableSettings

PLIES_A_WORLD: Final = 12
"""They take more than 10 s in every profile: so long is the window of the torques' mean."""
GRASPS_A_WORLD: Final = 10
MOST_OPENING: Final = 60
"""Random moves before the plies of a world."""
_APART: Final = 0.2
"""Pieces that stand off towards each other, as spare ones in a tray can, have pushed each other apart by then [s]."""


class Disorder(NamedTuple):
    """What is not as the controller believes."""

    offset: tuple[float, float] = (0.0, 0.0)  # pieces stand up to so far off along x and y [m]
    mass_error: float = 0.0  # masses of the arm are believed wrong by up to this share


class Done(NamedTuple):
    """One ply."""

    ply: Ply
    plan: Plan
    planning: float  # time that planning took [s, wall]
    duration: float  # from the first tick to the last [s]
    torques: Vector  # of each tick, (n, 3) [N m]
    released: dict[str, float]
    """How far each piece stands from its place's centre, by name [m]; only of those not moved before."""
    tool: list[float]  # how far the tool was from the plan when each piece touched the board, seen from above [m]
    disturbed: float  # how far the farthest of the other pieces was moved [m]
    peak_contact: float  # the largest contact force [N]
    parts: Counter[Part]  # where the time went [s]


class GameBed(Bed):
    """A test bed with pieces set up, and how the game on it stands."""

    def __init__(
        self, board: chess.Board, settings: MotionSettings, table: TableSettings, disorder: Disorder, seed: int
    ) -> None:
        rng = np.random.default_rng(seed)
        self.board = board
        self.inventory = Inventory.of(start_layout(board, table), table)
        standing = stand_off(tuple(self.inventory), table, disorder, rng)
        law = TaskSpaceController(DeltaModel(weighed(disorder.mass_error, load_parameters(), rng)))
        super().__init__(plant_of(standing, table, settings, looks=True), table, settings, law)
        self.moved: set[str] = set()
        self._torques: list[Triple] = []
        self.listeners.append(lambda supervisor: self._torques.append(supervisor.torque))
        self.wait(_APART)

    def planned(self, move: chess.Move) -> tuple[Ply, Plan, float]:
        """Plan a ply; and how long that took [s, wall]."""
        ply = transfers(self.board, move, self.inventory)
        since = time.perf_counter()
        plan = self.planner().ply(ply.san, ply.transfers, self.inventory)
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
        start, tool, parts = self.plant.tick, list[float](), Counter[Part]()
        for motion, followed in self.continued(plan):
            begun = self.supervisor.measurement.tick
            self.carry_out(motion, followed)
            parts += time_by_part(motion, begun, self.supervisor.admission.ended, self.parameters.drive.tick)
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
        torques = np.array(self._torques)
        return Done(ply, plan, planning, duration, torques, released, tool, max(others, default=0.0), peak, parts)

    def slide(self, move: chess.Move) -> float:
        """Grasp the piece of a quiet move where it stands, let go of it and go home; how far it was pushed [m].

        Raises:
            RuntimeError: the piece was not gripped.
        """
        ply, plan, _ = self.planned(move)
        name, kind = ply.transfers[0].name, ply.transfers[0].kind
        before = self.positions()[name]
        for motion in plan.motions[:2]:
            self.carry_out(motion)
        pushed = float(np.hypot(*(self.positions()[name] - before)[:2]))
        for motion in self.planner().home(kind).motions:
            self.carry_out(motion)
        return pushed


ALONG_THE_FINGERS: Final = Disorder(offset=(0.003, 0.0))  # pieces stand off along the fingers' axis


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


class Games:
    """Plies of random games under the same circumstances, carried out until so many transfers are done."""

    def __init__(
        self, transfers_wanted: int, settings: MotionSettings, table: TableSettings, disorder: Disorder, seed: int
    ) -> None:
        self.done: list[Done] = []  # in order; each world's follow each other
        self.failures: list[str] = []  # sentences about plies that were not carried out
        self.worlds: list[int] = []  # how many plies each world did
        rng, made = random.Random(seed), 0
        for number, board in enumerate(positions(seed)):
            if made >= transfers_wanted:
                return
            bed = GameBed(board, settings, table, disorder, seed + number)
            self.worlds.append(0)
            for _ in range(PLIES_A_WORLD):
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


def slides(count: int, settings: MotionSettings, seed: int, progress: Progress) -> list[float]:
    """How far each of so many pieces is pushed before both fingers hold it, seen from above [m].

    Raises:
        RuntimeError: a piece was not gripped.
    """
    rng, found = random.Random(seed), list[float]()
    for number, board in enumerate(positions(seed)):
        bed = GameBed(board, settings, TableSettings(), ALONG_THE_FINGERS, seed + number)
        for move in _one_a_piece(board, rng)[:GRASPS_A_WORLD]:
            found.append(bed.slide(move))
            if len(found) == count:
                return found
        if number % 10 == 0:
            progress(f"{len(found)} of {count} grasps, k* = {settings.gains.tactile_gain:g}")
    raise AssertionError("positions never end")


def _one_a_piece(board: chess.Board, rng: random.Random) -> list[chess.Move]:
    """A quiet move of every piece that has one."""
    moves = [move for move in board.legal_moves if not board.is_capture(move) and not board.is_castling(move)]
    rng.shuffle(moves)
    return list({move.from_square: move for move in moves if move.promotion is None}.values())
