"""Hands, motion and rest, in pictures made by formula: what light does is no hand, and what a hand does is seen."""

from __future__ import annotations

import os
import re
from itertools import count
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from hardware.interfaces import DepthFrame, Frame, Intrinsics
from hardware.table import TableSettings, square_place
from tests.vision.views import looking_at, square_polygon
from vision.board.view import BoardView, playing_area
from vision.hands.arm_mask import Capsules, Hidden
from vision.hands.hand_and_motion import ColourWatch, Seen, SettledView, VideoGate, Watch, WatchSettings

TABLE = TableSettings()
PINHOLE = Intrinsics(640, 480, 617.0, 617.0, 319.5, 239.5)
VIEW = BoardView(PINHOLE, looking_at((0.0, 0.30, 0.62), (0.0, 0.0, 0.0)), TABLE)
CORNERS = VIEW.project(playing_area(TABLE))
PERIOD = 1.0 / 30.0
SKIN, SLEEVE, WOOD = (205, 160, 130), (40, 55, 95), (110, 75, 50)
Picture = NDArray[np.uint8]


class Scene:
    """A board with pieces, drawn as boxes and pictures of the right size; noise of a sensor on top."""

    def __init__(self, seed: int = 1) -> None:
        self.rng = np.random.default_rng(seed)
        self.pieces = dict.fromkeys(range(48, 64), (60, 40, 30)) | dict.fromkeys(range(16), (225, 200, 160))
        self.times = count(1)
        self.noise = [self.rng.normal(0.0, 2.5, (480, 640, 3)).astype(np.int16) for _ in range(3)]
        self.rough = [self.rng.normal(0.0, 0.0013, (480, 640)) for _ in range(3)]

    def picture(self, hand: tuple[float, float] | None = None) -> Picture:
        """Without noise; ``hand``: where its fingertips are, coming from −y, board frame [m]."""
        picture = np.full((480, 640, 3), WOOD, dtype=np.uint8)
        for square in range(64):
            light = (square // 8 + square) % 2
            fill(picture, square_polygon(VIEW, square), (230, 205, 165) if light else (125, 80, 55))
        for square, colour in sorted(self.pieces.items(), key=lambda one: -one[0]):
            x, y = TABLE.xy(square_place(square))
            box(picture, (x - 0.009, x + 0.009), (y - 0.009, y + 0.009), 0.042, colour)
        if hand is not None:
            x, y = hand
            box(picture, (x - 0.040, x + 0.040), (y - 0.16, y), 0.09, SKIN)
            box(picture, (x - 0.045, x + 0.045), (y - 0.60, y - 0.16), 0.12, SLEEVE)
        return picture

    def noisy(self, picture: Picture) -> Picture:
        return (picture + self.noise[self.rng.integers(3)]).clip(0, 255).astype(np.uint8)

    def depth(self, hand: tuple[float, float, float] | None = None) -> NDArray[np.float32]:
        """Of the board, and a slab of a hand with its fingertips at (x, y), at a height, coming from −y."""
        height = plane_depth(0.0)
        if hand is not None:
            x, y, z = hand
            above = plane_depth(z)
            where = np.zeros((480, 640), dtype=np.uint8)
            corners = [[x - 0.03, y - 0.30, z], [x + 0.03, y - 0.30, z], [x + 0.03, y, z], [x - 0.03, y, z]]
            cv2.fillConvexPoly(where, np.rint(VIEW.project(corners)).astype(np.int32), 1)
            height = np.where(where > 0, above, height)
        measured = height + self.rough[self.rng.integers(3)]
        measured[self.rng.integers(480, size=600), self.rng.integers(640, size=600)] = 0.0
        return measured.astype(np.float32)

    def frame(self, colour: Picture, depth: NDArray[np.float32] | None = None) -> Frame:
        return Frame(self.noisy(colour), depth, PINHOLE, next(self.times) * PERIOD)


def plane_depth(z: float) -> NDArray[np.float64]:
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    rays = np.stack([(u - PINHOLE.cx) / PINHOLE.fx, (v - PINHOLE.cy) / PINHOLE.fy, np.ones(u.shape)], axis=2)
    slope = rays @ VIEW.camera_from_board[:3, 2]
    return np.where(slope < 0.0, (z - VIEW.camera_position[2]) / slope, 0.0)


def fill(picture: Picture, polygon: Any, colour: tuple[int, int, int]) -> None:
    cv2.fillConvexPoly(picture, np.rint(polygon).astype(np.int32), colour)


def box(
    picture: Picture, x: tuple[float, float], y: tuple[float, float], z: float, colour: tuple[int, int, int]
) -> None:
    corners = [[a, b, c] for a in x for b in y for c in (0.0, z)]
    corners = [point for point in corners if VIEW.depth(point) > 0.05]
    fill(picture, cv2.convexHull(VIEW.project(corners).astype(np.float32))[:, 0], colour)


def shade(picture: Picture, polygon: list[list[float]], factor: float) -> Picture:
    where = np.zeros(picture.shape[:2], dtype=np.uint8)
    fill(where, VIEW.project([[*point, 0.0] for point in polygon]), 1)  # type: ignore[arg-type]
    soft = 1.0 - (1.0 - factor) * cv2.GaussianBlur(where.astype(np.float32), (0, 0), 4.0)
    return (picture * soft[..., None]).astype(np.uint8)


def settled(scene: Scene, watch: Watch | ColourWatch, frames: int = 16) -> Seen:
    seen = None
    for _ in range(frames):
        seen = look(scene, watch, scene.picture())
    assert seen is not None
    assert seen.settled
    return seen


def look(scene: Scene, watch: Watch | ColourWatch, colour: Picture, hidden: Any = None) -> Seen:
    frame = scene.frame(colour)
    if isinstance(watch, Watch):
        return watch.update(frame, VIEW, hidden)
    return watch.update(frame.colour, frame.stamp, hidden)


@pytest.fixture(params=["view", "corners"])
def watch(request: pytest.FixtureRequest) -> Watch | ColourWatch:
    return Watch() if request.param == "view" else ColourWatch(CORNERS)


def test_a_board_that_is_left_alone_settles_after_the_stable_time(watch: Watch | ColourWatch) -> None:
    scene, told = Scene(), []
    for _ in range(12):
        told.append(look(scene, watch, scene.picture()))
    first = next(seen for seen in told if seen.settled)
    assert first.stable_since is not None
    assert WatchSettings().stable_time <= first.stamp - first.stable_since < WatchSettings().stable_time + 2.0 * PERIOD
    assert all(seen.settled for seen in told[told.index(first) :])
    assert not any(seen.hand_present for seen in told)


def test_a_hand_is_seen_as_long_as_it_is_there_even_if_it_rests(watch: Watch | ColourWatch) -> None:
    scene = Scene()
    settled(scene, watch)
    while_there = [look(scene, watch, scene.picture((0.02, 0.0))) for _ in range(24)]
    assert all(seen.hand_present for seen in while_there[1:])
    assert not any(seen.settled for seen in while_there)
    assert {27, 28} & while_there[-1].over
    after = [look(scene, watch, scene.picture()) for _ in range(12)]
    assert not after[2].hand_present
    done = next(seen for seen in after if seen.settled)
    assert done.stamp - while_there[-1].stamp < 0.35
    assert while_there[-1].over <= done.touched
    assert not after[after.index(done) + 1].touched


def test_a_move_is_no_hand_and_settles(watch: Watch | ColourWatch) -> None:
    scene = Scene()
    settled(scene, watch)
    for start, end in ((12, 28), (52, 36), (6, 21), (57, 42), (5, 33), (4, 6), (7, 5)):
        scene.pieces[end] = scene.pieces.pop(start)
    after = [look(scene, watch, scene.picture()) for _ in range(10)]
    assert after[0].moving
    assert not any(seen.hand_present for seen in after)
    assert after[-1].settled


def test_a_step_of_the_exposure_is_neither_motion_nor_a_hand(watch: Watch | ColourWatch) -> None:
    scene = Scene()
    settled(scene, watch)
    for factor in (0.9, 0.75, 0.75, 1.05, 1.05):
        seen = look(scene, watch, (scene.picture() * factor).clip(0, 255).astype(np.uint8))
        assert not seen.moving
        assert not seen.hand_present
        assert seen.settled


def test_a_shadow_that_moves_is_motion_but_no_hand(watch: Watch | ColourWatch) -> None:
    scene = Scene()
    settled(scene, watch)
    moved = []
    for step in range(12):
        x = -0.25 + 0.03 * step
        polygon = [[x, -0.3], [x + 0.1, -0.3], [x + 0.1, 0.1], [x, 0.1]]
        moved.append(look(scene, watch, shade(scene.picture(), polygon, 0.6)))
    assert not any(seen.hand_present for seen in moved)
    assert sum(seen.moving for seen in moved) > 8
    rests = [look(scene, watch, shade(scene.picture(), polygon, 0.6)) for _ in range(9)]
    assert rests[-1].settled


def test_what_is_masked_is_not_seen(watch: Watch | ColourWatch) -> None:
    scene = Scene()
    settled(scene, watch)
    arm = scene.picture((0.0, 0.05))
    hidden = cv2.dilate((np.abs(arm.astype(int) - scene.picture()).sum(axis=2) > 0).astype(np.uint8), np.ones((7, 7)))
    for _ in range(4):
        seen = look(scene, watch, arm, hidden > 0)
        assert not seen.hand_present
        assert not seen.moving


def test_darkness_is_not_a_settled_board(watch: Watch | ColourWatch) -> None:
    scene = Scene()
    for _ in range(12):
        assert not look(scene, watch, np.zeros((480, 640, 3), dtype=np.uint8)).settled


# ------------------------------------------------------------------------------------------------------------- depth


@pytest.mark.parametrize("bare", [True, False])
def test_a_board_of_which_depth_shows_nothing_is_not_settled(bare: bool) -> None:
    """A hand before the lens is too near to have depth: what is behind it nobody sees."""
    scene, watch = Scene(), Watch()

    def look(depth: NDArray[np.float32]) -> Seen:
        frame = scene.frame(scene.picture(), depth)
        return watch.update(DepthFrame(depth, PINHOLE, frame.stamp) if bare else frame, VIEW)

    for _ in range(16):
        seen = look(scene.depth())
    assert (seen.settled, seen.blind) == (True, False)
    covered = np.zeros((480, 640), np.float32)
    covered[:, :60] = 0.5
    for _ in range(16):
        seen = look(covered)
        assert (seen.settled, seen.stable_since, seen.blind) == (False, None, True)
    for _ in range(16):
        seen = look(scene.depth())
    assert (seen.settled, seen.blind) == (True, False)


def test_with_depth_a_hand_is_known_from_the_first_picture_on_and_only_where_it_is() -> None:
    scene, watch = Scene(), Watch()
    hand = [watch.update(scene.frame(scene.picture(), scene.depth((0.06, 0.02, 0.10))), VIEW) for _ in range(2)]
    assert hand[-1].hand_present
    assert hand[-1].over == {square for square in hand[-1].over if square % 8 in (4, 5, 6)} != set()
    gone = [watch.update(scene.frame(scene.picture(), scene.depth()), VIEW) for _ in range(10)]
    assert not gone[1].hand_present
    assert gone[-1].settled


def test_with_depth_light_is_no_hand_and_masks_hide() -> None:
    scene, watch = Scene(), Watch()
    for _ in range(8):
        watch.update(scene.frame(scene.picture(), scene.depth()), VIEW)
    lit = shade(scene.picture((0.0, 0.0)), [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]], 0.4)
    for _ in range(3):
        assert not watch.update(scene.frame(lit, scene.depth()), VIEW).hand_present
    depth = scene.depth((0.0, 0.0, 0.15))
    hidden = cv2.dilate((np.abs(depth - plane_depth(0.0)) > 0.02).astype(np.uint8), np.ones((5, 5))) > 0
    for _ in range(3):
        assert not watch.update(scene.frame(lit, depth), VIEW, hidden).hand_present


def test_a_hand_that_lies_low_on_the_board_is_seen_too() -> None:
    scene, watch = Scene(), Watch()
    for _ in range(14):
        watch.update(scene.frame(scene.picture(), scene.depth()), VIEW)
    for _ in range(2):
        seen = watch.update(scene.frame(scene.picture(), scene.depth((-0.05, -0.06, 0.035))), VIEW)
    assert seen.hand_present
    assert seen.touched


def test_a_hand_over_a_tray_leaves_the_board_as_still_as_it_is() -> None:
    scene, watch = Scene(), Watch()
    for _ in range(14):
        watch.update(scene.frame(scene.picture(), scene.depth()), VIEW)
    over_board = [watch.update(scene.frame(scene.picture(), scene.depth((0.10, 0.0, 0.10))), VIEW) for _ in range(4)]
    over_tray = [watch.update(scene.frame(scene.picture(), scene.depth((0.24, 0.0, 0.10))), VIEW) for _ in range(10)]
    gone = [watch.update(scene.frame(scene.picture(), scene.depth()), VIEW) for _ in range(2)]
    assert all(seen.hand_present and not seen.settled for seen in (*over_board[1:], *over_tray))
    assert over_board[-1].over
    assert over_board[-1].stable_since is None
    assert not over_tray[-1].over
    assert over_tray[-1].stable_since == over_tray[0].stamp
    assert [seen.settled for seen in gone] == [False, True]


def test_something_high_beside_the_table_is_not_over_it() -> None:
    scene, watch = Scene(), Watch()
    for _ in range(4):
        seen = watch.update(scene.frame(scene.picture(), scene.depth((0.0, -0.26, 0.12))), VIEW)
    assert not seen.hand_present


# ------------------------------------------------------------------------------------------------------------- misuse


def test_frames_must_fit() -> None:
    scene, watch = Scene(), Watch()
    frame = scene.frame(scene.picture())
    watch.update(frame, VIEW)
    with pytest.raises(ValueError, match=re.escape("a frame of 0.033 s came after one of 0.033 s: give them in order")):
        watch.update(frame, VIEW)
    with pytest.raises(ValueError, match="the frame is by a camera with"):
        watch.update(Frame(frame.colour, None, Intrinsics(640, 480, 1.0, 1.0, 0.0, 0.0), 9.0), VIEW)
    with pytest.raises(
        ValueError, match=re.escape("a mask of shape (4, 4) does not fit a picture of shape (480, 640)")
    ):
        watch.update(scene.frame(scene.picture()), VIEW, np.zeros((4, 4), dtype=np.bool_))
    with pytest.raises(ValueError, match="confirm is at least 1"):
        WatchSettings(confirm=0)
    gate = ColourWatch(CORNERS)
    gate.update(scene.picture(), 0.0)
    with pytest.raises(ValueError, match="watch one camera"):
        gate.update(np.zeros((10, 10, 3), dtype=np.uint8), 1.0)
    with pytest.raises(ValueError, match="too small to watch"):
        ColourWatch(np.array([[0, 0], [4, 0], [4, 4], [0, 4]])).update(scene.picture(), 0.0)


# ------------------------------------------------------------------------------------------------------------- videos


def test_the_gate_tells_each_settled_board_once() -> None:
    scene, gate = Scene(), VideoGate(CORNERS)
    views: list[SettledView] = []
    for frame in range(60):
        hand = (0.0, 0.0) if 20 <= frame < 40 else None
        if frame == 30:
            scene.pieces[28] = scene.pieces.pop(12)
        view = gate.update(scene.noisy(scene.picture(hand)), frame * PERIOD)
        views += [view] if view is not None else []
    assert len(views) == 2
    first, second = views
    assert first.stamp < 20 * PERIOD < 40 * PERIOD <= second.since < second.stamp
    assert 28 in second.touched


def photographs() -> Path:
    folder = os.environ.get("TOUCHMOVE_PHOTOS")
    found = sorted(Path(folder).glob("*/scholarsmate_video")) if folder else []
    if not found:
        pytest.skip("no recordings of real boards here: set TOUCHMOVE_PHOTOS to their folder")
    return found[0]


@pytest.mark.slow
def test_a_real_video_is_gated_as_people_would() -> None:
    """Every interval that people call free of hands is caught, and no picture with a hand over the squares is told."""
    import json

    folder = photographs()
    labels = json.loads((folder / "labels.json").read_text())
    corners = [labels["corners_px"][name] for name in ("a1", "h1", "h8", "a8")]
    gate, caught, frame, told = VideoGate(corners), set(), 0, []
    video = cv2.VideoCapture(str(folder / labels["video"]))
    intervals = [(one["first_frame"], one["last_frame"]) for one in labels["stable_intervals"]]
    while (read := video.read())[0]:
        view = gate.update(np.ascontiguousarray(read[1][..., ::-1]), frame / labels["fps"])
        if gate.seen is not None and gate.seen.settled:
            caught |= {first for first, last in intervals if first <= frame <= last}
        if view is not None:
            told.append(frame)
        frame += 1
    assert frame == labels["n_frames"]
    assert caught == {first for first, _ in intervals}
    start_up = 25  # frames before the first label; the board is free in some of them
    outside = [n for n in told if n > start_up and not any(first - 2 <= n <= last + 2 for first, last in intervals)]
    assert not outside


def test_depth_alone_tells_of_a_hand_as_a_whole_frame_does() -> None:
    scene, whole, bare = Scene(), Watch(), Watch()
    for _ in range(16):
        frame = scene.frame(scene.picture(), scene.depth())
        whole.update(frame, VIEW)
        bare.update(frame, VIEW)
    for y in (-0.30, -0.22, -0.18, -0.15, -0.12, -0.05, 0.0, -0.10, -0.20, -0.40, -0.50, -0.50, -0.50):
        hand = (0.02, y, 0.10)
        frame = scene.frame(scene.picture((0.02, y)), scene.depth(hand))
        assert frame.depth is not None
        seen = whole.update(frame, VIEW)
        told = bare.update(DepthFrame(frame.depth, PINHOLE, frame.stamp), VIEW)
        assert (told.hand_present, told.hand_area, told.over) == (seen.hand_present, seen.hand_area, seen.over)
        assert told.settled <= (not told.hand_present)
    assert not told.hand_present
    for _ in range(12):
        told = bare.update(DepthFrame(scene.depth(), PINHOLE, next(scene.times) * PERIOD), VIEW)
    assert told.settled


@pytest.mark.parametrize("speed", [0.1, 0.2, 0.35])
def test_depth_alone_tells_when_a_piece_has_come_to_rest(speed: float) -> None:
    """One that rolls over the board, 25 mm high: no hand, and the board is settled 0.2 s after it has stopped."""
    scene, watch, stands = Scene(), Watch(), 0.0
    for k in range(60):
        x = -0.10 + speed * PERIOD * min(k, 20)
        bump = np.where(_over(x - 0.013, x + 0.013, -0.02, 0.03), plane_depth(0.025), np.inf)
        depth = np.where(np.isinf(bump), scene.depth(), bump).astype(np.float32)
        stamp = next(scene.times) * PERIOD
        seen = watch.update(DepthFrame(depth, PINHOLE, stamp), VIEW)
        assert not seen.hand_present
        if k == 20:
            stands = stamp
        if 3 <= k <= 20 + 4:
            assert not seen.settled
    assert seen.settled
    assert seen.stable_since is not None
    assert -0.20 - 0.02 / speed < seen.stable_since - stands < 0.10


def _over(left: float, right: float, near: float, far: float) -> NDArray[np.bool_]:
    """Pixels in which a rectangle of the board is seen [m]."""
    where = np.zeros((480, 640), dtype=np.uint8)
    corners = [[left, near, 0.025], [right, near, 0.025], [right, far, 0.025], [left, far, 0.025]]
    cv2.fillConvexPoly(where, np.rint(VIEW.project(corners)).astype(np.int32), 1)
    return where > 0


def test_what_stands_beyond_the_table_is_told_of_where_it_is_and_is_no_hand_over_the_board() -> None:
    scene, watch = Scene(), Watch()
    for _ in range(16):
        seen = watch.update(DepthFrame(scene.depth(), PINHOLE, next(scene.times) * PERIOD), VIEW)
    assert len(seen.away) == 0
    for _ in range(3):
        depth = scene.depth((0.0, -0.205, 0.12))
        seen = watch.update(DepthFrame(depth, PINHOLE, next(scene.times) * PERIOD), VIEW)
    assert not seen.hand_present
    assert len(seen.away) > 20
    assert np.abs(seen.away[:, 0]).max() < 0.045
    assert seen.away[:, 1].max() == pytest.approx(-0.205, abs=0.01)
    assert np.median(seen.away[:, 2]) == pytest.approx(0.12, abs=0.004)


def test_a_hand_before_or_behind_the_arms_outline_is_seen_and_the_arm_is_not() -> None:
    """The outline of something known covers all of the board here; only what is within it in space is left out."""
    scene, everywhere = Scene(), np.ones((480, 640), dtype=np.bool_)
    hand = (0.02, 0.0, 0.10)
    slab = Capsules([[[0.02, -0.16, 0.10], [0.02, -0.14, 0.10]]], [0.17])
    far = Capsules([[[0.02, 0.25, 0.30], [0.10, 0.25, 0.30]]], [0.05])
    for bodies, seen_then in ((None, False), (slab, False), (far, True)):
        watch = Watch()
        for _ in range(3):
            frame = scene.frame(scene.picture(), scene.depth(hand))
            seen = watch.update(frame, VIEW, Hidden(everywhere, bodies))
        assert seen.hand_present is seen_then, bodies


def test_who_looks_again_after_a_pause_knows_the_board_and_no_hand() -> None:
    scene, watch = Scene(), Watch()
    for _ in range(16):
        watch.update(scene.frame(scene.picture(), scene.depth()), VIEW)
    for _ in range(3):
        seen = watch.update(scene.frame(scene.picture((0.02, 0.0)), scene.depth((0.02, 0.0, 0.10))), VIEW)
    assert seen.hand_present
    watch.pause()
    assert not watch.update(scene.frame(scene.picture(), scene.depth()), VIEW).hand_present
    low = (0.02, 0.0, 0.05)  # lower than the tallest piece: only who knows the board sees that it came in
    for _ in range(2):
        seen = watch.update(scene.frame(scene.picture(), scene.depth(low)), VIEW)
    assert seen.hand_present
