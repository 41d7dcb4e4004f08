"""Bench ``fallen``: pieces that fell are found by the camera, stood up and carried to their squares by the arm.

In every world some pieces stand as in a game. One of them is knocked over, or lost from the fingers on its way, by a
gripper that lets go. What the camera then shows is rendered from where the pieces really came to lie; nothing else of
the truth is used until the end. Up to three times per piece the arm looks, stands up or carries, and looks again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from app.execution.recovery_plans import in_order, plan_making_way, plan_stand_up
from app.measure.bench.beds.bed import Bed, plant_of
from app.measure.bench.report import BenchReport, Progress, row
from app.motion import MotionSettings, Plan, PlanRefused
from app.motion.plan import InTheWay
from app.pieces.inventory import Inventory, Transfer
from controller.protocol import CommandCode
from hardware.piece_set import Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.plant.grip_faults import GripFaults
from hardware.sim.plant.imperfections import Flaws, Imperfections
from hardware.sim.process.table_studio import PlacedPiece, TableStudio
from hardware.sim.render.settings import SceneState
from hardware.table import PieceSpec, Place, TableSettings, square_place
from vision.board.view import BoardView
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.misplaced import find_misplaced

SEED: Final = 11
TRIALS: Final = {True: 4, False: 60}  # by ``quick``; every other piece knocked over, the others lost from the fingers
STANDING: Final = 14  # pieces in a world
PUSHED: Final = math.radians(40.0)  # a knocked piece begins so far from upright, and falls from there [rad]
TRIES: Final = 3
LOOKS: Final = 2 * TRIES + 3
"""Each try is two plans at most, stand up and carry; and some pieces may have to make way."""
UPRIGHT: Final = math.radians(5.0)
PLACED: Final = 0.004  # a piece further from its square's centre is carried there; the game's own tolerance is 5 mm [m]
RIGHT: Final = 0.005
_SETTLE: Final = 1.0
"""From a fall until all is at rest [s]."""


def fallen_bench(quick: bool, progress: Progress) -> BenchReport:
    """Run the bench; ``quick`` with fewer pieces."""
    table = TableSettings()
    unmended, plans = list[float](), list[float]()
    with TableStudio(_set(), table, MotionSettings().home) as studio:
        for number in range(TRIALS[quick]):
            trial = FallTrial(studio, table, number, lost=bool(number % 2))
            trouble = trial.run()
            unmended.append(float(trouble is not None))
            plans.append(float(trial.plans))
            progress(f"{number + 1} of {TRIALS[quick]}: {trial.what}: {trouble or f'put right by {trial.plans} plans'}")
    rows = {"unmended": row(unmended, "1", 0.05, "mean"), "plans": row(plans, "1")}
    return BenchReport.of("fallen", SEED, rows)


def _set() -> tuple[PieceSpec, ...]:
    """Two of each kind and side, as they are called; the places are those of no world."""
    each = itertools.product(Colour, Kind, (1, 2))
    return tuple(
        PieceSpec(f"{colour}-{kind}-{twin}", kind, colour, square_place(square))
        for square, (colour, kind, twin) in enumerate(each)
    )


class FallTrial:
    """One world and one mishap, both decided by a number: a piece is knocked over, or ``lost`` out of the fingers.

    Attributes:
        what: happened.
        plans: that the arm carried out to put it right.
    """

    def __init__(self, studio: TableStudio, table: TableSettings, number: int, *, lost: bool) -> None:
        self._studio, self._table, self._number = studio, table, number
        self._rng = np.random.default_rng([SEED, number])
        specs, squares = self._rng.permutation(np.array(_set(), dtype=object)), self._rng.permutation(64)
        stands = [
            replace(spec, place=square_place(int(at))) for spec, at in zip(specs[:STANDING], squares, strict=False)
        ]
        self._victim: PieceSpec = stands[0]
        self._target = square_place(int(squares[STANDING])) if lost else self._victim.place
        self._inventory = Inventory.of(stands, table)
        self._lost = lost
        pieces = tuple(self._put(spec, not lost and spec is self._victim) for spec in stands)
        faults = Imperfections(grip=GripFaults(holds=(1,) if lost else (), latest=0.4))
        self._bed = Bed(plant_of(pieces, table, MotionSettings(), Flaws(faults, number)), table)
        self._looks = SceneState()
        self._view = studio.camera_from_board(self._looks.mount)
        self.what = f"{self._victim.kind} on {self._victim.place} {'lost on its way' if lost else 'knocked over'}"
        self.plans, self._ways = 0, list[Transfer]()

    def _put(self, spec: PieceSpec, pushed: bool) -> StandingPiece:
        x, y = np.array(self._table.xy(spec.place)) + self._rng.normal(0.0, 0.0007, 2).clip(-0.002, 0.002)
        tip = PUSHED if pushed else 0.0
        lift = 0.012 * math.sin(tip) + 0.001 * bool(tip)
        return StandingPiece(spec, float(x), float(y), float(self._rng.uniform(-math.pi, math.pi)), lift, tip=tip)

    def run(self) -> str | None:
        """A sentence if the piece does not stand on its square in the end, or another one no longer does."""
        if self._lost:  # the gripper lets go on the way, and the arm notices, at the latest when nothing stands
            self._carry_out(self._ply(Transfer.of(self._victim, self._target), self._inventory))
        self._bed.wait(_SETTLE)
        for _ in range(LOOKS):
            misplaced = self._misplaced()
            one = next(iter(in_order(misplaced)), None)
            if one is None:
                break
            try:
                plan = plan_stand_up(self._bed.planner(), one, misplaced, self._inventory)
            except InTheWay as blocked:
                if trouble := self._make_way(blocked.piece.name, misplaced):
                    return trouble
                continue
            except PlanRefused as refused:
                return str(refused)
            self.plans += 1
            self._carry_out(plan)
            self._bed.wait(0.3)
        for transfer in reversed(self._ways):
            back = Transfer(transfer.name, transfer.kind, transfer.colour, transfer.target, transfer.source)
            righted = [replace(spec, place=self._place(spec)) for spec in self._inventory]
            self._carry_out(self._ply(back, Inventory.of(righted, self._table)))
            self._inventory = self._inventory.moved(back)
        return self._judge()

    def _ply(self, transfer: Transfer, inventory: Inventory) -> Plan:
        return self._bed.planner().ply("", [transfer], inventory)

    def _make_way(self, name: str, misplaced: Sequence[MisplacedPiece]) -> str | None:
        """Carry a piece away that is where the fingers have to go; a sentence if that is impossible."""
        if name not in {spec.name for spec in self._inventory}:
            return f"the {name} lies in the way"
        try:
            transfer, plan = plan_making_way(self._bed.planner(), name, misplaced, self._inventory)
        except PlanRefused as refused:
            return str(refused)
        self._carry_out(plan)
        self._inventory = self._inventory.moved(transfer)
        self._ways.append(transfer)
        self.plans += 1
        return None

    def _carry_out(self, plan: Plan) -> None:
        """As far as it goes; then home."""
        try:
            self._bed.execute_plan(plan)
        except RuntimeError:
            self._bed.wait(0.5)
            self._bed.supervisor.obey(CommandCode.RESUME)
            self._bed.carry_out(self._bed.planner().home(self._victim.kind).motions[0])

    def _poses(self) -> Iterator[PlacedPiece]:
        """Of all pieces, for the picture."""
        for spec in self._inventory:
            body = self._bed.plant.data.body(spec.name)
            x, y, z = body.xpos.tolist()
            axis = body.xmat.reshape(3, 3)[:, 2]
            tip = math.acos(max(-1.0, min(1.0, axis[2])))
            yield PlacedPiece(spec.name, x, y, z, math.atan2(axis[0], -axis[1]), tip)

    def _misplaced(self) -> list[MisplacedPiece]:
        """What the camera finds out of place; the victim first."""
        self._number += 1000
        frame = self._studio.frame(self._poses(), self._looks, self._number)
        view = BoardView(frame.intrinsics, self._view, self._table)
        expected = {self._place(spec): spec for spec in self._inventory}
        found = find_misplaced(frame, view, expected, tolerance=PLACED)
        return [replace(stray, target=self._place(expected[stray.target])) for stray in found]

    def _place(self, spec: PieceSpec) -> Place:
        return self._target if spec.name == self._victim.name else spec.place

    def _judge(self) -> str | None:
        poses: Mapping[str, PlacedPiece] = {pose.name: pose for pose in self._poses()}
        for spec in self._inventory:
            pose, (x, y) = poses[spec.name], self._table.xy(self._place(spec))
            off = math.hypot(pose.x - x, pose.y - y)
            if pose.tip > UPRIGHT:
                return f"{spec.name} leans by {math.degrees(pose.tip):.0f}°"
            if off > RIGHT:
                return f"{spec.name} stands {1e3 * off:.1f} mm off {self._place(spec)}"
        return None
