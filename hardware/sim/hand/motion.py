"""How a hand moves: smooth strokes as people make them, added up (``plant.tick``); pure functions of time.

A new stroke may begin before the one before has ended, as people do it. So corners become round.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.sim.bodies.hand import HandPose
from hardware.sim.plant.tick import add_up

PEAK: Final = 1.875
"""Highest speed of a minimum-jerk stroke over its mean speed."""
TURNING_SPEED: Final = 4.0
"""Of the hand about its vertical axis [rad/s]."""
GRIP_SPEED: Final = 0.10
"""Of a fingertip [m/s]."""
QUICKEST: Final = 0.12
"""No stroke takes less than this [s]; people's do not either."""


class Target(NamedTuple):
    """What servos follow: position, velocity and acceleration of x, y, z [m], yaw [rad] and gap [m], shape (5,)."""

    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """A smooth change of the pose, shape (5,), from ``begin`` on, counted from the program's start [s]."""

    begin: float
    duration: float
    change: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Program:
    """A motor program."""

    start: HandPose
    """Pose before it."""
    strokes: tuple[Stroke, ...]
    """That add up."""
    duration: float
    """After which nothing moves any more [s]."""

    def at(self, time: float) -> Target:
        """Where the hand shall be, so many seconds after the start."""
        told = np.empty((3, len(self.start)))
        add_up(np.array(self.start), self.table(), time, told)
        return Target(*told)

    def table(self) -> NDArray[np.float64]:
        """The strokes as rows, see ``plant.tick.ServoStrokes``."""
        rows = [(stroke.begin, stroke.duration, *stroke.change.tolist()) for stroke in self.strokes]
        return np.array(rows, dtype=np.float64).reshape(-1, 2 + len(self.start))

    def cut(self, time: float) -> Program:
        """What is left if no stroke begins any more from a time on [s]; those that have begun end."""
        begun = tuple(stroke for stroke in self.strokes if stroke.begin <= time)
        return Program(self.start, begun, max((s.begin + s.duration for s in begun), default=0.0))

    @property
    def end(self) -> HandPose:
        """Pose after it."""
        total = np.sum([stroke.change for stroke in self.strokes], axis=0) if self.strokes else np.zeros(5)
        return HandPose(*(np.array(self.start) + total).tolist())


@dataclass(slots=True, eq=False)
class Sketch:
    """A program in the making."""

    pose: HandPose
    """At its end so far."""
    speed: float
    """Highest of a long stroke [m/s]."""
    _start: HandPose = field(init=False)
    _strokes: list[Stroke] = field(init=False, default_factory=list)
    _end: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        self._start = self.pose

    def to(
        self,
        *,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        yaw: float | None = None,
        gap: float | None = None,
        overlap: float = 0.0,
        speed: float | None = None,
    ) -> Sketch:
        """Add a stroke to what is given of a pose [m, rad]; the others stay unchanged.

        It begins so much before the end so far as ``overlap`` says, a share of the stroke before, and is no faster than
        ``speed`` [m/s], if it is another one.
        """
        given = (x, y, z, yaw, gap)
        new = HandPose(*(old if value is None else value for old, value in zip(self.pose, given, strict=True)))
        change = np.subtract(new, self.pose)
        reach = float(np.linalg.norm(change[:3]))
        duration = max(
            QUICKEST if change.any() else 0.0,
            PEAK * reach / (speed or self.speed),
            PEAK * abs(float(change[3])) / TURNING_SPEED,
            PEAK * abs(float(change[4])) / GRIP_SPEED,
        )
        if duration > 0.0:
            before = self._strokes[-1].duration if self._strokes else 0.0
            begin = max(self._end - overlap * before, 0.0)
            self._strokes.append(Stroke(begin, duration, change))
            self._end = max(self._end, begin + duration)
            self.pose = new
        return self

    def wait(self, duration: float) -> Sketch:
        """Stay [s]."""
        self._end += duration
        return self

    def done(self) -> Program:
        """The program."""
        return Program(self._start, tuple(self._strokes), self._end)
