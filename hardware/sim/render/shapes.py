"""Triangles of what a model shows: its meshes, and the shapes that MuJoCo draws by itself, as finely as it does.

Light is reckoned at the vertices, so how finely a shape is divided is part of how it looks; as everywhere in pictures,
the model's ``vis.quality`` says it. Shapes are of unit size, an instance stretches them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

COARSE = ".coarse"
"""A mesh may have another one of its name and this after it: the same with fewer triangles, for films."""
_COARSE_SLICES = 16
"""Of a small cylinder of which little is seen, and nothing from below."""
_SMOOTH = 0.8
"""A corner's normal is that of its face where the mesh's own is further from it than this (cosine), as MuJoCo has it:
so edges stay sharp."""
_FINEST = 0.03
"""A cylinder is divided along its length and its radius no finer than this [m]: light hardly changes within it."""
_LONGEST_GRID = 200
"""Lines of a plane's grid at most: MuJoCo's ``mjMAXPLANEGRID``."""


class Triangles(NamedTuple):
    """A shape.

    Attributes:
        places: x, y, z of each vertex and by how many radii it lies further along z, shape (n, 4).
        normals: of length 1, shape (n, 3).
        faces: vertices of each triangle, counter-clockwise from outside, shape (m, 3).
    """

    places: NDArray[np.float32]
    normals: NDArray[np.float32]
    faces: NDArray[np.uint32]


def divisions(model: mujoco.MjModel, kind: int, size: NDArray[np.floating]) -> tuple[int, int]:
    """Into how many parts a geom's length and its radius are divided, given its half sizes [m]; (0, 0): as all of its
    kind are.
    """
    if kind != mujoco.mjtGeom.mjGEOM_CYLINDER:
        return 0, 0
    stacks = model.vis.quality.numstacks
    along, out = math.ceil(2.0 * float(size[2]) / _FINEST), math.ceil(float(size[0]) / _FINEST)
    return min(stacks, max(1, along)), min(stacks // 2, max(1, out))


def shape_of(model: mujoco.MjModel, kind: int, data: int, divided: tuple[int, int]) -> Triangles:
    """The triangles of a geom.

    Args:
        model: with the meshes and the fineness of shapes.
        kind: one of ``mujoco.mjtGeom``.
        data: of the geom in the scene: which mesh (two each, the second its hull) or which plane.
        divided: see ``divisions``.

    Raises:
        ValueError: shapes of this kind are not drawn.
    """
    quality = model.vis.quality
    slices, stacks, quads = quality.numslices, quality.numstacks, quality.numquads
    match kind:
        case mujoco.mjtGeom.mjGEOM_MESH:
            return _mesh(model, data // 2)
        case mujoco.mjtGeom.mjGEOM_PLANE:
            planes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
            return _plane(model.geom_size[planes[data]])
        case mujoco.mjtGeom.mjGEOM_BOX:
            return _box(quads)
        case mujoco.mjtGeom.mjGEOM_SPHERE | mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return _together(_dome(slices, stacks // 2, 1.0, 0.0), _dome(slices, stacks // 2, -1.0, 0.0))
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            along, out = divided
            return _together(_tube(slices, along), _disc(slices, out, 1.0), _disc(slices, out, -1.0))
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            domes = _dome(slices, stacks // 2, 1.0, 1.0), _dome(slices, stacks // 2, -1.0, 1.0)
            return _together(_tube(slices, stacks), *domes)
        case _:
            raise ValueError(
                f"a geom of MuJoCo's kind {kind} is not drawn: take a plane, box, sphere, ellipsoid, cylinder, capsule "
                "or mesh"
            )


def coarse_shape_of(model: mujoco.MjModel, kind: int, data: int, divided: tuple[int, int]) -> Triangles | None:
    """What stands for a geom where little is seen of it, as of ``shape_of``; None: it has no such shape."""
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER and divided == (1, 1):  # felt, or the mark of a tray's place
        return _together(_tube(_COARSE_SLICES, 1), _disc(_COARSE_SLICES, 1, 1.0))
    if kind != mujoco.mjtGeom.mjGEOM_MESH:
        return None
    fine = data // 2
    coarse = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MESH, model.mesh(fine).name + COARSE)
    if coarse < 0:
        return None
    shape, turn, back = _mesh(model, coarse), np.empty(9), np.empty(9)  # each mesh is in a frame of its own inertia
    mujoco.mju_quat2Mat(turn, model.mesh_quat[coarse])
    mujoco.mju_quat2Mat(back, model.mesh_quat[fine])
    rotation = back.reshape(3, 3).T @ turn.reshape(3, 3)
    shift = back.reshape(3, 3).T @ (model.mesh_pos[coarse] - model.mesh_pos[fine])
    return _triangles(shape.places[:, :3] @ rotation.T + shift, shape.normals @ rotation.T, shape.faces)


def _mesh(model: mujoco.MjModel, mesh: int) -> Triangles:
    """One vertex for each pair of place and normal that occurs."""
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    corners = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[first : first + count]]
    normals = model.mesh_normal[model.mesh_normaladr[mesh] + model.mesh_facenormal[first : first + count]]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
    sharp = np.einsum("fck,fk->fc", normals, flat) < _SMOOTH
    normals = np.where(sharp[..., None], flat[:, None, :], normals)
    pairs = np.concatenate([corners, normals], axis=2).reshape(-1, 6).astype(np.float32)
    unique, faces = np.unique(pairs, axis=0, return_inverse=True)
    return _triangles(unique[:, :3], unique[:, 3:], faces.reshape(-1, 3))


def _plane(size: NDArray[np.float64]) -> Triangles:
    """A plane of a finite size, half a side along x and y and from line to line of its grid [m], as MuJoCo divides it.

    Raises:
        ValueError: it is infinite.
    """
    if size[0] <= 0.0 or size[1] <= 0.0:
        raise ValueError("an infinite plane is not drawn: give it a size")
    lines = [_grid_lines(half, size[2]) for half in size[:2]]
    x, y = np.meshgrid(*lines, indexing="ij")
    places = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return _triangles(places, np.tile([0.0, 0.0, 1.0], (len(places), 1)), _grid(len(lines[0]), len(lines[1])))


def _grid_lines(half: float, between: float) -> NDArray[np.float64]:
    """Where the lines of a plane's grid run, from one border to the other: an even number of squares, and what is left
    at both ends.
    """
    step = max(between, half / (_LONGEST_GRID - 2))
    inner = int(half // max(step, 1e-15))
    inner -= inner % 2
    margin = half - inner * step
    lines = -half + margin + 2.0 * step * np.arange(inner + 1)
    return np.concatenate([[-half], np.maximum(lines, -half), [half]])


def _box(quads: int) -> Triangles:
    line = np.linspace(-1.0, 1.0, quads + 1)
    u, v = (axis.ravel() for axis in np.meshgrid(line, line, indexing="ij"))
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            places, normals = np.empty((u.size, 3)), np.zeros((u.size, 3))
            across = (axis + 1) % 3, (axis + 2) % 3
            places[:, axis], normals[:, axis] = sign, sign
            places[:, across[0]], places[:, across[1]] = (u, v) if sign > 0.0 else (v, u)
            sides.append(_triangles(places, normals, _grid(quads + 1, quads + 1)))
    return _together(*sides)


def _dome(slices: int, stacks: int, sign: float, beyond: float) -> Triangles:
    """Half a sphere above (sign 1) or below its middle; ``beyond`` 1: its height counts in radii, beyond a tube."""
    around, up = _turn(slices), 0.5 * math.pi * np.arange(stacks) / stacks
    ring = np.stack(
        [
            np.outer(np.cos(up), np.cos(around)),
            np.outer(np.cos(up), np.sin(around)),
            np.broadcast_to(sign * np.sin(up)[:, None], (stacks, slices)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    normals = np.concatenate([ring, [[0.0, 0.0, sign]]])
    faces = _rings(slices, stacks)
    top = np.stack([np.arange(slices), (np.arange(slices) + 1) % slices, np.full(slices, slices)], axis=1)
    top[:, :2] += (stacks - 1) * slices
    top[:, 2] = stacks * slices
    faces = np.concatenate([faces, top])
    places = np.concatenate([normals, np.zeros((len(normals), 1))], axis=1)
    if beyond > 0.0:
        places[:, 3], places[:, 2] = places[:, 2], sign
    return _triangles(places, normals, faces if sign > 0.0 else faces[:, ::-1])


def _tube(slices: int, stacks: int) -> Triangles:
    around, up = _turn(slices), np.linspace(-1.0, 1.0, stacks + 1)
    x, y = np.cos(around), np.sin(around)
    places = np.stack([np.tile(x, stacks + 1), np.tile(y, stacks + 1), np.repeat(up, slices)], axis=1)
    return _triangles(places, places * [1.0, 1.0, 0.0], _rings(slices, stacks + 1))


def _disc(slices: int, stacks: int, sign: float) -> Triangles:
    around, radii = _turn(slices), np.arange(stacks, 0, -1) / stacks
    ring = np.stack([np.outer(radii, np.cos(around)), np.outer(radii, np.sin(around))], axis=-1).reshape(-1, 2)
    places = np.concatenate([np.concatenate([ring, [[0.0, 0.0]]]), np.full((len(ring) + 1, 1), sign)], axis=1)
    faces = _rings(slices, stacks)
    last = (stacks - 1) * slices + np.arange(slices)
    middle = np.stack([last, (stacks - 1) * slices + (np.arange(slices) + 1) % slices, np.full(slices, len(ring))], 1)
    faces = np.concatenate([faces, middle])
    normals = np.tile([0.0, 0.0, sign], (len(places), 1))
    return _triangles(places, normals, faces if sign > 0.0 else faces[:, ::-1])


def _turn(slices: int) -> NDArray[np.float64]:
    return 2.0 * math.pi * np.arange(slices) / slices


def _rings(slices: int, rings: int) -> NDArray[np.int64]:
    """Triangles between closed rings of vertices, each over the one before."""
    ring, slot = np.meshgrid(np.arange(rings - 1), np.arange(slices), indexing="ij")
    a, b = ring * slices + slot, ring * slices + (slot + 1) % slices
    return _halved(np.stack([a, b, b + slices, a + slices], axis=-1).reshape(-1, 4))


def _grid(rows: int, columns: int) -> NDArray[np.int64]:
    """Triangles of a grid of vertices whose rows go along x and columns along y."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = row * columns + column
    return _halved(np.stack([a, a + columns, a + columns + 1, a + 1], axis=-1).reshape(-1, 4))


def _halved(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    """Two triangles of each quadrangle, cut as OpenGL cuts one."""
    return np.concatenate([quads[:, [0, 1, 3]], quads[:, [1, 2, 3]]])


def _triangles(places: NDArray[np.floating], normals: NDArray[np.floating], faces: NDArray[np.integer]) -> Triangles:
    if places.shape[1] == 3:
        places = np.concatenate([places, np.zeros((len(places), 1))], axis=1)
    return Triangles(places.astype(np.float32), normals.astype(np.float32), faces.astype(np.uint32))


def _together(*parts: Triangles) -> Triangles:
    starts = np.cumsum([0, *(len(part.places) for part in parts)])
    faces = [part.faces + np.uint32(start) for part, start in zip(parts, starts[:-1], strict=True)]
    return Triangles(
        np.concatenate([part.places for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate(faces),
    )
