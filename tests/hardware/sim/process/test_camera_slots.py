"""Files for pictures: as many as visitors need at once, however many come and go."""

from __future__ import annotations

import json
from collections import deque
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from hardware.sim.process.cameras.camera_service import CameraService
from hardware.sim.process.connections import Visitor
from hardware.sim.process.scene_control import SceneControlService
from hardware.sim.render.renderer import Renderer, RenderRequest
from hardware.sim.render.settings import CameraSettings, SceneState


class StillPlant:
    """Nothing moves."""

    tick = 0

    def positions(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        return np.zeros(1)


class StillStage:
    looks = SceneState()


class Drawing:
    """A renderer that draws when it is told."""

    def __init__(self) -> None:
        self.asked = deque[int]()
        self.finished = 0

    def request(self, shot: RenderRequest, _positions: object) -> None:
        self.asked.append(shot.slot)

    def take(self, wait: bool) -> int | None:
        if not self.finished:
            return None
        self.finished -= 1
        return self.asked.popleft()

    def close(self, patience: float = 0.0) -> None:
        """Nothing to end."""


class Person:
    def __init__(self) -> None:
        self.told: list[dict[str, Any]] = []

    def tell(self, answer: dict[str, Any]) -> None:
        self.told.append(answer)


class Cameras:
    def __init__(self, run_dir: Path) -> None:
        self.run_dir, self.plant, self.drawing = run_dir, StillPlant(), Drawing()
        self.service = CameraService(
            {"lockstep": True}, cast("Any", self.plant), cast("Renderer", self.drawing), run_dir, 5, CameraSettings(),
            1, cast("SceneControlService", StillStage()),
        )  # fmt: skip

    def come(self) -> Visitor:
        visitor = cast("Visitor", Person())
        self.service.welcome(visitor)
        return visitor

    def say(self, visitor: Visitor, **words: object) -> None:
        self.service.hear(visitor, json.dumps(words).encode())

    def draw(self) -> None:
        self.drawing.finished = len(self.drawing.asked)
        self.service.look()

    @property
    def files(self) -> int:
        return len(list(self.run_dir.glob("frame-*.bin")))


@pytest.fixture
def cameras(tmp_path: Path) -> Cameras:
    return Cameras(tmp_path)


@pytest.mark.parametrize(
    "wish",
    [
        {"camera": "camera", "depth": True},
        {"camera": "film", "stream_ticks": 3},
        {"camera": "camera", "watch_ticks": 3, "depth": True},
    ],
)
def test_who_comes_and_goes_leaves_no_files_behind(cameras: Cameras, wish: dict[str, object]) -> None:
    most = 0
    for number in range(6):
        visitor = cameras.come()
        cameras.say(visitor, **wish)
        for _ in cameras.service.serve(waits=False):
            pass
        cameras.draw()
        cameras.service.leave(visitor)
        if number == 0:
            most = cameras.files
    assert cameras.files == most


def test_a_file_that_is_being_drawn_into_is_nobody_elses(cameras: Cameras) -> None:
    first = cameras.come()
    cameras.say(first, camera="camera", depth=True)
    (slot,) = cameras.drawing.asked
    cameras.service.leave(first)
    second = cameras.come()
    cameras.say(second, camera="camera", depth=True)
    assert slot not in list(cameras.drawing.asked)[1:]
    cameras.draw()
    third = cameras.come()
    cameras.say(third, camera="camera", depth=True)
    assert list(cameras.drawing.asked) == [slot]  # free again
    assert cameras.files == 2
