"""Shapes of turned pieces for the camera: profiles as (radius, height) and their meshes of revolution."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hardware.table import PIECE_SHAPES, Kind

SEGMENTS = 20

# Profiles above the foot: (radius in stem radii, height as a fraction from the foot's top to the piece's top).
_PROFILES: dict[Kind, tuple[tuple[float, float], ...]] = {
    Kind.PAWN: (
        (0.95, 0.05), (0.62, 0.35), (0.6, 0.5), (0.95, 0.55), (0.6, 0.6), (0.9, 0.7), (1.0, 0.8), (0.85, 0.92),
        (0.45, 0.98),
    ),
    Kind.ROOK: ((1.0, 0.05), (0.8, 0.35), (0.78, 0.6), (1.0, 0.7), (1.0, 1.0), (0.65, 1.0), (0.65, 0.88)),
    Kind.KNIGHT: ((1.0, 0.05), (0.85, 0.2), (0.75, 0.3)),
    Kind.BISHOP: (
        (1.0, 0.04), (0.6, 0.35), (0.55, 0.55), (0.95, 0.6), (0.55, 0.64), (0.85, 0.74), (0.8, 0.84), (0.35, 0.95),
        (0.4, 0.97), (0.3, 0.995),
    ),
    Kind.QUEEN: (
        (1.0, 0.04), (0.6, 0.35), (0.58, 0.6), (1.0, 0.65), (0.6, 0.69), (0.75, 0.8), (1.0, 0.92), (0.7, 0.93),
        (0.35, 0.95), (0.4, 0.985),
    ),
    Kind.KING: (
        (1.0, 0.04), (0.62, 0.35), (0.6, 0.58), (1.0, 0.63), (0.62, 0.67), (0.75, 0.78), (0.95, 0.88), (0.5, 0.9),
        (0.2, 0.91), (0.2, 0.99),
    ),
}  # fmt: skip

# Neck and head of the knight, seen from the side: (y in stem radii, height as above).
_HORSE = (
    (-0.95, 0.15), (0.85, 0.15), (0.55, 0.45), (1.0, 0.55), (0.95, 0.72), (0.3, 0.95), (0.1, 1.0), (-0.5, 0.85),
    (-0.95, 0.5),
)  # fmt: skip


def _profile(kind: Kind) -> list[tuple[float, float]]:
    shape = PIECE_SHAPES[kind]
    foot = [
        (0.0, 0.0),
        (shape.foot_radius, 0.0),
        (shape.foot_radius, 0.45 * shape.foot_height),
        (0.9 * shape.foot_radius, 0.65 * shape.foot_height),
        (0.75 * shape.foot_radius, shape.foot_height),
    ]
    span = shape.height - shape.foot_height
    body = [(r * shape.stem_radius, shape.foot_height + f * span) for r, f in _PROFILES[kind]]
    return [*foot, *body, (0.0, body[-1][1])]


def _revolve(profile: list[tuple[float, float]]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    rings = profile[1:-1]
    angles = 2.0 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    vertices = [[0.0, 0.0, profile[0][1]]]
    for radius, height in rings:
        vertices.extend([radius * math.cos(a), radius * math.sin(a), height] for a in angles)
    vertices.append([0.0, 0.0, profile[-1][1]])
    top = len(vertices) - 1
    faces: list[list[int]] = []
    for i in range(SEGMENTS):
        j = (i + 1) % SEGMENTS
        faces.append([0, 1 + j, 1 + i])
        for ring in range(len(rings) - 1):
            a, b = 1 + ring * SEGMENTS, 1 + (ring + 1) * SEGMENTS
            faces += [[a + i, a + j, b + j], [a + i, b + j, b + i]]
        last = 1 + (len(rings) - 1) * SEGMENTS
        faces.append([last + i, last + j, top])
    return np.array(vertices), np.array(faces, dtype=np.int32)


def _horse_head(kind: Kind) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A side view of neck and head, cut from a board as thick as the stem; faces +y."""
    shape = PIECE_SHAPES[kind]
    r, low, span = shape.stem_radius, shape.foot_height, shape.height - shape.foot_height
    sides = []
    for x in (-0.55 * r, 0.55 * r):
        sides += [[x, y * r, low + f * span] for y, f in _HORSE]
    n = len(_HORSE)
    centres = [[-0.6 * r, 0.0, low + 0.5 * span], [0.6 * r, 0.0, low + 0.5 * span]]
    faces = []
    for i in range(n):
        j = (i + 1) % n
        faces += [[2 * n, j, i], [2 * n + 1, n + i, n + j], [i, j, n + j], [i, n + j, n + i]]
    return np.array(sides + centres), np.array(faces, dtype=np.int32)


def turned_mesh(kind: Kind) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices (n, 3) [m], origin at the centre of the foot's underside, and triangles (m, 3) of one kind."""
    vertices, faces = _revolve(_profile(kind))
    if kind is not Kind.KNIGHT:
        return vertices, faces
    head, head_faces = _horse_head(kind)
    return np.vstack([vertices, head]), np.vstack([faces, head_faces + len(vertices)]).astype(np.int32)
