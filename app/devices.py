"""What a game runs on, seen from the game: arm, clock, and where there are any, camera and referee."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from app import UserError
from app.arm import Arm
from hardware.interfaces import Camera, Clock
from hardware.sim.referee import Referee


class RigFailed(UserError):
    """A process or device of the rig did not start, does not answer or ended unexpectedly; says what to do."""


@dataclass(frozen=True, slots=True)
class EndState:
    """How the arm was left: at rest or not, and its fastest joint or the tool's speed [rad/s, m/s]."""

    at_rest: bool
    arm_speed: float


class Rig(Protocol):
    """Devices that were opened together and are given up together. A context manager."""

    @property
    def arm(self) -> Arm:
        """Executes plans."""

    @property
    def clock(self) -> Clock:
        """Plant time."""

    @property
    def camera(self) -> Camera | None:
        """Looks at the board."""

    @property
    def referee(self) -> Referee | None:
        """Knows what is really so; only of a simulated world."""

    def failure(self) -> str | None:
        """A sentence on what has ended unexpectedly, None while all runs."""

    def close(self) -> EndState | None:
        """Bring the arm to rest and give everything up; None where nobody can say how the arm was left."""

    def __enter__(self) -> Self:
        """Nothing more."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
