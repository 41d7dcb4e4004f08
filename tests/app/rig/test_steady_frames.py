"""Frames of a camera that others read as well, for whoever watches."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from app.rig.steady_frames import PICTURE_AGE, CameraPictures
from hardware.interfaces import CameraClosed, Frame, HardwareError, Intrinsics, StaleFrame

PINHOLE = Intrinsics(4, 3, 5.0, 5.0, 1.5, 1.0)


def frame(stamp: float) -> Frame:
    return Frame(np.zeros((3, 4, 3), dtype=np.uint8), None, PINHOLE, stamp)


class ScriptedCamera:
    """Says one thing after the other."""

    def __init__(self, *said: Frame | Exception) -> None:
        self._said: Iterator[Frame | Exception] = iter(said)

    def read(self, max_age: float) -> Frame:
        said = next(self._said)
        if isinstance(said, Exception):
            raise said
        return said

    def close(self) -> None:
        """Nothing to end."""


def test_a_camera_that_was_held_up_or_unplugged_is_watched_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.rig.steady_frames._MENDED", 0.0)
    troubles = StaleFrame(2.0, PICTURE_AGE), HardwareError("it is unplugged")
    pictures = CameraPictures(ScriptedCamera(frame(1.0), *troubles, frame(4.0)), None, 0.5)
    stamps = [found[1] for found in (pictures.next(), pictures.next()) if found is not None]
    assert stamps == [2, 8]


@pytest.mark.parametrize("cancelled", [False, True])
def test_pictures_end_with_the_camera_or_with_whoever_watches(cancelled: bool) -> None:
    pictures = CameraPictures(ScriptedCamera(CameraClosed()), None, 0.5)
    if cancelled:
        pictures.cancel()
    assert pictures.next() is None
