"""Parameters of the robot, read from one TOML file: geometry, inertia, friction, drives, gripper, pads.

All values are SI. ``parameters.toml`` beside this module is the default set and says of each value where it comes
from; a lab's own file has the same form.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, NamedTuple, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    ValidationError,
    model_validator,
)

from hardware.demands import demand
from hardware.frozen import FrozenFinite

DEFAULT_FILE = Path(__file__).with_name("parameters.toml")
FLAT_PADS_FILE = Path(__file__).with_name("flat_pads.toml")
"""The same robot with flat rubber pads."""


class ParametersError(ValueError):
    """A parameter file is missing, malformed or holds an impossible value; the message names file and field."""


class _Parameters(FrozenFinite):
    model_config = ConfigDict(strict=True)


class Geometry(_Parameters):
    """Lengths of Table 1 [m]: l0, l1, l2, l3, l4 in this order."""

    base_radius: PositiveFloat
    proximal_length: PositiveFloat
    distal_length: PositiveFloat
    flange_radius: PositiveFloat
    gripper_height: PositiveFloat


class Inertia(_Parameters):
    """Masses [kg] and the rotor's inertia about its axis [kg m²]."""

    proximal_mass: PositiveFloat
    distal_pair_mass: PositiveFloat
    rotor_inertia: PositiveFloat
    flange_mass: PositiveFloat
    gripper_body_mass: PositiveFloat
    finger_mass: PositiveFloat

    @property
    def moving_platform_mass(self) -> float:
        """Everything that translates with the tool: flange, gripper body, both fingers [kg]."""
        return self.flange_mass + self.gripper_body_mass + 2.0 * self.finger_mass


class Friction(_Parameters):
    """Friction of one servomotor shaft: viscous [N m s/rad] and Coulomb [N m]."""

    viscous: NonNegativeFloat
    coulomb: NonNegativeFloat


_Three = Annotated[tuple[PositiveFloat, PositiveFloat, PositiveFloat], Field(strict=False)]
_ThreeOrNone = Annotated[tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat], Field(strict=False)]


class Arms(_Parameters):
    """What differs from arm to arm, arms 1 to 3 in this order, as ``touchmove identify`` finds it.

    It counts for more than what ``[inertia]`` and ``[friction]`` say of all three alike.
    """

    hinge_inertia: _Three
    """Of proximal link and rotor about the servomotor's axis [kg m²]."""
    proximal_moment: _Three
    """Mass of the proximal link times the distance of its centre from that axis [kg m]."""
    distal_pair_mass: _Three
    """Of the uniform rods that would move alike [kg]."""
    viscous: _ThreeOrNone
    """Friction of the servomotor's shaft [N m s/rad] …"""
    coulomb: _ThreeOrNone
    """… and its dry part [N m]."""


class OneArm(NamedTuple):
    """One arm: the fields of ``Arms``."""

    hinge_inertia: float
    proximal_moment: float
    distal_pair_mass: float
    viscous: float
    coulomb: float


class Drive(_Parameters):
    """Servomotor and amplifier: torques [N m], encoder, speed limit [rad/s], tick [s], watchdog [ticks]."""

    rated_torque: PositiveFloat
    peak_torque: PositiveFloat
    brake_torque: PositiveFloat
    encoder_bits: PositiveInt
    max_speed: PositiveFloat
    tick: PositiveFloat
    watchdog_ticks: PositiveInt

    @model_validator(mode="after")
    def _peak_above_rated(self) -> Drive:
        if self.peak_torque < self.rated_torque:
            raise ValueError(f"peak_torque {self.peak_torque} N m is below rated_torque {self.rated_torque} N m")
        return self


class Gripper(_Parameters):
    """Parallel gripper; positions are of one pad's front edge from the tool centre, forces of one finger."""

    stroke: PositiveFloat
    velocity_gain: PositiveFloat
    max_force: PositiveFloat
    max_speed: PositiveFloat
    reflected_mass: PositiveFloat
    coupling_stiffness: PositiveFloat


class Pads(_Parameters):
    """Pads: half width and height [m], angle of their faces [rad], back [m], friction coefficient.

    Faces that lean make a V-groove, which centres a round stem; at angle 0 a pad is flat.
    """

    half_width: PositiveFloat
    half_height: PositiveFloat
    groove_angle: NonNegativeFloat
    back: PositiveFloat
    friction: PositiveFloat


class Tactile(_Parameters):
    """Tactile sensor: first-order bandwidth [rad/s]."""

    bandwidth: PositiveFloat


class Marker(_Parameters):
    """A printed ArUco marker (4×4, 50) on the tool, by which a camera sees where the arm is.

    Only its centre counts for calibration; which way it faces only decides from where it can be seen. It faces −z₂,
    tilted upwards.
    """

    number: Annotated[int, Field(ge=0, lt=50)]
    """Of the dictionary's 50."""
    size: PositiveFloat
    """Side of the black square [m]; the white border around it is an eighth of the plate at each side."""
    x: float
    """Of its centre from the tool centre, axes of the base frame [m]."""
    y: float
    z: float
    tilt: Annotated[float, Field(ge=0.0, le=1.58)]
    """Of its face's normal above the horizontal [rad]."""

    @property
    def plate(self) -> float:
        """Side of the plate with the white border: six of eight modules are the black square [m]."""
        return self.size * 8.0 / 6.0

    @property
    def centre(self) -> tuple[float, float, float]:
        """From the tool centre, axes of the base frame [m]."""
        return self.x, self.y, self.z


class RobotParameters(_Parameters):
    """The whole parameter set of one robot."""

    geometry: Geometry
    inertia: Inertia
    friction: Friction
    drive: Drive
    gripper: Gripper
    pads: Pads
    tactile: Tactile
    marker: Marker | None = None
    """None: the tool bears none, and no camera can be calibrated."""
    arms: Arms | None = None
    """None: all three are alike, and their proximal links uniform bars."""

    @model_validator(mode="after")
    def _heavier_than_rotors(self) -> RobotParameters:
        rotor = self.inertia.rotor_inertia
        if self.arms is not None and min(self.arms.hinge_inertia) <= rotor:
            least = min(self.arms.hinge_inertia)
            raise ValueError(f"arms.hinge_inertia {least} kg m² must exceed inertia.rotor_inertia {rotor} kg m²")
        return self

    def arm(self, number: int) -> OneArm:
        """Arm 0, 1 or 2 as the dynamics know it."""
        if self.arms is not None:
            one = self.arms
            return OneArm(*(getattr(one, name)[number] for name in OneArm._fields))
        inertia, length, friction = self.inertia, self.geometry.proximal_length, self.friction
        return OneArm(
            inertia.proximal_mass * length**2 / 3.0 + inertia.rotor_inertia, inertia.proximal_mass * length / 2.0,
            inertia.distal_pair_mass, friction.viscous, friction.coulomb,
        )  # fmt: skip

    def with_arms(self, arms: Sequence[OneArm]) -> RobotParameters:
        """The same robot with these three arms."""
        columns = {name: tuple(getattr(arm, name) for arm in arms) for name in OneArm._fields}
        return self.model_copy(update={"arms": Arms(**columns)})


@cache
def load_parameters(path: Path = DEFAULT_FILE) -> RobotParameters:
    """Read a TOML file in the form of the default ``parameters.toml``.

    Raises ``ParametersError`` if it cannot be read, is no TOML, lacks a field, has an unknown one or an impossible
    value.
    """
    try:
        return RobotParameters.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ParametersError(f"parameter file {path} cannot be read: {error.strerror}") from error
    except ValidationError as error:
        raise ParametersError(f"parameter file {path}: {_explain(error)}") from error
    except (ValueError, RecursionError) as error:  # no TOML, or no text at all
        raise ParametersError(f"parameter file {path} is not valid TOML: {error}") from error


def _explain(problem: ValidationError) -> str:
    """What is wrong, in one sentence; an unknown name first, since it is often the misspelt form of a missing one."""
    errors = problem.errors(include_url=False)
    error = next((one for one in errors if one["type"] == "extra_forbidden"), errors[0])
    field = ".".join(map(str, error["loc"]))
    if error["type"] == "extra_forbidden":
        model: type[BaseModel] = RobotParameters
        for name in error["loc"][:-1]:
            model = _table(model, str(name))
        return f"{field} is unknown, choose from {', '.join(model.model_fields)}"
    if error["type"] == "missing":
        return f"{field} is missing, compare {DEFAULT_FILE.name}"
    if error["type"] == "value_error":
        return f"{field}: {error['msg'].removeprefix('Value error, ')}"
    return f"{field} is {error['input']!r}: {demand(error)}"


def _table(model: type[BaseModel], name: str) -> type[BaseModel]:
    table = model.model_fields[name].annotation
    kinds = [kind for kind in (table, *get_args(table)) if isinstance(kind, type) and issubclass(kind, BaseModel)]
    return kinds[0]
