"""A guard over a camera that others read as well."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from app.guard.arm_silhouette import ArmHistory
from app.guard.game_guard import GameGuard
from app.guard.hand_guard import Blind
from app.rig.simulation.nominal_view import nominal_view
from app.rig.steady_frames import SteadyFrames
from hardware.interfaces import CameraClosed, Frame, Intrinsics, StaleFrame
from hardware.parameters import load_parameters
from hardware.table import TableSettings
from tests.waiting import PATIENCE

PINHOLE = Intrinsics(320, 240, 308.0, 308.0, 159.5, 119.5)


class Camera:
    """Shows the same frame until there is a newer one."""

    def __init__(self, stamps: list[float]) -> None:
        self.stamps, self.closed = stamps, False

    def read(self, max_age: float) -> Frame:
        if not self.stamps:
            raise StaleFrame(2.0, max_age)
        stamp = self.stamps.pop(0)
        return Frame(np.zeros((240, 320, 3), np.uint8), None, PINHOLE, stamp)

    def close(self) -> None:
        self.closed = True


def test_each_frame_is_read_once_and_a_camera_that_fell_silent_says_so() -> None:
    frames = SteadyFrames(Camera([1.0, 1.0, 1.0, 1.1, 1.0, 1.1, 1.2]))
    assert [frames.read(0.5).stamp for _ in range(3)] == [1.0, 1.1, 1.2]
    with pytest.raises(StaleFrame):
        frames.read(0.5)


def test_closing_ends_a_reader_and_leaves_the_camera_to_others() -> None:
    camera = Camera([1.0] * 100000)
    frames = SteadyFrames(camera)
    frames.read(0.5)
    ended = threading.Event()

    def wait() -> None:
        with pytest.raises(CameraClosed):
            frames.read(0.5)
        ended.set()

    reader = threading.Thread(target=wait)
    reader.start()
    frames.close()
    reader.join(PATIENCE)
    assert ended.is_set()
    assert not camera.closed


def test_a_guard_whose_camera_falls_silent_holds_the_arm() -> None:
    asked: list[str] = []

    class Client:
        def ask_to_hold(self) -> None:
            asked.append("hold")

        def resume(self) -> None:
            asked.append("resume")

    table = TableSettings()
    arm = load_parameters(), table, ArmHistory(0.001)
    camera = Camera([])
    with GameGuard(lambda: SteadyFrames(camera), Client(), arm, patience=0.0) as guard:
        guard.clear()
        assert guard.newest() is None, "nobody knows where the board is: nothing to wait for"
        guard.look(nominal_view(PINHOLE, table))
        with pytest.raises(Blind, match="no longer sees hands"):
            guard.clear()
    assert asked == ["hold"]
