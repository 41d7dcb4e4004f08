"""Feeling how high the board is: on a free spot, to a fifth of a millimetre; then what lies on it stands up."""

from __future__ import annotations

import math

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.measure.bench.beds.bed import Bed
from app.motion import Planner
from app.motion.fallen.feel_board import MARGIN, plan_feeling
from app.motion.fallen.lying import Lying
from app.motion.fallen.stand_up import plan_upright
from app.motion.obstacles import Obstacle
from app.motion.plan import PlanRefused
from app.motion.settings import PROFILES, MotionSettings, Profile
from app.rig.arm import TOUCH_ERROR
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.imperfections import Flaws, Imperfections
from hardware.sim.plant.plant import Plant
from hardware.table import PieceSpec, TableSettings, square_place

PARAMETERS, TABLE = load_parameters(), TableSettings()
HOME = np.array(MotionSettings().home)
PLANNER = Planner.of(MotionSettings(), PARAMETERS, TABLE, HOME, 0.01)


def lowered(by: float) -> TableSettings:
    """The table as it really is."""
    x, y, z = TABLE.centre_in_base
    return TABLE.model_copy(update={"centre_in_base": (x, y, z + by)})


def bed_of(lower: float, pieces: tuple[StandingPiece, ...], profile: Profile, seed: int) -> Bed:
    """A robot far from what is believed, at a table that is lower than is believed [m]."""
    flaws = Flaws(Imperfections(torque_ripple=0.04, cogging=0.02, friction=0.6, encoder_noise=1.5e-6), seed)
    model = build_model(PARAMETERS, lowered(lower), pieces, HOME, looks=False)
    names = tuple(piece.spec.name for piece in pieces)
    return Bed(Plant(model, PARAMETERS, names, flaws=flaws), TABLE, PROFILES[profile])


@pytest.mark.parametrize("profile", [Profile.DEFAULT, Profile.FAST])
@pytest.mark.parametrize("seed", range(2))
def test_the_board_is_felt_where_it_is(profile: Profile, seed: int) -> None:
    rng = np.random.default_rng([seed, 0xFEE1])
    lower, near = float(rng.uniform(-0.003, 0.003)), (float(rng.uniform(-0.16, 0.16)), float(rng.uniform(-0.16, 0.16)))
    bed = bed_of(lower, (), profile, seed)
    feeling = plan_feeling(bed.planner(), near, (), ())
    (down,) = feeling.plan.motions
    ended = bed.execute(down.samples)
    assert ended.result is down.wanted
    assert ended.position[2] - feeling.expected == pytest.approx(lower, abs=0.0002)


@pytest.mark.parametrize(("kind", "lower"), [(Kind.BISHOP, 0.002), (Kind.KING, -0.0035)])
def test_what_lies_on_a_board_elsewhere_than_believed_stands_up(kind: Kind, lower: float) -> None:
    shape = PIECE_SHAPES[kind]
    spec = PieceSpec("piece", kind, Colour.WHITE, square_place(27))
    piece = StandingPiece(spec, 0.02, 0.02, 0.3, shape.foot_radius, tip=0.5 * math.pi)
    bed = bed_of(lower, (piece,), Profile.DEFAULT, 1)
    bed.wait(0.5)
    body = bed.plant.data.body("piece")
    axis = body.xmat.reshape(3, 3)[:, 2].copy()
    assert axis[2] < 0.1
    lying = Lying(kind, (float(body.xpos[0]), float(body.xpos[1])), math.atan2(axis[1], axis[0]))
    off = []
    for felt in (0.0, lower):
        down, *_ = plan_upright(bed.planner(), lying, (), (), lower=felt).plan.motions
        assert down.touches_at is not None
        ended = bed.execute(down.samples)
        off.append(ended.position[2] - down.touches_at)
        bed.execute_plan(bed.planner().home(held_up_at=np.array(ended.position)))
    assert abs(off[0]) > TOUCH_ERROR > abs(off[1])
    bed.execute_plan(plan_upright(bed.planner(), lying, (), (), lower=lower).plan)
    (pose,) = bed.plant.truth(reset_peak=False).pieces
    assert pose.tilt < math.radians(2.0)


@settings(max_examples=20)
@given(
    free=st.sets(st.sampled_from(list(chess.SQUARES)), max_size=5),
    near=st.tuples(st.floats(-0.16, 0.16), st.floats(-0.16, 0.16)),
    kind=st.sampled_from(list(Kind)),
    yaw=st.floats(-math.pi, math.pi),
)
def test_the_fingers_come_down_on_the_nearest_free_square(
    free: set[chess.Square], near: tuple[float, float], kind: Kind, yaw: float
) -> None:
    crowd = [
        Obstacle.at(chess.square_name(square), square_place(square), Kind.PAWN, TABLE)
        for square in chess.SQUARES if square not in free
    ]  # fmt: skip
    lying = Lying(kind, near, yaw)
    middles = {square: TABLE.xy(square_place(square)) for square in free}
    try:
        (down,) = plan_feeling(PLANNER, near, crowd, (lying,)).plan.motions
    except PlanRefused:  # what lies there takes all that was left
        assert all(_covered(lying, at) for at in middles.values())
        return
    x, y, _ = PLANNER.cell.board(down.samples["position"][-1].astype(float))
    over = min(middles, key=lambda square: math.dist(middles[square], (x, y)))
    assert math.dist(middles[over], (x, y)) < 1e-6
    nearer = [at for at in middles.values() if math.dist(at, near) < math.dist(middles[over], near) - 1e-9]
    assert all(_covered(lying, at) for at in nearer)


def _covered(lying: Lying, at: tuple[float, float]) -> bool:
    """Whether a piece comes so near to a point that the fingers might touch it there."""
    shape = PIECE_SHAPES[lying.kind]
    along = [lying.along(share * shape.height) for share in np.linspace(0.0, 1.0, 40)]
    return min(math.dist(point, at) for point in along) < shape.foot_radius + 0.02 + MARGIN
