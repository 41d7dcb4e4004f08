"""Shapes of turned pieces, for whoever draws them: profiles as (radius, height), their meshes of revolution, and what
is carved: a rook's battlements, a queen's coronet, a king's cross, a knight's head.

Nothing above the foot is wider than the stem that the gripper holds.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.piece_set import FELT_HEIGHT, PIECE_PROFILES, PIECE_SHAPES, Kind, piece_profile

SEGMENTS = 20
COARSE_SEGMENTS: Final = 10
"""Around a piece of which little is seen, but for one that is carved in a number of teeth that does not divide it."""
COARSE_TOLERANCE: Final = 0.0004
"""By which the outline of such a piece may be off [m]: half a pixel of a film."""

KING_CROSS: Final = (((0.13, 0.13, 0.05), 0.05), ((0.4, 0.13, 0.014), 0.04))
"""Its upright and its arm: half the size along x and y in stem radii and along z as height above, and how far the
middle lies below the king's top, as height above."""

Mesh = tuple[NDArray[np.float64], NDArray[np.int32]]
"""Vertices (n, 3) [m] and triangles (m, 3)."""


class Carving(NamedTuple):
    """What is cut into a turned piece.

    Attributes:
        rings: of ``PIECE_PROFILES`` that are not level all around: which, from 0.
        height: by which they rise or sink, as part of the piece's whole height; negative: they sink.
        teeth: so many around the piece.
        square: cut straight down over two fifths of each tooth's share; else a wave.
    """

    rings: tuple[int, ...]
    height: float
    teeth: int
    square: bool


CARVINGS: Final[dict[Kind, Carving]] = {
    Kind.ROOK: Carving((8, 9), -0.09, 4, square=True),  # battlements
    Kind.QUEEN: Carving((10,), 0.03, 5, square=False),  # a coronet
}

# Neck and head of the knight, seen from the side: (y in stem radii, height as above); it looks towards +y.
KNIGHT_HEAD: Final = (
    (-0.85, 0.17), (0.8, 0.17), (0.7, 0.28), (0.4, 0.42), (0.3, 0.5), (0.55, 0.5), (0.9, 0.47), (1.0, 0.54),
    (0.95, 0.62), (0.55, 0.78), (0.25, 0.88), (0.15, 1.0), (-0.1, 0.91), (-0.5, 0.82), (-0.85, 0.62), (-0.95, 0.38),
)  # fmt: skip
KNIGHT_LAYERS: Final = ((-0.62, 0.7), (-0.34, 1.0), (0.34, 1.0), (0.62, 0.7))
"""Across the head: (x in stem radii, scale of the outline), so that its edges are rounded off."""


@cache
def turned_mesh(kind: Kind, *, coarse: bool = False) -> Mesh:
    """Vertices (n, 3) [m], origin at the centre of the foot's underside, and triangles (m, 3) of one kind.

    ``coarse``: with a third of the triangles, for films.
    """
    profile, segments, carving = _profile(kind), SEGMENTS, CARVINGS.get(kind)
    if coarse:
        teeth = 1 if carving is None else carving.teeth
        segments = math.ceil(COARSE_SEGMENTS / teeth) * teeth
        profile = _thinned(profile) if carving is None else profile
    parts = [_revolve(profile, _carving(kind, segments), segments)]
    if kind is Kind.KNIGHT:
        parts.append(_horse_head(kind))
    if kind is Kind.KING:
        parts += _cross(kind)
    return _together(parts)


def _profile(kind: Kind) -> list[tuple[float, float]]:
    return [(0.0, FELT_HEIGHT), *piece_profile(kind)[2:]]


def _thinned(profile: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Those points of an outline without which it would be off by more than the tolerance (Ramer, Douglas, Peucker)."""
    points = np.array(profile)
    along, off = points[-1] - points[0], points - points[0]
    away = np.abs(off[:, 0] * along[1] - off[:, 1] * along[0]) / max(float(np.linalg.norm(along)), 1e-12)
    furthest = int(np.argmax(away))
    if away[furthest] <= COARSE_TOLERANCE:
        return [profile[0], profile[-1]]
    return [*_thinned(profile[: furthest + 1])[:-1], *_thinned(profile[furthest:])]


def _carving(kind: Kind, segments: int) -> Callable[[int, int], float]:
    """By how much a ring's vertex stands higher than the profile, as part of the piece above the foot."""
    carving = CARVINGS.get(kind)
    first = len(_profile(kind)) - len(PIECE_PROFILES[kind]) - 2  # of the profile above the foot, among all rings
    carved = {first + ring for ring in carving.rings} if carving else set()

    def lift(ring: int, segment: int) -> float:
        if carving is None or ring not in carved:
            return 0.0
        share = segments // carving.teeth
        if carving.square:
            return carving.height if segment % share < 2 * share // 5 else 0.0
        return carving.height * math.cos(2.0 * math.pi * segment / share)

    return lift


def _revolve(profile: list[tuple[float, float]], lift: Callable[[int, int], float], segments: int) -> Mesh:
    rings = profile[1:-1]
    top = max(height for _radius, height in profile)
    angles = 2.0 * np.pi * np.arange(segments) / segments
    vertices = [[0.0, 0.0, profile[0][1]]]
    for number, (radius, height) in enumerate(rings):
        for segment, a in enumerate(angles):
            vertices.append([radius * math.cos(a), radius * math.sin(a), height + top * lift(number, segment)])
    vertices.append([0.0, 0.0, profile[-1][1]])
    end = len(vertices) - 1
    faces: list[list[int]] = []
    for i in range(segments):
        j = (i + 1) % segments
        faces.append([0, 1 + j, 1 + i])
        for ring in range(len(rings) - 1):
            a, b = 1 + ring * segments, 1 + (ring + 1) * segments
            faces += [[a + i, a + j, b + j], [a + i, b + j, b + i]]
        last = 1 + (len(rings) - 1) * segments
        faces.append([last + i, last + j, end])
    return np.array(vertices), np.array(faces, dtype=np.int32)


def _horse_head(kind: Kind) -> Mesh:
    """Neck and head: the outline in layers across, the outer ones smaller."""
    shape = PIECE_SHAPES[kind]
    low, span = shape.foot_height, shape.height - shape.foot_height
    outline = np.array([[y * shape.stem_radius, low + f * span] for y, f in KNIGHT_HEAD])
    middle = np.array([-0.1 * shape.stem_radius, low + 0.55 * span])
    n = len(outline)
    vertices, faces = [], []
    for x, scale in KNIGHT_LAYERS:
        ring = middle + scale * (outline - middle)
        ring[:, 1] = np.minimum(np.maximum(ring[:, 1], low + 0.15 * span), shape.height)
        vertices += [[x * shape.stem_radius, y, z] for y, z in ring]
    for layer in range(len(KNIGHT_LAYERS) - 1):
        a, b = layer * n, (layer + 1) * n
        for i in range(n):
            j = (i + 1) % n
            faces += [[a + i, a + j, b + j], [a + i, b + j, b + i]]
    for layer, turned in ((0, True), (len(KNIGHT_LAYERS) - 1, False)):
        centre = len(vertices)
        vertices.append([KNIGHT_LAYERS[layer][0] * shape.stem_radius, *middle.tolist()])
        for i in range(n):
            a, b = layer * n + i, layer * n + (i + 1) % n
            faces.append([centre, b, a] if turned else [centre, a, b])
    return np.array(vertices), np.array(faces, dtype=np.int32)


def _cross(kind: Kind) -> list[Mesh]:
    """On top of the king: an upright and an arm."""
    shape = PIECE_SHAPES[kind]
    r, top, span = shape.stem_radius, shape.height, shape.height - shape.foot_height
    return [_box((x * r, y * r, z * span), top - below * span) for (x, y, z), below in KING_CROSS]


def _box(half: tuple[float, float, float], height: float) -> Mesh:
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]) * half
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [triangle for a, b, c, d in quads for triangle in ([a, b, c], [a, c, d])]
    return corners + np.array([0.0, 0.0, height]), np.array(faces, dtype=np.int32)


def _together(parts: list[Mesh]) -> Mesh:
    vertices, faces, count = [], [], 0
    for points, triangles in parts:
        vertices.append(points)
        faces.append(triangles + count)
        count += len(points)
    return np.vstack(vertices), np.vstack(faces).astype(np.int32)
