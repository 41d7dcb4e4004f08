"""Episodes: the moments of a ply that are its frames, and what was observed and commanded at each.

A frame is a moment that was recorded: nothing is interpolated. State and picture are of one and the same tick, where
both are recorded at the same ticks as a quick simulation does; else the state is the one nearest to the picture.
No whole number of frames a second is a whole number of ticks. A quick simulation records each 45 ticks, 25.25 times a
second: at 25 frames a second those moments are the frames, evenly, although 39.6 ms pass from one to the next and not
40. At a rate that is no such neighbour, frame k is the moment nearest to k/fps after the first. ``plant_time`` has the
true time of each.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app import UserError
from app.dataset.games import RecordedPly
from app.dataset.signals import Rows, actions
from app.dataset.told import ToldTicks

Ticks = NDArray[np.int64]

_ALIKE: Final = 0.02
"""Rates that differ by less than this share are taken for the same: no whole rate fits a tick exactly."""
_SETTLES: Final = 0.04
"""The last frame lies no longer after the end of a ply [s]."""


class LeftOut(StrEnum):
    """Why a ply is no episode."""

    FAILED = "went wrong"
    RESUMED = "were finished after an interruption"
    MENDED = "needed something to be put right on the way"
    GAPS = "have gaps in what was recorded"


@dataclass(frozen=True, slots=True)
class Demonstration:
    """One episode: n frames of a ply.

    Attributes:
        ply: that was played.
        tick: of each frame, shape (n,), rising.
        time: plant time of each, shape (n,) [s].
        state: rows of ``signals.STATE``, shape (n, 21).
        reference: rows of ``signals.REFERENCE``, shape (n, 3) [m].
        action: rows of ``signals.ACTION``, shape (n, 7).
    """

    ply: RecordedPly
    tick: Ticks
    time: NDArray[np.float64]
    state: Rows
    reference: Rows
    action: Rows

    def __len__(self) -> int:
        return len(self.tick)


class Moments:
    """The moments of a match that can be frames.

    Args:
        told: what the controller told.
        pictured: ticks of which pictures can be drawn, shape (m,), rising; None: no pictures are wanted.
        fps: frames a second of plant time.

    Raises:
        UserError: fewer were recorded than frames are wanted.
    """

    def __init__(self, told: ToldTicks, pictured: Ticks | None, fps: int) -> None:
        self._told = told
        self._ticks = told.tick if pictured is None else pictured
        period = float(told.time[-1] / max(told.tick[-1], 1))
        self._time = self._ticks.astype(np.float64) * period
        interval = float(np.median(np.diff(self._time))) if len(self._time) > 1 else math.inf
        if fps * interval > 1.0 + _ALIKE:
            most = math.floor((1.0 + _ALIKE) / interval)
            raise UserError(
                f"--fps {fps} is more than was recorded, {1.0 / interval:.1f} moments a second: "
                f"say --fps {most} or less"
                if most
                else "what was recorded is too short for frames: name a game of which a ply was played"
            )
        self._interval, self._step = interval, _step(interval, fps)
        """From frame to frame [s]."""
        self._farthest = 0.5 * (1.0 + _ALIKE) * max(interval, self._step)
        """A frame may lie so far from where it should [s]."""
        self._told_within = self._farthest / period
        """And so far from what the controller told [ticks]."""

    def demonstration(self, ply: RecordedPly) -> Demonstration | LeftOut:
        """A ply as an episode: from just before its first part was begun until the arm had come to rest at home."""
        told, chosen = self._told, self._chosen(ply.begun, ply.ended)
        if chosen is None:
            return LeftOut.GAPS
        rows = told.nearest(self._ticks[chosen])
        state, reference = told.state[rows], told.reference[rows]
        near = np.abs(told.tick[rows] - self._ticks[chosen]) <= self._told_within
        if not (near.all() and np.isfinite(state).all() and np.isfinite(reference).all()):
            return LeftOut.GAPS
        return self._episode(ply, chosen, state, reference)

    def _chosen(self, begun: float, ended: float) -> NDArray[np.intp] | None:
        """Which moments are frames; None: where some should be there are none.

        The first is one at which the arm still rests at home: of those in the last interval before it sets out the one
        from which the frames follow most evenly, or else the last before that. The last comes no later than it must so
        that the arm rests at home again.
        """
        latest = max(int(np.searchsorted(self._time, begun, side="right")) - 1, 0)
        if ended > self._time[-1]:
            return None
        earliest = min(int(np.searchsorted(self._time, begun - self._interval, side="right")), latest)
        ways = [self._even(start, ended) for start in range(latest, earliest - 1, -1)]
        chosen, off = min(ways, key=lambda way: round(float(way[1].max()), 6))
        held = off <= self._farthest
        return chosen if held.all() and (np.diff(chosen) > 0).all() and len(chosen) > 1 else None

    def _even(self, start: int, ended: float) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """The moments that follow from one on, and how far each is from where it should be [s]."""
        begins = self._time[start]
        due = begins + np.arange(math.ceil((ended - begins) / self._step) + 1) * self._step
        chosen = self._nearest(due)
        here = self._time[chosen] < ended + min(self._step, _SETTLES)
        return chosen[here], np.abs(self._time[chosen] - due)[here]

    def _nearest(self, due: NDArray[np.float64]) -> NDArray[np.intp]:
        after = np.clip(np.searchsorted(self._time, due), 1, len(self._time) - 1)
        before = after - 1
        return np.where(due - self._time[before] <= self._time[after] - due, before, after)

    def _episode(self, ply: RecordedPly, chosen: NDArray[np.intp], state: Rows, reference: Rows) -> Demonstration:
        """After the last frame the arm rests: what is commanded there is to stay."""
        time = self._time[chosen]
        commanded = actions(
            np.vstack((state, state[-1:])), np.vstack((reference, reference[-1:])), np.append(time, time[-1] + 1.0)
        )
        return Demonstration(ply, self._ticks[chosen], time, state, reference, commanded)


def _step(interval: float, fps: int) -> float:
    """From frame to frame [s]: as many whole intervals as come near to 1/fps, or else just that."""
    whole = round(1.0 / (fps * interval)) * interval
    return whole if abs(whole * fps - 1.0) <= _ALIKE else 1.0 / fps


def demonstrations(
    plies: tuple[RecordedPly, ...], moments: Moments, failures: bool
) -> Iterator[Demonstration | LeftOut]:
    """Each ply as an episode, or why it is none.

    Args:
        plies: of a match, in the order in which they were played.
        moments: of that match.
        failures: also those that went wrong.
    """
    for ply in plies:
        if ply.resumed:
            yield LeftOut.RESUMED
        elif ply.mended:
            yield LeftOut.MENDED
        elif not (ply.success or failures):
            yield LeftOut.FAILED
        else:
            yield moments.demonstration(ply)
