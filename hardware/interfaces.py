"""Seams to the devices: few verbs, typed and frozen results. Simulated, fake and real devices implement these.

Units are SI. Arms are numbered 1 to 3 as in the paper; triples are in that order.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag, StrEnum, unique
from typing import Final, NamedTuple, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Triple = tuple[float, float, float]


class Pace(StrEnum):
    """How plant time goes."""

    REAL = "real"
    """By the wall clock."""
    FAST = "fast"
    """As fast as the processes can, standing still while all rests."""


SEED: Final = 1
"""Everything that is drawn at random is drawn from this where nobody chooses another seed."""
LINGER: Final = 30.0
"""How long an arm or a world that has lost its program waits for another one [s, wall]: long enough to start a program
again, short enough for motors."""


class HardwareError(Exception):
    """A device failed or is not there; the message is one sentence with the next step."""


class BusLost(HardwareError):
    """The drives no longer answer."""


class RigGone(HardwareError):
    """What all devices stood behind has ended: none of them will answer again."""


class HandRefused(HardwareError):
    """A simulated person cannot do what was asked; the message says why."""


class StaleFrame(HardwareError):
    """A camera frame is older than its reader accepts."""

    def __init__(self, age: float, limit: float) -> None:
        super().__init__(
            f"the newest camera frame is {age:.3f} s old, at most {limit:.3f} s is accepted: is the camera running?"
        )
        self.age = age
        self.limit = limit


class CameraClosed(HardwareError):
    """A camera was read after it was closed."""

    def __init__(self) -> None:
        super().__init__("this camera is closed: open it again to read from it")


class DriveStatus(IntFlag):
    """What the drives say of themselves; also whether plant time stands still. Higher bits: see ``status_of``."""

    OK = 0
    ENABLED = 1
    """Amplifiers follow the torque command."""
    BRAKED = 2
    """Power-off brakes are closed."""
    SATURATED = 4
    """A torque command was cut at the drive's peak in this tick."""
    WATCHDOG = 8
    """The drives braked because no command came; cleared by disabling and enabling."""
    FAULT = 16
    """A drive reports a fault of its own."""
    STANDING = 32
    """Plant time did not advance at this exchange (pace fast: all is at rest and nobody waits for time)."""
    OVERSPEED = 64
    """A servomotor exceeded its speed limit; the drives braked."""


@unique
class DriveTrouble(IntEnum):
    """What can be wrong with a drive; its number goes with the status word, see ``status_of``."""

    words: str
    """After the device's name."""
    remedy: str
    """What a person can do."""

    def __new__(cls, number: int, words: str, remedy: str) -> Self:
        """A number with its words."""
        one = int.__new__(cls, number)
        one._value_, one.words, one.remedy = number, words, remedy
        return one

    UNSPECIFIED = 0, "reports a fault", "read its display"
    NO_REPLY = 1, "does not answer", "check its cable and power"
    WRONG_REPLY = 2, "sends answers that cannot be read", "check its cable and what runs beside it"
    FAULT_CODE = 3, "has switched itself off because of a fault", "look up its code in its manual"
    TOO_HOT = 4, "is too hot", "let it cool, and check what made it work so hard"
    UNDER_VOLTAGE = 5, "has too little voltage", "check its power supply"
    ENCODER_JUMPED = 6, "has an encoder that jumped", "check the encoder's cable and magnet"
    TORQUE_NOT_FOLLOWED = 7, "does not deliver the commanded torque", "check the motor's phases and its limits"
    WATCHDOG_BIT = 8, "received nothing for too long, and braked", "check what delayed this computer"
    NOT_OPERATIONAL = 9, "has left its operating state", "check its own diagnosis"
    FRAMES_LOST = 10, "loses frames", "check its cable and plugs"
    WATCHDOG_DEAD = 12, "keeps running without commands: its watchdog does not trip", "set its time-out again"
    NOT_FINITE = 13, "received a command that is not a number", "report this as a defect"
    OVER_VOLTAGE = 14, "has too much voltage", "check its supply and what absorbs the braking energy"
    OUT_OF_STEP = 15, "is out of step with the bus's clock", "check the distributed clocks of its neighbours"


_TROUBLES: Final = {int(trouble): trouble for trouble in DriveTrouble}
_DEVICE_AT, _TROUBLE_AT = 8, 11
"""Bits of the status word from which the number of a device, and of what is wrong with it, are counted."""


def status_of(device: int, trouble: DriveTrouble) -> DriveStatus:
    """A fault of a device: 0 the bus, 1 to 3 servomotors, 4 the gripper, 5 the sensors; fits into 16 bits."""
    return DriveStatus(DriveStatus.FAULT | device << _DEVICE_AT | trouble << _TROUBLE_AT)


def fault_of(status: int) -> tuple[int, DriveTrouble]:
    """Which device a status word tells a fault of, and what is wrong with it."""
    return status >> _DEVICE_AT & 7, _TROUBLES[status >> _TROUBLE_AT & 31]


class Command(NamedTuple):
    """What the controller asks of the drives for one tick."""

    torque: Triple
    """Servomotor torques u [N m]."""
    finger_velocity: float
    """Velocity of each finger, positive opening [m/s]."""
    brake: bool
    enable: bool
    busy: bool
    """The controller is not done: motion announced, stopping or homing. Keeps plant time going in pace fast."""


class Measurement(NamedTuple):
    """What the drives and sensors say at one tick."""

    tick: int
    """Counts periods of the motion board since the plant was switched on."""
    angle: Triple
    """Servomotor angles y = (q11, q21, q31) [rad], from the horizontal, positive down."""
    velocity: Triple
    """Servomotor velocities [rad/s]."""
    finger_position: float
    """z4: a pad's front edge from the tool centre, the same for both fingers [m]."""
    tactile: tuple[float, float]
    """Forces on the right (+z1) and left (-z1) pad [N], pressing positive."""
    status: DriveStatus


class ServoBus(Protocol):
    """Drives, gripper and tactile sensors behind one exchange a tick. The plant is the clock."""

    @property
    def lockstep(self) -> bool:
        """True where plant time waits for the next exchange, so that nothing can be late (pace fast)."""

    @property
    def period(self) -> float:
        """Length of one tick [s]."""

    def exchange(self, command: Command) -> Measurement:
        """Hand over a command, block until the next tick's measurement; raises ``BusLost`` if the plant is silent."""

    def close(self) -> None:
        """Give the drives up; they brake by themselves."""


@dataclass(frozen=True, slots=True, eq=False)
class PlantCall:
    """A controller as a plant in the same thread calls it, without a line of Python in between.

    ``function`` is the address of a C function of three addresses: those of ``measurement``, ``command``, and
    ``context``. It takes a tick's measurement, writes the command for the next tick, and returns 0; 1 where the
    measurement was left to others, and the command as it was; 2 where it has done its work, but cannot take another
    measurement at present.
    """

    function: int
    context: int
    measurement: NDArray[np.float64]
    """Tick, angles [rad], velocities [rad/s], finger position [m], forces on the pads [N], status, (11,)."""
    command: NDArray[np.float64]
    """Torques [N m] and velocity of each finger [m/s], (4,)."""

    def measured(self) -> Measurement:
        """The last measurement."""
        tick, a, b, c, d, e, f, finger, right, left, status = self.measurement.tolist()
        return Measurement(int(tick), (a, b, c), (d, e, f), finger, (right, left), DriveStatus(int(status)))


class Stretch(NamedTuple):
    """What came of a run of ticks in one call."""

    ticks: int
    """How many; there may have been none."""
    said: int
    """By the controller after the last one, see ``PlantCall``; 0 where it would have gone on."""
    measurement: Measurement
    """The last one."""


@runtime_checkable
class ServoBusInThread(ServoBus, Protocol):
    """A lockstep bus whose plant runs in the thread of its controller."""

    def run(self, controller: PlantCall, most: int, busy: bool) -> Stretch:
        """Up to so many exchanges, each with the next tick's measurement, while nothing else is to be done.

        ``busy`` is the commands'.
        """

    def hear(self, seconds: float) -> None:
        """Hear others for a while, without a tick [s, wall]; the controller asks for none at present."""


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """Pinhole camera: size [px], focal lengths and principal point [px]; no distortion."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def matrix(self) -> NDArray[np.float64]:
        """Camera matrix K, shape (3, 3) [px]."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture: colour (h, w, 3) uint8 RGB, depth (h, w) float32 [m] aligned to it, stamp of exposure [s].

    The arrays are the reader's own.
    """

    colour: NDArray[np.uint8]
    depth: NDArray[np.float32] | None
    """Distance along the view; 0 where none could be measured. None: the camera has no depth."""
    intrinsics: Intrinsics
    stamp: float


@dataclass(frozen=True, slots=True, eq=False)
class DepthFrame:
    """Depth alone, as of a ``Frame``: for whoever asks only how high things stand. The array is the reader's own."""

    depth: NDArray[np.float32]
    intrinsics: Intrinsics
    stamp: float


class Camera(Protocol):
    """A camera looking at the board, with or without depth."""

    def read(self, max_age: float) -> Frame:
        """The newest frame, exposed at most ``max_age`` before now [s]. Stamps never go backwards.

        Raises ``StaleFrame`` if no frame that young is to be had, ``CameraClosed`` if it was closed before, and
        ``HardwareError`` if the camera does not answer.
        """

    def close(self) -> None:
        """Release the device; a second call does nothing."""


class Clock(Protocol):
    """Plant time: simulated in rig ``sim``, the wall clock in a lab."""

    def now(self) -> float:
        """Plant time [s]."""

    def sleep(self, duration: float) -> None:
        """Wait until ``duration`` [s] of plant time has passed."""
