"""What a person sees of the table: where pieces stand and where the robot's tool is. For the hand alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hardware.piece_set import PIECE_SHAPES, Kind, PieceShape
from hardware.sim.bodies.hand import FOREARM, PALM, SLEEVE, Bone, HandPose, finger_bones
from hardware.table import Box

Point = tuple[float, float]
_APART: Final = 0.01
"""Points of a way at which it is compared with boxes [m]."""
UPRIGHT: Final = 0.30
"""A piece that leans by less than this stands [rad]."""
OBSTACLES: Final = np.array(
    [
        # half sizes in x and y, lower and upper side above the tool point [m]
        [0.036, 0.013, -0.008, 0.055],  # fingers
        [0.042, 0.018, 0.050, 0.078],  # the gripper's body
        [0.054, 0.054, 0.072, 0.090],  # the flange
        [0.060, 0.060, 0.090, 0.300],  # the rods above it
    ]
)
"""The robot's tool as a person sees it, about the tool point."""


@dataclass(frozen=True, slots=True)
class SeenPiece:
    """A piece."""

    name: str
    kind: Kind
    x: float
    """Of the middle of its foot, board frame [m]."""
    y: float
    z: float
    axis: tuple[float, float, float]
    """Unit vector from its foot to its top."""

    @property
    def shape(self) -> PieceShape:
        """Sizes."""
        return PIECE_SHAPES[self.kind]

    @property
    def tilt(self) -> float:
        """From upright [rad]."""
        return math.acos(max(-1.0, min(1.0, self.axis[2])))

    @property
    def standing(self) -> bool:
        """False where it has fallen over."""
        return self.tilt < UPRIGHT

    @property
    def top(self) -> float:
        """Its highest point above the board [m]."""
        return self.z + max(0.0, self.axis[2]) * self.shape.height + 2.0 * self.shape.foot_radius * math.sin(self.tilt)

    def distance(self, x: float, y: float) -> float:
        """Of its foot from a point [m]; of all that lies on the board from it if it has fallen."""
        dx, dy = x - self.x, y - self.y
        if self.standing:
            return math.hypot(dx, dy)
        i, j, _ = self.axis
        along = min(self.shape.height, max(0.0, dx * i + dy * j))
        return math.hypot(dx - along * i, dy - along * j)


@dataclass(frozen=True, slots=True, eq=False)
class TableView:
    """The table at one moment."""

    pieces: tuple[SeenPiece, ...]
    """All of them."""
    tool: NDArray[np.float64] = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    """The robot's tool point, board frame, shape (3,) [m]."""
    boxes: tuple[Box, ...] = ()
    """On the table, with walls that a hand passes over."""

    def nearest(self, x: float, y: float) -> SeenPiece | None:
        """The piece nearest to a point; None where there are no pieces."""
        return min(self.pieces, key=lambda piece: piece.distance(x, y), default=None)

    def without(self, name: str) -> TableView:
        """All but one piece."""
        return replace(self, pieces=tuple(piece for piece in self.pieces if piece.name != name))

    def find(self, name: str) -> SeenPiece:
        """The piece of that name."""
        return next(piece for piece in self.pieces if piece.name == name)

    def highest(self, begin: Point, end: Point, width: float) -> float:
        """Top of the highest piece or box near a straight line between two points of the board [m], 0 where there is
        none.

        Near is up to ``width`` from it to the middle of a piece's foot, or to a wall [m].
        """
        tops = [piece.top for piece in self.pieces if _distance_to_line(piece, begin, end) < width]
        tops += [box.height for box in self.boxes if _comes_near(box, begin, end, width)]
        return max(tops, default=0.0)

    def pinch_room(self, x: float, y: float, yaw: float, z: float, half_width: float) -> float:
        """Least distance of fingertips beside a point from other pieces [m]; negative where they meet.

        ``yaw`` is of the hand [rad], ``z`` of the fingertips, ``half_width`` from the middle to the middle of a
        fingertip [m].
        """
        room = math.inf
        for piece in self.pieces:
            if piece.top < z - 0.006:
                continue
            radius = piece.shape.foot_radius if z < piece.shape.foot_height + 0.006 else piece.shape.stem_radius
            for side in (-half_width, half_width):
                tip = x + side * math.cos(yaw), y + side * math.sin(yaw)
                room = min(room, piece.distance(*tip) - radius - 0.006)
        return room

    def arm_room(self, *poses: HandPose) -> float:
        """Least distance between the robot's tool and a hand in some poses [m]; negative where they meet."""
        points = np.concatenate([_outline(pose) for pose in poses]) - [*self.tool, 0.0]
        sideways = np.abs(points[:, None, :2]) - OBSTACLES[:, :2]
        upwards = np.maximum(OBSTACLES[:, 2] - points[:, None, 2], points[:, None, 2] - OBSTACLES[:, 3])
        outside = np.concatenate([sideways, upwards[:, :, None]], axis=2)
        distance = np.linalg.norm(np.maximum(outside, 0.0), axis=2) + np.minimum(outside.max(axis=2), 0.0)
        return float((distance - points[:, 3:4]).min())


def _comes_near(box: Box, a: Point, b: Point, width: float) -> bool:
    """Whether a straight line comes closer to a box than so far [m]."""
    at = np.linspace(a, b, 2 + int(math.dist(a, b) / _APART))
    beside = np.abs(at - (box.x, box.y)) - (box.half_x + box.wall, box.half_y + box.wall)
    return bool((np.linalg.norm(np.maximum(beside, 0.0), axis=1) < width).any())


def _distance_to_line(piece: SeenPiece, a: Point, b: Point) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = dx * dx + dy * dy
    share = 0.0 if length == 0.0 else ((piece.x - a[0]) * dx + (piece.y - a[1]) * dy) / length
    share = min(1.0, max(0.0, share))
    return piece.distance(a[0] + share * dx, a[1] + share * dy)


def _dots(bone: Bone, spacing: float = 0.012) -> NDArray[np.float64]:
    start, end, radius = np.array(bone[0]), np.array(bone[1]), bone[2]
    shares = np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(end - start) / spacing))[:, None]
    return np.hstack([start + shares * (end - start), np.full((len(shares), 1), radius)])


_WIDE_PALM: Final[tuple[Bone, ...]] = tuple(
    ((x, PALM[0][1], PALM[0][2]), (0.5 * x, PALM[1][1], PALM[1][2]), PALM[2]) for x in (-0.022, 0.0, 0.030)
)
_FINGERS: Final = {side: np.vstack([_dots(bone) for bone in finger_bones(side)]) for side in (-1, 1)}
_REST: Final = np.vstack([_dots(bone) for bone in (*_WIDE_PALM, FOREARM, SLEEVE)])


def _outline(pose: HandPose) -> NDArray[np.float64]:
    """Balls that fill the hand: centres in the board frame and radii, shape (n, 4) [m]."""
    shifted = [dots + np.array([side * pose.gap, 0.0, 0.0, 0.0]) for side, dots in _FINGERS.items()]
    dots = np.vstack([*shifted, _REST])
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    x, y = dots[:, 0], dots[:, 1]
    return np.column_stack([pose.x + cos * x - sin * y, pose.y + sin * x + cos * y, pose.z + dots[:, 2], dots[:, 3]])
