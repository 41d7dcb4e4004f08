"""Pushing a piece aside: which push is chosen, what it keeps clear of, and what it does in the world."""

from __future__ import annotations

import math
from dataclasses import replace

import chess
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from app.execution.recovery_plans import Blocked, plan_pushing, plan_stirring
from app.measure.bench.beds.bed import Bed
from app.motion import MotionSettings, Planner
from app.motion.arcs import Workcell
from app.motion.fallen.lying import LoosePieces, Lying, crowd_of
from app.motion.fallen.pivot_edge import reach
from app.motion.fallen.push import Nudge, find_nudge, nudge_of, plan_nudge
from app.motion.fallen.stand_up import room_to_stand_up
from app.motion.finger_opening import fits_around
from app.motion.obstacles import Obstacle
from app.motion.plan import PlanRefused
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.plant import Plant
from hardware.table import Captured, PieceSpec, Place, TableSettings, square_place
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.poses import Pose

PARAMETERS, TABLE, SETTINGS = load_parameters(), TableSettings(), MotionSettings()
CELL = Workcell.of(SETTINGS, PARAMETERS, TABLE)
HOME = np.array(SETTINGS.home)


def pawn(name: str, x: float, y: float) -> Obstacle:
    return Obstacle(name, square_place(27), x, y, Kind.PAWN)


def found(scene: LoosePieces, *names: str, kept: frozenset[str] = frozenset()) -> Nudge | None:
    """The push after which the first of these pieces can be taken."""
    return find_nudge(names, scene, kept, lambda after: takeable(names[0], after), PARAMETERS.pads, TABLE)


def takeable(name: str, scene: LoosePieces) -> bool:
    piece = next(one for one in scene.standing if one.name == name)
    return fits_around(piece, crowd_of(scene, TABLE, without=name), CELL)


def after(scene: LoosePieces, nudge: Nudge) -> LoosePieces:
    dx, dy = nudge.way * math.cos(nudge.direction), nudge.way * math.sin(nudge.direction)
    return LoosePieces(
        tuple(one._replace(x=one.x + dx, y=one.y + dy) if one.name == nudge.name else one for one in scene.standing),
        tuple(
            replace(one, base=(one.base[0] + dx, one.base[1] + dy)) if one.name == nudge.name else one
            for one in scene.lying
        ),
    )


def test_of_two_pieces_side_by_side_one_is_pushed_away_and_then_can_be_taken() -> None:
    scene = LoosePieces((pawn("one", 0.0, 0.0), pawn("other", 0.0205, 0.0)))
    assert not takeable("one", scene)
    nudge = found(scene, "one", "other")
    assert nudge is not None
    assert takeable("one", after(scene, nudge))


def test_rather_one_that_is_out_of_place_anyway_is_pushed() -> None:
    scene = LoosePieces((pawn("one", 0.0, 0.0), pawn("other", 0.0205, 0.0)))
    for kept, pushed in (("one", "other"), ("other", "one")):
        nudge = found(scene, "one", "other", kept=frozenset({kept}))
        assert nudge is not None
        assert nudge.name == pushed


@pytest.mark.parametrize("outwards", [True, False])
def test_a_push_beside_a_box_goes_neither_into_its_wall_nor_begins_there(outwards: bool) -> None:
    table = TableSettings(captured=Captured.BOX)
    place = Place("R", 5)
    x, y = table.xy(place)
    scene = LoosePieces((Obstacle("queen", place, x, y, Kind.QUEEN),))
    wall = min(abs(box.x) - box.half_x - box.wall for box in table.boxes())
    for least in (0.006, 0.012, 0.020, 0.030):

        def helps(after: LoosePieces, least: float = least) -> bool:
            return (after.standing[0].x - x) * (1.0 if outwards else -1.0) >= least

        nudge = find_nudge(("queen",), scene, frozenset(), helps, PARAMETERS.pads, table)
        if nudge is None:
            continue
        end = x + nudge.way * math.cos(nudge.direction)
        unit = np.array([math.cos(nudge.direction), math.sin(nudge.direction)])
        ahead = reach(PARAMETERS.pads, np.array([1.0, 0.0]))
        assert end + PIECE_SHAPES[Kind.QUEEN].foot_radius < wall
        assert max(nudge.begin[0], nudge.end[0]) + ahead < wall, f"the fingers touch the box on a way along {unit}"


@settings(max_examples=60)
@given(
    x=st.floats(0.0201, 0.0215), angle=st.floats(-math.pi, math.pi),
    crowd=st.lists(st.tuples(st.floats(-0.08, 0.08), st.floats(-0.08, 0.08)), max_size=6),
)  # fmt: skip
def test_neither_fingers_nor_the_piece_touch_any_other(
    x: float, angle: float, crowd: list[tuple[float, float]]
) -> None:
    pieces = [pawn("one", 0.0, 0.0), pawn("other", x * math.cos(angle), x * math.sin(angle))]
    pieces += [pawn(f"crowd {number}", *at) for number, at in enumerate(crowd)]
    radius = PIECE_SHAPES[Kind.PAWN].foot_radius
    places = [(one.x, one.y) for one in pieces]
    assume(all(math.dist(a, b) > 2.0 * radius for i, a in enumerate(places) for b in places[:i]))
    scene = LoosePieces(tuple(pieces))
    nudge = found(scene, "one", "other")
    assume(nudge is not None)
    assert nudge is not None
    unit = np.array([math.cos(nudge.direction), math.sin(nudge.direction)])
    ahead, wide = reach(PARAMETERS.pads, unit), reach(PARAMETERS.pads, np.array([-unit[1], unit[0]]))
    pushed = next(one for one in pieces if one.name == nudge.name)
    shape = PIECE_SHAPES[Kind.PAWN]
    thick = shape.foot_radius if nudge.tips < shape.foot_height else shape.stem_radius
    touching = math.dist(nudge.begin, nudge.end) - nudge.way
    for share in np.linspace(0.0, 1.0, 12).tolist():
        tool = np.array(nudge.begin) + share * (np.array(nudge.end) - nudge.begin)
        moved = np.array([pushed.x, pushed.y]) + max(0.0, share * (touching + nudge.way) - touching) * unit
        for one in pieces:
            if one.name == nudge.name:
                continue
            off = np.array([one.x, one.y]) - tool
            box = np.maximum(np.abs([off @ unit, off @ [-unit[1], unit[0]]]) - [ahead, wide], 0.0)
            assert np.hypot(*box) > thick, "the fingers touch another piece"
            before = math.dist((one.x, one.y), (pushed.x, pushed.y))
            assert math.dist((one.x, one.y), moved) > min(2.0 * radius + 0.0015, before - 0.001), "a foot another"


def test_a_piece_that_lies_between_others_is_stood_up_after_a_push() -> None:
    """A bishop beside a pawn that hems it in, neither of which the fingers get around."""
    board = chess.Board()
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    bishop = inventory.at(Place.parse("c1"))
    assert bishop is not None
    misplaced = [MisplacedPiece(bishop, bishop.place, Pose(-0.0739, -0.1167, 3.133))]
    blocked = [Blocked(bishop.name, "white-pawn-c")]
    nudge, plan = plan_pushing(
        Planner.of(SETTINGS, PARAMETERS, inventory.table, HOME, 0.01), blocked, misplaced, inventory
    )
    assert nudge.name in {bishop.name, "white-pawn-c"}
    assert len(plan.motions) == 3
    assert plan.motions[-1].samples["position"][-1] == pytest.approx(HOME)


def test_where_no_push_helps_it_says_which_pieces_to_move() -> None:
    """In a corner of the table, between the board's edge and a wall of pieces that touch each other."""
    inventory = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
    names = ["white-pawn-a", "white-pawn-b", "white-pawn-c", "white-pawn-d", "white-pawn-e", "white-pawn-f"]
    row = [inventory.find(name) for name in names] + [inventory.find(f"black-pawn-{file}") for file in "abcdef"]
    x, y = TABLE.xy(Place.parse("d5"))
    misplaced = [
        MisplacedPiece(piece, piece.place, Pose(x + 0.0203 * (i % 4 - 1.5), y + 0.0203 * (i // 4 - 1)))
        for i, piece in enumerate(row)
    ]
    middle, beside = row[5], row[6]
    with pytest.raises(PlanRefused, match=f"^no push of the {middle.name} or the {beside.name} helps: move one of"):
        plan_pushing(
            Planner.of(SETTINGS, PARAMETERS, inventory.table, HOME, 0.01),
            [Blocked(middle.name, beside.name)],
            misplaced,
            inventory,
        )


def test_what_leans_somewhere_is_pushed_right_through_by_the_way_that_is_free() -> None:
    """A bishop that leans over c1 and c2 can be pushed where those two are taken off; in a ring of pawns it cannot."""
    inventory = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
    planner = Planner.of(SETTINGS, PARAMETERS, inventory.table, HOME, 0.01)
    x, y = TABLE.xy(Place.parse("c1"))
    spot = x, y + 0.01
    plan = plan_stirring(planner, spot, {"white-bishop-c", "white-pawn-c"}, [], inventory)
    way = np.array([TABLE.board_from_base(point)[:2] for point in plan.motions[1].samples["position"]])
    assert np.hypot(*(way - spot).T).min() < 0.016, "the fingers go to it"
    assert np.hypot(*(way[-1] - way[0])) > 0.02
    others = [piece for piece in inventory if piece.name not in ("white-bishop-c", "white-pawn-c")]
    for piece in others:
        away = np.hypot(*(way - TABLE.xy(piece.place)).T).min()
        assert away > PIECE_SHAPES[piece.kind].stem_radius + PARAMETERS.pads.half_width, "and touch nothing else"
    ring = [
        MisplacedPiece(piece, piece.place, Pose(0.029 * math.cos(i * math.pi / 4), 0.029 * math.sin(i * math.pi / 4)))
        for i, piece in enumerate(piece for piece in inventory if piece.name.startswith("black-pawn"))
    ]
    with pytest.raises(PlanRefused, match="cannot reach what leans there"):
        plan_stirring(planner, (0.0, 0.0), set(), ring, inventory)


def test_a_place_that_is_kept_for_a_piece_counts_where_it_is() -> None:
    """What blocks is the place where it shall be set down, wherever it stands now."""
    inventory = Inventory.of(start_layout(chess.Board("4k3/8/8/8/8/8/P6P/4K3 w - - 0 1"), TABLE), TABLE)
    a2, h2 = (inventory.at(Place.parse(square)) for square in ("a2", "h2"))
    assert a2 is not None
    assert h2 is not None
    goal = Obstacle.at(h2.name, Place.parse("d4"), h2.kind, TABLE)
    misplaced = [MisplacedPiece(a2, a2.place, Pose(goal.x + 0.0205, goal.y))]
    nudge, _ = plan_pushing(
        Planner.of(SETTINGS, PARAMETERS, inventory.table, HOME, 0.01),
        [Blocked(h2.name, a2.name, goal)],
        misplaced,
        inventory,
    )
    assert nudge.name == a2.name
    assert math.cos(nudge.direction) > 0.3, "away from where the other one goes"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "tip", "direction", "tips"),
    [
        (Kind.PAWN, 0.0, 0.0, 0.004), (Kind.PAWN, 0.0, 0.5 * math.pi, 0.014), (Kind.KING, 0.0, math.pi, 0.009),
        (Kind.PAWN, 0.5 * math.pi, 0.0, 0.004), (Kind.QUEEN, 0.5 * math.pi, -0.5 * math.pi, 0.004),
    ],
)  # fmt: skip
def test_in_the_world_a_pushed_piece_goes_as_far_as_it_is_pushed_and_does_not_fall(
    kind: Kind, tip: float, direction: float, tips: float
) -> None:
    """Standing or lying, at the foot or higher; pushed through its centre of mass, it turns little."""
    went, tilted = pushed_in_the_world(kind, 0.4, tip, direction, 0.018, tips)
    assert tilted < 0.1, "it stands as it stood, lies as it lay"
    assert went == pytest.approx(0.018, abs=0.005)


@pytest.mark.slow
def test_in_the_world_the_shortest_push_moves_what_lies_wherever_its_head_points() -> None:
    """Fingers that meet a head with a corner meet it later; what is pushed askew turns, too, and goes less far."""
    rng = np.random.default_rng(145)
    kinds, ways = rng.choice(list(Kind), 12), list[float]()
    for kind in kinds:
        direction = 0.125 * math.pi * float(rng.integers(16))
        went, _ = pushed_in_the_world(kind, rng.uniform(-math.pi, math.pi), 0.5 * math.pi, direction, 0.006, 0.004)
        ways.append(went)
    print("pushed by 6 mm:", ", ".join(f"{kind} {1e3 * way:.1f}" for kind, way in zip(kinds, ways, strict=True)))
    assert min(ways) > 0.0015
    assert np.median(ways) > 0.004


def pushed_in_the_world(
    kind: Kind, yaw: float, tip: float, direction: float, way: float, tips: float
) -> tuple[float, float]:
    """How far a piece's centre of mass went along a push [m], and by how much it is tilted otherwise."""
    shape = PIECE_SHAPES[kind]
    piece = StandingPiece(
        PieceSpec("piece", kind, Colour.WHITE, square_place(27)), 0.02, 0.02, yaw, shape.foot_radius if tip else 0.0,
        tip=tip,
    )  # fmt: skip
    model = build_model(PARAMETERS, TABLE, (piece,), HOME, looks=False)
    bed = Bed(Plant(model, PARAMETERS, ("piece",)), TABLE, SETTINGS)
    for _ in range(600):
        bed.tick()
    body = bed.plant.data.body("piece")
    x, y, _ = body.xpos.tolist()
    axis = body.xmat.reshape(3, 3)[:, 2].copy()
    begin = body.xipos[:2].copy()
    scene = LoosePieces((), (Lying(kind, (x, y), math.atan2(axis[1], axis[0]), "piece"),))
    if not tip:
        scene = LoosePieces((Obstacle("piece", square_place(27), x, y, kind),))
    plan = plan_nudge(bed.planner(), nudge_of(scene, "piece", direction, way, tips, PARAMETERS.pads), scene)
    bed.execute_plan(plan)
    went = (body.xipos[:2] - begin) @ np.array([math.cos(direction), math.sin(direction)])
    return float(went), abs(float(body.xmat.reshape(3, 3)[2, 2] - axis[2]))


def test_a_push_that_was_not_enough_is_followed_by_a_longer_one() -> None:
    inventory = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
    planner = Planner.of(SETTINGS, PARAMETERS, inventory.table, HOME, 0.01)
    bishop = inventory.find("white-bishop-c")
    misplaced = [MisplacedPiece(bishop, bishop.place, Pose(-0.0739, -0.1167, 3.133))]
    ways = [
        plan_pushing(planner, [Blocked(bishop.name, "white-pawn-c", pushed=pushed)], misplaced, inventory)[0].way
        for pushed in range(3)
    ]
    assert ways[0] < ways[1] < ways[2]


def test_room_to_stand_up_is_what_the_planner_asks_for() -> None:
    lying = Lying(Kind.BISHOP, (-0.0739, -0.1167), 3.133, "bishop")
    near = pawn("near", -0.06, -0.1)
    assert room_to_stand_up(lying, crowd_of(LoosePieces((), (lying,)), TABLE, without="bishop"), CELL)
    assert not room_to_stand_up(lying, crowd_of(LoosePieces((near,), (lying,)), TABLE, without="bishop"), CELL)
