"""How fast, how stiff and how gently the arm moves."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, NonNegativeFloat, PositiveFloat


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Gains(_Frozen):
    """Task-space gains by natural frequency: k_p = ω², k_v = 2ζω, so that the damping ratio ζ is what is stated."""

    frequency_in_air: PositiveFloat = 70.0
    """ω of all axes away from contacts; a step of 0.88 ms and one tick of delay leave it ample margin [rad/s]."""
    frequency_at_contact: PositiveFloat = 20.0
    """ω of z₃ where a foot meets the board: a height wrong by 1 mm then presses with 0.4 N [rad/s]."""
    damping_ratio: PositiveFloat = 1.0
    soft_height: PositiveFloat = 0.004
    """z₃ is at its softest below this height above the contact [m] …"""
    stiff_height: PositiveFloat = 0.014
    """… and as stiff as in air above this one; smooth between [m]."""


class Grip(_Frozen):
    """Finger motion; velocities are of one finger."""

    opening_margin: PositiveFloat = 0.005
    """Pads open this much further than the stem needs: room for a piece 3 mm off its centre [m]."""
    closing_speed: PositiveFloat = 0.025
    """Asked while closing and holding; in stall the gripper's velocity gain makes 4 N of it [m/s]."""
    opening_speed: PositiveFloat = 0.060
    """[m/s]"""
    guard_force: PositiveFloat = 3.0
    """Both pads must feel this before a piece counts as gripped [N]."""
    patience: PositiveFloat = 0.40
    """Beyond the time the fingers need for their way, a piece must be felt within this [s]."""
    settle: NonNegativeFloat = 0.030
    """From gripped to lifting: the grip force must not change while the piece leaves the board [s]."""


class MotionSettings(_Frozen):
    """Bounds of the reference and where it goes."""

    home: tuple[float, float, float] = (0.0, 0.075, 0.325)
    """Tool point between plies, base frame: the camera sees all squares and trays past it [m]."""
    speed: PositiveFloat = 0.8
    """Of the tool; never above the table's contact limit [m/s]."""
    acceleration: PositiveFloat = 15.0
    """[m/s²]"""
    jerk: PositiveFloat = 500.0
    """[m/s³]"""
    clearance: PositiveFloat = 0.006
    """Between a carried foot, or the pads, and the tallest piece passed over [m]."""
    corridor: PositiveFloat = 0.034
    """Pieces whose centre is closer than this to the way of the tool, seen from above, are passed over [m]."""
    touch_height: PositiveFloat = 0.002
    """A piece is lowered fast to this height of its foot … [m]"""
    touch_speed: PositiveFloat = 0.030
    """… and from there at this speed [m/s]."""
    touch_depth: NonNegativeFloat = 0.001
    """The reference ends this far below the board, so that the foot surely stands [m]."""
    release_wait: NonNegativeFloat = 0.020
    """With the piece on the board, before the fingers open [s]."""
    gains: Gains = Gains()
    grip: Grip = Grip()
