"""How a simulated world differs from what the app believes of it: one strict set of ranges, drawn by the world's seed.

A range is half a width: ``board_shift = 0.002`` puts the board up to 2 mm off, either way. Shares are of the value that
the parameters state. All zero, but for pieces that people put down: the world as believed.
"""

import itertools
import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat

from hardware.frozen import FrozenFinite
from hardware.parameters import OneArm, RobotParameters
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.bodies.placed import FOOT_SIDE, BoardOffset, StandingPiece
from hardware.sim.plant.imperfections import PERFECT, Imperfections
from hardware.sim.render.settings import CameraSettings, LightSettings
from hardware.table import PieceSpec, TableSettings

Share = Annotated[float, Field(ge=0.0, lt=1.0)]
_LEAST_ELEVATION: Final = math.radians(15.0)
"""A lamp stands at least so high over the table, wherever it is turned to."""


class Randomisation(FrozenFinite):
    """Ranges of everything that can differ."""

    placement_sigma: NonNegativeFloat = 0.0007
    """Pieces are set up by hand: standard deviation of their offset from the centre in x and y [m]."""
    placement_limit: NonNegativeFloat = 0.002
    """No offset is larger than this [m]."""
    yaw: Annotated[float, Field(ge=0.0, le=math.pi)] = math.pi
    """Pieces are turned by up to so much [rad]."""
    piece_mass: Share = 0.0
    """Each piece weighs up to so much more or less."""
    friction: Share = 0.0
    """Each piece slides up to so much better or worse, on the board and in the fingers."""
    board_shift: NonNegativeFloat = 0.0
    """The table stands off along x and y [m] …"""
    board_height: NonNegativeFloat = 0.0
    """… and in height [m] …"""
    board_turn: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    """… and is turned [rad]."""
    robot_mass: Share = 0.0
    """Each part of the arm weighs more or less than the controller believes."""
    arm_mass: Share = 0.0
    """Each proximal link and each distal pair weighs more or less by itself …"""
    arm_inertia: Share = 0.0
    """… has more or less inertia than its mass would have it, and its centre elsewhere by half of that …"""
    arm_friction: Share = 0.0
    """… and its shaft more or less viscous and dry friction, each by itself."""
    devices: Imperfections = PERFECT
    """Amplifiers, shafts, tactile sensors."""
    light_brightness: Share = 0.0
    """Of lamp, fill and ambient light, each by itself."""
    light_colour: Share = 0.0
    """Red, green and blue of the lamp are up to so much darker."""
    light_direction: Annotated[float, Field(ge=0.0, le=math.pi)] = 0.0
    """The lamp is turned about the vertical, and up or down by up to half of it [rad]."""
    light_radius: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """The lamp is up to so large: the larger, the softer its shadows [m]."""
    exposure: Share = 0.0
    """Of the colour sensor."""
    white_balance: Share = 0.0
    """Red and blue come out so much too strong or too weak."""
    camera_shift: NonNegativeFloat = 0.0
    """The camera hangs off along each axis [m] …"""
    camera_turn: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """… and is turned about each of its axes [rad]."""
    camera_noise: Share = 0.0
    """Both sensors are so much noisier or quieter than a D435's are on average."""


AS_A_LAB: Final = Randomisation(
    placement_sigma=0.0008, piece_mass=0.1, friction=0.1,
    board_shift=0.0003, board_height=0.0005, board_turn=0.001, robot_mass=0.02,
    devices=Imperfections(
        torque_ripple=0.015, cogging=0.006, friction=0.2, tactile_noise=0.03, tactile_offset=0.05,
        encoder_noise=1.5e-6, finger_noise=1e-5,
    ),
    light_brightness=0.15, light_direction=0.5, light_radius=0.05, exposure=0.1, white_balance=0.05,
    camera_shift=0.002, camera_turn=0.004, camera_noise=0.15,
)  # fmt: skip
"""What a careful lab is left with, and what games are simulated with unless asked otherwise.

Assumed: a table squared up and a camera calibrated to half a millimetre or two, parts weighed to 2 %, ripple and
cogging of a good servomotor (``Imperfections``), encoders that flicker by one count of 22 bits."""


@dataclass(frozen=True, slots=True)
class Draw:
    """One world of a seed."""

    pieces: tuple[StandingPiece, ...]
    """Where each stands, what it weighs, how it slides."""
    parameters: RobotParameters
    """Of the robot as it really is."""
    board: BoardOffset
    """Where the table really stands."""
    light: LightSettings
    """Over it."""
    camera: CameraSettings
    """As it really hangs and exposes."""


def draw(
    ranges: Randomisation,
    seed: int,
    pieces: tuple[PieceSpec, ...],
    table: TableSettings,
    parameters: RobotParameters,
    light: LightSettings,
    camera: CameraSettings,
) -> Draw:
    """Draw a world from what is believed of it, and light and camera as they are on average.

    Each group of things has random numbers of its own, so that a range changes nothing but its own.
    """
    board, robot, lamp, view = (np.random.default_rng([seed, group]) for group in range(1, 5))
    shift = np.array([ranges.board_shift, ranges.board_shift, ranges.board_height]) * board.uniform(-1.0, 1.0, 3)
    return Draw(
        stand(ranges, seed, pieces, table),
        uneven(ranges, weighed(ranges.robot_mass, parameters, robot), np.random.default_rng([seed, 5])),
        BoardOffset(_triple(shift), float(ranges.board_turn * board.uniform(-1.0, 1.0))),
        _lit(ranges, light, lamp), _hung(ranges, camera, view),
    )  # fmt: skip


def stand(
    ranges: Randomisation, seed: int, pieces: tuple[PieceSpec, ...], table: TableSettings
) -> tuple[StandingPiece, ...]:
    """Put every piece near the centre of its place, off by a human amount, turned at random; as ``draw`` does."""
    rng, weights = np.random.default_rng(seed), np.random.default_rng([seed, 0])
    standing = []
    for spec in pieces:
        x, y = table.xy(spec.place)
        offset = rng.normal(0.0, ranges.placement_sigma, 2) if ranges.placement_sigma else np.zeros(2)
        dx, dy = offset.clip(-ranges.placement_limit, ranges.placement_limit).tolist()
        yaw = float(rng.uniform(-ranges.yaw, ranges.yaw))
        mass, friction = (1.0 + np.array([ranges.piece_mass, ranges.friction]) * weights.uniform(-1.0, 1.0, 2)).tolist()
        standing.append(StandingPiece(spec, x + dx, y + dy, yaw, mass=mass, friction=friction))
    crossed = {piece for pair in itertools.combinations(standing, 2) if _feet_overlap(*pair) for piece in pair}
    return tuple(replace(piece, yaw=0.0) if piece in crossed else piece for piece in standing)


def _feet_overlap(one: StandingPiece, other: StandingPiece) -> bool:
    """Whether the squares that stand for two round feet would cross, which pushes pieces over before a game begins.

    Straight they do not, where the feet themselves do not.
    """
    dx, dy = other.x - one.x, other.y - one.y
    halves = [(FOOT_SIDE * PIECE_SHAPES[piece.spec.kind].foot_radius, piece.yaw) for piece in (one, other)]
    if math.hypot(dx, dy) > math.sqrt(2.0) * sum(half for half, _ in halves):
        return False
    for along in (one.yaw, one.yaw + math.pi / 2, other.yaw, other.yaw + math.pi / 2):
        reach = sum(half * (abs(math.cos(yaw - along)) + abs(math.sin(yaw - along))) for half, yaw in halves)
        if abs(dx * math.cos(along) + dy * math.sin(along)) > reach:
            return False
    return True


def weighed(share: float, parameters: RobotParameters, rng: np.random.Generator) -> RobotParameters:
    """Parameters of a robot with each of its masses wrong by up to a share, by its own."""
    inertia = parameters.inertia
    masses = ("proximal_mass", "distal_pair_mass", "flange_mass", "gripper_body_mass", "finger_mass")
    factors = 1.0 + share * rng.uniform(-1.0, 1.0, len(masses))
    by = dict(zip(masses, factors.tolist(), strict=True))
    real = parameters.model_copy(
        update={"inertia": inertia.model_copy(update={name: getattr(inertia, name) * by[name] for name in masses})}
    )
    if parameters.arms is None:
        return real
    link, rods, rotor = by["proximal_mass"], by["distal_pair_mass"], inertia.rotor_inertia
    return real.with_arms([
        OneArm(
            rotor + link * (one.hinge_inertia - rotor), link * one.proximal_moment, rods * one.distal_pair_mass,
            one.viscous, one.coulomb,
        )
        for one in map(parameters.arm, range(3))
    ])  # fmt: skip


def uneven(ranges: Randomisation, parameters: RobotParameters, rng: np.random.Generator) -> RobotParameters:
    """The robot with three arms that are not alike; the same where no range says so."""
    if not (ranges.arm_mass or ranges.arm_inertia or ranges.arm_friction):
        return parameters
    rotor, arms = parameters.inertia.rotor_inertia, []
    for number in range(3):
        one = parameters.arm(number)
        link, rods = (1.0 + ranges.arm_mass * rng.uniform(-1.0, 1.0, 2)).tolist()
        about, centre = (1.0 + ranges.arm_inertia * np.array([1.0, 0.5]) * rng.uniform(-1.0, 1.0, 2)).tolist()
        viscous, coulomb = (1.0 + ranges.arm_friction * rng.uniform(-1.0, 1.0, 2)).tolist()
        arms.append(OneArm(
            rotor + link * about * (one.hinge_inertia - rotor), link * centre * one.proximal_moment,
            rods * one.distal_pair_mass, viscous * one.viscous, coulomb * one.coulomb,
        ))  # fmt: skip
    return parameters.with_arms(arms)


def _lit(ranges: Randomisation, light: LightSettings, rng: np.random.Generator) -> LightSettings:
    around, up = ranges.light_direction * np.array([1.0, 0.5]) * rng.uniform(-1.0, 1.0, 2)
    x, y, z = light.direction
    azimuth = math.atan2(y, x) + float(around)
    elevation = math.atan2(z, math.hypot(x, y)) + float(up)
    elevation = min(max(elevation, _LEAST_ELEVATION), 0.5 * math.pi - 1e-3)
    flat = math.cos(elevation)
    brightness, fill, ambient = (
        np.array([light.brightness, light.fill, light.ambient])
        * (1.0 + ranges.light_brightness * rng.uniform(-1.0, 1.0, 3))
    ).tolist()
    colour = (np.array(light.colour) * (1.0 - ranges.light_colour * rng.uniform(0.0, 1.0, 3))).tolist()
    changed: dict[str, Any] = {
        "direction": (flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)),
        "brightness": brightness, "fill": fill, "ambient": ambient, "colour": tuple(colour),
        "radius": min(light.radius + ranges.light_radius * float(rng.uniform()), 0.5),
    }  # fmt: skip
    return light.model_copy(update=changed)


def _hung(ranges: Randomisation, camera: CameraSettings, rng: np.random.Generator) -> CameraSettings:
    shift = np.array(camera.mount.shift) + ranges.camera_shift * rng.uniform(-1.0, 1.0, 3)
    turn = np.array(camera.mount.turn) + ranges.camera_turn * rng.uniform(-1.0, 1.0, 3)
    time, noise = (1.0 + np.array([ranges.exposure, ranges.camera_noise]) * rng.uniform(-1.0, 1.0, 2)).tolist()
    red, blue = (1.0 + ranges.white_balance * rng.uniform(-1.0, 1.0, 2)).tolist()
    r, g, b = camera.exposure.white_balance
    exposure = camera.exposure.model_copy(
        update={"time": camera.exposure.time * time, "white_balance": (r * red, g, b * blue)}
    )
    mount = camera.mount.model_copy(update={"shift": _triple(shift), "turn": _triple(turn)})
    return camera.model_copy(update={"mount": mount, "exposure": exposure, "noise": camera.noise * noise})


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    a, b, c = values.tolist()
    return a, b, c
