"""The guard against hands in a game: put together from what a rig has; it follows the board where that is found."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final, Self

from app.guard.arm_silhouette import ArmHistory, ArmMasks
from app.guard.hand_guard import Blind, GuardStop, HandGuard
from app.guard.separation import Separation
from app.rig.depth_scale import scaled_frames
from app.rig.devices import GuardFrames, Holder, Rig, RigFailed
from controller.protocol.messages import Telemetry
from controller.wire.errors import ControllerError
from hardware.interfaces import HardwareError, Intrinsics
from hardware.parameters import RobotParameters
from hardware.table import TableSettings
from vision.board.view import BoardView
from vision.hands.hand_and_motion import Seen

AGAIN: Final = 1.0  # so often a camera that has fallen silent is asked again [s, wall]
SIGHT_PATIENCE: Final = 10.0  # longer than this nobody waits for sight [s, wall]
LATENCY: Final = 0.065
"""From a frame's exposure until it was looked at; one that is older admits no speed [s]. Of a D435 by USB 0.04 to
0.06, of the simulated one 0.06."""
FIRST_FRAME_AGE: Final = 60.0  # of a frame that is asked for its camera alone [s]


class GameGuard:
    """Watches for hands from when it is known where the board is. A context manager.

    Until then nothing but the controller's own protection looks after people: a caller that knows beforehand where the
    board is, by calibration, says so at once.

    ``frames`` begins to read the board's camera, in intervals [s]; ``seen_from`` says where the board is in them, given
    where it is in the camera's pictures. ``arm``: the robot, where the table is below it, and the history that hears
    the telemetry of its controller. ``progress`` is told when a hand comes and goes. A camera that has fallen silent
    has ``patience`` to come back [s, wall].
    """

    def __init__(
        self, frames: Callable[[], GuardFrames], holder: Holder, arm: tuple[RobotParameters, TableSettings, ArmHistory],
        progress: Callable[[str], None] | None = None, patience: float = 15.0,
        seen_from: Callable[[BoardView], BoardView] = lambda view: view, interval: float = 1.0 / 30.0,
    ) -> None:  # fmt: skip
        self._patience, self._seen_from, self._interval = patience, seen_from, interval
        self._frames, self._holder, self._arm, self._progress = frames, holder, arm, progress
        self._guard: HandGuard | None = None
        self._view: BoardView | None = None
        self._tried = -math.inf
        self._departures = 0
        self._gone_at: float | None = None
        self.stops: list[GuardStop] = []  # each time the arm was asked to hold, until the board was looked for last

    def look(self, view: BoardView) -> None:
        """From now on the board is where this view of its camera has it.

        Raises:
            HardwareError: the camera cannot be read.
        """
        self._view, here = view, self._seen_from(view)
        frames, masks = self._frames(), ArmMasks(here, *self._arm)  # the guard before stays where this fails
        before = self._guard
        self.close()
        holding = before is not None and before.holding  # once its thread has ended
        self._guard = HandGuard(
            frames, here, masks, self._holder, separation=self._separation(here), progress=self._progress,
            holding=holding,
        )  # fmt: skip
        self._guard.start()

    def _separation(self, view: BoardView) -> Separation | None:
        limits = view.table.limits
        if limits.shared_tool_speed is None:
            return None
        return Separation(view, self._holder, self._interval, LATENCY, limits)

    def clear(self) -> None:
        """Wait until no hand is over the board, then admit motions; see ``HandGuard.clear``.

        A camera that falls silent may come back, as one does that is plugged in again.

        Raises:
            Blind: it has not.
            ControllerError: the controller does not answer.
        """
        until = time.monotonic() + self._patience
        while self._guard is not None:
            try:
                self._guard.clear()
                return
            except Blind:
                if time.monotonic() > until:
                    raise
                time.sleep(AGAIN)
                self._look_again()

    def newest(self) -> Seen | None:
        """What the newest frame showed; see ``HandGuard.seen``. None before the first one.

        Raises:
            Blind: the camera gives no frames; it is asked again from time to time.
        """
        if self._guard is None:
            return None
        try:
            return self._guard.seen
        except Blind:
            if time.monotonic() > self._tried + AGAIN:
                self._look_again()
            raise

    def _look_again(self) -> None:
        """Perhaps the camera is there again."""
        self._tried = time.monotonic()
        assert self._view is not None
        with suppress(HardwareError):  # it is not: who has asked was told already
            self.look(self._view)

    @property
    def departures(self) -> int:
        """So often a hand has gone since the session began; see ``HandGuard.departures``."""
        return self._departures + (0 if self._guard is None else self._guard.departures)

    @property
    def arrivals(self) -> int:
        """So often a hand has come since the session began: if it is as often as at a look, none has come since."""
        return self._departures + (0 if self._guard is None else self._guard.arrivals)

    @property
    def hands(self) -> int:
        """How many hands were seen to come and go, one that is leaving included."""
        return self.departures + self.leaving

    @property
    def gone_at(self) -> float | None:
        """When the last hand had gone [s]; None: there was none, or one is there; see ``HandGuard.gone_at``."""
        if self._guard is None or not self._guard.arrivals:
            return self._gone_at
        return self._guard.gone_at

    @property
    def leaving(self) -> bool:
        """Whether a hand has gone, and the board does not lie still yet."""
        return self._guard is not None and self._guard.leaving

    def wait_for_sight(self) -> bool:
        """Wait until no hand is over the board, which hides what stands there, as far as anybody sees; admits no
        motion.

        Not for ever: what looks like a hand may be a board that was moved, and is to be found anew. A camera that gives
        no frames hinders nobody from asking it for one.
        """
        with suppress(Blind):
            return self._guard is None or self._guard.sight(SIGHT_PATIENCE)
        return True

    def wake(self, awake: bool) -> None:
        """Whether plant time shall run for the camera while nothing moves; see ``GuardFrames.wake``."""
        if self._guard is not None:
            self._guard.wake(awake)

    @property
    def holding(self) -> bool:
        """Whether the arm holds because this guard has asked for it."""
        return self._guard is not None and self._guard.holding

    def close(self) -> None:
        """End watching; a hold stays in force."""
        if self._guard is not None:
            self._guard.close()
            self.stops += self._guard.stops
            if self._guard.arrivals:
                # nobody will tell of a hand that is there yet: it counts as gone, so that somebody looks what it did
                at = self._guard.gone_at
                self._gone_at = self._guard.last_stamp if at is None else at
            self._departures += self._guard.arrivals
            self._guard = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        before = self._guard
        self.close()
        if before is not None and before.holding and not before.blind:
            with suppress(ControllerError):  # one that is gone needs no leave
                self._holder.resume()  # nothing moves now, and the next game watches for itself


class Guarding:
    """How a session is guarded, before its rig is open.

    ``view``: where the board should be in the pictures of a camera; None: nobody knows. ``depth_factor``: by which the
    camera's depth is to be multiplied; ``interval``: from frame to frame of a simulated camera [s]; ``progress`` is
    told when a hand comes and goes.
    """

    def __init__(
        self, parameters: RobotParameters, table: TableSettings, view: Callable[[Intrinsics], BoardView | None],
        depth_factor: float, interval: float, progress: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._parameters, self._table, self._view, self._factor = parameters, table, view, depth_factor
        self._interval, self._progress = interval, progress
        self._history = ArmHistory(parameters.drive.tick)

    def take(self, telemetry: Telemetry) -> None:
        """A listener of the controller's client."""
        self._history.take(telemetry)

    def open(self, rig: Rig) -> GameGuard | None:
        """The guard of an open rig, None where there is no camera; it watches already if it is known where the board
        is.

        Raises:
            RigFailed: it cannot be read.
            UserError: the calibration is of another camera.
        """
        guard_feed = rig.guard_feed()
        if guard_feed is None or rig.camera is None:
            return None

        def frames() -> GuardFrames:
            return scaled_frames(guard_feed.frames(self._interval), self._factor)

        arm = self._parameters, self._table, self._history
        guard = GameGuard(
            frames, guard_feed.holder, arm, self._progress, seen_from=guard_feed.seen_from, interval=self._interval
        )
        try:
            if (view := self._view(rig.camera.read(FIRST_FRAME_AGE).intrinsics)) is not None:
                guard.look(view)
        except HardwareError as error:
            raise RigFailed(f"cannot watch for hands: {error}") from error
        return guard
