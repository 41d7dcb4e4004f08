"""How stiff and how damped the arm is, near the board and in the air; ``gain_schedule`` applies it to a motion."""

from pydantic import NonNegativeFloat, PositiveFloat

from hardware.frozen import Frozen


class Gains(Frozen):
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
    grasp_damping: PositiveFloat = 4.0
    """k_v of z₁ while the fingers close or open; its stiffness is 0 then, so that the tool goes to the piece instead of
    pushing it [1/s]."""
    tactile_gain: NonNegativeFloat = 5.0
    """k* while the fingers close or open [1/kg]. With the paper's 2 the friction of the shafts, of which about 0.1 N is
    felt at the tool, makes half of the tool's yielding go into pushing the piece; see bench motion."""
    yielding: PositiveFloat = 0.020
    """Stiffness along z₁ goes within this time when a grasp or a release begins [s] …"""
    firming: PositiveFloat = 0.120
    """… and comes back no quicker than this, that along z₃ likewise: a tool 3 mm off, or one that sags at a contact as
    the arm weighs more than is known, then comes back before the error counts as an obstacle."""
