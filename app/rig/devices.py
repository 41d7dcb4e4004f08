"""What a game runs on, seen from the game: arm, clock, and where there are any, camera and referee."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, Self

from app import UserError
from app.rig.arm import Arm
from app.terminal.shown import FilmSource, View
from hardware.interfaces import Camera, Clock, DepthFrame, Frame
from hardware.referee import Referee

if TYPE_CHECKING:
    from vision.board.view import BoardView


class RigFailed(UserError):
    """A process or device of the rig did not start, does not answer or ended unexpectedly; says what to do."""


@dataclass(frozen=True, slots=True)
class EndState:
    """How the arm was left: at rest or not, and its fastest joint or the tool's speed [rad/s, m/s]."""

    at_rest: bool
    arm_speed: float


class GuardFrames(Protocol):
    """A camera whose frames come one after the other at a steady rate."""

    def read(self, max_age: float) -> Frame | DepthFrame:
        """The next frame, as ``Camera.read``; depth alone where nobody needs colour: while the camera is not awake."""

    def close(self) -> None:
        """Release the device; a reader in another thread ends with ``CameraClosed``."""

    def wake(self, awake: bool) -> None:
        """Whether plant time shall run for it, also while nothing moves; where time runs anyway, nothing happens."""

    def release(self) -> None:
        """The last frame is done with."""


class Holder(Protocol):
    """What the guard asks of a controller's client."""

    def ask_to_hold(self) -> None:
        """Stop the present motion and refuse others."""

    def resume(self) -> None:
        """Admit motions again."""

    def admit_speed(self, speed: float, until: float, borders: tuple[float, ...]) -> None:
        """Let the tool go faster than near people [m/s], until a plant time [s], between planes of the base frame."""


@dataclass(frozen=True, slots=True)
class GuardFeed:
    """What a guard against hands needs of a rig."""

    frames: Callable[[float], GuardFrames]
    """Begins to read the board's camera, each time anew. Given the interval from frame to frame [s] of a camera that
    has none of its own."""
    holder: Holder
    """Of the arm."""
    seen_from: Callable[[BoardView], BoardView] = lambda view: view
    """Where the board is in these frames, given where it is in the camera's colour pictures."""


class PositionRecording(Protocol):
    """Positions that are being written down."""

    def finish(self) -> None:
        """End it; what was written stays. A world that is gone has ended it."""


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

    def guard_feed(self) -> GuardFeed | None:
        """For a guard against hands; None where nothing can be watched."""

    @property
    def controller(self) -> tuple[str, int, Path] | None:
        """Where listeners find the controller: host, UDP port, key file; None: there is none."""

    def film(self, view: View = "film", rate: float | None = None) -> FilmSource | None:
        """Pictures of the whole scene, or of the view ``camera``, from now on; None where nobody can take any.

        Those of the camera are for people who watch while the arm moves: in pace fast there are none, as plant time
        would wait for them.

        Args:
            view: film or camera.
            rate: so many a second [1/s]; None: as a film wants them.
        """

    def record_positions(self, path: Path) -> PositionRecording | None:
        """Have a simulated world write down where everything is, from now on, for a film that is drawn later.

        Args:
            path: of the file, which is made new.

        Returns:
            None where there is no world, or it is not drawn.

        Raises:
            HardwareError: the world cannot write it.
        """

    def failure(self) -> str | None:
        """A sentence on what has ended unexpectedly, None while all runs."""

    def close(self) -> EndState | None:
        """Bring the arm to rest and give everything up; None where nobody can say how the arm was left."""

    def __enter__(self) -> Self:
        """Nothing more."""

    def __exit__(self, *_: object) -> None:
        """Close."""
