"""Contacts of a stated stiffness: what MuJoCo's solref and solimp must be for them.

MuJoCo softens a contact by R = (1 - d) / (d m), with the impedance d of solimp and the mass m of the lighter body, and
asks for the acceleration -B v - K d x, with K = k' / d² and B = b' / d for solref = (-k', -b'). Its force is

    f = (-B v - K d x - a) / R = -c v - k x - M a,    k = k' m / (1 - d),  c = b' m / (1 - d),  M = m d / (1 - d):

a spring and a damper, and a mass M that moves along while they touch. M is not there in the world. It does
not show in a rest, and hardly in a blow of something that weighs much more; but it keeps light things calm
on a stiff spring: √(k / (m + M)) times the time step must stay well below 2.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple


class Solver(NamedTuple):
    """MuJoCo's numbers of a contact."""

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Contact:
    """What a pair of surfaces is like."""

    stiffness: float
    """Force by depth, as a blow of ``mass`` meets it [N/m]."""
    mass: float
    """Effective one of such a blow, for which stiffness and damping are right [kg]."""
    damping_ratio: float
    """Of the contact with that mass on it."""
    followed: float
    """Mass that moves along with the surface while they touch, M above [kg]."""

    def met_by(self, mass: float) -> float:
        """Stiffness as a blow of another effective mass [kg] than the contact's own meets it [N/m]."""
        return self.stiffness * (1.0 + self.followed / self.mass) / (1.0 + self.followed / mass)

    def solver(self, lighter: float, points: float = 1.0) -> Solver:
        """For one of so many points that touch at once and share the force; of oblique ones, the sum of the squared
        cosines.

        ``lighter`` is the mass that MuJoCo takes for m: that of the body which can move, if one cannot [kg].
        """
        ratio = self.followed / (points * lighter)
        impedance = ratio / (1.0 + ratio)
        stiffness = self.stiffness * (1.0 + self.followed / self.mass)
        damping = 2.0 * self.damping_ratio * math.sqrt(stiffness * (self.mass + self.followed))
        per_point = (1.0 - impedance) / (points * lighter)
        return Solver((-stiffness * per_point, -damping * per_point), (impedance, impedance, 0.001, 0.5, 2.0))

    def peak(self, speed: float, mass: float) -> float:
        """Largest force of a blow of an effective mass [kg] at a speed [m/s] without damping: v √(k μ) [N]."""
        return speed * math.sqrt(self.met_by(mass) * mass)
