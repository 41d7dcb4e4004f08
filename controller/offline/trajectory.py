"""What laws and attachments see of a simulation, and what is left of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from controller.model.compiled import FloatArray, Vector
from controller.model.constants import DeltaModel
from controller.offline import constrained
from controller.offline.forward import tool_motion, total_energy


class ArmMotion(NamedTuple):
    """Where the arm is and how it moves: q, shape (9,) [rad], and v = q̇, shape (9,) [rad/s]."""

    q: FloatArray
    v: FloatArray


@dataclass(frozen=True, eq=False)
class Moment:
    """One moment of a simulation, as laws and attachments see it."""

    time: float
    """Since the start [s]."""
    q: FloatArray
    """Shape (9,) [rad]."""
    v: FloatArray
    """Shape (9,) [rad/s]."""
    own: FloatArray
    """Shape (k,), states of the attachment; empty without one."""
    model: DeltaModel
    """The robot."""

    @property
    def angle(self) -> Vector:
        """y, servomotor angles [rad]."""
        return self.q.item(0), self.q.item(3), self.q.item(6)

    @property
    def rate(self) -> Vector:
        """ẏ [rad/s]."""
        return self.v.item(0), self.v.item(3), self.v.item(6)

    @cached_property
    def tool(self) -> tuple[Vector, Vector]:
        """Position (8) [m] and velocity J_v v [m/s] of the tool point, base frame."""
        return tool_motion(self.model.constants, self.q, self.v)


Law = Callable[[Moment], Sequence[float] | FloatArray]
"""Three numbers for a moment: servomotor torques [N m], or a force on the tool in the base frame [N]."""


class Attachment(Protocol):
    """What moves with or against the tool and has states of its own: gripper, tactile sensors, a block."""

    def start(self) -> FloatArray:
        """States at time 0, shape (k,)."""

    def rates(self, moment: Moment) -> FloatArray:
        """Their time derivatives, shape (k,)."""

    def force(self, moment: Moment) -> Sequence[float] | FloatArray:
        """Force on the tool [N], base frame."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """What a simulation found, one row a sample."""

    time: FloatArray
    """Shape (n,) [s]."""
    q: FloatArray
    """Shape (n, 9) [rad]."""
    v: FloatArray
    """Shape (n, 9) [rad/s]."""
    own: FloatArray
    """Shape (n, k), states of the attachment."""
    torque: FloatArray
    """Shape (n, 3) [N m]; in a sampled run what acts from this tick on."""
    model: DeltaModel
    """The robot."""
    evaluations: int
    """How often (2) was solved."""

    @property
    def last(self) -> ArmMotion:
        """Where the run ended."""
        return ArmMotion(self.q[-1].copy(), self.v[-1].copy())

    @cached_property
    def _tool(self) -> FloatArray:
        rows = zip(self.q, self.v, strict=True)
        return np.array([tool_motion(self.model.constants, q, v) for q, v in rows]).reshape(-1, 2, 3)

    @property
    def position(self) -> FloatArray:
        """Tool points (8), shape (n, 3) [m]."""
        return self._tool[:, 0]

    @property
    def velocity(self) -> FloatArray:
        """Tool velocities J_v v, shape (n, 3) [m/s]."""
        return self._tool[:, 1]

    @property
    def angle(self) -> FloatArray:
        """Servomotor angles y, shape (n, 3) [rad]."""
        return self.q[:, constrained.MEASURED]

    @property
    def rate(self) -> FloatArray:
        """Servomotor velocities ẏ, shape (n, 3) [rad/s]."""
        return self.v[:, constrained.MEASURED]

    def energy(self) -> FloatArray:
        """Kinetic and potential energy, shape (n, 2) [J]."""
        rows = zip(self.q, self.v, strict=True)
        return np.array([total_energy(self.model.constants, q, v) for q, v in rows])

    def gap(self) -> FloatArray:
        """How far the chain is open, max |h(q)| of each sample, shape (n,) [m]."""
        return np.array([np.abs(constrained.constraint(self.model, q)).max() for q in self.q])
