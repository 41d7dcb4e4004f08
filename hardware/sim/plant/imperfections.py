"""How the simulated devices fall short of their data sheets; every seed another way. All zero: perfect devices."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveInt

from hardware.frozen import FrozenFinite
from hardware.sim.plant.grip_faults import NEVER, GripFault, GripFaults

_NOISE_TICKS: Final = 1 << 15
"""Noise repeats after so many ticks, half a minute: longer than anything that filters it."""


class Imperfections(FrozenFinite):
    """Of amplifiers, shafts and sensors.

    The robot is built with these; the controller does not know of them.
    """

    torque_ripple: NonNegativeFloat = 0.0
    """Amplitude of the torque's ripple, as a share of the torque. Servomotors of this size have 1 to 3 %."""
    cogging: NonNegativeFloat = 0.0
    """Amplitude of the torque that is there without current [N m]; 0.5 to 1 % of the rated one is usual."""
    pole_pairs: PositiveInt = 5
    """Ripple comes six times, cogging twelve times for each pair in a turn (a three-phase machine)."""
    friction: NonNegativeFloat = 0.0
    """The dry (Coulomb) friction of each shaft is off by up to this share of what the parameters say; viscous friction
    is not, see ``arm_friction`` of ``Randomisation``."""
    tactile_noise: NonNegativeFloat = 0.0
    """Standard deviation of a tactile sensor's noise in each tick [N]."""
    tactile_offset: NonNegativeFloat = 0.0
    """Each tactile sensor reads up to so much too much or too little [N]."""
    encoder_noise: NonNegativeFloat = 0.0
    """Standard deviation of an encoder's noise in each tick [rad]; one count of 22 bits is 1.5e-6."""
    finger_noise: NonNegativeFloat = 0.0
    """Standard deviation of the noise of the fingers' position in each tick [m]."""
    grip: GripFaults = NEVER
    """The gripper's motor lets go of what it holds."""


PERFECT: Final = Imperfections()


class Flaws:
    """Imperfections as one seed makes them.

    ``friction`` are factors of each shaft's, ``grip`` is when the gripper lets go by itself. ``noise`` is what sensors
    add to what is there, by tick modulo its length, (n, 6): right and left pad [N], three encoders [rad], fingers [m].
    """

    def __init__(self, imperfections: Imperfections, seed: int) -> None:
        rng = np.random.default_rng([seed, 0xF1A5])
        self._set = imperfections
        self._phases = rng.uniform(-math.pi, math.pi, (3, 2))
        self.friction: NDArray[np.float64] = 1.0 + imperfections.friction * rng.uniform(-1.0, 1.0, 3)
        offset = imperfections.tactile_offset * rng.uniform(-1.0, 1.0, 2)
        deviations = np.array([
            *2 * [imperfections.tactile_noise], *3 * [imperfections.encoder_noise], imperfections.finger_noise
        ])  # fmt: skip
        self.noise: NDArray[np.float64] = np.zeros((_NOISE_TICKS if deviations.any() else 1, 6))
        self.noise[:, :2] = offset
        if imperfections.tactile_noise:
            self.noise[:, :2] += imperfections.tactile_noise * rng.standard_normal((_NOISE_TICKS, 2))
        if deviations[2:].any():
            positions = np.random.default_rng([seed, 0xF1A5, 1])
            self.noise[:, 2:] = deviations[2:] * positions.standard_normal((_NOISE_TICKS, 4))
        self.grip = GripFault(imperfections.grip, seed)

    @property
    def ripple(self) -> bool:
        """Whether torques are changed at all."""
        return bool(self._set.torque_ripple or self._set.cogging)

    def ripples(self, rad_per_count: float) -> NDArray[np.float64]:
        """Of the torque, as ``tick.rippled`` takes them, for encoders of so many rad a count, (10,)."""
        flaws = self._set
        return np.array([
            flaws.torque_ripple, flaws.cogging, flaws.pole_pairs, rad_per_count, *self._phases.reshape(6)
        ])  # fmt: skip
