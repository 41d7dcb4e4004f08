"""Board, trays, boxes, pieces, light and camera as MuJoCo bodies; and the compiled model of the whole world."""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.parameters import RobotParameters
from hardware.piece_set import FELT_HEIGHT, FELT_RADIUS, PIECE_SHAPES, Colour, Kind, PieceShape
from hardware.sim.bodies.arm import (
    SCENE_BITS,
    TOOL_BITS,
    add_arm,
    add_contact_sensors,
    start_positions,
    stiffen_closures,
)
from hardware.sim.bodies.board_texture import board_png
from hardware.sim.bodies.friction_and_stiffness import (
    FOOT_FRICTION,
    FOOT_ON_BOARD,
    LINED,
    WALL,
    WOOD_FRICTION,
    give_stiffness,
)
from hardware.sim.bodies.mujoco_contact import Contact
from hardware.sim.bodies.placed import AS_BELIEVED, FOOT_SIDE, BoardOffset, StandingPiece
from hardware.sim.render.d435 import COLOUR_FIELD_OF_VIEW
from hardware.sim.render.lamps import lamps, set_ambient
from hardware.sim.render.settings import LightSettings
from hardware.sim.render.shapes import COARSE
from hardware.table import TableSettings
from hardware.turned_shapes import turned_mesh

STANDARD_GRAVITY = 9.80665
"""[m/s²]"""
SLEEP_TOLERANCE = 1e-3
"""A resting piece falls asleep below this velocity [m/s, scaled]."""

PIECE_RGBA = {Colour.WHITE: [0.87, 0.76, 0.58, 1.0], Colour.BLACK: [0.16, 0.11, 0.09, 1.0]}
SQUARES_FILE = "squares.png"
FELT_RGBA = [0.10, 0.22, 0.14, 1.0]
BOX_RGBA, LINING_RGBA = [0.52, 0.38, 0.25, 1.0], [0.20, 0.27, 0.36, 1.0]
LINING = 0.003
"""Thickness of what pieces fall on in a box [m]."""


@dataclass(frozen=True, slots=True)
class CameraStand:
    """Where a camera hangs: position and point looked at in the board frame [m], vertical field of view [rad]."""

    position: tuple[float, float, float] = (0.0, 0.46, 0.44)
    target: tuple[float, float, float] = (0.0, 0.02, 0.0)
    field_of_view: float = COLOUR_FIELD_OF_VIEW

    def axes(self) -> NDArray[np.float64]:
        """The camera's x right, y down and z along the view in the board frame, (3, 3), one row each."""
        forward = np.subtract(self.target, self.position)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(forward, right), forward])


CAMERAS = {"camera": CameraStand(), "film": CameraStand((0.44, -0.60, 0.36), (0.0, 0.0, 0.12), math.radians(46.0))}
"""Views: the board's camera, beside the base; and one that films the whole arm."""


def deck_half_size(table: TableSettings) -> tuple[float, float]:
    """Of the board with its trays and boxes, along x and y [m]."""
    half_y = max(4.0 * table.square, table.tray_rows * table.tray_row_pitch / 2.0) + 0.018
    return table.half_width, max([half_y, *(box.half_y + box.wall for box in table.boxes())])


def _add_deck(spec: mujoco.MjSpec, table: TableSettings) -> None:
    half_board = 4.0 * table.square
    half_x, half_y = deck_half_size(table)
    # the board is let into the table, whose top goes on at the same height: an infinite plane costs the least
    spec.worldbody.add_geom(
        name="deck", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.5, 1.5, 0.1], contype=SCENE_BITS,
        conaffinity=SCENE_BITS | TOOL_BITS, friction=[WOOD_FRICTION, 0.005, 0.0001], rgba=[0.55, 0.58, 0.60, 1.0],
        pos=[0, 0, 0],
    )  # fmt: skip
    spec.worldbody.add_geom(
        name="rim", type=mujoco.mjtGeom.mjGEOM_BOX, size=[half_x, half_y, 0.00015], pos=[0, 0, 0], contype=0,
        conaffinity=0, rgba=[0.36, 0.25, 0.17, 1.0],
    )  # fmt: skip
    spec.assets[SQUARES_FILE] = board_png()
    spec.add_texture(name="squares", type=mujoco.mjtTexture.mjTEXTURE_2D, file=SQUARES_FILE)
    material = spec.add_material(name="squares", reflectance=0.0, specular=0.2)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "squares"
    spec.worldbody.add_geom(
        name="squares", type=mujoco.mjtGeom.mjGEOM_BOX, size=[half_board, half_board, 0.0003], material="squares",
        contype=0, conaffinity=0, pos=[0, 0, 0.0],
    )  # fmt: skip
    for place in table.tray_places():
        x, y = table.xy(place)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.0135, 0.0003, 0], pos=[x, y, 0.0], contype=0, conaffinity=0,
            rgba=[0.47, 0.34, 0.24, 1.0],
        )  # fmt: skip


def _add_boxes(spec: mujoco.MjSpec, table: TableSettings) -> None:
    """Four walls and a lined floor each; the walls stop the tool, too."""
    for box in table.boxes():
        wide, deep, half = box.half_x + box.wall, box.half_y + box.wall, box.wall / 2.0
        walls = {
            "a": (-box.half_x - half, 0.0, half, deep), "b": (box.half_x + half, 0.0, half, deep),
            "c": (0.0, -box.half_y - half, wide, half), "d": (0.0, box.half_y + half, wide, half),
        }  # fmt: skip
        for name, (x, y, half_x, half_y) in walls.items():
            spec.worldbody.add_geom(
                name=f"{WALL}{box.zone}.{name}", type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[half_x, half_y, box.height / 2.0], pos=[box.x + x, box.y + y, box.height / 2.0],
                contype=SCENE_BITS, conaffinity=SCENE_BITS | TOOL_BITS, friction=[WOOD_FRICTION, 0.002, 0.0001],
                rgba=BOX_RGBA,
            )  # fmt: skip
        spec.worldbody.add_geom(
            name=f"{LINED}{box.zone}", type=mujoco.mjtGeom.mjGEOM_BOX, size=[box.half_x, box.half_y, LINING / 2.0],
            pos=[box.x, box.y, LINING / 2.0], contype=SCENE_BITS, conaffinity=SCENE_BITS | TOOL_BITS,
            friction=[FOOT_FRICTION, 0.002, 0.0001], rgba=LINING_RGBA,
        )  # fmt: skip


def camera_poses(table: TableSettings) -> dict[str, CameraStand]:
    """Views of a table: of one that is larger than the usual one from as much further away."""
    ratios = np.divide(deck_half_size(table), deck_half_size(TableSettings()))
    scale = max(1.0, float(ratios.max()))
    return {
        name: replace(pose, position=_scaled(pose.position, scale), target=_scaled(pose.target, scale))
        for name, pose in CAMERAS.items()
    }


def _scaled(point: tuple[float, float, float], scale: float) -> tuple[float, float, float]:
    x, y, z = point
    return scale * x, scale * y, scale * z


def _add_surroundings(spec: mujoco.MjSpec, table: TableSettings, offset: BoardOffset) -> None:
    spec.add_texture(
        name="room", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.82, 0.85, 0.88], rgb2=[0.55, 0.58, 0.62], width=128, height=768,
    )  # fmt: skip
    _add_lights(spec)
    for name, pose in camera_poses(table).items():
        seen = replace(pose, position=offset.in_true(pose.position), target=offset.in_true(pose.target))
        add_camera(spec, name, seen)


def _add_lights(spec: mujoco.MjSpec) -> None:
    """Lamps as ``LightSettings`` has them by default; the renderer sets them as they are (``render.lamps``)."""
    for lamp in lamps(LightSettings()):
        spec.worldbody.add_light(**asdict(lamp), ambient=[0.0, 0.0, 0.0])
    set_ambient(spec.visual.headlight, LightSettings())


def add_camera(spec: mujoco.MjSpec, name: str, stand: CameraStand) -> None:
    """Hang a camera over a scene."""
    right, down, forward = stand.axes()
    view = spec.worldbody.add_camera(name=name, pos=list(stand.position), fovy=math.degrees(stand.field_of_view))
    rotation = np.column_stack([right, -down, -forward])  # MuJoCo looks along -z with y up
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, rotation.ravel())
    view.quat = quat.tolist()


def _piece_inertia(shape: PieceShape) -> tuple[tuple[float, float, float], list[float]]:
    """Centre of mass and diagonal inertia: a solid cylinder between stem and foot in radius, weighted low."""
    radius = 0.5 * (shape.foot_radius + shape.stem_radius)
    across = shape.mass * (3.0 * radius**2 + shape.height**2) / 12.0
    return (0.0, 0.0, 0.38 * shape.height), [across, across, 0.5 * shape.mass * radius**2]


def _add_piece(spec: mujoco.MjSpec, piece: StandingPiece) -> None:
    """A foot, which stands on felt, and a stem; two shapes are enough for all that the gripper and the table feel."""
    shape = PIECE_SHAPES[piece.spec.kind]
    cos, sin = math.cos(piece.yaw / 2.0), math.sin(piece.yaw / 2.0)
    upright, over = math.cos(piece.tip / 2.0), math.sin(piece.tip / 2.0)
    body = spec.worldbody.add_body(
        name=piece.spec.name,
        pos=[piece.x, piece.y, piece.height],
        quat=[cos * upright, cos * over, sin * over, sin * upright],
    )
    body.add_freejoint(name=piece.spec.name)
    centre, inertia = _piece_inertia(shape)
    body.mass, body.ipos, body.explicitinertial = piece.mass * shape.mass, list(centre), True
    body.inertia = [piece.mass * moment for moment in inertia]
    side = FOOT_SIDE * shape.foot_radius
    common = {
        "mass": 0.0, "rgba": [0.0, 0.0, 0.0, 0.0], "group": 3, "contype": SCENE_BITS,
        "conaffinity": TOOL_BITS | SCENE_BITS,
    }  # fmt: skip
    body.add_geom(
        name=f"{piece.spec.name}.foot", type=mujoco.mjtGeom.mjGEOM_BOX, pos=[0, 0, shape.foot_height / 2.0],
        size=[side, side, shape.foot_height / 2.0], friction=[piece.friction * FOOT_FRICTION, 0.002, 0.0001], **common,
    )  # fmt: skip
    body.add_geom(
        name=f"{piece.spec.name}.stem", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[shape.stem_radius, 0, 0],
        fromto=[0, 0, shape.stem_radius + 0.001, 0, 0, shape.height - shape.stem_radius],
        friction=[WOOD_FRICTION, 0.002, 0.0001], **common,
    )  # fmt: skip


def _dress(body: mujoco.MjsBody, piece: StandingPiece) -> None:
    """What is seen of a piece: lacquered wood on felt."""
    foot = PIECE_SHAPES[piece.spec.kind].foot_radius
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname=piece.spec.kind.value, contype=0, conaffinity=0, mass=0.0,
        material=piece.spec.colour.value, group=1,
    )  # fmt: skip
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, contype=0, conaffinity=0, mass=0.0, rgba=FELT_RGBA, group=1,
        size=[FELT_RADIUS * foot, FELT_HEIGHT / 2.0, 0], pos=[0, 0, FELT_HEIGHT / 2.0],
    )  # fmt: skip


def _add_looks(spec: mujoco.MjSpec) -> None:
    """Quality of pictures, and the meshes of the pieces."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
    spec.visual.quality.shadowsize = 2048
    # discs and cylinders need no more, and more is slow
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 24, 6
    spec.visual.map.znear = 0.02
    for colour, rgba in PIECE_RGBA.items():
        spec.add_material(name=colour.value, rgba=rgba, specular=0.35, shininess=0.6)  # lacquered wood
    for kind in Kind:
        for name, coarse in ((kind.value, False), (kind.value + COARSE, True)):
            vertices, faces = turned_mesh(kind, coarse=coarse)
            mesh = spec.add_mesh(name=name)
            mesh.uservert, mesh.userface = vertices.ravel().tolist(), faces.ravel().tolist()
            mesh.smoothnormal = True


def _drop_looks(spec: mujoco.MjSpec) -> None:
    """Take out what is only seen; MuJoCo's search for contacts looks at every shape of a body that can touch."""
    for geom in list(spec.geoms):
        if geom.contype == 0 and geom.conaffinity == 0:
            spec.delete(geom)
    for part in (*spec.meshes, *spec.materials, *spec.textures):
        spec.delete(part)


def build_model(
    parameters: RobotParameters,
    table: TableSettings,
    pieces: tuple[StandingPiece, ...],
    home: NDArray[np.float64],
    timestep: float | None = None,
    *,
    looks: bool = True,
    feet: Contact = FOOT_ON_BOARD.contact,
    offset: BoardOffset = AS_BELIEVED,
    add: Callable[[mujoco.MjSpec], None] | None = None,
) -> mujoco.MjModel:
    """Compile the world, whose frame is the board frame, z up; key frame 0 holds the whole start state.

    Args:
        parameters: robot.
        table: board and trays.
        pieces: every physical piece with its pose.
        home: tool point in the base frame at which the arm starts [m]; ``ValueError`` where it does not reach.
        timestep: of the integration [s], default the drive's tick.
        looks: with all that is only seen. Without it a step is quicker, and what happens is the same.
        feet: of the pieces, on the board.
        offset: where the table really stands; robot and cameras stay where they are.
        add: puts something more into the world.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "touchmove"
    option = spec.option
    option.timestep = timestep or parameters.drive.tick
    option.gravity = [0.0, 0.0, -STANDARD_GRAVITY]  # MuJoCo's own 9.81 would let a weighed-out arm fall by 3 mm/s²
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 100.0  # a shaken king slips 0.05 mm; at 20, 0.14 mm
    option.noslip_iterations = 0
    option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    option.sleep_tolerance = SLEEP_TOLERANCE
    _add_looks(spec)
    _add_deck(spec, table)
    _add_boxes(spec, table)
    _add_surroundings(spec, table, offset)
    x, y, z = table.board_from_base(np.zeros(3)).tolist()
    add_arm(spec, parameters, offset.in_true((x, y, z)), offset.turn + table.yaw_in_base)
    for piece in pieces:
        _add_piece(spec, piece)
        if looks:
            _dress(spec.body(piece.spec.name), piece)
    if add is not None:
        add(spec)
    add_contact_sensors(spec)
    if not looks:
        _drop_looks(spec)
    model = spec.compile()
    give_stiffness(spec, model, parameters.pads, {p.spec.name: p.friction for p in pieces}, feet)
    start = start_positions(model, parameters, home, parameters.gripper.stroke / 2.0)
    spec.add_key(name="start").qpos = start.tolist()
    model = spec.compile()
    stiffen_closures(model)
    return model
