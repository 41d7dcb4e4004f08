"""Board, trays, pieces, light and camera as MuJoCo bodies; and the compiled model of the whole world."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.parameters import RobotParameters
from hardware.sim.arm import SCENE_BITS, TOOL_BITS, add_arm, inverse_kinematics
from hardware.sim.contact import Contact, set_solver
from hardware.sim.turning import turned_mesh
from hardware.table import PIECE_SHAPES, Colour, Kind, PieceShape, PieceSpec, TableSettings

FEET = 6
FOOT_PAD_RADIUS = 0.0015
FOOT_FRICTION = 0.45
"""Felt on lacquered wood (assumed)."""
FELT = Contact(stiffness=1.0e5, mass=1.1, damping_ratio=0.2, followed=0.2)
"""Feet on the board, as a piece in the fingers meets it: 100 N/mm with the mass of the arm behind it. Felt of 2 mm on
2 cm² (assumed: its modulus is some MPa); it gives back little of what it takes."""
SLEEP_TOLERANCE = 1e-3
"""A resting piece falls asleep below this velocity [m/s, scaled]."""

PIECE_RGBA = {Colour.WHITE: [0.87, 0.76, 0.58, 1.0], Colour.BLACK: [0.16, 0.11, 0.09, 1.0]}


@dataclass(frozen=True, slots=True)
class CameraPose:
    """Where a camera hangs: position and point looked at in the board frame [m], vertical field of view [rad]."""

    position: tuple[float, float, float] = (0.0, 0.46, 0.44)
    target: tuple[float, float, float] = (0.0, 0.02, 0.0)
    field_of_view: float = math.radians(43.0)


CAMERAS = {
    "camera": CameraPose(),
    "film": CameraPose((0.44, -0.60, 0.36), (0.0, 0.0, 0.12), math.radians(46.0)),
}
"""Views: the board's camera, beside the base; and one that films the whole arm."""


@dataclass(frozen=True, slots=True)
class StandingPiece:
    """One piece as it is put down before the start: its spec and exact pose in the board frame [m, rad].

    Attributes:
        spec: name, kind, colour, place.
        x: of its centre.
        y: of its centre.
        yaw: about its axis.
        height: of what it stands on, above the board.
    """

    spec: PieceSpec
    x: float
    y: float
    yaw: float = 0.0
    height: float = 0.0


def deck_half_size(table: TableSettings) -> tuple[float, float]:
    """Of the board with its trays, along x and y [m]."""
    half_board = 4.0 * table.square
    half_x = half_board + table.tray_gap + (table.tray_columns - 1) * table.tray_column_pitch + 0.028
    return half_x, max(half_board, table.tray_rows * table.tray_row_pitch / 2.0) + 0.018


def _add_deck(spec: mujoco.MjSpec, table: TableSettings) -> None:
    half_board = 4.0 * table.square
    half_x, half_y = deck_half_size(table)
    spec.worldbody.add_geom(
        name="deck", type=mujoco.mjtGeom.mjGEOM_BOX, size=[half_x, half_y, 0.01], pos=[0, 0, -0.01],
        contype=SCENE_BITS, conaffinity=SCENE_BITS | TOOL_BITS, friction=[FOOT_FRICTION, 0.005, 0.0001],
        rgba=[0.36, 0.25, 0.17, 1.0],
    )  # fmt: skip
    spec.add_texture(
        name="squares", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.90, 0.82, 0.68], rgb2=[0.45, 0.28, 0.16], width=512, height=512,
    )  # fmt: skip
    material = spec.add_material(name="squares", texrepeat=[4, 4], reflectance=0.0, specular=0.2)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "squares"
    spec.worldbody.add_geom(
        name="squares", type=mujoco.mjtGeom.mjGEOM_BOX, size=[half_board, half_board, 0.0002], material="squares",
        contype=0, conaffinity=0, pos=[0, 0, 0.0],
    )  # fmt: skip
    for place in table.tray_places():
        x, y = table.xy(place)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.0135, 0.0002, 0], pos=[x, y, 0.0], contype=0, conaffinity=0,
            rgba=[0.47, 0.34, 0.24, 1.0],
        )  # fmt: skip


def _add_surroundings(spec: mujoco.MjSpec) -> None:
    spec.worldbody.add_geom(
        name="desk", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.5, 1.5, 0.1], pos=[0, 0, -0.02],
        contype=SCENE_BITS, conaffinity=SCENE_BITS, rgba=[0.55, 0.58, 0.60, 1.0],
    )  # fmt: skip
    spec.add_texture(
        name="room", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.82, 0.85, 0.88], rgb2=[0.55, 0.58, 0.62], width=128, height=768,
    )  # fmt: skip
    spec.worldbody.add_light(
        pos=[0.9, 0.5, 1.0], dir=[-0.9, -0.5, -1.0], diffuse=[0.55, 0.55, 0.53], ambient=[0.25, 0.25, 0.26],
        specular=[0.2, 0.2, 0.2], castshadow=True,
    )  # fmt: skip
    spec.worldbody.add_light(
        pos=[-0.8, -0.4, 1.2], dir=[0.8, 0.4, -1.0], diffuse=[0.35, 0.35, 0.37], castshadow=False, specular=[0, 0, 0]
    )
    for name, pose in CAMERAS.items():
        _add_camera(spec, name, pose)


def _add_camera(spec: mujoco.MjSpec, name: str, pose: CameraPose) -> None:
    forward = np.subtract(pose.target, pose.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    view = spec.worldbody.add_camera(name=name, pos=list(pose.position), fovy=math.degrees(pose.field_of_view))
    rotation = np.column_stack([right, -down, -forward])  # MuJoCo looks along -z with y up
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, rotation.ravel())
    view.quat = quat.tolist()


def _piece_inertia(shape: PieceShape) -> tuple[tuple[float, float, float], list[float]]:
    """Centre of mass and diagonal inertia: a solid cylinder between stem and foot in radius, weighted low."""
    radius = 0.5 * (shape.foot_radius + shape.stem_radius)
    across = shape.mass * (3.0 * radius**2 + shape.height**2) / 12.0
    return (0.0, 0.0, 0.38 * shape.height), [across, across, 0.5 * shape.mass * radius**2]


def _add_piece(spec: mujoco.MjSpec, piece: StandingPiece, feet: Contact) -> None:
    shape = PIECE_SHAPES[piece.spec.kind]
    solver = feet.solver(shape.mass, FEET)
    half = piece.yaw / 2.0
    body = spec.worldbody.add_body(
        name=piece.spec.name, pos=[piece.x, piece.y, piece.height], quat=[math.cos(half), 0.0, 0.0, math.sin(half)]
    )
    body.add_freejoint(name=piece.spec.name)
    centre, inertia = _piece_inertia(shape)
    body.mass, body.ipos, body.inertia, body.explicitinertial = shape.mass, list(centre), inertia, True
    common = {"mass": 0.0, "rgba": [0.0, 0.0, 0.0, 0.0], "group": 3, "friction": [FOOT_FRICTION, 0.002, 0.0001]}
    ring = shape.foot_radius - FOOT_PAD_RADIUS
    for i in range(FEET):
        angle = 2.0 * math.pi * i / FEET
        foot = body.add_geom(
            name=f"{piece.spec.name}.foot{i}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[FOOT_PAD_RADIUS, 0, 0],
            pos=[ring * math.cos(angle), ring * math.sin(angle), FOOT_PAD_RADIUS], contype=SCENE_BITS,
            conaffinity=0, **common,
        )  # fmt: skip
        set_solver(foot, solver)
    body.add_geom(
        name=f"{piece.spec.name}.disc", type=mujoco.mjtGeom.mjGEOM_CYLINDER, contype=0, conaffinity=TOOL_BITS,
        size=[shape.foot_radius, (shape.foot_height - FOOT_PAD_RADIUS) / 2.0, 0],
        pos=[0, 0, (shape.foot_height + FOOT_PAD_RADIUS) / 2.0], **common,
    )  # fmt: skip
    body.add_geom(
        name=f"{piece.spec.name}.stem", type=mujoco.mjtGeom.mjGEOM_CAPSULE, contype=SCENE_BITS,
        conaffinity=TOOL_BITS | SCENE_BITS, size=[shape.stem_radius, 0, 0],
        fromto=[0, 0, shape.stem_radius + 0.001, 0, 0, shape.height - shape.stem_radius], **common,
    )  # fmt: skip
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname=piece.spec.kind.value, contype=0, conaffinity=0, mass=0.0,
        rgba=PIECE_RGBA[piece.spec.colour], group=1,
    )  # fmt: skip


def _add_contact_sensors(spec: mujoco.MjSpec) -> None:
    """Net contact forces [N] in the world frame: on each finger, on the gripper's body, on the deck."""
    net = 3  # reduction of a contact sensor: net force
    parts = {
        "force_right": (mujoco.mjtObj.mjOBJ_BODY, "finger_right"),
        "force_left": (mujoco.mjtObj.mjOBJ_BODY, "finger_left"),
        "force_body": (mujoco.mjtObj.mjOBJ_BODY, "platform"),
        "force_deck": (mujoco.mjtObj.mjOBJ_GEOM, "deck"),
    }
    for name, (kind, part) in parts.items():
        # data specification: found bit 0, force bit 1; one contact reported
        spec.add_sensor(
            name=name, type=mujoco.mjtSensor.mjSENS_CONTACT, objtype=kind, objname=part,
            reftype=mujoco.mjtObj.mjOBJ_UNKNOWN, intprm=[2, net, 1],
        )  # fmt: skip


def _add_looks(spec: mujoco.MjSpec) -> None:
    """Quality of pictures, and the meshes of the pieces."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
    spec.visual.quality.shadowsize = 2048
    spec.visual.map.znear = 0.02
    for kind in Kind:
        vertices, faces = turned_mesh(kind)
        mesh = spec.add_mesh(name=kind.value)
        mesh.uservert, mesh.userface = vertices.ravel().tolist(), faces.ravel().tolist()
        mesh.smoothnormal = True


def _drop_looks(spec: mujoco.MjSpec) -> None:
    """Take out what is only seen; MuJoCo's search for contacts looks at every shape of a body that can touch."""
    for geom in list(spec.geoms):
        if geom.contype == 0 and geom.conaffinity == 0:
            spec.delete(geom)


def build_model(
    parameters: RobotParameters,
    table: TableSettings,
    pieces: tuple[StandingPiece, ...],
    home: NDArray[np.float64],
    timestep: float | None = None,
    *,
    looks: bool = True,
    feet: Contact = FELT,
    add: Callable[[mujoco.MjSpec], None] | None = None,
) -> mujoco.MjModel:
    """Compile the world.

    Args:
        parameters: robot.
        table: board and trays.
        pieces: every physical piece with its pose.
        home: tool point in the base frame [m] at which the arm starts; key frame 0 holds the whole start state.
        timestep: integration step [s], default the drive's tick.
        looks: with all that is only seen. Without it a step is quicker, and what happens is the same.
        feet: of the pieces, on the board.
        add: puts something more into the world.

    World frame: the board frame, z up.

    Raises:
        ValueError: the arm does not reach home.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "touchmove"
    option = spec.option
    option.timestep = timestep or parameters.drive.tick
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 20.0
    option.noslip_iterations = 0
    option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    option.sleep_tolerance = SLEEP_TOLERANCE
    _add_looks(spec)
    _add_deck(spec, table)
    _add_surroundings(spec)
    add_arm(spec, parameters, table.centre_in_base)
    for piece in pieces:
        _add_piece(spec, piece, feet)
    if add is not None:
        add(spec)
    _add_contact_sensors(spec)
    if not looks:
        _drop_looks(spec)
    model = spec.compile()
    key = spec.add_key(name="start")
    key.qpos = _start_positions(model, parameters, home).tolist()
    return spec.compile()


def _start_positions(
    model: mujoco.MjModel, parameters: RobotParameters, home: NDArray[np.float64]
) -> NDArray[np.float64]:
    qpos = np.array(model.qpos0)
    joints = inverse_kinematics(parameters, home)
    for arm in range(3):
        for name, value in zip(("servo{}", "universal{}a", "universal{}b"), joints[arm], strict=True):
            qpos[model.joint(name.format(arm + 1)).qposadr[0]] = value
    for axis, name in enumerate("xyz"):
        qpos[model.joint(f"platform_{name}").qposadr[0]] = home[axis]
    for side in ("right", "left"):
        qpos[model.joint(f"finger_{side}").qposadr[0]] = parameters.gripper.stroke / 2.0
    return qpos
