"""Pieces that lie, or stand elsewhere, in rendered pictures: which, where, and how well that is known."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import chess
import numpy as np
import pytest

from app.pieces.layout import start_layout
from hardware.interfaces import Frame
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.sim.process.table_studio import PlacedPiece as Put
from hardware.sim.process.table_studio import TableStudio
from hardware.sim.render.settings import SceneState
from hardware.table import PieceSpec, Place, TableSettings, square_place
from tests.vision.rendering import studio_of
from vision.board.view import BoardView
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.misplaced import find_misplaced
from vision.pieces.poses import Pose, _profile, drawn, off_surface

TABLE = TableSettings()
LINE = "e4 e5 Nf3 Nc6 Bc4 Bc5 d3 Nf6 Nc3 d6 Bg5 h6"


@pytest.fixture(scope="module")
def studio() -> Iterator[TableStudio]:
    with studio_of(start_layout(chess.Board(), TABLE)) as made:
        yield made


def laid(name: str, kind: Kind, x: float, y: float, yaw: float) -> Put:
    """As a piece comes to rest in the world: on the rim of its foot and on its head."""
    shape = PIECE_SHAPES[kind]
    radius = 0.85 * shape.foot_radius
    lean = math.atan2(radius - shape.stem_radius, shape.height - shape.stem_radius - shape.foot_height)
    height = radius * math.cos(lean) + shape.foot_height * math.sin(lean)
    return Put(name, x, y, height, yaw + 0.5 * math.pi, 0.5 * math.pi + lean)


def look(
    studio: TableStudio, square: str, pose: Pose, *, use_depth: bool = True, seed: int = 1
) -> tuple[PieceSpec, tuple[MisplacedPiece, ...]]:
    """A position in which one piece does not stand on its square, but in a pose."""
    board = chess.Board()
    for san in LINE.split():
        board.push_san(san)
    rng = np.random.default_rng(seed)
    specs = start_layout(board, TABLE)
    poses = dict[str, Put]()
    for spec in specs:
        x, y = (np.array(TABLE.xy(spec.place)) + rng.uniform(-0.001, 0.001, 2)).tolist()
        poses[spec.name] = Put(spec.name, x, y, yaw=float(rng.uniform(-3.0, 3.0)))
    expected = {spec.place: spec for spec in specs if spec.place.on_board}
    one = expected[Place.parse(square)]
    if pose.yaw is None:
        poses[one.name] = Put(one.name, pose.x, pose.y)
    else:
        poses[one.name] = laid(one.name, one.kind, pose.x, pose.y, pose.yaw)
    frame = studio.frame(poses.values(), SceneState(), seed)
    view = BoardView(frame.intrinsics, studio.camera_from_board(SceneState().mount), TABLE)
    return one, find_misplaced(frame, view, expected, use_depth=use_depth)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("square", "x", "y", "yaw"),
    [("e4", 0.022, -0.030, 2.0), ("c5", -0.052, 0.021, -2.6), ("a2", -0.150, -0.098, 0.6)],
)
def test_a_fallen_piece_is_found(studio: TableStudio, square: str, x: float, y: float, yaw: float) -> None:
    one, misplaced = look(studio, square, Pose(x, y, yaw))
    (stray,) = misplaced
    assert stray.piece == one
    assert stray.target == Place.parse(square)
    assert stray.lies
    assert stray.pose.yaw is not None
    off = math.dist((stray.pose.x, stray.pose.y), (x, y))
    turned = abs((stray.pose.yaw - yaw + math.pi) % (2.0 * math.pi) - math.pi)
    print(f"{one.kind}: {1e3 * off:.1f} mm, {math.degrees(turned):.1f}°, said {1e3 * stray.std:.1f} mm")
    assert off < 0.005
    assert turned < math.radians(12.0)
    assert off < 3.0 * math.sqrt(2.0) * stray.std
    assert stray.lead > 0.1


@pytest.mark.slow
def test_a_piece_that_stands_between_squares_is_found_standing(studio: TableStudio) -> None:
    x, y = 0.003, 0.042
    one, misplaced = look(studio, "e5", Pose(x, y))
    (stray,) = misplaced
    assert stray.piece == one
    assert not stray.lies
    assert math.dist((stray.pose.x, stray.pose.y), (x, y)) < 0.0045


@pytest.mark.slow
def test_where_all_stands_there_are_no_strays(studio: TableStudio) -> None:
    x, y = TABLE.xy(square_place(chess.E4))
    _, misplaced = look(studio, "e4", Pose(x, y))
    assert misplaced == ()


@pytest.mark.slow
def test_by_colour_alone_a_fallen_piece_is_found_too(studio: TableStudio) -> None:
    one, misplaced = look(studio, "c5", Pose(-0.052, 0.021, -2.6), use_depth=False)
    found = [stray for stray in misplaced if stray.piece == one]
    assert len(found) == 1
    assert found[0].lies
    assert math.dist((found[0].pose.x, found[0].pose.y), (-0.052, 0.021)) < 0.008


def test_silhouettes_are_where_the_piece_is(studio: TableStudio) -> None:
    """The drawing of a lying piece holds the picture of its axis, and grows with its kind."""
    frame = studio.frame([], SceneState(), 1)
    view = BoardView(frame.intrinsics, studio.camera_from_board(SceneState().mount), TABLE)
    areas = []
    for kind in (Kind.PAWN, Kind.ROOK, Kind.KING):
        shape, pose = PIECE_SHAPES[kind], Pose(0.01, 0.02, 0.5)
        seen = drawn(kind, pose, view, (frame.intrinsics.height, frame.intrinsics.width), (0, 0))
        along = np.linspace(0.1, 0.9, 5) * shape.height
        axis = np.stack([0.01 + along * math.cos(0.5), 0.02 + along * math.sin(0.5), np.full(5, shape.stem_radius)], 1)
        for u, v in np.rint(view.project(axis)).astype(int).tolist():
            assert seen.mask[v - seen.rows.start, u - seen.columns.start]
        assert not (seen.underside & ~seen.mask).any()
        areas.append(int(seen.mask.sum()))
    assert areas == sorted(areas)
    turned = replace(Pose(0.01, 0.02, 0.5), yaw=-0.5 * math.pi)
    assert drawn(Kind.KING, turned, view, (480, 640), (0, 0)).underside.any()  # its foot towards the camera


def scene(studio: TableStudio, fen: str, elsewhere: dict[str, Pose], seed: int = 1) -> tuple[MisplacedPiece, ...]:
    """What is found, also in trays, of a position in which some pieces are elsewhere; by the square of each."""
    specs = start_layout(chess.Board(fen), TABLE)
    poses = []
    for spec in specs:
        pose = elsewhere.get(str(spec.place), Pose(*TABLE.xy(spec.place)))
        if pose.yaw is None:
            poses.append(Put(spec.name, pose.x, pose.y))
        else:
            poses.append(laid(spec.name, spec.kind, pose.x, pose.y, pose.yaw))
    frame = studio.frame(poses, SceneState(), seed)
    view = BoardView(frame.intrinsics, studio.camera_from_board(SceneState().mount), TABLE)
    return find_misplaced(frame, view, {spec.place: spec for spec in specs}, trays=True)


def near(stray: MisplacedPiece, pose: Pose) -> bool:
    turned = 0.0 if stray.pose.yaw is None else math.remainder(stray.pose.yaw - (pose.yaw or 0.0), 2.0 * math.pi)
    same = (stray.pose.yaw is None) == (pose.yaw is None)
    return same and math.dist((stray.pose.x, stray.pose.y), (pose.x, pose.y)) < 0.005 and abs(turned) < 0.25


FEN = "r1bqk2r/ppp2pp1/2np1n1p/2b1p1B1/2B1P3/2NP1N2/PPP2PPP/R2QK2R w KQkq - 0 1"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("square", "pose"),
    [
        ("c5", Pose(0.192, 0.022)),  # in a tray, a little beside a place of it
        ("g5", Pose(-0.196, 0.055, 1.2)),  # fallen in the other one
        ("d6", Pose(-0.066, 0.192)),  # behind the last rank, before other pieces
        ("h6", Pose(0.13, 0.182, 5.9)),
        ("c4", Pose(0.02, -0.175, -0.3)),  # before the first rank, behind other pieces
    ],
)
def test_beside_the_board_pieces_are_found_too(studio: TableStudio, square: str, pose: Pose) -> None:
    (stray,) = scene(studio, FEN, {square: pose})
    assert stray.target == Place.parse(square)
    assert near(stray, pose), stray.pose


@pytest.mark.slow
@pytest.mark.parametrize("square", ["f8", "h1"])
def test_with_everything_in_its_place_nothing_is_found_in_the_trays(studio: TableStudio, square: str) -> None:
    fen = chess.STARTING_FEN
    assert scene(studio, fen, {square: Pose(*TABLE.xy(Place.parse(square)))}, seed=ord(square[0])) == ()


@pytest.mark.slow
def test_a_piece_that_stands_before_another_is_not_taken_for_a_part_of_it(studio: TableStudio) -> None:
    """The head of the bishop hides the knight behind it: it belongs to the bishop, and that stands."""
    x, y = TABLE.xy(Place.parse("f4"))
    (stray,) = scene(studio, "4k3/8/8/8/6p1/5N2/5PPP/4KB1R w - - 0 1", {"f1": Pose(x, y)})
    assert stray.target == Place.parse("f1")
    assert near(stray, Pose(x, y)), stray.pose


@pytest.mark.slow
def test_two_pieces_of_one_side_are_told_apart(studio: TableStudio) -> None:
    """One hidden in part explains less than the other would in its place."""
    bishop, rook = Pose(0.152, 0.093), Pose(0.13, 0.176)
    found = scene(
        studio,
        "rnbqkbnr/pppppp1p/8/8/8/8/PPPPPPPP/RNBQKBNR w KQkq - 0 1",
        {"f8": bishop, "h8": rook, "h7": Pose(0.14, 0.06)},
    )
    poses = {str(stray.target): stray for stray in found}
    assert near(poses["f8"], bishop), poses["f8"]
    assert near(poses["h8"], rook), poses["h8"]


@pytest.mark.slow
@pytest.mark.parametrize(("bearing", "seed"), [(64.0, 2), (64.0, 5), (50.0, 0), (50.0, 1), (50.0, 3)])
def test_a_pawn_that_was_pushed_by_what_leans_on_it_is_not_taken_for_that(
    studio: TableStudio, bearing: float, seed: int
) -> None:
    """Together they look more like a rook that stands there than like a pawn, but the pawn is nearly at home."""
    specs, rng = start_layout(chess.Board(), TABLE), np.random.default_rng(seed)
    poses = dict[str, Put]()
    for spec in specs:
        x, y = (np.array(TABLE.xy(spec.place)) + rng.uniform(-0.001, 0.001, 2)).tolist()
        poses[spec.name] = Put(spec.name, x, y, yaw=float(rng.uniform(-3.0, 3.0)))
    poses["white-pawn-h"] = Put("white-pawn-h", 0.1406, -0.0935)
    yaw, tip = math.radians(bearing) + 0.5 * math.pi, math.radians(85.0)
    poses["white-rook-h"] = Put("white-rook-h", 0.1406, -0.1282, 0.0093, yaw, tip)
    frame = studio.frame(poses.values(), SceneState(), seed)
    view = BoardView(frame.intrinsics, studio.camera_from_board(SceneState().mount), TABLE)
    expected = {spec.place: spec for spec in specs}
    found = find_misplaced(frame, view, expected, doubted=(Place.parse("h1"),), trays=True)
    standing = {stray.piece.name: stray for stray in found if not stray.lies}
    assert "white-rook-h" not in standing
    assert near(standing["white-pawn-h"], Pose(0.1406, -0.0935))


@pytest.mark.slow
def test_crowded_falls_lie_as_they_are_said_to(studio: TableStudio) -> None:
    """Between the pieces of an opening, mostly hidden: which end is the foot, and where."""
    rng = np.random.default_rng(4)
    right = 0
    for number in range(10):
        square = str(rng.choice(["b2", "c2", "d3", "f2", "g2", "f3", "c3", "f7", "c6", "f6", "d6"]))
        x, y = (np.array(TABLE.xy(Place.parse(square))) + rng.uniform(-0.012, 0.012, 2)).tolist()
        pose = Pose(x, y, float(rng.uniform(-math.pi, math.pi)))
        found = scene(studio, FEN, {square: pose}, seed=number)
        right += any(str(stray.target) == square and near(stray, pose) for stray in found)
    assert right >= 9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pawn", "knight"),
    [
        (Pose(0.0150, 0.0477, -1.7266), Pose(0.0102, 0.0773, -1.2556)),
        (Pose(0.0448, -0.0594, 1.8665), Pose(0.0318, -0.0323, -0.2015)),
        (Pose(0.0290, -0.0490, 0.0488), Pose(0.0580, -0.0414, 2.3332)),
    ],
)
def test_of_two_that_lie_together_the_second_is_found_as_well_as_the_first(
    studio: TableStudio, pawn: Pose, knight: Pose
) -> None:
    """What depth shows of the first one does not speak against the second."""
    found = scene(studio, "4k3/8/8/3p4/4N3/8/8/4K3 w - - 0 1", {"d5": pawn, "e4": knight})
    poses = {str(stray.target): stray for stray in found}
    assert near(poses["d5"], pawn), poses["d5"]
    assert near(poses["e4"], knight), poses["e4"]


@pytest.mark.slow
def test_what_stands_across_the_pictures_edge_does_not_lie(studio: TableStudio) -> None:
    """A camera that sees the board alone, and cuts through what stands in a tray."""
    board = chess.Board()
    specs = start_layout(board, TABLE)
    fallen = next(spec for spec in specs if str(spec.place) == "e2")
    poses = [Put(spec.name, *TABLE.xy(spec.place)) for spec in specs if spec is not fallen]
    frame = studio.frame([*poses, laid(fallen.name, fallen.kind, 0.02, -0.03, 1.0)], SceneState(), 1)
    whole = BoardView(frame.intrinsics, studio.camera_from_board(SceneState().mount), TABLE)
    edges = whole.project([(-0.16, -0.16, 0.0), (0.16, 0.16, 0.0)])[:, 0]
    spares = [spec for spec in specs if spec.place.in_tray]
    middle = float(whole.project([(*TABLE.xy(spares[0].place), 0.0)])[0, 0])
    cuts = 8, round(abs(middle - edges.mean()) - 0.5 * float(np.ptp(edges)))
    for beyond in cuts:
        left, right = max(0, int(edges.min()) - beyond), int(edges.max()) + beyond
        cut, view = narrowed(frame, whole, left, right)
        misplaced = find_misplaced(cut, view, {spec.place: spec for spec in specs}, trays=True)
        assert [str(stray.target) for stray in misplaced if stray.lies] == ["e2"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pawn", "off"),
    [(Pose(0.014, -0.023, -2.75), 14), (Pose(0.031, 0.031, 0.09), 8), (Pose(0.046, -0.029, 1.97), 11)],
)
def test_what_lies_in_plain_sight_is_found_whatever_stands_out_at_the_pictures_edge(
    studio: TableStudio, pawn: Pose, off: int
) -> None:
    """A captured knight in a tray rises higher than a pawn that lies; the camera sees a part of it."""
    edge = Place.parse("R13")
    position = start_layout(chess.Board("4k3/8/8/8/8/4P3/8/1N2K3 w - - 0 1"), TABLE)
    specs = [replace(spec, place=edge) if str(spec.place) == "b1" else spec for spec in position]
    fallen = next(spec for spec in specs if str(spec.place) == "e3")
    poses = [Put(spec.name, *TABLE.xy(spec.place)) for spec in specs if spec is not fallen]
    frame = studio.frame([*poses, laid(fallen.name, fallen.kind, pawn.x, pawn.y, pawn.yaw or 0.0)], SceneState(), 1)
    whole = BoardView(frame.intrinsics, studio.camera_from_board(SceneState().mount), TABLE)
    middle = float(whole.project([(*TABLE.xy(edge), 0.0)])[0, 0])
    cut, view = narrowed(frame, whole, int(middle) - off, frame.intrinsics.width)
    misplaced = find_misplaced(cut, view, {spec.place: spec for spec in specs}, trays=True)
    assert [near(stray, pawn) for stray in misplaced if str(stray.target) == "e3"] == [True]


def narrowed(frame: Frame, whole: BoardView, left: int, right: int) -> tuple[Frame, BoardView]:
    """The same picture without the columns beyond these."""
    assert frame.depth is not None
    eye = replace(frame.intrinsics, width=right - left, cx=frame.intrinsics.cx - left)
    cut = replace(
        frame,
        colour=np.ascontiguousarray(frame.colour[:, left:right]),
        depth=np.ascontiguousarray(frame.depth[:, left:right]),
        intrinsics=eye,
    )
    return cut, BoardView(eye, whole.camera_from_board, TABLE)


@pytest.mark.parametrize("kind", list(Kind))
def test_distances_from_a_pieces_surface_are_those_from_its_outline(kind: Kind) -> None:
    """Also of a rook, whose outline goes down again between the battlements."""
    pose = Pose(0.03, -0.02)
    rows = np.array(_profile(kind))
    share = np.linspace(0.0, 1.0, 5)[:, None]
    on = np.concatenate([start + share * (end - start) for start, end in pairwise(rows)])
    angle = np.linspace(0.0, 6.0, len(on))
    points = np.stack([pose.x + on[:, 0] * np.cos(angle), pose.y + on[:, 0] * np.sin(angle), on[:, 1]], axis=1)
    assert off_surface(points.astype(np.float32), kind, pose).max() < 0.0004
    height, radius = rows[:, 1].max(), rows[:, 0].max()
    above = np.array([[pose.x + rows[rows[:, 1].argmax(), 0], pose.y, height + 0.005]], dtype=np.float32)
    aside = np.array([[pose.x, pose.y - radius - 0.004, rows[rows[:, 0].argmax(), 1]]], dtype=np.float32)
    assert off_surface(above, kind, pose) == pytest.approx(0.005, abs=0.0004)
    assert off_surface(aside, kind, pose) == pytest.approx(0.004, abs=0.0004)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("knight", "rook"),
    [
        (Pose(0.0885, 0.1374, 2.70), Pose(0.1214, 0.1445)),
        (Pose(0.1189, 0.1740, 3.88), Pose(0.1470, 0.1386)),
        (Pose(0.0887, 0.1377, 2.75), Pose(0.1177, 0.1470, 2.56)),
        (Pose(0.1232, 0.1763), Pose(0.1470, 0.1386)),
    ],
)
def test_a_knight_and_a_rook_are_told_apart(studio: TableStudio, knight: Pose, rook: Pose) -> None:
    fen = "rnbqkbnr/pppp1ppp/8/4p3/4P3/8/PPPP1PPP/RNBQKBNR w KQkq - 0 1"
    poses = {str(stray.target): stray for stray in scene(studio, fen, {"g8": knight, "h8": rook})}
    assert near(poses["g8"], knight), poses["g8"]
    assert near(poses["h8"], rook), poses["h8"]
