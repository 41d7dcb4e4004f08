"""When to look at the board: whether a hand is over it, whether anything moves, and since when it is settled.

Frame by frame and without any clock of its own: time is what frames are stamped with. With depth a hand is what stands
higher than any piece, or reaches in from outside (:mod:`vision.hands.depth_changes`); without, it is what differs from
the settled board, whatever the light does, and reaches in from outside (:mod:`vision.hands.colour_changes`). What is
known to be before the table, such as the arm's links, is masked by the caller. A frame of depth alone
tells of hands just as well, and whether anything moves by what becomes higher or lower.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Final, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hardware.interfaces import DepthFrame, Frame
from vision.arrays import Array, Field, Mask, Picture
from vision.board.view import BoardView
from vision.hands.arm_mask import Hidden
from vision.hands.colour_changes import ColourObservation, Differences
from vision.hands.depth_changes import NOWHERE, Heights, Relief
from vision.hands.watched_zone import Space, Zone, shrink

_T = TypeVar("_T", bound=np.generic)

_NOBODY: Final = frozenset[int]()
_DARK: Final = 12.0  # a board whose lightest parts are darker is not seen: a camera that starts, a lamp that is out
_SHOWN: Final = 0.2
"""Of a board of which less has depth nothing is seen: something covers the camera, or is too near to it (measured in
guarded games: at least 0.97)."""
STABLE_TIME = 0.1  # players of a quick game leave the board alone for hardly longer between two moves [s]


@dataclass(frozen=True, slots=True)
class WatchSettings:
    """How a board is watched."""

    stable_time: float = 0.2  # nothing moved and no hand was there for so long: the board is settled [s]
    confirm: int = 2  # a hand counts as there, or as gone, after so many frames in a row that show it so
    motion: float = 0.15  # area that moves on a board at rest, by noise, at most [squares]
    margin: float = 0.75  # in colour, the board is watched to so far beyond its edge [squares]
    space_margin: float = 0.03  # in depth, to so far beyond the board and the trays [m]
    learning_delay: float = 0.15
    """A settled board is learned when it stays so for this long after: what comes in slowly is not taken for a part of
    the table [s]."""
    patience: float = 10.0
    """Without depth, what looks like a hand and does not move at all for so long is part of the table, as no hand is so
    still [s]."""

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a number is impossible.
        """
        if self.confirm < 1 or min(self.stable_time, self.motion, self.margin, self.learning_delay) < 0.0:
            raise ValueError(f"{self} is impossible: confirm is at least 1, everything else at least 0")


@dataclass(frozen=True, slots=True)
class Seen:
    """What is so at a frame."""

    stamp: float  # of the frame's exposure [s]
    hand_present: bool  # a hand, or whatever else is no piece, is over the board or the trays
    hand_area: float  # of what this frame shows of it [squares]
    over: frozenset[int]  # squares that it is over in this frame, 0 = a1 … 63 = h8
    moving: bool  # something moves over the board
    stable_since: float | None
    """Stamp of the first frame since which nothing on the board moved and no hand was over it or hid a part of it;
    None: not now [s]. A hand over a tray may be there meanwhile, where there is depth."""
    settled: bool  # that has been so for the stable time, and no hand is anywhere
    touched: frozenset[int]
    """Squares at which a hand was, low enough to touch, since the board was settled the last time; once it is settled
    again they are told in its first frame, and are then none."""
    away: Array = field(default_factory=lambda: NOWHERE, compare=False)
    """Points of what stands high, or higher than usual, beyond board and trays, (n, 3), board frame [m]; with depth
    alone."""
    blind: bool = False  # depth shows next to nothing of the board, so that a hand may be there all the same


@dataclass(slots=True)
class _StillnessTrack:
    """What was so up to the last frame."""

    hand: bool = False
    against: int = 0  # frames in a row that contradict ``hand``
    free: bool = False  # the last frame showed no hand over the board
    since: float | None = None
    settled: bool = False
    touched: frozenset[int] = _NOBODY
    still_since: float | None = None
    pending: deque[tuple[float, Picture | None, Field | None, Mask | None]] = field(default_factory=deque)
    moved: bool = True


class Watch:
    """Watches one board by one camera. Not thread-safe."""

    def __init__(self, settings: WatchSettings | None = None) -> None:
        self._settings = settings or WatchSettings()
        self._view: BoardView | None = None
        self._senses: _Senses | None = None

    def update(self, frame: Frame | DepthFrame, view: BoardView, hidden: Mask | Hidden | None = None) -> Seen:
        """Take in a frame by the camera of the view, later than the ones before; another view than the last begins
        anew.

        ``hidden``: where the arm, or anything else that is known, is before the table; a mask is (height, width).

        Raises:
            ValueError: the frame is by another camera, older than the last, or the mask has another size.
        """
        view.require_camera(frame)
        if self._senses is None or view is not self._view:
            zone = Zone.of_view(view, self._settings.margin)
            heights = Heights(Space.of_view(view, self._settings.space_margin), view.table)
            self._view, self._senses = view, _Senses(self._settings, zone, heights, view.table.square)
        colour = frame.colour if isinstance(frame, Frame) else None
        known = hidden if isinstance(hidden, Hidden) or hidden is None else Hidden(hidden)
        return self._senses.take(colour, frame.depth, frame.stamp, known)

    def pause(self) -> None:
        """Nobody looks for a while: the last frames will say nothing of the next one, but the board stays known."""
        if self._senses is not None:
            self._senses.pause()


class ColourWatch:
    """Watches by a camera of which nothing is known but where the board's outer corners a1, h1, h8, a8 are, (4, 2)
    [px]. Not thread-safe.
    """

    def __init__(self, corners: ArrayLike, settings: WatchSettings | None = None) -> None:
        self._corners = np.array(corners, dtype=float)
        self._settings = settings or WatchSettings()
        self._senses: _Senses | None = None
        self._size: tuple[int, ...] = ()

    def update(self, colour: Picture, stamp: float, hidden: Mask | None = None) -> Seen:
        """Take a frame in, RGB (h, w, 3), exposed at a stamp [s]; see ``Watch.update``.

        Raises:
            ValueError: frames come in another order or size, or the corners are no board.
        """
        if self._senses is None:
            height, width = colour.shape[:2]
            zone = Zone.of_corners(self._corners, (width, height), self._settings.margin)
            self._senses, self._size = _Senses(self._settings, zone, None, 1.0), colour.shape
        if colour.shape != self._size:
            raise ValueError(f"a frame of shape {colour.shape} came after ones of {self._size}: watch one camera")
        return self._senses.take(colour, None, stamp, None if hidden is None else Hidden(hidden))


@dataclass(frozen=True, slots=True, eq=False)
class SettledView:
    """A picture of a settled board."""

    colour: Picture  # RGB, shape (h, w, 3)
    stamp: float  # of its exposure [s]
    since: float  # the board has looked like this since then [s]
    touched: frozenset[int]  # squares at which a hand was since the last settled view


class VideoGate:
    """Gates a video, frame by frame, in which the outer corners a1, h1, h8, a8 are (4, 2) [px]. Not thread-safe.

    By default the watch has a shorter stable time than that of a game at a camera.
    """

    def __init__(self, corners: ArrayLike, settings: WatchSettings | None = None) -> None:
        self.seen: Seen | None = None  # what the last frame showed; None before the first one
        self._watch = ColourWatch(corners, settings or WatchSettings(stable_time=STABLE_TIME))
        self._told = False

    def update(self, colour: Picture, stamp: float) -> SettledView | None:
        """Take a frame in, RGB (h, w, 3), all of one size, with a stamp later than those before [s]; give it back if
        the board is settled from here on.

        Raises:
            ValueError: frames come in another order or size, or the corners are no board.
        """
        seen = self.seen = self._watch.update(colour, stamp)
        if not seen.settled:
            self._told = False
            return None
        if self._told or seen.stable_since is None:
            return None
        self._told = True
        return SettledView(colour, stamp, seen.stable_since, seen.touched)


class _Senses:
    """The watch of one view."""

    def __init__(self, settings: WatchSettings, zone: Zone, heights: Heights | None, square: float) -> None:
        self._settings, self._zone, self._heights = settings, zone, heights
        self._differences = Differences(zone)
        self._square = square
        self._track = _StillnessTrack()
        self._stamp = float("-inf")

    def pause(self) -> None:
        """See ``Watch.pause``."""
        self._track = _StillnessTrack()

    def take(self, colour: Picture | None, depth: Field | None, stamp: float, hidden: Hidden | None) -> Seen:
        """See ``Watch.update``; ``colour`` None: depth must be there."""
        if stamp <= self._stamp:
            raise ValueError(f"a frame of {stamp:.3f} s came after one of {self._stamp:.3f} s: give them in order")
        shape = next(picture.shape[:2] for picture in (colour, depth) if picture is not None)
        if hidden is not None and hidden.mask.shape != shape:
            raise ValueError(f"a mask of shape {hidden.mask.shape} does not fit a picture of shape {shape}")
        if self._track.settled:
            self._track.touched = _NOBODY  # told with that frame
        before, self._stamp = self._stamp, stamp
        covered, bodies = (None, None) if hidden is None else (self._every(hidden.mask), hidden.bodies)
        distance = None if depth is None or self._heights is None else self._every(depth)
        relief = None if distance is None or self._heights is None else self._heights.look(distance, covered, bodies)
        small = None if colour is None else shrink(colour, self._zone.step)
        colours = None if small is None else self._differences.look(small, covered, reaching=distance is None)
        area, over, low = self._evidence(colours, relief)
        if low and (relief is not None or (colours is not None and colours.moving > 0.0)):
            self._track.touched |= low
        self._judge_hand(area > 0.0)
        moving = self._moves(colours, relief)
        # a hand over a tray, where it ends what it has to do, leaves the board as it is
        over_board = area > 0.0 if relief is None else relief.before
        blind = distance is not None and self._heights is not None and self._heights.shown(distance, covered) < _SHOWN
        free = not (over_board or blind) and (
            small is None or float(np.percentile(small[::4, ::4][self._zone.board[::4, ::4]], 90)) >= _DARK
        )
        # a frame that differs in nothing from the one before shows what that one showed: it has been so since then
        since = before if self._track.free else stamp
        self._judge_rest(free and not moving, since, nobody=not (area > 0.0 or self._track.hand))
        self._track.free = free
        self._learn(small, distance, covered, still=not moving and relief is None)
        track, away = self._track, NOWHERE if relief is None else relief.away
        return Seen(stamp, track.hand, area, over, moving, track.since, track.settled, track.touched, away, blind)

    def _moves(self, colours: ColourObservation | None, relief: Relief | None) -> bool:
        if colours is not None:
            return colours.moving > self._settings.motion
        return relief is None or relief.moving > self._settings.motion * self._square**2

    def _evidence(
        self, colours: ColourObservation | None, relief: Relief | None
    ) -> tuple[float, frozenset[int], frozenset[int]]:
        """Area of a hand [squares], squares it is over, and those where it may touch something."""
        if relief is not None:
            return relief.area / self._square**2, relief.over, relief.low
        assert colours is not None  # a frame has colour or depth
        return colours.reaching, colours.over, colours.over

    def _every(self, pixels: NDArray[_T]) -> NDArray[_T]:
        """Each ``step``-th pixel along both axes, as many as the small picture has."""
        step, (height, width) = self._zone.step, self._zone.board.shape
        return pixels[: step * height : step, : step * width : step]

    def _judge_hand(self, shown: bool) -> None:
        track = self._track
        track.against = track.against + 1 if shown is not track.hand else 0
        if track.against >= self._settings.confirm:
            track.hand, track.against = shown, 0

    def _judge_rest(self, quiet: bool, since: float, *, nobody: bool) -> None:
        track = self._track
        if not (quiet and nobody):
            if track.settled:
                track.moved = True
            track.settled = False
            track.pending.clear()
        if not quiet:
            track.since = None
        elif track.since is None:
            track.since = since
        track.settled = (
            nobody and track.since is not None and self._stamp - track.since >= self._settings.stable_time - 1e-6
        )

    def _learn(self, small: Picture | None, depth: Field | None, hidden: Mask | None, *, still: bool) -> None:
        """What is settled, and stays so, is what the board looks like."""
        track, delay = self._track, self._settings.learning_delay
        if track.settled:
            track.pending.append((self._stamp, small, depth, hidden))
            if small is not None and not self._differences.knows_the_board:
                delay = 0.0
        while track.pending and self._stamp - track.pending[0][0] >= delay:
            _, picture, distance, mask = track.pending.popleft()
            if picture is not None:
                self._differences.learn(picture, mask, moved=track.moved)
            if self._heights is not None and distance is not None:
                self._heights.learn(distance, mask, moved=track.moved)
            track.moved = False
        track.still_since = (track.still_since or self._stamp) if still else None
        if track.hand and track.still_since is not None and self._stamp - track.still_since > self._settings.patience:
            self._differences.forget()
            self._track = _StillnessTrack()
