"""The brakes open for some milliseconds, or bear a torque while they are closed; every tick is watched.

Whatever happens, the arm ends on its brakes: also where a limit is exceeded, the drives report a fault, or a person
ends the program.
"""

from __future__ import annotations

from dataclasses import dataclass
from operator import itemgetter
from typing import Final

import numpy as np

from app.commissioning.bring_up.axis_judgement import SLIP
from controller.model.compiled import FloatArray
from hardware.drives.faults import status_words
from hardware.interfaces import Command, DriveStatus, HardwareError, Measurement, ServoBus, Triple

OPENING_WAY: Final = 0.003
"""The brakes close as soon as a servomotor has turned so far [rad]: 0.6 mm at the tool."""
OPENING_TIME: Final = 0.1
"""They stay open no longer, whatever the encoders say [s]; brakes of servomotors take 20 to 50 ms to open."""
TOTAL_WAY: Final = 0.25
"""Of a servomotor from where the step began, all openings together [rad]: 50 mm at the tool. The six openings take
25 mrad; the rest is for brakes that are slow to bite."""
ROOM: Final = 0.07
"""So high above the board the tool has to be before the brakes open [m]."""
_SWITCHING: Final = 0.02  # amplifiers are on before brakes open, and brakes are closed before a torque changes [s]
_SWITCHED: Final = 1.0  # they are on within this [s]
_RAMP: Final = 0.1  # to the full torque on a closed brake [s]
LEAST_ROWS: Final = 5
"""Ticks of an opening from which its accelerations are found."""
UNSTEADY: Final = 0.01
"""Share of its way by which an opening may differ from a steady acceleration (rms). It is 0.0015 where every tick was
told as it was, and 0.02 with one that was told a period off, which is a quarter of the acceleration."""
_TRIES: Final = 3
_RESTING: Final = 0.05  # the arm rests when it has turned by less than a noise for so long [s]
_STILL: Final = 1e-4  # [rad]
_PATIENCE: Final = 2.0  # for it to rest [s]
_ZERO: Final[Triple] = (0.0, 0.0, 0.0)
_TRIPS: Final = DriveStatus.WATCHDOG | DriveStatus.FAULT | DriveStatus.OVERSPEED


class BringUpStopped(HardwareError):
    """A limit of a step was exceeded, or the drives reported a fault; the arm is on its brakes."""


@dataclass(frozen=True, slots=True, eq=False)
class BrakeOpening:
    """What one opening of the brakes showed."""

    torque: FloatArray
    """That acted meanwhile, (3,) [N m]."""
    time: FloatArray
    """Since the brakes were told to open, (n,) [s]."""
    angle: FloatArray
    """(n, 3) [rad]; the first row is at rest."""
    velocity: FloatArray
    """As the drives say it, (n, 3) [rad/s]."""
    stopping: FloatArray
    """How far each servomotor turned from the last row until the arm rested, (3,) [rad]."""


class WatchedBus:
    """Drives of an arm on its brakes; ``farthest`` is how far any encoder has turned since the beginning [rad].

    ``count`` is the step of their encoders [rad].
    """

    def __init__(self, bus: ServoBus, count: float) -> None:
        self._bus, self.count = bus, count
        self._said = bus.exchange(_command(_ZERO, brake=True, enable=False))
        self._origin = np.array(self._said.angle)
        self.farthest = 0.0
        self._widest = 0.0  # of one opening, with what the brakes took to bite

    @property
    def angle(self) -> FloatArray:
        """Of the servomotors at the last tick, (3,) [rad]."""
        return np.array(self._said.angle)

    def open_briefly(self, torque: FloatArray, way: float = OPENING_WAY, longest: float = OPENING_TIME) -> BrakeOpening:
        """Open the brakes under a torque, (3,) [N m], until a servomotor has turned so far [rad], or for so long [s].

        Once more where this computer was held up meanwhile, and has seen too little, or a tick that was none.

        Raises:
            BringUpStopped: the arm has come too far, or the drives report a fault.
            BusLost: the drives no longer answer.
        """
        openings: list[tuple[float, BrakeOpening]] = []
        while len(openings) < _TRIES:
            opening = self._open_once(_triple(torque), way, longest)
            openings.append((steady_fall(opening)[1], opening))
            if openings[-1][0] <= UNSTEADY * way + self.count or self.farthest + self._widest >= TOTAL_WAY:
                break
        return min(openings, key=itemgetter(0))[1]

    def _open_once(self, asked: Triple, way: float, longest: float) -> BrakeOpening:
        before = self.farthest
        if before + self._widest >= TOTAL_WAY:
            raise BringUpStopped(
                f"a servomotor has turned by {before:.3f} rad in this step, {self._widest:.3f} rad of it "
                f"in one opening, and {TOTAL_WAY:g} rad are allowed: the brakes are too slow, check their supply"
            )
        try:
            self._switch_on(asked)
            rows = [self._said]
            start = self.angle
            ticks = round(longest / self._bus.period)
            while self._said.tick - rows[0].tick < ticks and np.abs(self.angle - start).max() < way:
                last = self._said.tick
                self._exchange(asked, brake=False)
                if self._said.tick != last:
                    rows.append(self._said)
        finally:
            self.rest()
            self._widest = max(self._widest, self.farthest - before)
        return BrakeOpening(
            np.array(asked), (np.array([row.tick for row in rows], float) - rows[0].tick) * self._bus.period,
            np.array([row.angle for row in rows]), np.array([row.velocity for row in rows]),
            np.abs(self.angle - np.array(rows[-1].angle)),
        )  # fmt: skip

    def pull(self, axis: int, torque: float) -> float:
        """Pull at a closed brake, ever harder up to a torque [N m]; how far its shaft has turned [rad].

        Ends where the brake slips. Raises as ``open_briefly``.
        """
        start, ticks, turned = self.angle, round(_RAMP / self._bus.period), 0.0
        try:
            self._switch_on(_ZERO)
            for tick in range(1, ticks + 1):
                asked = [0.0, 0.0, 0.0]
                asked[axis] = torque * tick / ticks
                self._exchange((asked[0], asked[1], asked[2]), brake=True)
                turned = float(np.abs(self.angle - start).max())
                if turned > SLIP:
                    break
        finally:
            self.rest()
        return turned

    def rest(self) -> None:
        """Brakes on, amplifiers off, until the arm rests.

        Raises:
            BringUpStopped: it does not come to rest, or has come too far.
        """
        first = since = self._exchange(_ZERO, brake=True, enable=False, watch=False).tick
        angle = self.angle
        while (now := self._said.tick) - since < _RESTING / self._bus.period:
            self._exchange(_ZERO, brake=True, enable=False, watch=False)
            if np.abs(self.angle - angle).max() > _STILL:
                since, angle = now, self.angle
            if now - first > _PATIENCE / self._bus.period:
                raise BringUpStopped(
                    f"the arm does not come to rest on its brakes within {_PATIENCE:g} s: secure it, then check them"
                )
        self._watch()

    def _switch_on(self, torque: Triple) -> None:
        """Amplifiers on, at their torque, brakes closed."""
        first = self._said.tick
        while self._said.tick - first < _SWITCHING / self._bus.period or not self._said.status & DriveStatus.ENABLED:
            self._exchange(torque, brake=True)
            if self._said.tick - first > _SWITCHED / self._bus.period:
                raise BringUpStopped(f"the amplifiers do not switch on within {_SWITCHED:g} s: check their enable line")

    def _exchange(self, torque: Triple, *, brake: bool, enable: bool = True, watch: bool = True) -> Measurement:
        self._said = self._bus.exchange(_command(torque, brake=brake, enable=enable))
        self.farthest = max(self.farthest, float(np.abs(self.angle - self._origin).max()))
        if watch:
            self._watch()
        return self._said

    def _watch(self) -> None:
        if self._said.status & _TRIPS:
            said = status_words(self._said.status)
            raise BringUpStopped(f"the drives switched themselves off ({said}): read their displays, then start again")
        if not self.farthest < TOTAL_WAY:
            raise BringUpStopped(
                f"a servomotor turned by {self.farthest:.3f} rad in this step, {TOTAL_WAY:g} rad are allowed: the arm "
                "is on its brakes; check that nothing pushes it, then start the step again"
            )


def _command(torque: Triple, *, brake: bool, enable: bool) -> Command:
    return Command(torque, 0.0, brake, enable, busy=True)


def _triple(values: FloatArray) -> Triple:
    a, b, c = values.tolist()
    return a, b, c


def accelerations(opening: BrakeOpening) -> FloatArray:
    """Of the three servomotors from the moment at which the brakes really opened, (3,) [rad/s²]."""
    return steady_fall(opening)[0]


def steady_fall(opening: BrakeOpening) -> tuple[FloatArray, float]:
    """Accelerations, (3,) [rad/s²], and by how much the angles differ from theirs, rms [rad]; infinite with few rows.

    Least squares on ``q = q0 + a (t - t0)²/2`` with one t0 for all, half a tick fine; so the brakes' own delay does not
    count; drives that integrate in one go have moved from the middle of the tick before.
    """
    time, least = opening.time, LEAST_ROWS
    if len(time) < least + 1:
        return np.zeros(3), np.inf
    tick = float(time[-1] - time[-2])
    best, found = np.inf, np.zeros(3)
    for begin in np.arange(-tick, float(time[-least]) + 0.25 * tick, 0.5 * tick):
        after = np.maximum(time - begin, 0.0)
        columns = np.stack([np.ones_like(time), 0.5 * after**2], axis=1)
        fitted, _, _, _ = np.linalg.lstsq(columns, opening.angle, rcond=None)
        left = float(((opening.angle - columns @ fitted) ** 2).mean())
        if left < best:
            best, found = left, fitted[1]
    return found, float(np.sqrt(best))
