"""What cameras with a thread of their own share."""

from __future__ import annotations

import gc
import threading
import weakref

import pytest

from hardware.camera.background import DeviceReader
from hardware.interfaces import CameraClosed, HardwareError
from tests.waiting import PATIENCE


class Held:
    """What somebody works with who looks."""


def look(reader: DeviceReader[int], seen: list[weakref.ref[Held]]) -> int:
    mine = Held()
    seen.append(weakref.ref(mine))
    return reader.newest()


def test_a_lost_camera_that_is_looked_at_again_and_again_keeps_nothing_of_who_looked() -> None:
    """Else memory fills while one is unplugged: a guard asks every second, and holds pictures."""
    lost, told = threading.Event(), threading.Event()

    def run() -> None:
        reader.put(1)
        lost.wait(PATIENCE)
        reader.fail(HardwareError("check its cable"))
        told.set()
        reader.closing.wait(PATIENCE)

    reader = DeviceReader[int]("camera", run)
    assert reader.start(PATIENCE, HardwareError("silent")) == 1
    lost.set()
    assert told.wait(PATIENCE)
    seen: list[weakref.ref[Held]] = []
    for _ in range(20):
        with pytest.raises(HardwareError, match="check its cable"):
            look(reader, seen)
    gc.collect()
    assert sum(one() is not None for one in seen) <= 1, "the last one at most"
    reader.end()
    with pytest.raises(CameraClosed):
        reader.newest()
