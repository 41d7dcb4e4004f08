"""Standing up what has fallen: plans keep clear of what stands, and in the world the piece stands in the end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.measure.bench.beds.bed import Bed
from app.motion import MotionSettings, Planner
from app.motion.fallen.lying import Lying, Strip
from app.motion.fallen.pivot_edge import PivotSettings, circle, pivot_of, reach
from app.motion.fallen.stand_up import StandUpPlan, plan_upright
from app.motion.obstacles import Obstacle
from app.motion.plan import Continuation, InTheWay, Motion
from app.motion.timing.reference import eased
from controller.protection.limits import default_limits
from controller.protocol import SAMPLE
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.plant import Plant
from hardware.table import PieceSpec, TableSettings, square_place

PARAMETERS, TABLE, SETTINGS = load_parameters(), TableSettings(), MotionSettings()
TICK = PARAMETERS.drive.tick
HOME = np.array(SETTINGS.home)
HOW = PivotSettings()
kinds = st.sampled_from(list(Kind))
angles = st.floats(-math.pi, math.pi)


def planned(lying: Lying, *standing: Obstacle, others: tuple[Lying, ...] = ()) -> StandUpPlan:
    return plan_upright(Planner.of(SETTINGS, PARAMETERS, TABLE, HOME, 0.01), lying, standing, others)


@given(kind=kinds)
def test_the_way_round_the_rim_is_smooth_and_lowers_no_tip_onto_the_board(kind: Kind) -> None:
    pivot, stiffness = pivot_of(PIECE_SHAPES[kind], HOW), 1000.0
    way = circle(pivot, HOW, stiffness, 1000, TICK)
    for axis in range(2):
        position, velocity, change = way[:, axis].T
        assert np.diff(position) / TICK == pytest.approx(0.5 * (velocity[1:] + velocity[:-1]), abs=1e-4)
        assert np.diff(velocity) / TICK == pytest.approx(0.5 * (change[1:] + change[:-1]), abs=1e-2)
    assert way[:, 1, 0].min() >= HOW.lowest - 1e-9
    assert way[-1, :, 1] == pytest.approx([0.0, 0.0], abs=1e-9)
    # less what presses, the way keeps its distance from the rim
    first = math.hypot(pivot.contact[0] - pivot.rim, pivot.contact[1])
    assert np.hypot(way[:, 0, 0] - pivot.rim, way[:, 1, 0] + HOW.press / stiffness) == pytest.approx(first, abs=0.012)


def test_a_quintic_goes_from_rest_to_rest() -> None:
    share = eased(500, TICK)
    assert share[-1] == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert (np.diff(share[:, 0]) > 0.0).all()
    assert share[:, 1].sum() * TICK == pytest.approx(1.0, abs=1e-3)


@given(angle=angles)
def test_the_closed_fingers_reach_no_further_than_they_are_wide(angle: float) -> None:
    across = reach(PARAMETERS.pads, np.array([math.cos(angle), math.sin(angle)]))
    assert 0.007 <= across <= math.hypot(0.010, 0.010)


@settings(max_examples=6)
@given(kind=kinds, yaw=angles, x=st.floats(-0.1, 0.1), y=st.floats(-0.1, 0.1))
def test_plans_keep_the_controllers_limits_and_end_at_home(kind: Kind, yaw: float, x: float, y: float) -> None:
    lying = Lying(kind, (x, y), yaw)
    plan, stands = planned(lying)
    limits, at = default_limits(PARAMETERS, TABLE), HOME
    for motion in plan.motions:
        samples = motion.samples
        assert (np.abs(samples["position"] - limits.centre).max(axis=0) <= limits.half_size).all()
        step = np.diff(samples["position"], axis=0) - 0.5 * TICK * (samples["velocity"][1:] + samples["velocity"][:-1])
        assert np.abs(step).max() < limits.position_step
        assert np.abs(np.diff(samples["velocity"], axis=0)).max() < limits.velocity_step
        if not motion.touches:
            assert samples["position"][0] == pytest.approx(at, abs=0.02)
        at = samples["position"][-1]
    assert plan.motions[0].touches
    assert at == pytest.approx(HOME, abs=1e-6)
    assert math.dist(stands, lying.base) < PIECE_SHAPES[kind].foot_radius
    assert np.dot(np.subtract(stands, lying.base), lying.outwards) > 0.0


@pytest.mark.parametrize(("along", "free"), [(0.020, False), (0.045, False), (0.09, True), (-0.09, True)])
def test_what_stands_where_the_fingers_go_is_named(along: float, free: bool) -> None:
    lying = Lying(Kind.KING, (0.01, 0.02), 0.7, "white-king")
    x, y = (np.array(lying.base) + along * lying.outwards).tolist()
    rook = Obstacle("black-rook", square_place(36), x, y, Kind.ROOK)
    if free:
        planned(lying, rook)
        return
    with pytest.raises(InTheWay, match="white-king cannot be stood up: the rook") as caught:
        planned(lying, rook)
    assert caught.value.piece == rook


def test_what_lies_where_the_fingers_go_is_in_the_way_too() -> None:
    lying = Lying(Kind.PAWN, (0.0, 0.0), math.pi / 2)
    with pytest.raises(InTheWay):
        planned(lying, others=(Lying(Kind.QUEEN, (0.03, -0.035), math.pi),))


def test_a_strip_tells_how_far_points_are_from_it() -> None:
    strip = Strip((0.0, 0.0), np.array([0.0, 1.0]), 2.0, 0.5)
    assert [strip.distance(*at) for at in ((0.2, 1.0), (1.5, 1.0), (0.0, 3.0), (-1.5, -1.0))] == pytest.approx(
        [0.0, 1.0, 1.0, math.sqrt(2.0)]
    )


def test_samples_without_a_route_follow_a_touch_up_and_down_but_nowhere_else() -> None:
    samples = np.zeros(3, dtype=SAMPLE)
    samples["position"][:] = (0.1, 0.2, 0.4)
    motion = Motion("press", samples, 0.1, continuation=Continuation(SETTINGS, TABLE, TICK))
    moved = motion.continued(np.array([0.1, 0.2, 0.405]))
    assert moved.samples["position"] == pytest.approx(np.full((3, 3), (0.1, 0.2, 0.405)))
    assert motion.continued(np.array([0.11, 0.2, 0.4])) is motion
    assert motion.continued(np.array([0.1, 0.2, 0.45])) is motion
    assert replace(motion, continuation=None).continued(np.array([0.1, 0.2, 0.405])).samples is samples


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "yaw", "along"), [
    (Kind.PAWN, 0.3, 0.0), (Kind.KNIGHT, -1.2, 0.002), (Kind.BISHOP, 2.9, -0.002), (Kind.ROOK, 1.6, 0.0),
    (Kind.QUEEN, -2.4, 0.002), (Kind.KING, 0.0, -0.002),
])  # fmt: skip
def test_in_the_world_a_lying_piece_stands_up(kind: Kind, yaw: float, along: float) -> None:
    """Also where it is believed to lie 2 mm further along than it does."""
    shape = PIECE_SHAPES[kind]
    piece = StandingPiece(
        PieceSpec("piece", kind, Colour.WHITE, square_place(27)), 0.02, 0.02, yaw + 0.5 * math.pi, shape.foot_radius,
        tip=0.5 * math.pi,
    )  # fmt: skip
    model = build_model(PARAMETERS, TABLE, (piece,), HOME, looks=False)
    bed = Bed(Plant(model, PARAMETERS, ("piece",)), TABLE, SETTINGS)
    for _ in range(600):
        bed.tick()
    body = bed.plant.data.body("piece")
    axis = body.xmat.reshape(3, 3)[:, 2].copy()
    assert axis[2] < 0.1  # it lies
    lying = Lying(kind, (float(body.xpos[0]), float(body.xpos[1])), math.atan2(axis[1], axis[0]))
    x, y = (np.array(lying.base) + along * lying.outwards).tolist()
    plan, stands = plan_upright(bed.planner(), Lying(kind, (x, y), lying.yaw), (), ())
    bed.execute_plan(plan)
    (pose,) = bed.plant.truth(reset_peak=False).pieces
    print(f"{kind}: {math.degrees(pose.tilt):.1f}°, {1e3 * math.dist((pose.x, pose.y), stands):.1f} mm off")
    assert pose.tilt < math.radians(2.0)
    assert math.dist((pose.x, pose.y), stands) < 0.006
