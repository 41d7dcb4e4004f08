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
PLATFORM_MASS: Final = 4
"""mp: flange, gripper and payload [kg]."""
GRAVITY: Final = 5
"""g along +z3 [m/s²]."""
HINGE_INERTIA: Final = 6
"""I1 of the first of three arms: proximal link and rotor about the servomotor's axis [kg m²]."""
PROXIMAL_MOMENT: Final = 9
"""m1 c1 of the first of three arms: mass of the proximal link times the distance of its centre [kg m]."""
DISTAL_MASS: Final = 12
"""m2 of the first of three arms, both rods [kg]."""
VISCOUS: Final = 15
"""Of the first of three shafts [N m s/rad]."""
COULOMB: Final = 18
"""The same [N m]."""
SIZE: Final = 21

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
    """Shape (21,), read-only; what the compiled functions take, indexed by the names of this module."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.payload) and self.payload >= 0.0):
            raise ValueError(f"payload is {self.payload} kg, it must be a finite mass of at least 0 kg")
        constants = _pack(self.parameters, self.payload)
        constants.flags.writeable = False
        object.__setattr__(self, "constants", constants)


def _pack(parameters: RobotParameters, payload: float) -> FloatArray:
    geometry = parameters.geometry
    constants = np.empty(SIZE)
    constants[RADIUS] = geometry.base_radius - geometry.flange_radius
    constants[PROXIMAL] = geometry.proximal_length
    constants[DISTAL] = geometry.distal_length
    constants[HEIGHT] = geometry.gripper_height
    constants[PLATFORM_MASS] = parameters.inertia.moving_platform_mass + payload
    constants[GRAVITY] = STANDARD_GRAVITY
    for number in range(3):
        one = parameters.arm(number)
        constants[HINGE_INERTIA + number] = one.hinge_inertia
        constants[PROXIMAL_MOMENT + number] = one.proximal_moment
        constants[DISTAL_MASS + number] = one.distal_pair_mass
        constants[VISCOUS + number] = one.viscous
        constants[COULOMB + number] = one.coulomb
    return constants
