"""Motor programs and plans of the hand, without physics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.sim.bodies.hand import HandPose, parked
from hardware.sim.hand.actions import REACH
from hardware.sim.hand.motion import PEAK, Program, Sketch
from hardware.sim.hand.paths import CAREFUL, ENOUGH_ARM_ROOM
from hardware.sim.hand.plan import Person, grip_height, held_now
from hardware.sim.hand.sight import SeenPiece, TableView
from hardware.table import Box, Place, TableSettings

TABLE = TableSettings()
HOME = np.array([0.0, -0.075, 0.145])
START = HandPose(0.10, -0.72, 0.10, 0.0, 0.0)
WHITE = Person(Colour.WHITE, 0.8)


def piece(
    name: str, x: float, y: float, kind: Kind = Kind.PAWN, axis: tuple[float, float, float] = (0, 0, 1)
) -> SeenPiece:
    return SeenPiece(name, kind, x, y, 0.0, axis)


def full_board(kind: Kind) -> tuple[SeenPiece, ...]:
    """One on each square."""
    return tuple(piece(str(i), *TABLE.xy(Place("board", i)), kind=kind) for i in range(64))


def winding() -> Program:
    sketch = Sketch(START, 0.8).to(z=0.2).to(x=0.0, y=0.1, yaw=0.4, overlap=0.3).to(gap=0.01, overlap=1.0)
    return sketch.to(z=0.03, overlap=0.2).wait(0.1).done()


def test_a_program_is_smooth_and_rests_at_both_ends() -> None:
    program, step = winding(), 1e-5
    for time in np.linspace(0.01, program.duration - 0.01, 60):
        before, here, after = (program.at(float(time) + d) for d in (-step, 0.0, step))
        np.testing.assert_allclose((after.position - before.position) / (2 * step), here.velocity, atol=1e-6)
        np.testing.assert_allclose((after.velocity - before.velocity) / (2 * step), here.acceleration, atol=1e-3)
    for time in (0.0, program.duration, program.duration + 5.0):
        assert not program.at(time).velocity.any()
        np.testing.assert_allclose(program.at(time).acceleration, 0.0, atol=1e-9)
    np.testing.assert_allclose(program.at(0.0).position, START)
    np.testing.assert_allclose(program.at(program.duration).position, program.end)
    np.testing.assert_allclose(program.end, (0.0, 0.1, 0.03, 0.4, 0.01), atol=1e-12)


def test_a_stroke_has_the_speed_that_is_asked() -> None:
    program = Sketch(START, 0.8).to(y=0.1).done()
    speeds = [float(np.linalg.norm(program.at(t).velocity)) for t in np.linspace(0.0, program.duration, 500)]
    assert max(speeds) == pytest.approx(0.8, rel=1e-4)
    assert program.duration == pytest.approx(PEAK * 0.82 / 0.8)


def test_a_program_that_is_cut_finishes_what_it_began_without_a_jump() -> None:
    program = winding()
    for time in np.linspace(0.0, program.duration, 25):
        cut = program.cut(float(time))
        for before in (0.5 * time, time):
            now, then = program.at(float(before)), cut.at(float(before))
            np.testing.assert_allclose(now.position, then.position)
            np.testing.assert_allclose(now.velocity, then.velocity)
        assert cut.duration <= program.duration
        assert not cut.at(cut.duration).velocity.any()


@pytest.mark.parametrize("kind", list(Kind))
def test_fingertips_are_above_the_foot_and_below_the_top(kind: Kind) -> None:
    shape = PIECE_SHAPES[kind]
    z = grip_height(shape)
    assert z - 0.006 > shape.foot_height
    assert z + 0.008 < shape.height - shape.stem_radius


@pytest.mark.parametrize("side", list(Colour))
@pytest.mark.parametrize("kind", [Kind.PAWN, Kind.KING])
def test_on_a_full_board_every_piece_can_be_held_between_its_neighbours(side: Colour, kind: Kind) -> None:
    person, everything = Person(side, 0.8), TableView(full_board(kind), np.array([0.0, 0.0, 1.0]))
    radius, z = PIECE_SHAPES[kind].stem_radius, grip_height(PIECE_SHAPES[kind])
    for one in everything.pieces:
        others = everything.without(one.name)
        hold = person.holds(others, one.x, one.y, z, 0.1, radius)[0]
        assert others.pinch_room(one.x, one.y, hold.yaw, z, hold.gap + 0.006) > 0.002
        assert hold.gap >= radius + 0.003
        base = 0.0 if side is Colour.WHITE else math.pi
        assert abs(hold.yaw - base) < math.radians(80.0)


@pytest.mark.parametrize("side", list(Colour))
def test_every_square_and_tray_is_reached_clear_of_the_arm_at_home(side: Colour) -> None:
    person, sight = Person(side, 0.8), TableView((), HOME)
    places = [*(Place("board", i) for i in range(64)), *TABLE.tray_places()]
    start = START if side is Colour.WHITE else HandPose(-0.1, 0.72, 0.1, math.pi, 0.0)
    for place in places[::3]:
        x, y = TABLE.xy(place)
        program, _ = person.reach(TableView((piece("pawn", x, y),), HOME), start, piece("pawn", x, y))
        poses = [HandPose(*program.at(float(t)).position.tolist()) for t in np.arange(0.0, program.duration, 0.02)]
        assert sight.arm_room(*poses) > 0.0, place
        assert max(abs(x), abs(y)) < REACH


def test_a_hand_creeps_past_the_arm_and_nowhere_else() -> None:
    """Home from between pawns, beside and below the tool."""
    sight, creeping = TableView(full_board(Kind.PAWN)[8:16], HOME), 0
    for name in ("b2", "b3", "b4", "c2", "c3", "d2", "d3", "e2", "e3", "f3", "g4"):
        x, y = TABLE.xy(Place.parse(name))
        start = HandPose(x, y, 0.05, WHITE.natural_yaw(x, y), 0.008)
        program = WHITE.home(sight, start, parked(Colour.WHITE))
        for time in np.arange(0.0, program.duration, 0.01).tolist():
            position, velocity, _ = program.at(time)
            if sight.arm_room(HandPose(*position)) < ENOUGH_ARM_ROOM / 2.0:
                assert np.linalg.norm(velocity[:3]) < 1.1 * CAREFUL, name
                creeping += 1
        assert program.duration < 3.0, name
    assert creeping > 50


def test_a_piece_is_carried_above_what_is_in_its_way_and_no_higher() -> None:
    held = held_now(piece("pawn", 0.0, 0.0), HandPose(0.0, 0.0, 0.014, 0.0, 0.002))
    start = HandPose(0.0, 0.0, 0.03, 0.0, 0.002)

    def highest(*others: SeenPiece, boxes: tuple[Box, ...] = ()) -> float:
        sight = TableView((*others, piece("pawn", 0.0, 0.0)), np.array([0.0, 0.0, 1.0]), boxes)
        program = WHITE.place(sight, start, held, 0.0, 0.12, 0.0)
        return max(float(program.at(t).position[2]) for t in np.arange(0.0, program.duration, 0.01)) - held.below

    assert highest() < 0.02
    assert highest(piece("aside", 0.06, 0.06, Kind.KING)) < 0.02
    assert 0.068 < highest(piece("king", 0.0, 0.06, Kind.KING)) < 0.08
    assert 0.042 < highest(piece("other", 0.004, 0.06)) < 0.052
    assert 0.04 < highest(boxes=(Box("BL", 0.05, 0.06, 0.03, 0.03, 0.04, 0.004),)) < 0.055
    assert highest(boxes=(Box("BL", 0.12, 0.06, 0.03, 0.03, 0.04, 0.004),)) < 0.02


def test_a_hand_in_the_robots_tool_is_seen_to_be() -> None:
    sight = TableView((), HOME)
    assert sight.arm_room(HandPose(0.0, -0.075, 0.12, 0.0, 0.01)) < 0.0
    assert sight.arm_room(HandPose(0.0, -0.075, 0.02, 1.2, 0.01)) > 0.0
    assert sight.arm_room(START) > 0.05
    near, nearer = (sight.arm_room(HandPose(0.0, y, 0.145, math.pi, 0.01)) for y in (0.0, -0.01))
    assert 0.002 < near - nearer <= 0.010


def test_a_fallen_piece_is_met_anywhere_along_it() -> None:
    fallen = piece("king", 0.0, 0.0, Kind.KING, axis=(1.0, 0.0, 0.0))
    assert not fallen.standing
    assert fallen.distance(0.05, 0.003) == pytest.approx(0.003)
    assert fallen.distance(-0.01, 0.0) == pytest.approx(0.01)
    assert fallen.top < 0.03
