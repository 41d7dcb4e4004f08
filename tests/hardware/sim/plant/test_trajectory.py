"""Positions on file: what is read is what was written, as far as it was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hardware.interfaces import HardwareError
from hardware.sim.plant.trajectory import TrajectoryFile, TrajectoryHeader, TrajectoryWriter

HEADER = TrajectoryHeader(period=0.00088, every=45, positions=300, world={"seed": 3})


def write(path: Path, frames: int, seed: int = 1) -> list[np.ndarray]:
    """Random walks of a few of many positions, as of an arm among resting pieces; a note now and then."""
    rng, positions = np.random.default_rng(seed), np.zeros(300)
    file, written = TrajectoryWriter(path, HEADER), []
    for number in range(frames):
        positions[rng.integers(0, 300, 5)] += rng.normal(size=5)
        file.keep(45 * number, positions, f'{{"step": {number // 4}}}')
        written.append(positions.copy())
    file.close()
    return written


def test_frames_come_back_as_they_were_written(tmp_path: Path) -> None:
    written = write(tmp_path / "a", 12)
    file = TrajectoryFile(tmp_path / "a")
    assert file.header == HEADER
    assert file.span() == (0, 45 * 11)
    for number, (frame, was) in enumerate(zip(file.frames(), written, strict=True)):
        assert frame.tick == 45 * number
        assert frame.note == {"step": number // 4}
        assert frame.positions == pytest.approx(was, rel=1e-6)
        assert frame.changed


def test_what_rests_costs_next_to_nothing_and_says_so(tmp_path: Path) -> None:
    file, positions = TrajectoryWriter(tmp_path / "a", HEADER), np.arange(300.0)
    file.keep(0, positions)
    size = (tmp_path / "a").stat().st_size
    for number in range(1, 101):
        file.keep(45 * number, positions)
    file.close()
    assert (tmp_path / "a").stat().st_size == size + 100 * 17
    assert [frame.changed for frame in TrajectoryFile(tmp_path / "a").frames()] == [True] + 100 * [False]


@pytest.mark.parametrize("seed", range(3))
def test_file_that_broke_off_or_is_damaged_is_good_up_to_there(tmp_path: Path, seed: int) -> None:
    written = write(tmp_path / "a", 20)
    whole, rng = (tmp_path / "a").read_bytes(), np.random.default_rng(seed)
    start = whole.index(b"\n") + 1
    for _ in range(40):
        cut = int(rng.integers(start, len(whole)))
        damaged = bytearray(whole)
        damaged[cut] ^= 1 << int(rng.integers(0, 8))
        for content in (whole[:cut], bytes(damaged)):
            (tmp_path / "b").write_bytes(content)
            frames = [frame.positions.copy() for frame in TrajectoryFile(tmp_path / "b").frames()]
            assert len(frames) < len(written)
            assert all(np.allclose(frame, was, rtol=1e-6) for frame, was in zip(frames, written, strict=False))


def test_no_file_is_written_over_another(tmp_path: Path) -> None:
    write(tmp_path / "a", 1)
    with pytest.raises(FileExistsError):
        write(tmp_path / "a", 1)


def test_what_is_no_such_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"something else")
    with pytest.raises(HardwareError, match="holds no positions that a film can be drawn from"):
        TrajectoryFile(tmp_path / "a")
    with pytest.raises(HardwareError, match="No such file"):
        TrajectoryFile(tmp_path / "b")
