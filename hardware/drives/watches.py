"""What positions and torques of a joint tell about its drive: an encoder that jumps, a torque that is not followed.

The same for every bus. A driver tells a watch what it has read and when, and gets back what is wrong, if anything.
"""

from typing import Final, NamedTuple

from hardware.drives.faults import DriveFinding
from hardware.drives.settings import JointSettings, VelocitySource
from hardware.interfaces import DriveTrouble
from hardware.parameters import Drive

_SPEED_MARGIN: Final = 2.0
"""No joint turns faster than the drive's limit times this: at the limit itself the bus brakes, and a brake takes a
while."""
_COMMANDS: Final = 3
"""Commands within which a drive gives a torque and says so: one is on its way, the current loop settles within the next
period, and the answer was put together a period before it is read."""
_READINGS: Final = 4
"""A torque has to be wrong in so many readings at least, however long each took: a single late one proves nothing."""


class EncoderReading(NamedTuple):
    """What an encoder said, and between which moments it was read."""

    angle: float
    """Of the joint [rad]."""
    velocity: float
    """Of the joint, as the drive says it [rad/s]."""
    earliest: float
    """It was read after this …"""
    latest: float
    """… and before that (``time.monotonic``) [s]."""


class EncoderWatch:
    """Sees whether a joint is where its velocities before and after have taken it.

    With an acceleration of at most a, the mean of the two velocities misses the way of a time T by a T² / 4 at most: by
    a triangle of height a T / 2. When exactly two readings were made is not known; for half of the doubt about T the
    joint may have moved on with the faster of both velocities. And beyond ``fastest`` nothing is believed.

    An encoder that has jumped stays wrong until it has jumped back: its zero is no longer known, and whoever moved the
    arm by it would move it elsewhere.
    """

    def __init__(self, settings: JointSettings, drive: Drive) -> None:
        self._jump, self._acceleration = settings.encoder_jump, settings.acceleration
        self._fastest = _SPEED_MARGIN * drive.max_speed
        self._trusted = settings.velocity is VelocitySource.DRIVE
        self._before: EncoderReading | None = None
        self._jumped: DriveFinding | None = None
        self._shift = self._doubt = 0.0

    def begin_anew(self) -> None:
        """What was read before does not count: nobody has looked for a while. A jump that was seen does."""
        self._before = None

    def see(self, reading: EncoderReading) -> DriveFinding | None:
        """The next reading."""
        before, self._before = self._before, reading
        if before is None:
            return self._jumped
        longest = reading.latest - before.earliest
        shortest = max(0.0, reading.earliest - before.latest)
        moved, most = reading.angle - before.angle, self._jump + self._fastest * longest
        if abs(moved) <= most and self._trusted:
            moved -= 0.25 * (before.velocity + reading.velocity) * (longest + shortest)
            faster = min(self._fastest, max(abs(before.velocity), abs(reading.velocity)))
            unsure = 0.5 * (longest - shortest) * faster
            most = self._jump + unsure + 0.25 * self._acceleration * longest * longest
        if abs(moved) <= most:
            return self._jumped
        self._shift += moved
        self._doubt += most
        seen = f"by {moved:+.4f} rad within {1e3 * longest:.1f} ms, at most {most:.4f} rad is possible"
        found = DriveFinding(DriveTrouble.ENCODER_JUMPED, f"{seen}; until it jumps back, or its zero is found again")
        self._jumped = found if abs(self._shift) > self._doubt else None
        if self._jumped is None:  # it is back: the next jump is measured from here
            self._shift = self._doubt = 0.0
        return found


class TorqueWatch:
    """Sees whether a drive gives the torque that it was asked for, at the motor's shaft.

    Args:
        settings: what may be missing, and for how long.
        rated: torque of the motor [N m].
    """

    def __init__(self, settings: JointSettings, rated: float) -> None:
        self._share, self._rated = settings.torque_error, rated
        self._patience = settings.torque_time
        self._asked: list[float | None] = [None] * _COMMANDS
        self._apart = 0.0

    def begin_anew(self) -> None:
        """What was asked for before does not count."""
        self._asked[:] = [None] * _COMMANDS
        self._apart = 0.0

    def ask(self, torque: float | None) -> None:
        """What the drive is asked for from now on [N m]; None: for none, it is braked or switched off."""
        del self._asked[0]
        self._asked.append(torque)

    def see(self, given: float, elapsed: float, limited: str = "") -> DriveFinding | None:
        """What the drive says that it gives [N m], so long after it said so before [s]; ``limited``: why it may."""
        asked = self._asked[-1]
        if asked is None or any(self._agrees(one, given) for one in self._asked if one is not None):
            self._apart = 0.0
            return None
        self._apart += min(elapsed, self._patience / _READINGS)
        if self._apart < self._patience:
            return None
        limited = f"; {limited}" if limited else ""
        seen = f"{asked:.2f} N m requested at the motor, it reports {given:.2f} N m, for {1e3 * self._apart:.0f} ms"
        return DriveFinding(DriveTrouble.TORQUE_NOT_FOLLOWED, seen + limited)

    def _agrees(self, asked: float, given: float) -> bool:
        return abs(given - asked) <= self._share * (self._rated + abs(asked))
