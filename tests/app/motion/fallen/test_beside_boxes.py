"""What has fallen against a box, into whose wall the fingers would run, is turned first, and stands up then."""

from __future__ import annotations

import math
from contextlib import suppress
from itertools import product

import chess
import numpy as np
import pytest

from app.execution.clearing import turning
from app.execution.recovery_plans import plan_stand_up, plan_stirring
from app.measure.bench.beds.bed import Bed
from app.motion import MotionSettings
from app.motion.fallen.lying import Lying
from app.motion.plan import BoxInTheWay, Plan, PlanRefused
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.plant import Plant
from hardware.table import Captured, Place, TableSettings
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.poses import Pose

pytestmark = pytest.mark.slow
TABLE, SETTINGS = TableSettings(captured=Captured.BOX), MotionSettings()
STANDS = Inventory.of(start_layout(chess.Board("4k3/8/8/8/8/8/8/RNBQKB2 w - - 0 1"), TABLE), TABLE)


def as_it_lies(bed: Bed, name: str) -> MisplacedPiece:
    """What a perfect camera would say."""
    body, piece = bed.plant.data.body(name), STANDS.find(name)
    x, y, _ = body.xpos.tolist()
    axis = body.xmat.reshape(3, 3)[:, 2]
    return MisplacedPiece(piece, piece.place, Pose(x, y, math.atan2(axis[1], axis[0]) if axis[2] < 0.5 else None))


def turned(bed: Bed, one: MisplacedPiece) -> Plan:
    """A push at its head, its middle or its foot, rather along the box, as the arm does it."""
    yaw, alone = one.pose.yaw or 0.0, Inventory.of([one.piece], TABLE)
    lying, height = Lying(one.piece.kind, (one.pose.x, one.pose.y), yaw), PIECE_SHAPES[one.piece.kind].height
    for towards, part in product((*turning(yaw), None), (1.0, 0.5, 0.0)):
        with suppress(PlanRefused):
            spot = lying.along(part * height)
            return plan_stirring(bed.planner(), spot, {one.piece.name}, [], alone, towards, one)
    raise AssertionError("it cannot be turned")


@pytest.mark.parametrize(("square", "gap", "yaw"), [("b1", 0.022, 2.9), ("d1", 0.024, -2.5), ("c1", 0.018, 2.2)])
def test_a_piece_that_lies_with_its_foot_at_a_box_is_turned_and_stood_up(square: str, gap: float, yaw: float) -> None:
    piece = STANDS.at(Place.parse(square))
    assert piece is not None
    wall = min(box.x - box.half_x - box.wall for box in TABLE.boxes() if box.x > 0.0)
    foot = PIECE_SHAPES[piece.kind].foot_radius
    lies = StandingPiece(piece, wall - gap, 0.03, yaw + 0.5 * math.pi, foot, tip=0.5 * math.pi)
    parameters = load_parameters()
    model = build_model(parameters, TABLE, (lies,), np.array(SETTINGS.home), looks=False)
    bed = Bed(Plant(model, parameters, (piece.name,)), TABLE, SETTINGS)
    for _ in range(600):
        bed.tick()
    alone = Inventory.of([piece], TABLE)
    with pytest.raises(BoxInTheWay, match="lies too near to a box for the fingers to stand it up"):
        plan_stand_up(bed.planner(), as_it_lies(bed, piece.name), [as_it_lies(bed, piece.name)], alone)
    for _ in range(8):
        one = as_it_lies(bed, piece.name)
        if not one.lies:
            break
        try:
            plan = plan_stand_up(bed.planner(), one, [one], alone)
        except BoxInTheWay:
            plan = turned(bed, one)
        bed.execute_plan(plan)
        for _ in range(300):
            bed.tick()
    assert not as_it_lies(bed, piece.name).lies
    assert bed.plant.data.body(piece.name).xpos[0] + foot < wall
