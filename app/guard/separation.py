"""Where the arm may move faster than near people: speed and separation monitoring, ISO/TS 15066 5.5.4.

A person may be wherever the camera does not look, and reaches out at up to 1.6 m/s. From a frame's exposure until the
tool is slow again pass the frame's age, the time until the next one should have admitted more, and the slowing down.
Where no hand can be by then that came in at a side of the picture, the tool may be fast. Frame by frame that is
admitted again, as long as none shows anything over board and trays, or nearer to them than such a reach.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from app.rig.devices import Holder
from controller.loop.playback import CHANGE
from hardware.contact_speeds import ContactSpeeds
from hardware.table import TableSettings
from vision.arrays import Array
from vision.board.view import BoardView
from vision.hands.hand_and_motion import Seen

HAND_SPEED: Final = 1.6  # of a hand that reaches out [m/s]; ISO 13855
TOOL_SIZE: Final = 0.050
"""From the tool point to the farthest of what moves as fast beside it: gripper, fingers, and what they hold [m]."""
GRACE: Final = 0.008  # a frame may come so much later than the one after the other should [s]
EDGE: Final = 0.07
"""Share of the picture's width at either side that has no depth: one imager alone sees it. At the D435's left border
56 of 848 px where something is 0.4 m away."""
OVERHEAD: Final = 0.120
"""So far the tool stays from the picture's upper border [m]. Beyond it a hand is above all that is seen, on an arm that
comes over the table's edge: whoever it belongs to is in the picture before (assumed), as a sitting person's chest is.
A hand that nevertheless comes from there alone is covered up to 0.55 m/s; a camera that hangs higher sees it sooner."""


def reach(age: float, interval: float, fast: float, slow: float) -> float:
    """How far from the tool a hand must be in a frame for the tool to be fast until the next one and slow after [m].

    ``age``: of the frame when it is judged; ``interval``: from frame to frame [s]; ``slow``: near people [m/s].
    """
    slowing = (fast - slow) / CHANGE
    way = 0.5 * (fast + slow) * slowing  # of the tool, meanwhile
    return HAND_SPEED * (age + interval + GRACE + slowing) + way + TOOL_SIZE


def borders(view: BoardView, aside: float, overhead: float = OVERHEAD) -> Array:
    """Planes (4, 4) between which all is so far inside of what a camera sees [m]: left, right, upper, lower border.

    Rows a, b, c, d with a x + b y + c z + d ≥ 0 inside, (a, b, c) of length 1, base frame.
    """
    pinhole, table = view.intrinsics, view.table
    left, right = EDGE * pinhole.width - pinhole.cx, (1.0 - EDGE) * pinhole.width - pinhole.cx
    inward = np.array([
        [pinhole.fx, 0.0, -left], [-pinhole.fx, 0.0, right], [0.0, pinhole.fy, pinhole.cy],
        [0.0, -pinhole.fy, pinhole.height - pinhole.cy],
    ])  # fmt: skip
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    camera_from_base = view.camera_from_board @ np.linalg.inv(table.pose_in_base())
    planes = np.concatenate([inward @ camera_from_base[:3, :3], (inward @ camera_from_base[:3, 3])[:, None]], axis=1)
    planes[:, 3] -= np.array([aside, aside, overhead, aside])
    return planes


def nearest_beyond(points: Array, table: TableSettings) -> float:
    """How near points (n, 3) beyond board and trays, board frame, come to these, seen from above [m]; infinite without
    any.
    """
    if not len(points):
        return math.inf
    beyond = np.maximum(np.abs(points[:, :2]) - np.array(table.half_play), 0.0)
    return float(np.sqrt((beyond**2).sum(axis=1).min()))


class Separation:
    """Admits speed to the arm of a holder, frame by frame, in intervals [s].

    A frame that is older than ``latency`` [s] when it is judged admits nothing. ``limits``: of the tool's speed, where
    nobody is near and where somebody may be.

    Attributes:
        reach: of a hand, until the tool is slow [m].
        frames: how many were judged.
        admitted: how many showed nobody near.
    """

    def __init__(self, view: BoardView, holder: Holder, interval: float, latency: float, limits: ContactSpeeds) -> None:
        fast, slow = limits.tool_speed, limits.shared_tool_speed or limits.tool_speed
        self.reach = reach(latency, interval, fast, slow)
        self.frames = self.admitted = 0
        self._table, self._holder, self._speed, self._lasts = view.table, holder, fast, latency + interval + GRACE
        self._borders = tuple(borders(view, self.reach).ravel().tolist())

    def judge(self, seen: Seen) -> None:
        """Admit speed, where a frame shows nobody near.

        Raises:
            ControllerError: the controller does not answer.
        """
        self.frames += 1
        somebody = seen.hand_present or seen.hand_area > 0.0 or seen.blind
        if not (somebody or nearest_beyond(seen.away, self._table) < self.reach):
            self.admitted += 1
            self._holder.admit_speed(self._speed, seen.stamp + self._lasts, self._borders)
