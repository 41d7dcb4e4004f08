"""The state that a running world keeps on disk, and what a world that was killed goes on from."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import mujoco
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.interfaces import HardwareError
from hardware.sim.plant.live_state import LIVE_FILE, SLOTS, LiveState, load_live_state
from tests.waiting import PATIENCE

BALL = "<mujoco><worldbody><body><freejoint/><geom size='0.1'/></body></worldbody></mujoco>"
"""It falls."""
MODEL = mujoco.MjModel.from_xml_string(BALL)

WRITER = """
import sys, mujoco
from pathlib import Path
from hardware.sim.plant.live_state import LiveState
model = mujoco.MjModel.from_xml_string(sys.argv[3])
data = mujoco.MjData(model)
live = LiveState(Path(sys.argv[1]), model, data, 0)
if sys.argv[2] == "aside":
    live.write_aside()
tick = 0
while True:
    mujoco.mj_step(model, data)
    tick += 1
    live.keep(tick)
    print(tick, flush=True)
"""


def fallen(ticks: int) -> mujoco.MjData:
    data = mujoco.MjData(MODEL)
    for _ in range(ticks):
        mujoco.mj_step(MODEL, data)
    return data


def kept(path: Path) -> mujoco.MjData:
    """The state in the file, in a plant of its own."""
    snapshot = load_live_state(path)
    assert snapshot is not None
    assert not snapshot.at_rest
    data = mujoco.MjData(MODEL)
    mujoco.mj_setState(MODEL, data, snapshot.state, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert data.time == pytest.approx(snapshot.tick * MODEL.opt.timestep)
    return data


@pytest.mark.parametrize("aside", [False, True])
def test_the_last_tick_that_was_kept_is_found_to_the_last_bit(tmp_path: Path, aside: bool) -> None:
    path, data = tmp_path / LIVE_FILE, mujoco.MjData(MODEL)
    assert load_live_state(path) is None
    live = LiveState(path, MODEL, data, 0)
    if aside:
        live.write_aside()
    assert kept(path).qpos.tolist() == data.qpos.tolist()
    for tick in range(1, 8):
        mujoco.mj_step(MODEL, data)
        live.keep(tick)
        deadline = time.monotonic() + PATIENCE
        while (snapshot := load_live_state(path)) is None or snapshot.tick < tick:
            assert aside, "on the disk as soon as it is kept"
            assert time.monotonic() < deadline
            time.sleep(0.01)
            live.keep(tick)  # a thread that was not done with the tick before has left this one out
    for _ in range(100):
        mujoco.mj_step(MODEL, data)  # goes on, and is not told of
    assert kept(path).qpos.tolist() == fallen(7).qpos.tolist()
    assert path.stat().st_mode & 0o777 == 0o600
    live.end()
    assert not path.exists()
    live.keep(200)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("how", ["at once", "aside"])
def test_a_writer_may_be_killed_at_any_moment(tmp_path: Path, how: str) -> None:
    path = tmp_path / LIVE_FILE
    for delay in (0.0, 0.0007, 0.0031, 0.0113):
        with subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path), how, BALL], stdout=subprocess.PIPE, text=True
        ) as writer:
            assert writer.stdout is not None
            writer.stdout.readline()
            time.sleep(delay)
            writer.send_signal(signal.SIGKILL)
            told = 1 + sum(1 for line in writer.stdout if line.endswith("\n"))
        snapshot = load_live_state(path)
        assert snapshot is not None
        assert snapshot.tick >= told if how == "at once" else snapshot.tick >= 0
        assert kept(path).qpos.tolist() == fallen(snapshot.tick).qpos.tolist(), "whole, and of one tick"


@given(st.data())
def test_where_one_slot_is_torn_the_other_one_counts(
    tmp_path_factory: pytest.TempPathFactory, draw: st.DataObject
) -> None:
    path, data = tmp_path_factory.mktemp("live") / LIVE_FILE, mujoco.MjData(MODEL)
    live = LiveState(path, MODEL, data, 0)
    last = draw.draw(st.integers(1, 5))
    for tick in range(1, last + 1):
        mujoco.mj_step(MODEL, data)
        live.keep(tick)
    whole = path.read_bytes()
    size = len(whole) // SLOTS
    at = draw.draw(st.integers(0, len(whole) - 1))
    torn = bytearray(whole)
    torn[at] ^= draw.draw(st.integers(1, 255))
    path.write_bytes(torn)
    newest = (last + 1) % SLOTS  # the first writing, of tick 0, is number 1
    expected = last - 1 if at // size == newest else last
    assert kept(path).qpos.tolist() == fallen(expected).qpos.tolist()


@pytest.mark.parametrize("content", [b"", b"x", b"TMLS" + bytes(500)])
def test_a_file_that_holds_no_state_is_one_sentence(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / LIVE_FILE
    path.write_bytes(content)
    with pytest.raises(HardwareError, match=r"world_live\.bin is not the state of a world: delete it"):
        load_live_state(path)


def test_where_there_is_no_room_the_world_does_not_begin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(HardwareError, match=r"cannot keep its state in .*: No space left on device; make room there"):
        LiveState(tmp_path / LIVE_FILE, MODEL, mujoco.MjData(MODEL), 0)
    assert list(tmp_path.iterdir()) == []


def test_a_state_that_can_no_longer_be_written_is_not_left_to_be_believed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> int:
        raise OSError(5, "Input/output error")

    path = tmp_path / LIVE_FILE
    live = LiveState(path, MODEL, mujoco.MjData(MODEL), 0)
    monkeypatch.setattr(os, "pwrite", broken)
    live.keep(1)
    live.keep(2)
    assert not path.exists()
    assert capsys.readouterr().err.count("no longer kept") == 1, "said once; the world goes on"
