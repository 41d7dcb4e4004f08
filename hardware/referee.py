"""The referee's seam: what is really so in a simulated world, for records, figures, tests and the exit status alone.

A lab has no referee. Nothing that chooses a move, a grasp or a motion may import this.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class PiecePose:
    """True pose of a piece: centre of its foot in the board frame [m], tilt from upright [rad]."""

    name: str
    x: float
    y: float
    z: float
    tilt: float


@dataclass(frozen=True, slots=True)
class Truth:
    """What only the referee sees."""

    tick: int
    pieces: tuple[PiecePose, ...]
    peak_contact_force: float
    """Largest net contact force on the deck, the gripper's body or one finger since the last reset of the peak [N]."""
    closure_error: float
    """Largest gap of a closed loop at the beginning of the last tick [m]."""
    arm_speed: float
    """Fastest joint of arm and gripper [rad/s, m/s]."""
    state_sha256: str
    """Digest of all positions and velocities."""
    tool: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The tool point, base frame, at the beginning of the last tick [m]."""
    hand_force: float = 0.0
    """Largest force of the robot on a person's hand since the last reset of the peak [N]; 0 in a world without one."""
    hand: tuple[float, float, float, float] | None = None
    """Where a person's fingertips are, board frame [m], and how the hand is turned about the vertical [rad], as in
    ``hardware.sim.bodies.hand.HandPose``; None in a world without a person."""
    grips_lost: int = 0
    """So often the gripper has let go by itself, since the world was begun or continued."""


@dataclass(frozen=True, slots=True)
class RunSpeed:
    """Plant time run so far [s] and the wall time it took while ticks ran [s]."""

    plant: float
    wall: float

    @property
    def ratio(self) -> float:
        """How many times faster than life."""
        return self.plant / self.wall if self.wall > 0.0 else 0.0


class Referee(Protocol):
    """Tells what is really so."""

    def look(self, reset_peak: bool = False) -> tuple[Truth, RunSpeed]:
        """The world as it is; optionally start counting the peak contact force anew."""

    def positions(self) -> NDArray[np.float64]:
        """All generalised positions of the world's model, shape (nq,)."""

    def close(self) -> None:
        """Let the world go."""
