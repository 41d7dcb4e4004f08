"""A hand over the board stops the arm: a thread that watches the camera's frames and asks the controller to hold.

The guard looks at every frame, masks the arm's links as they were when it was exposed, and asks for a hold at the first
frame that confirms a hand. The controller then refuses every motion until the board is clear again and the game
calls ``clear``, so that no motion can slip in between. From the hand being seen until the arm rests it
takes, in plant time: up to one frame's interval until the next exposure, ``WatchSettings.confirm`` − 1 more of
them, the camera's latency, and at most 0.1 s of the controlled stop; at 30 frames a second and 60 ms of
latency 0.23 s.

Nothing here replaces the controller's own protection, which notices what it touches; it only comes earlier.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Self

from app import UserError
from app.guard.arm_silhouette import ArmMasks
from app.guard.separation import Separation
from app.rig.devices import GuardFrames, Holder
from controller.wire.errors import ControllerError
from hardware.interfaces import CameraClosed, DepthFrame, Frame, HardwareError
from vision.board.view import BoardView
from vision.hands.hand_and_motion import Seen, Watch

FRAME_AGE: Final = 1.0  # frames older than this say nothing about the present [s]; a late one is left out and told of
_Shown = tuple[Frame | DepthFrame, Seen]
Listener = Callable[[Frame | DepthFrame, Seen], None]


class Blind(UserError):
    """The camera gives no frames any more, so that a hand would not be seen."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"the camera no longer sees hands over the board: {reason}; the arm holds")


@dataclass(frozen=True, slots=True)
class GuardStop:
    """The arm was asked to hold: stamp of the frame that confirmed a hand [s], and squares that it was over."""

    stamp: float
    over: frozenset[int]


@dataclass(slots=True, eq=False)
class _Request:
    """Of somebody who waits for a frame without a hand."""

    gone: bool = False  # that is all; else the board is to be settled, too
    admit: bool = False  # motions shall be admitted then
    colour: bool = False  # the frame shall have colour
    after: float | None = None  # it shall be stamped later [s]; None: it shall be a new one
    first: int = 0  # number of the first frame that will do
    found: _Shown | None = None  # the frame


class HandGuard:
    """Watches in a thread of its own from ``start`` to ``close``. A context manager.

    ``frames`` are of the board's camera, ``view`` and ``masks`` say where board and arm are in them. ``holder`` is
    asked to hold; ``separation`` admits speed to the arm where depth shows nobody near (None: nobody does).
    ``progress`` is told when a hand comes and goes; ``listener`` is called with each frame and what was seen in it, in
    the guard's thread. ``holding``: a guard before this one has asked to hold, and that is in force.
    """

    def __init__(
        self, frames: GuardFrames, view: BoardView, masks: ArmMasks, holder: Holder, watch: Watch | None = None,
        separation: Separation | None = None, progress: Callable[[str], None] | None = None,
        listener: Listener | None = None, *, holding: bool = False,
    ) -> None:  # fmt: skip
        self.stops: list[GuardStop] = []  # each time the arm was asked to hold
        self._frames, self._view, self._masks, self._holder = frames, view, masks, holder
        self._watch, self._separation = watch or Watch(), separation
        self._progress, self._listener = progress, listener
        self._news = threading.Condition()
        self._newest: _Shown | None = None
        self._count = 0
        self._requests = list[_Request]()
        self._came, self._departures = False, 0
        self._gone_at: float | None = None
        self._blind_since: float | None = None
        self._holding = holding
        self._trouble: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="hand guard", daemon=True)

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def close(self) -> None:
        """End the thread and give the camera back; a hold stays in force."""
        self._frames.close()
        if self._thread.is_alive():
            self._thread.join()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def holding(self) -> bool:
        """Whether a hold that this guard has asked for is in force."""
        with self._news:
            return self._holding

    @property
    def seen(self) -> Seen | None:
        """What the newest frame showed; None before the first one.

        Raises:
            Blind: there are no frames any more.
        """
        with self._news:
            self._check()
            return None if self._newest is None else self._newest[1]

    def wake(self, awake: bool) -> None:
        """Whether plant time shall run for the camera while nothing moves; see ``GuardFrames.wake``."""
        self._frames.wake(awake)

    @property
    def blind(self) -> bool:
        """Whether there are no frames any more."""
        with self._news:
            return self._trouble is not None

    @property
    def departures(self) -> int:
        """So often a hand has come, has gone, and the board lay still."""
        with self._news:
            return self._departures

    @property
    def arrivals(self) -> int:
        """So often a hand has come since it watches."""
        with self._news:
            return self._departures + self._came

    @property
    def last_stamp(self) -> float | None:
        """Of the newest frame [s]; None before the first one."""
        with self._news:
            return None if self._newest is None else self._newest[0].stamp

    @property
    def leaving(self) -> bool:
        """Whether a hand has gone, and the board does not lie still yet."""
        with self._news:
            return self._came and self._gone_at is not None

    @property
    def gone_at(self) -> float | None:
        """Stamp of the first frame without the hand that was seen last [s]; None: there is one, or there was none."""
        with self._news:
            return self._gone_at

    def clear(self) -> Seen:
        """Wait until no hand is over the board and the board is settled, then admit motions again: what a frame shows
        that was exposed after this call began.

        The turn's interlock: called before every motion over the board, at rest. Plant time runs meanwhile.

        Raises:
            Blind: there are no frames any more.
            ControllerError: the controller does not answer.
        """
        _, seen = self._wait(admit=True)
        return seen

    def settled(self, after: float | None = None) -> tuple[Frame, Seen]:
        """Wait likewise, but admit no motion: for a person's turn, whose move is then looked for in the frame.

        Returns:
            A frame that was exposed after this call began, or any with a later stamp than ``after``, that of one that
            was not clear enough [s]; and what was seen in it.

        Raises:
            Blind: there are no frames any more.
        """
        frame, seen = self._wait(admit=False, after=after)
        assert isinstance(frame, Frame)
        return frame, seen

    def sight(self, patience: float) -> bool:
        """Wait until no hand is over the board, settled or not, but not longer than a patience [s, wall]; admits no
        motion. Whether none is there.

        Raises:
            Blind: there are no frames any more.
        """
        with self._news:
            self._check()
            if self._newest is None or not self._newest[1].hand_present:
                return True
        return self._answer(_Request(gone=True), patience) is not None

    def _wait(self, *, admit: bool, after: float | None = None) -> _Shown:
        found = self._answer(_Request(admit=admit, colour=not admit, after=after), None)
        assert found is not None
        return found

    def _answer(self, request: _Request, patience: float | None) -> _Shown | None:
        """Let plant time run until a frame is there that somebody waits for; None: it does not come."""
        self._frames.wake(True)
        with self._news:
            if request.after is None and not request.gone:
                # a frame that was exposed before this call may be on its way, and one or two more in the pipe
                request.first = self._count + 3
            self._requests.append(request)
            try:
                self._serve()
                self._news.wait_for(lambda: self._trouble is not None or request.found is not None, patience)
            finally:
                if request in self._requests:  # nobody waits any more
                    self._requests.remove(request)
                    self._frames.wake(False)
            if request.found is None:
                self._check()
        return request.found

    def _serve(self) -> None:
        """Give who waits the newest frame, if it is the one. In the thread that reads, before it reads on: plant time
        that waits for it then goes on, or stands, as if the waiter had taken no time.
        """
        for request in [request for request in self._requests if self._is_met(request)]:
            if request.admit and self._holding:
                self._holding = False
                self._holder.resume()  # under the lock: a hand that comes now is told of to the controller later
                self._say("the board is clear: the arm may continue")
            self._frames.wake(False)
            request.found = self._newest
            self._requests.remove(request)

    def _is_met(self, request: _Request) -> bool:
        if self._newest is None or self._count < request.first:
            return False
        frame, seen = self._newest
        if seen.hand_present or not (seen.settled or request.gone):
            return False
        late = request.after is None or frame.stamp > request.after
        return late and (isinstance(frame, Frame) or not request.colour)

    def _check(self) -> None:
        if self._trouble is not None:
            raise Blind(str(self._trouble)) from self._trouble

    def _run(self) -> None:
        try:
            while True:
                self._take(self._frames.read(FRAME_AGE))
        except CameraClosed:
            pass  # by ``close``
        except Exception as error:
            self._give_up(error)
            if not isinstance(error, ControllerError | HardwareError | UserError):
                raise  # a bug: the arm holds already, and the traceback is told

    def _take(self, frame: Frame | DepthFrame) -> None:
        seen = self._watch.update(frame, self._view, self._masks.at(frame.stamp))
        self._require_sight(seen)
        with self._news:
            ask = seen.hand_present and not self._holding
            self._holding = self._holding or ask
            self._newest = frame, seen
            if seen.hand_present:
                self._came, self._gone_at = True, None
            elif self._came and self._gone_at is None:
                self._gone_at = frame.stamp
            if self._came and seen.settled and not seen.hand_present:
                self._came, self._departures = False, self._departures + 1
        if ask:
            self._holder.ask_to_hold()
            self.stops.append(GuardStop(frame.stamp, seen.over))
            self._say("a hand is over the board: the arm holds")
        elif self._separation is not None and frame.depth is not None:  # colour shows nobody beyond the board's rim
            self._separation.judge(seen)
        if self._listener is not None:
            self._listener(frame, seen)
        with self._news:
            self._count += 1
            self._serve()
            self._news.notify_all()

    def _require_sight(self, seen: Seen) -> None:
        """Raises ``HardwareError`` where frames have shown nothing of the board for so long as none may be missing."""
        self._blind_since = (self._blind_since or seen.stamp) if seen.blind else None
        if self._blind_since is not None and seen.stamp - self._blind_since > FRAME_AGE:
            raise HardwareError(
                "its depth shows nothing of the board: take away what covers it or is close to it, and check that its "
                "emitter is on"
            )

    def _give_up(self, error: Exception) -> None:
        """Nobody watches any more: the arm must not move over the board."""
        for last_act in (self._holder.ask_to_hold, self._frames.release):
            try:
                last_act()
            except (ControllerError, HardwareError) as worse:
                error = worse
        with self._news:
            self._holding = True
            self._trouble = error
            self._news.notify_all()

    def _say(self, sentence: str) -> None:
        if self._progress is not None:
            self._progress(sentence)
