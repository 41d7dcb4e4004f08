"""Where and when the arm may be fast: hands that come from wherever nobody looks do not meet a fast tool."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.guard.separation import EDGE, GRACE, HAND_SPEED, TOOL_SIZE, Separation, borders, nearest_beyond, reach
from app.rig.simulation.nominal_view import nominal_view
from controller.loop.playback import CHANGE
from hardware.contact_speeds import CONTACT_PROFILES
from hardware.sim.render.d435 import GLANCE, LEFT_IMAGER, colour_intrinsics, depth_intrinsics
from hardware.table import TableSettings
from vision.hands.hand_and_motion import Seen

TABLE = TableSettings(limits=CONTACT_PROFILES["separation"])
VIEW = nominal_view(colour_intrinsics(640, 480), TABLE).beside(depth_intrinsics(GLANCE), LEFT_IMAGER)
INTERVAL, LATENCY = 1.0 / 30.0, 0.06
FAST, SLOW = 1.5, 0.8
NOWHERE = np.zeros((0, 3))


class Holder:
    """Remembers what it was asked for."""

    def __init__(self) -> None:
        self.admitted: list[Any] = []

    def ask_to_hold(self) -> None: ...

    def resume(self) -> None: ...

    def admit_speed(self, speed: float, until: float, planes: tuple[float, ...]) -> None:
        self.admitted.append((speed, until, planes))


def seen(
    stamp: float = 1.0, area: float = 0.0, *, hand: bool = False, away: Any = NOWHERE, blind: bool = False
) -> Seen:
    return Seen(
        stamp, hand, area, frozenset(), moving=False, stable_since=0.0, settled=True, touched=frozenset(), away=away,
        blind=blind,
    )  # fmt: skip


@given(
    st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(0.0, 0.15)),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.1, 0.3)),
    st.floats(0.0, INTERVAL),
)
def test_a_hand_out_of_sight_meets_no_fast_tool(tool: Any, hand: Any, wait: float) -> None:
    """It starts wherever the last picture that showed nobody had no depth, as quickly as hands are, straight to a tool
    that is fast as long as it may be and comes towards it meanwhile."""
    aside = reach(LATENCY, INTERVAL, FAST, SLOW)
    planes = borders(VIEW, aside)
    fast = (planes[:, :3] @ TABLE.base_from_board(np.array(tool)) + planes[:, 3] >= 0.0).all()
    u, v = VIEW.project(np.array(hand)) if VIEW.depth(np.array(hand)) > 0.0 else (-1.0, -1.0)
    width, height = VIEW.intrinsics.width, VIEW.intrinsics.height
    aside_of_sight = not EDGE * width <= u <= (1.0 - EDGE) * width or v > height
    if fast and aside_of_sight:
        slow_after = LATENCY + INTERVAL + GRACE + (FAST - SLOW) / CHANGE
        comes = HAND_SPEED * slow_after + 0.5 * (FAST + SLOW) * (FAST - SLOW) / CHANGE
        assert math.dist(tool, hand) - TOOL_SIZE >= comes - 1e-9


@given(st.floats(0.0, 0.3), st.floats(0.004, 0.2), st.floats(0.0, 0.2))
def test_older_and_rarer_frames_ask_for_more_distance(age: float, interval: float, more: float) -> None:
    asked = reach(age, interval, FAST, SLOW)
    assert reach(age + more, interval, FAST, SLOW) >= asked
    assert reach(age, interval + more, FAST, SLOW) >= asked
    assert reach(age, interval, FAST, FAST) <= asked


def test_over_the_middle_of_the_board_the_arm_may_be_fast_and_at_the_cameras_side_it_may_not() -> None:
    planes = borders(VIEW, reach(LATENCY, INTERVAL, FAST, SLOW))

    def may(x: float, y: float, z: float) -> bool:
        point = TABLE.base_from_board(np.array([x, y, z]))
        return bool((planes[:, :3] @ point + planes[:, 3] >= 0.0).all())

    assert may(0.0, -0.05, 0.10)
    assert may(0.05, -0.10, 0.10)
    assert not may(0.0, 0.14, 0.10)
    assert not may(0.22, 0.05, 0.10)
    assert not may(0.0, -0.05, 0.30)


def test_each_frame_that_shows_nobody_admits_speed_for_as_long_as_the_next_may_take() -> None:
    holder = Holder()
    separation = Separation(VIEW, holder, INTERVAL, LATENCY, TABLE.limits)
    separation.judge(seen(2.0))
    speed, until, planes = holder.admitted[0]
    assert (speed, len(planes)) == (FAST, 16)
    assert until == pytest.approx(2.0 + LATENCY + INTERVAL + GRACE)


@pytest.mark.parametrize("shown", [
    seen(hand=True), seen(area=0.1), seen(away=np.array([[0.0, -0.25, 0.1]])), seen(away=np.array([[-0.4, 0.0, 0.2]])),
    seen(blind=True),
])  # fmt: skip
def test_whatever_may_be_a_person_near_the_table_admits_nothing(shown: Seen) -> None:
    holder = Holder()
    separation = Separation(VIEW, holder, INTERVAL, LATENCY, TABLE.limits)
    separation.judge(shown)
    assert holder.admitted == []
    assert (separation.frames, separation.admitted) == (1, 0)


def test_who_sits_farther_away_than_a_reach_slows_nothing_down() -> None:
    holder = Holder()
    separation = Separation(VIEW, holder, INTERVAL, LATENCY, TABLE.limits)
    sitting = np.array([[x, -TABLE.half_play[1] - separation.reach - 0.02, 0.1] for x in (-0.1, 0.0, 0.1)])
    separation.judge(seen(away=sitting))
    assert len(holder.admitted) == 1
    assert nearest_beyond(sitting, TABLE) == pytest.approx(separation.reach + 0.02)
    assert nearest_beyond(NOWHERE, TABLE) == math.inf
