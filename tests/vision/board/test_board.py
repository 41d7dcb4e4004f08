"""The board in a picture: against closed-form views, against rendered ones, and what the rig's camera can see."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import chess
import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from app.motion import MotionSettings
from app.pieces.layout import start_layout
from hardware.interfaces import Frame, Intrinsics
from hardware.parameters import load_parameters
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import CAMERAS, build_model
from hardware.sim.process.settings import WorldSettings, stand_pieces
from hardware.sim.render.drawing import draw_rods
from hardware.sim.render.renderer import HEIGHT, WIDTH, intrinsics_for
from hardware.table import PieceSpec, TableSettings, square_place
from tests.vision.views import looking_at, square_polygon
from vision.board.view import BoardNotFound, BoardView, playing_area

TABLE = TableSettings()
CAMERA = CAMERAS["camera"]
PINHOLE = intrinsics_for(CAMERA.field_of_view)
HOME = np.array(MotionSettings().home)

Picture = NDArray[Any]


def rig_view() -> BoardView:
    return BoardView(PINHOLE, looking_at(CAMERA.position, CAMERA.target), TABLE)


def from_above(height: float = 1.0, focal: float = 1000.0) -> BoardView:
    """A camera straight above the centre, its columns along the files: everything can be written down by hand."""
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = height
    return BoardView(Intrinsics(640, 480, focal, focal, 319.5, 239.5), pose, TABLE)


# -------------------------------------------------------------------------------------------------- closed form


def test_projection_from_straight_above_is_a_scale() -> None:
    view = from_above(height=1.0, focal=1000.0)
    pixels = view.project([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.1, 0.0, 0.5]])
    np.testing.assert_allclose(pixels, [[319.5, 239.5], [419.5, 239.5], [319.5, 139.5], [519.5, 239.5]])
    np.testing.assert_allclose(view.camera_position, [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(view.depth([[0.3, 0.2, 0.0], [0.0, 0.0, 0.25]]), [1.0, 0.75])


def test_squares_lie_where_their_names_say() -> None:
    view = from_above()
    a1, h8 = square_polygon(view, chess.A1), square_polygon(view, chess.H8)
    np.testing.assert_allclose(a1, [[159.5, 399.5], [199.5, 399.5], [199.5, 359.5], [159.5, 359.5]], atol=1e-9)
    np.testing.assert_allclose(h8.mean(axis=0), [459.5, 99.5], atol=1e-9)


def test_squares_tile_the_playing_area() -> None:
    view = rig_view()
    corner = {square: square_polygon(view, square) for square in chess.SQUARES}
    for square in chess.SQUARES:
        if chess.square_file(square) < 7:
            np.testing.assert_allclose(corner[square][[1, 2]], corner[square + 1][[0, 3]], atol=1e-9)
        if chess.square_rank(square) < 7:
            np.testing.assert_allclose(corner[square][[3, 2]], corner[square + 8][[0, 1]], atol=1e-9)
    outer = [corner[chess.A1][0], corner[chess.H1][1], corner[chess.H8][2], corner[chess.A8][3]]
    np.testing.assert_allclose(outer, view.project(playing_area(TABLE)), atol=1e-9)


def test_points_behind_the_camera_have_no_picture() -> None:
    with pytest.raises(ValueError, match="1 of 2 points lie behind the camera: project only what it faces"):
        from_above(height=1.0).project([[0.0, 0.0, 0.0], [0.0, 0.0, 1.5]])


def test_a_pose_must_be_rigid_and_stays_as_it_is() -> None:
    for wrong in (2.0 * np.eye(4), np.diag([-1.0, 1.0, 1.0, 1.0]), np.eye(3), np.full((4, 4), np.nan)):
        with pytest.raises(ValueError, match="camera_from_board is not a rigid transform"):
            BoardView(PINHOLE, wrong, TABLE)
    pose = looking_at(CAMERA.position, CAMERA.target)
    view = BoardView(PINHOLE, pose, TABLE)
    pose[0, 3] += 1.0
    np.testing.assert_allclose(view.camera_position, CAMERA.position, atol=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        view.camera_from_board[0, 3] = 0.0


# ---------------------------------------------------------------------------------------------- pose from corners


def test_the_rig_cameras_pose_comes_out_of_its_corners() -> None:
    true = rig_view()
    found = BoardView.from_corners(PINHOLE, true.project(playing_area(TABLE)), TABLE)
    np.testing.assert_allclose(found.camera_from_board, true.camera_from_board, atol=1e-6)
    np.testing.assert_allclose(found.camera_position, CAMERA.position, atol=1e-6)


@given(
    x=st.floats(-0.5, 0.5), y=st.floats(-0.6, 0.6), z=st.floats(0.3, 1.0), roll=st.floats(-math.pi, math.pi),
    side=st.floats(-0.05, 0.05),
)  # fmt: skip
def test_any_view_from_above_is_found_again(x: float, y: float, z: float, roll: float, side: float) -> None:
    assume(math.hypot(x - side, y) > 0.02)  # straight down has no level horizon to build the view with
    true = BoardView(PINHOLE, looking_at((x, y, z), (side, 0.0, 0.0), roll), TABLE)
    found = BoardView.from_corners(PINHOLE, true.project(playing_area(TABLE)), TABLE)
    np.testing.assert_allclose(found.camera_position, true.camera_position, atol=1e-4)
    points = np.random.default_rng(0).uniform([-0.25, -0.2, 0.0], [0.25, 0.2, 0.06], (30, 3))
    np.testing.assert_allclose(found.project(points), true.project(points), atol=0.05)


def test_corners_half_a_pixel_wrong_shift_no_square_by_more_than_two() -> None:
    true = rig_view()
    rng = np.random.default_rng(3)
    for _ in range(50):
        noisy = true.project(playing_area(TABLE)) + rng.uniform(-0.5, 0.5, (4, 2))
        found = BoardView.from_corners(PINHOLE, noisy, TABLE)
        for square in chess.SQUARES:
            np.testing.assert_allclose(square_polygon(found, square), square_polygon(true, square), atol=2.0)


def test_a_larger_board_is_further_away() -> None:
    corners = rig_view().project(playing_area(TABLE))
    tournament = TableSettings(square=0.057)
    found = BoardView.from_corners(PINHOLE, corners, tournament)
    np.testing.assert_allclose(found.camera_position, np.array(CAMERA.position) * 57.0 / 40.0, atol=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c[::-1], "corners do not go round counter-clockwise in the picture: give them as a1, h1, h8, a8$"),
        (lambda c: c[[0, 2, 1, 3]], "do not go round counter-clockwise"),
        (lambda c: np.linspace(c[0], c[2], 4), "do not go round counter-clockwise"),
        (lambda c: c[:3], re.escape("corners of shape (3, 2) were given: give four finite points, a1, h1, h8, a8")),
        (lambda c: c * np.nan, "give four finite points"),
        (lambda c: 0.05 * c, r"the corners enclose \d+ px², at least 1000 px² are needed: bring the camera closer"),
        (
            lambda c: c + np.array([[0, 0], [60, 0], [0, 0], [0, 0]]),
            r"corner [ah][18] is \d+\.\d px from where a square board would have it, at most 3 px are accepted: "
            "point at the corners again, or check the intrinsics",
        ),
    ],
)  # fmt: skip
def test_what_is_no_board_is_refused(change: Callable[[Picture], Picture], message: str) -> None:
    corners = rig_view().project(playing_area(TABLE))
    with pytest.raises(BoardNotFound, match=message):
        BoardView.from_corners(PINHOLE, change(corners), TABLE)


# ---------------------------------------------------------------------------------------- rendered by the rig's camera


class Scene:
    """The simulated table as the camera sees it, with the arm at a tool point."""

    def __init__(
        self,
        make: Callable[..., Any],
        pieces: tuple[PieceSpec, ...] = (),
        stood: tuple[StandingPiece, ...] = (),
        tool: Picture = HOME,
    ) -> None:
        self.model = build_model(load_parameters(), TABLE, stood, tool)
        self.names = [piece.name for piece in pieces]
        self._data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, self._data, 0)
        mujoco.mj_forward(self.model, self._data)
        self._renderer = make(self.model, HEIGHT, WIDTH)
        self._option = mujoco.MjvOption()
        self._option.geomgroup[3] = 0  # shapes for collisions alone

    def frame(self) -> Frame:
        self._update()
        return Frame(np.array(self._renderer.render()), None, PINHOLE, 0.0)

    def geoms(self) -> Picture:
        """Number of the geom seen by each pixel, shape (h, w); -1 for anything else, such as the arm's rods."""
        scene = self._update()
        for index in range(scene.ngeom):
            scene.geoms[index].segid = index  # rods are drawn without a number of their own, but hide what is behind
        self._renderer.enable_segmentation_rendering()
        seen = np.array(self._renderer.render())
        self._renderer.disable_segmentation_rendering()
        return np.where(seen[..., 1] == mujoco.mjtObj.mjOBJ_GEOM, seen[..., 0], -1)

    def _update(self) -> Any:
        self._renderer.update_scene(self._data, camera="camera", scene_option=self._option)
        draw_rods(self._renderer.scene, self._data)
        return self._renderer.scene

    def table_geoms(self) -> set[int]:
        """Deck, squares and the marks of the trays: what belongs to no body but the world, except the table."""
        mine = {i for i in range(self.model.ngeom) if self.model.geom_bodyid[i] == 0}
        return mine - {self.model.geom("deck").id}


@pytest.fixture
def empty(renderer: Callable[..., Any]) -> Scene:
    return Scene(renderer)


def test_the_view_agrees_with_the_renderer(empty: Scene) -> None:
    """Each pixel of the picture is on the side of the playing area's edge on which the view has it."""
    geoms, squares = empty.geoms(), empty.model.geom("squares").id
    outline = rig_view().project(playing_area(TABLE))
    rows, columns = np.nonzero(np.isin(geoms, list(empty.table_geoms())))
    assert len(rows) > 50_000
    inside = np.min([_left_of(columns, rows, outline[i], outline[(i + 1) % 4]) for i in range(4)], axis=0)
    clear = np.abs(inside) > 0.75
    np.testing.assert_array_equal(inside[clear] > 0.0, geoms[rows, columns][clear] == squares)


def _left_of(u: Picture, v: Picture, start: Picture, end: Picture) -> Picture:
    """Distance of pixels to the left, to the eye, of a line [px]."""
    (along_u, along_v) = (end - start) / np.linalg.norm(end - start)
    return along_v * (u - start[0]) - along_u * (v - start[1])


def test_rendered_squares_have_the_colours_of_a_chess_board(empty: Scene) -> None:
    seen, board = empty.frame().colour, empty.geoms() == empty.model.geom("squares").id
    light, dark = [], []
    for square in chess.SQUARES:
        u, v = np.round(rig_view().project([*TABLE.xy(square_place(square)), 0.0])).astype(int)
        assert board[v, u]
        shade = light if chess.BB_LIGHT_SQUARES & chess.BB_SQUARES[square] else dark
        shade.append(float(seen[v, u].mean()))
    assert min(light) > max(dark)


def hidden_places(scene: Scene) -> dict[str, str]:
    """Squares and places of the trays whose centre the camera does not see, and what it sees there instead."""
    geoms, table = scene.geoms(), scene.table_geoms()
    places = [*map(square_place, chess.SQUARES), *TABLE.tray_places()]
    assert len(places) == 64 + 48
    hidden = {}
    for place in places:
        u, v = rig_view().project([*TABLE.xy(place), 0.0])
        if not (0 <= round(u) < WIDTH and 0 <= round(v) < HEIGHT):
            hidden[str(place)] = f"the border of the picture: {u:.0f}, {v:.0f}"
            continue
        geom = int(geoms[round(v), round(u)])
        if geom not in table:
            hidden[str(place)] = scene.model.geom(geom).name if geom >= 0 else "a rod or the room"
    return hidden


def test_from_home_the_camera_sees_every_square_and_every_place_of_the_trays(empty: Scene) -> None:
    assert hidden_places(empty) == {}


def test_an_arm_over_the_board_hides_squares_behind_it(renderer: Callable[..., Any]) -> None:
    over_d5 = TABLE.base_from_board(np.array([*TABLE.xy(square_place(chess.D5)), 0.03]))
    hidden = hidden_places(Scene(renderer, tool=over_d5))
    assert {hidden.get(square) for square in ("c1", "d1", "e1", "d2")} == {"flange"}
    assert "a rod or the room" in hidden.values()
    assert not {"d8", "a8", "h8", "L12", "R12"} & set(hidden)


def test_from_home_the_camera_sees_something_of_every_piece(renderer: Callable[..., Any]) -> None:
    pieces = start_layout(chess.Board(), TABLE)
    settings = WorldSettings(pieces=pieces, home=MotionSettings().home, table=TABLE, seed=1)
    scene = Scene(renderer, pieces, stand_pieces(settings))
    geoms = scene.geoms()
    bodies = scene.model.geom_bodyid[geoms[geoms >= 0]]
    pixels = {name: int(np.count_nonzero(bodies == scene.model.body(name).id)) for name in scene.names}
    assert len(pixels) == 50
    assert min(pixels.values()) >= 200, sorted(pixels.items(), key=lambda item: item[1])[:5]
