"""The ring of samples: whatever the order, loss or repetition, the motion in it is the one that was sent."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from controller.loop.motion import MotionBuffer
from controller.protection.limits import default_limits
from controller.protection.reference_check import SampleCheck, rows_from_samples
from controller.protocol import SAMPLE, MotionFlag
from controller.protocol.causes import Cause
from controller.protocol.messages import Announce, Samples
from hardware.parameters import load_parameters
from hardware.table import TableSettings

START, END = (0.0, 0.0, 0.40), (0.01, 0.0, 0.39)
Line = Callable[..., NDArray[Any]]


@pytest.fixture
def buffer() -> MotionBuffer:
    return _buffer(8192)


def _buffer(capacity: int) -> MotionBuffer:
    return MotionBuffer(capacity, SampleCheck(default_limits(load_parameters(), TableSettings()), 0.00088))


def _announce(buffer: MotionBuffer, samples: NDArray[Any]) -> None:
    buffer.announce(Announce(1, 0, len(samples), MotionFlag.NONE), np.array(START))


def _still(count: int) -> NDArray[Any]:
    """Samples at rest that can be told apart by their finger velocity."""
    samples = np.zeros(count, SAMPLE)
    samples["position"] = START
    samples["finger_velocity"] = np.arange(count) * 1e-4
    return samples


@given(st.lists(st.tuples(st.integers(0, 59), st.integers(1, 10)), max_size=80), st.integers(0, 60))
def test_any_order_and_any_repetition_gives_the_same_motion(pieces: list[tuple[int, int]], length: int) -> None:
    samples = _still(max(1, length))
    buffer, there = _buffer(100), np.zeros(len(samples), bool)
    _announce(buffer, samples)
    for start, count in pieces:
        if start >= len(samples):
            continue
        assert buffer.store(Samples(1, start, samples[start : start + count])) is None
        there[start : start + count] = True
        assert buffer.received == (len(there) if there.all() else int(np.argmin(there)))
    rows = rows_from_samples(samples)
    for index in range(buffer.received):
        assert np.array_equal(buffer.row(index), rows[index])


@given(st.integers(0, 2**32 - 1))
def test_a_long_motion_passes_through_a_small_ring(seed: int) -> None:
    samples, random = _still(300), Random(seed)
    buffer, rows = _buffer(40), rows_from_samples(samples)
    _announce(buffer, samples)
    while buffer.executed < len(samples):
        start = buffer.executed + random.randint(-20, 60)
        if 0 <= start < len(samples):
            buffer.store(Samples(1, start, samples[start : start + 10]))
        buffer.store(Samples(1, buffer.received, samples[buffer.received : buffer.received + 3]))
        while buffer.executed < buffer.received and random.random() < 0.8:
            assert np.array_equal(buffer.row(buffer.executed), rows[buffer.executed])
            buffer.executed += 1
        assert buffer.received - buffer.executed < 40


def test_the_first_copy_counts(buffer: MotionBuffer) -> None:
    samples, forged = _still(30), _still(30)
    forged["finger_velocity"] += 0.05
    _announce(buffer, samples)
    for part, start, end in ((samples, 20, 30), (samples, 0, 10), (forged, 0, 10), (forged, 15, 30), (samples, 10, 20)):
        buffer.store(Samples(1, start, part[start:end]))
    wanted = samples.copy()
    wanted[15:20] = forged[15:20]
    assert buffer.received == 30
    assert np.array_equal([buffer.row(index) for index in range(30)], rows_from_samples(wanted))


def test_samples_beyond_the_motion_are_left_out(buffer: MotionBuffer) -> None:
    samples = _still(25)
    _announce(buffer, samples[:15])
    buffer.store(Samples(1, 0, samples[:10]))
    buffer.store(Samples(1, 10, samples[10:20]))
    buffer.store(Samples(1, 20, samples[20:25]))
    assert buffer.received == 15


def test_without_a_motion_nothing_is_stored(buffer: MotionBuffer) -> None:
    assert buffer.store(Samples(1, 0, _still(5))) is None
    assert buffer.received == 0


def test_a_bad_sample_behind_a_gap_is_found_when_the_gap_closes(buffer: MotionBuffer, line: Line) -> None:
    samples = line(START, END, 99)
    samples["velocity"][55] = (0.0, 0.0, 2.0)
    _announce(buffer, samples)
    for start in range(10, 100, 10):
        assert buffer.store(Samples(1, start, samples[start : start + 10])) is None
    found = buffer.store(Samples(1, 0, samples[:10]))
    assert found is not None
    assert (found.cause, found.offset) == (Cause.SPEED, 55)
    assert buffer.received == 0


def test_a_step_between_datagrams_is_found(buffer: MotionBuffer, line: Line) -> None:
    samples = line(START, END, 99)
    samples["position"][50:] += (0.0, 0.001, 0.0)
    _announce(buffer, samples)
    for start in range(0, 50, 10):
        assert buffer.store(Samples(1, start, samples[start : start + 10])) is None
    found = buffer.store(Samples(1, 50, samples[50:60]))
    assert found is not None
    assert found.cause is Cause.POSITION_STEP


def test_start_and_end_are_checked(buffer: MotionBuffer, line: Line) -> None:
    away = line((0.0, 0.001, 0.40), END, 99)
    _announce(buffer, away)
    found = buffer.store(Samples(1, 0, away[:10]))
    assert found is not None
    assert found.cause is Cause.START_POSITION
    cut = line(START, END, 99)[:95]
    _announce(buffer, cut)
    assert [buffer.store(Samples(1, start, cut[start : start + 10])) for start in range(0, 90, 10)] == [None] * 9
    found = buffer.store(Samples(1, 90, cut[90:]))
    assert found is not None
    assert found.cause is Cause.ENDS_MOVING
