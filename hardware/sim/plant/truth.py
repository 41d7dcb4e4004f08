"""What is really so in the simulated world: for the referee alone."""

from __future__ import annotations

from dataclasses import dataclass


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
    ``hand_motion.Pose``; None in a world without a person."""
    grips_lost: int = 0
    """So often the gripper has let go by itself, since the world was begun or continued."""
