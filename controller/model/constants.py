"""The robot's numbers as the compiled functions take them: one flat, frozen array."""

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from controller.model.compiled import FloatArray
from hardware.parameters import RobotParameters

RADIUS: Final = 0
"""l0 - l3 [m]."""
PROXIMAL: Final = 1
"""l1 [m]."""
DISTAL: Final = 2
"""l2 [m]."""
HEIGHT: Final = 3
"""l4 [m]."""
HINGE_INERTIA: Final = 4
"""I1: proximal link and rotor about the servomotor's axis [kg m²]."""
PROXIMAL_MASS: Final = 5
"""m1 [kg]."""
DISTAL_MASS: Final = 6
"""m2, both rods of one arm [kg]."""
PLATFORM_MASS: Final = 7
"""mp: flange, gripper and payload [kg]."""
GRAVITY: Final = 8
"""g along +z3 [m/s²]."""
VISCOUS: Final = 9
"""[N m s/rad]."""
COULOMB: Final = 10
"""[N m]."""

STANDARD_GRAVITY: Final = 9.80665

_HALF_ROOT_3 = math.sqrt(3.0) / 2.0
ARM_COS: Final = (1.0, -0.5, -0.5)
"""Cosines of the arms' turns about z3: 0, -2π/3, +2π/3."""
ARM_SIN: Final = (0.0, -_HALF_ROOT_3, _HALF_ROOT_3)


@dataclass(frozen=True, eq=False)
class DeltaModel:
    """One robot with what it carries."""

    parameters: RobotParameters
    """Lengths, masses, friction."""
    payload: float = 0.0
    """Mass held by the gripper, moving with the tool [kg]."""
    constants: FloatArray = field(init=False, repr=False)
    """Shape (11,), read-only; what the compiled functions take, indexed by the names of this module."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.payload) and self.payload >= 0.0):
            raise ValueError(f"payload is {self.payload} kg, it must be a finite mass of at least 0 kg")
        constants = _pack(self.parameters, self.payload)
        constants.flags.writeable = False
        object.__setattr__(self, "constants", constants)


def _pack(parameters: RobotParameters, payload: float) -> FloatArray:
    """Fill the flat array; the proximal link is a uniform bar hinged at its end."""
    geometry, inertia = parameters.geometry, parameters.inertia
    constants = np.empty(11)
    constants[RADIUS] = geometry.base_radius - geometry.flange_radius
    constants[PROXIMAL] = geometry.proximal_length
    constants[DISTAL] = geometry.distal_length
    constants[HEIGHT] = geometry.gripper_height
    constants[HINGE_INERTIA] = inertia.proximal_mass * geometry.proximal_length**2 / 3.0 + inertia.rotor_inertia
    constants[PROXIMAL_MASS] = inertia.proximal_mass
    constants[DISTAL_MASS] = inertia.distal_pair_mass
    constants[PLATFORM_MASS] = inertia.moving_platform_mass + payload
    constants[GRAVITY] = STANDARD_GRAVITY
    constants[VISCOUS] = parameters.friction.viscous
    constants[COULOMB] = parameters.friction.coulomb
    return constants
