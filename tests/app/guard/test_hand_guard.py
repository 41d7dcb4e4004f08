"""The guard of the arm: over frames from a queue and a controller that only counts."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from app.game.person import HandNotice
from app.guard.arm_silhouette import ArmHistory, ArmMasks
from app.guard.game_guard import GameGuard
from app.guard.hand_guard import Blind, HandGuard
from app.guard.separation import Separation
from app.rig.simulation.nominal_view import nominal_view
from hardware.interfaces import CameraClosed, DepthFrame, Frame, HardwareError, Intrinsics
from hardware.parameters import load_parameters
from hardware.table import TableSettings
from tests.waiting import PATIENCE, until
from vision.hands.hand_and_motion import Seen

PINHOLE = Intrinsics(320, 240, 308.0, 308.0, 159.5, 119.5)
VIEW = nominal_view(PINHOLE, TableSettings())
COLOUR = np.full((240, 320, 3), 120, dtype=np.uint8)


def depth_of(hand: bool) -> Any:
    """The board's plane, and a slab 0.1 m above its middle."""
    u, v = np.meshgrid(np.arange(320), np.arange(240))
    rays = np.stack([(u - PINHOLE.cx) / PINHOLE.fx, (v - PINHOLE.cy) / PINHOLE.fy, np.ones(u.shape)], axis=2)
    slope = rays @ VIEW.camera_from_board[:3, 2]
    down = np.where(slope < 0.0, slope, -np.inf)
    height = np.zeros(u.shape)
    if hand:
        row, column = np.rint(VIEW.project([0.0, 0.0, 0.1])[::-1]).astype(int)
        height[row - 12 : row + 12, column - 12 : column + 12] = 0.1
    return ((height - VIEW.camera_position[2]) / down).astype(np.float32)


FREE, HAND = depth_of(False), depth_of(True)


class Frames:
    """Hands out what is put in; as a camera whose reader waits."""

    def __init__(self) -> None:
        self.waiting: queue.Queue[Frame | DepthFrame | Exception] = queue.Queue()
        self.woken: list[bool] = []
        self.released = 0
        self.newest = 0.0
        """Stamp of the last frame [s]."""

    def put(self, depth: Any, times: int = 1) -> None:
        for _ in range(times):
            self.newest += 1.0 / 30.0
            self.waiting.put(Frame(COLOUR.copy(), depth.copy(), PINHOLE, self.newest))

    def put_bare(self, depth: Any) -> None:
        self.newest += 1.0 / 30.0
        self.waiting.put(DepthFrame(depth.copy(), PINHOLE, self.newest))

    def read(self, max_age: float) -> Frame | DepthFrame:
        one = self.waiting.get(timeout=PATIENCE)
        if isinstance(one, Exception):
            raise one
        return one

    def wake(self, awake: bool) -> None:
        self.woken.append(awake)

    def release(self) -> None:
        self.released += 1

    def close(self) -> None:
        self.waiting.put(CameraClosed())


class Controller:
    """Counts."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def ask_to_hold(self) -> None:
        self.asked.append("hold")

    def resume(self) -> None:
        self.asked.append("resume")


class Masks(ArmMasks):
    """No arm is before the table."""

    def __init__(self) -> None:
        super().__init__(VIEW, load_parameters(), TableSettings(), ArmHistory(0.001))

    def at(self, stamp: float) -> None:
        return None


@contextmanager
def flowing(frames: Frames, put: Callable[[Any], None] | None = None) -> Iterator[None]:
    """Frames of the free board go on coming: who begins to wait for new ones may begin late."""
    over = threading.Event()

    def flow() -> None:
        while not over.wait(0.005):
            (put or frames.put)(FREE)

    thread = threading.Thread(target=flow)
    thread.start()
    yield
    over.set()
    thread.join()
    until(frames.waiting.empty)


@pytest.fixture
def frames() -> Frames:
    return Frames()


@pytest.fixture
def controller() -> Controller:
    return Controller()


@pytest.fixture
def guard(frames: Frames, controller: Controller) -> Iterator[HandGuard]:
    with HandGuard(frames, VIEW, Masks(), controller) as one:
        yield one


def test_the_frame_that_confirms_a_hand_makes_the_controller_hold_once(
    frames: Frames, controller: Controller, guard: HandGuard
) -> None:
    frames.put(FREE, 3)
    frames.put(HAND)
    until(lambda: frames.waiting.empty() and guard.seen is not None and guard.seen.stamp > 0.13)
    assert controller.asked == []
    frames.put(HAND, 5)
    until(lambda: guard.seen is not None and guard.seen.stamp > 0.29)
    assert controller.asked == ["hold"]
    assert guard.holding
    (stop,) = guard.stops
    assert stop.stamp == pytest.approx(5.0 / 30.0)
    assert {27, 28, 35, 36} & stop.over


def test_motions_are_admitted_again_when_the_board_is_clear_and_settled_and_not_before(
    frames: Frames, controller: Controller, guard: HandGuard
) -> None:
    frames.put(HAND, 3)
    until(lambda: controller.asked == ["hold"])
    cleared: list[Any] = []
    waiter = threading.Thread(target=lambda: cleared.append(guard.clear()))
    waiter.start()
    frames.put(HAND, 6)
    frames.put(FREE, 5)
    until(frames.waiting.empty)
    waiter.join(0.2)
    assert controller.asked == ["hold"]
    assert waiter.is_alive()
    with flowing(frames):
        waiter.join(PATIENCE)
    assert controller.asked == ["hold", "resume"]
    assert cleared[0].settled
    assert not guard.holding
    assert frames.woken == [True, False]


def test_a_board_without_a_hand_is_clear_once_newer_frames_say_so(
    frames: Frames, controller: Controller, guard: HandGuard
) -> None:
    frames.put(FREE, 12)
    until(frames.waiting.empty)
    before = guard.seen
    with flowing(frames):
        after = guard.clear()
    assert before is None or after.stamp > before.stamp
    assert controller.asked == []


def test_who_cannot_see_lets_nothing_move(frames: Frames, controller: Controller, guard: HandGuard) -> None:
    frames.put(FREE, 2)
    frames.waiting.put(HardwareError("the cable is out: plug it in"))
    with pytest.raises(Blind, match="no longer sees hands over the board: the cable is out: plug it in; the arm holds"):
        guard.clear()
    assert controller.asked == ["hold"]
    assert frames.released == 1
    with pytest.raises(Blind):
        _ = guard.seen


class Judge(Separation):
    """Notes which frames were judged."""

    def __init__(self) -> None:
        self.stamps: list[float] = []

    def judge(self, seen: Seen) -> None:
        self.stamps.append(seen.stamp)


@pytest.mark.parametrize("deep", [True, False])
def test_speed_is_admitted_by_depth_alone(frames: Frames, controller: Controller, deep: bool) -> None:
    """In colour only the board and its rim are watched: whoever is a hand's breadth from it is in no frame."""
    judge = Judge()
    with HandGuard(frames, VIEW, Masks(), controller, separation=judge) as guard:
        for number in range(1, 7):
            frames.waiting.put(Frame(COLOUR.copy(), FREE.copy() if deep else None, PINHOLE, number / 30.0))
        until(lambda: guard.last_stamp == 6 / 30.0)
    assert judge.stamps == ([number / 30.0 for number in range(1, 7)] if deep else [])


def test_a_camera_that_is_covered_is_one_that_does_not_see(
    frames: Frames, controller: Controller, guard: HandGuard
) -> None:
    """Something right before it has no depth, and hides the board: a hand might be there unseen."""
    frames.put(FREE, 12)
    frames.put(np.zeros_like(FREE), 20)
    frames.put(FREE, 12)
    frames.put(np.zeros_like(FREE), 28)
    until(lambda: frames.waiting.empty() and guard.seen is not None and guard.seen.stamp > 71.5 / 30.0)
    assert controller.asked == [], "not for a moment"
    frames.put(np.zeros_like(FREE), 4)
    until(lambda: guard.blind)
    assert controller.asked == ["hold"]
    with pytest.raises(Blind, match="its depth shows nothing of the board: take away what covers it"):
        guard.clear()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("release_fails", [False, True])
def test_a_guard_that_breaks_makes_the_arm_hold_first(frames: Frames, release_fails: bool) -> None:
    """Whatever ends the watch, also a bug and a world that does not listen: the arm must not go on unwatched."""

    def fail() -> None:
        raise HardwareError("the world is gone")

    if release_fails:
        frames.release = fail  # type: ignore[method-assign]
    controller = Controller()
    frames.waiting.put(RuntimeError("a bug"))
    with HandGuard(frames, VIEW, Masks(), controller) as guard:
        with pytest.raises(Blind, match="the world is gone" if release_fails else "a bug"):
            guard.clear()
        assert controller.asked == ["hold"]


def test_a_persons_turn_ends_with_a_settled_frame_and_admits_no_motion(
    frames: Frames, controller: Controller, guard: HandGuard
) -> None:
    frames.put(HAND, 3)
    until(lambda: controller.asked == ["hold"])
    found: list[Any] = []
    waiter = threading.Thread(target=lambda: found.append(guard.settled()))
    waiter.start()
    with flowing(frames):
        waiter.join(PATIENCE)
    (frame, seen) = found[0]
    assert frame.colour.shape == (240, 320, 3)
    assert frame.stamp == seen.stamp
    assert seen.settled
    assert controller.asked == ["hold"]
    assert guard.holding  # the hold is in force until the board is cleared for a motion
    with flowing(frames):
        guard.clear()
    assert controller.asked == ["hold", "resume"]


def test_after_a_frame_that_was_not_clear_enough_the_very_next_one_will_do(frames: Frames, guard: HandGuard) -> None:
    frames.put(FREE, 12)
    until(lambda: guard.seen is not None and guard.seen.settled and frames.waiting.empty())
    found: list[Any] = []

    def wait(after: float | None) -> threading.Thread:
        waiter = threading.Thread(target=lambda: found.append(guard.settled(after)))
        waiter.start()
        return waiter

    waiter = wait(None)
    with flowing(frames):
        waiter.join(PATIENCE)
    newest = frames.newest
    waiter = wait(newest + 0.01)
    waiter.join(0.2)
    assert waiter.is_alive(), "all frames so far are older than that"
    frames.put(FREE, 1)
    waiter.join(PATIENCE)
    assert found[1][0].stamp == pytest.approx(newest + 1.0 / 30.0)


def test_frames_of_depth_alone_hold_the_arm_and_clear_it_once_nothing_moves_but_are_no_look_at_the_board(
    frames: Frames, controller: Controller, guard: HandGuard
) -> None:
    for depth in (FREE, FREE, HAND, HAND):
        frames.put_bare(depth)
    until(lambda: controller.asked == ["hold"])
    looker, waiter = threading.Thread(target=guard.settled), threading.Thread(target=guard.clear)
    looker.start()
    waiter.start()
    rolling = FREE.copy()
    for k in range(20):
        rolling[100:120, 40 + 6 * k : 80 + 6 * k] -= 0.03  # something goes over the board, lower than any hand
        frames.put_bare(rolling)
        rolling = FREE.copy()
    until(frames.waiting.empty)
    waiter.join(0.2)
    assert waiter.is_alive()
    with flowing(frames, frames.put_bare):
        waiter.join(PATIENCE)
    assert controller.asked == ["hold", "resume"]
    assert looker.is_alive()
    with flowing(frames):
        looker.join(PATIENCE)


@pytest.fixture
def armless(monkeypatch: pytest.MonkeyPatch) -> None:
    """No arm is before the table, and no telemetry is waited for."""
    monkeypatch.setattr("app.guard.game_guard.ArmMasks", lambda *_: Masks())


@pytest.mark.usefixtures("armless")
def test_a_hand_that_is_there_while_the_board_is_found_anew_is_not_forgotten(controller: Controller) -> None:
    """It may go before the new guard's first frame; the first look after that is due then."""
    first, second = Frames(), Frames()
    waiting = [first, second]
    guard = GameGuard(lambda: waiting.pop(0), controller, (load_parameters(), TableSettings(), ArmHistory(0.001)))
    notice = HandNotice(guard)
    with guard:
        guard.look(VIEW)
        first.put(FREE, 10)
        first.put(HAND, 3)
        until(lambda: (seen := guard.newest()) is not None and seen.stamp > 0.42)
        assert guard.arrivals == 1
        assert (guard.departures, guard.gone_at) == (0, None)
        assert not notice.untold
        guard.look(VIEW)
        second.put(FREE, 10)
        until(lambda: (seen := guard.newest()) is not None and seen.settled)
        assert guard.arrivals == guard.departures == 1
        assert notice.untold
        assert notice.gone() == pytest.approx(13.0 / 30.0)
        assert notice.gone() is None


@pytest.mark.usefixtures("armless")
def test_sight_is_waited_for_and_a_hand_that_stays_is_told_of(
    controller: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.guard.game_guard.SIGHT_PATIENCE", 0.2)
    frames = Frames()
    guard = GameGuard(lambda: frames, controller, (load_parameters(), TableSettings(), ArmHistory(0.001)))
    with guard:
        guard.look(VIEW)
        frames.put(FREE, 10)
        until(lambda: (seen := guard.newest()) is not None and seen.settled)
        assert guard.wait_for_sight()
        frames.put(HAND, 3)
        until(lambda: guard.arrivals == 1)
        assert not guard.wait_for_sight()
        frames.put(FREE, 3)
        until(guard.wait_for_sight)
