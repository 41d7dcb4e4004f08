"""How fast, how stiff and how gently the arm moves."""

from enum import StrEnum
from types import MappingProxyType
from typing import Final, Self

from pydantic import NonNegativeFloat, PositiveFloat

from app.motion.gains import Gains
from controller.settings import HELD_FORCE
from hardware.contact_speeds import CONTACT_PROFILES, ContactSpeeds
from hardware.frozen import Frozen
from hardware.table import TableSettings


class Law(StrEnum):
    """How time runs along a path."""

    TIME_OPTIMAL = "time-optimal"
    RUCKIG = "ruckig"
    """Without the refinement."""
    MINIMUM_JERK = "minimum-jerk"
    """The quintic law, whose mean squared jerk is the least: from rest to rest as quickly as the bounds admit."""


HIGHEST_HOME: Final = 0.29
"""z₃ of the tool, base frame [m]: above it the condition of J_c grows from 2 to infinity within 20 mm."""
_DEFAULT: Final = TableSettings()
_SQUARES_BACK: Final = 4.5
_BACK_FOR_LOWER: Final = 1.25
"""So much further towards White is home for each metre that a square is larger, or that home is lower; found by trying
what a picture of the camera shows past the fingers, on boards of 40 to 56.5 mm squares."""


class Grip(Frozen):
    """Finger motion; velocities are of one finger."""

    opening_margin: PositiveFloat = 0.005
    """Pads open at least this much further than the stem needs: room for a piece 3 mm off its centre [m] …"""
    widest_margin: PositiveFloat = 0.0065
    """… and this much where neighbours leave room: 3 mm off along either axis [m]."""
    beside: PositiveFloat = 0.003
    """Before they are at the piece's height for good, the fingers close to so much more than the stem needs: they do
    not touch yet what stands 3 mm off along their axis [m] …"""
    beside_way: PositiveFloat = 0.007
    """… as soon as the tool is no further above it: the pads are around the piece then, and above its foot no piece is
    wider than its stem [m]."""
    closing_speed: PositiveFloat = 0.030
    """Asked while closing and holding; in stall the gripper's velocity gain makes 4.8 N of it [m/s]."""
    opening_speed: PositiveFloat = 0.080
    """[m/s]"""
    guard_force: PositiveFloat = 3.0
    """Both pads must feel this before a piece counts as gripped [N] …"""
    within: PositiveFloat = 0.001
    """… once the fingers may be so near to where they hold it: a piece that is off its place is met sooner, by fingers
    that are still quick, and for some milliseconds it resists as if it were gripped [m]."""
    held_force: PositiveFloat = HELD_FORCE
    """A pad that feels less on the way has lost the piece, and the arm stops: fingers that open by themselves, or what
    has fallen, may be in its way [N]."""
    patience: PositiveFloat = 0.40
    """Beyond the time the fingers need for their way, a piece must be felt within this [s]."""
    settle: NonNegativeFloat = 0.030
    """From gripped to lifting: the grip force must not change while the piece leaves the board [s]."""
    freed: PositiveFloat = 0.0015
    """Pads this far off the stem may be lifted; they go on opening on the way [m]."""


class MotionSettings(Frozen):
    """Bounds of the reference and where it goes."""

    home: tuple[float, float, float] = (0.0, 0.075, 0.325)
    """Tool point between plies, base frame: the camera sees all squares and trays past it [m]."""
    law: Law = Law.TIME_OPTIMAL
    speed: PositiveFloat = 0.8
    """Of the tool; never above the table's contact limit [m/s]."""
    downward_speed: PositiveFloat = CONTACT_PROFILES["default"].downward_speed
    """Likewise, near the board [m/s]."""
    acceleration: PositiveFloat = 15.0
    """Along each axis of the base frame [m/s²]."""
    jerk: PositiveFloat = 500.0
    """Along each axis of the base frame [m/s³]."""
    torque_share: PositiveFloat = 0.86
    """Of the drives' peak torque, what a plan may ask for; the rest is for what it does not foresee."""
    carrying: PositiveFloat = 1.0
    """Share of acceleration and jerk with a piece in the fingers: 4.8 N hold a king against 8 times as much."""
    corner: PositiveFloat = 0.060
    """A corner begins at most this far before the point where its lines meet [m]."""
    clearance: PositiveFloat = 0.006
    """Between a carried foot, or the pads, and a piece passed over [m]."""
    beside: PositiveFloat = 0.004
    """Pieces closer than this to what moves, seen from above, are passed over: they may stand 3 mm off [m]."""
    lift: PositiveFloat = 0.022
    """A piece is carried at least this high: lower hops have tighter corners and take longer [m]."""
    swing: NonNegativeFloat = 0.024
    """Ways without a piece begin so much higher than they must: room for wider corners … [m]"""
    swing_down: NonNegativeFloat = 0.024
    """… and end so much higher, before they lead down [m]."""
    touch_height: PositiveFloat = 0.0032
    """A piece is lowered fast to this height of its foot, above a board that may be 3 mm too high … [m]"""
    touch_speed: PositiveFloat = 0.030
    """… and from there at this speed … [m/s]"""
    touch_depth: NonNegativeFloat = 0.012
    """… at most to so far below the board [m] …"""
    touch_force: PositiveFloat = 1.5
    """… until it presses with so much more than before [N]."""
    touch_delay: NonNegativeFloat = 0.02
    """So long presses the tool more and more until the guard's force is reached, as measured in the world [s]."""
    release_wait: NonNegativeFloat = 0.020
    """With the piece on the board, before the fingers open [s]."""
    gains: Gains = Gains()
    grip: Grip = Grip()

    def at(self, table: TableSettings) -> Self:
        """For another table: home keeps its place over the board, but is no higher than the arm can fold up; over a
        larger board, or where it is lower, it is so much further towards White that the camera, which hangs farther
        from larger boards, sees the first rank past it (at least 14 pixels, of 24 over the default board).
        """
        x, y, z = (a + b - c for a, b, c in zip(self.home, table.centre_in_base, _DEFAULT.centre_in_base, strict=True))
        larger, lower = max(0.0, table.square - _DEFAULT.square), max(0.0, HIGHEST_HOME - z)
        towards_white = _SQUARES_BACK * larger + _BACK_FOR_LOWER * lower
        return self.model_copy(update={"home": (x, y + towards_white, max(z, HIGHEST_HOME))})


class Profile(StrEnum):
    """How the arm moves."""

    DEFAULT = "default"
    FAST = "fast"
    """For demonstrations without people in reach."""
    GENTLE = "gentle"
    """With children in reach."""
    MINIMUM_JERK = "minimum-jerk"
    """As default, by the quintic law."""
    SEPARATION = "separation"
    """As fast where the guard sees nobody near, else no faster than default: the controller stretches time."""


_FAST: Final = MotionSettings(
    speed=CONTACT_PROFILES["fast"].tool_speed, acceleration=18.0, jerk=2000.0, swing_down=0.006,
    touch_speed=0.045, release_wait=0.0, grip=Grip(opening_speed=0.12, settle=0.0, freed=0.0008),
)  # fmt: skip
"""The servomotors' rating limits it: it accelerates less, and changes acceleration more quickly, than torque peaks and
tracking would admit. Between two motions go 7 ms or more, in which grip and foot become firm. See bench motion.
"""
PROFILES: Final = MappingProxyType({
    Profile.DEFAULT: MotionSettings(),
    Profile.FAST: _FAST,
    Profile.SEPARATION: _FAST,
    Profile.GENTLE: MotionSettings(
        speed=CONTACT_PROFILES["gentle"].tool_speed, downward_speed=CONTACT_PROFILES["gentle"].downward_speed,
        acceleration=8.0, jerk=250.0,
    ),
    Profile.MINIMUM_JERK: MotionSettings(law=Law.MINIMUM_JERK),
})  # fmt: skip
"""Settings of each profile; what protection enforces is of ``contact_speeds``."""


def contact_speeds(profile: Profile) -> ContactSpeeds:
    """How fast the tool may move where it can meet a person."""
    return CONTACT_PROFILES.get(profile.value, CONTACT_PROFILES["default"])
