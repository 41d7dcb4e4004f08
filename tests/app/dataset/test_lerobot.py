"""A dataset in LeRobot's format v3.0 reads back as LeRobot reads it, in however many files it is."""

from __future__ import annotations

import json
import os
from pathlib import Path

import chess
import numpy as np
import pyarrow.parquet as pq
import pytest

from app.dataset.demonstrations import Demonstration
from app.dataset.games import RecordedPly
from app.dataset.lerobot.schema import ShardLimits
from app.dataset.lerobot.statistics import PictureStats, RunningStats, episode_stats
from app.dataset.lerobot.writer import LeRobotWriter
from app.dataset.signals import ACTION, REFERENCE, STATE
from app.records.files import RecordError
from tests.app.dataset.lerobot_reader import LeRobotReader

FPS, WIDTH, HEIGHT = 25, 96, 64
LENGTHS = (7, 12, 1, 9, 15, 8)
RNG = np.random.default_rng(25)


def demonstration(length: int, task: str) -> Demonstration:
    ply = RecordedPly(
        "game", 7, 1, "e2e4", chess.STARTING_FEN, task, 1.0, 2.0, success=task != "b", resumed=False, mended=False
    )
    rows = [RNG.normal(size=(length, len(signals))) for signals in (STATE, REFERENCE, ACTION)]
    return Demonstration(ply, np.arange(length), 1.0 + 0.0396 * np.arange(length), *rows)


EPISODES = [demonstration(length, "ab"[number % 2]) for number, length in enumerate(LENGTHS)]


def picture(number: int) -> np.ndarray:
    """A bar that says which one it is."""
    shown = np.full((HEIGHT, WIDTH, 3), 40, dtype=np.uint8)
    shown[:, : 1 + number % WIDTH] = 220
    return shown


def write(root: Path, limits: ShardLimits, times: int = 1) -> LeRobotReader:
    root.mkdir()
    writer, number = LeRobotWriter(root, ("camera", "film"), (WIDTH, HEIGHT), FPS, limits), 0
    for episode in EPISODES * times:
        writer.begin(episode, None)
        for frame in range(len(episode)):
            writer.show(frame, {"camera": picture(number), "film": picture(number)[:, ::-1]})
            number += 1
        writer.end()
    writer.close()
    return LeRobotReader(root)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> LeRobotReader:
    return write(tmp_path_factory.mktemp("lerobot") / "set", ShardLimits())


def test_all_that_a_loader_relies_on_holds(dataset: LeRobotReader) -> None:
    dataset.check()
    assert dataset.tasks == ["a", "b"]


def test_each_row_and_each_picture_is_its_own(dataset: LeRobotReader) -> None:
    index = 0
    for episode in EPISODES:
        for frame in range(len(episode)):
            item = dataset.item(index)
            assert item["observation.state"] == pytest.approx(episode.state[frame], rel=1e-6)
            assert item["observation.reference"] == pytest.approx(episode.reference[frame], rel=1e-6)
            assert item["action"] == pytest.approx(episode.action[frame], rel=1e-6)
            assert item["plant_time"] == episode.time[frame]
            last = frame == len(episode) - 1
            assert (item["next.done"], item["next.success"]) == (last, last and episode.ply.success)
            assert item["task"] == episode.ply.task
            for key, view in (("camera", picture(index)), ("film", picture(index)[:, ::-1])):
                seen = item[f"observation.images.{key}"].astype(float)
                assert np.sqrt(((seen - view) ** 2).mean()) < 12.0, (index, key)
            index += 1


def test_files_are_filled_up_to_a_size_and_folders_to_a_number(tmp_path: Path) -> None:
    many = write(tmp_path / "set", ShardLimits(data_mb=0.006, video_mb=0.002, chunk=2), times=4)
    many.check()
    for what in ("data", "videos/observation.images.camera"):
        files = sorted(path.relative_to(many.root / what) for path in (many.root / what).rglob("*.*"))
        assert len(files) > 2
        assert [path.parent.name for path in files[:3]] == ["chunk-000", "chunk-000", "chunk-001"]
        assert files[0].stem == "file-000"
    assert {pq.ParquetFile(path).num_row_groups for path in (many.root / "data").rglob("*.parquet")} <= {1, 2, 3}
    for index in (0, 6, 7, 18, 100, 4 * sum(LENGTHS) - 1):
        seen = many.item(index)["observation.images.camera"].astype(float)
        assert np.sqrt(((seen - picture(index)) ** 2).mean()) < 12.0, index


def test_this_thread_is_scheduled_as_before(dataset: LeRobotReader) -> None:
    assert dataset.root.exists()  # its videos were encoded in this thread
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_statistics_of_all_frames(dataset: LeRobotReader) -> None:
    state = np.vstack([episode.state for episode in EPISODES]).astype(np.float32).astype(float)
    found = dataset.stats["observation.state"]
    for name, value in (("min", state.min(0)), ("max", state.max(0)), ("mean", state.mean(0)), ("std", state.std(0))):
        assert found[name] == pytest.approx(value, rel=1e-9, abs=1e-12)
    assert found["count"] == [sum(LENGTHS)]
    spread = np.ptp(state, axis=0)
    inverted = np.quantile(state, 0.9, axis=0, method="inverted_cdf")
    assert (np.abs(np.array(found["q90"]) - inverted) <= spread / 5000 + 1e-9).all()
    assert dataset.stats["observation.images.camera"]["count"] == [sum(LENGTHS)]


def test_statistics_of_one_episode(dataset: LeRobotReader) -> None:
    second = dataset.episodes.slice(1, 1).to_pylist()[0]
    state = EPISODES[1].state.astype(np.float32).astype(float)
    for name, value in episode_stats(state).items():
        assert second[f"stats/observation.state/{name}"] == pytest.approx(value)
    assert second["stats/observation.state/q10"] == pytest.approx(np.quantile(state, 0.1, axis=0))
    assert second["stats/observation.images.film/count"] == [LENGTHS[1]]
    assert (second["game"], second["seed"], second["ply"], second["uci"]) == ("game", 7, 1, "e2e4")


def test_a_feature_that_never_changes_has_statistics() -> None:
    still = RunningStats()
    still.take(np.full((5, 2), 3.0))
    found = still.stats([np.full((5, 2), 3.0)])
    assert found["std"] == [0.0, 0.0]
    assert found["q01"] == found["q99"] == found["mean"] == [3.0, 3.0]


def test_statistics_of_pictures_are_exact() -> None:
    seen, pictures = PictureStats(), RNG.integers(0, 256, (4, 64, 96, 3), dtype=np.uint8)
    for one in pictures:
        seen.take(one)
    found, levels = seen.stats(), pictures.reshape(-1, 3) / 255.0
    assert np.ravel(found["mean"]) == pytest.approx(levels.mean(0))
    assert np.ravel(found["std"]) == pytest.approx(levels.std(0))
    assert np.ravel(found["q10"]) == pytest.approx(np.quantile(levels, 0.1, axis=0, method="inverted_cdf"))
    assert np.shape(found["q50"]) == (3, 1, 1)


def test_the_card_names_all_numbers_with_their_units(dataset: LeRobotReader) -> None:
    card = (dataset.root / "README.md").read_text()
    for signal in (*STATE, *REFERENCE, *ACTION):
        assert f"| `{signal.name}` | {signal.unit} |" in card


def test_a_full_disk_is_one_sentence(tmp_path: Path) -> None:
    root = tmp_path / "set"
    (root / "data/chunk-000").mkdir(parents=True)
    (root / "data/chunk-000/file-000.parquet").symlink_to("/dev/full")
    writer = LeRobotWriter(root, (), (WIDTH, HEIGHT), FPS)
    with pytest.raises(RecordError, match=r"file-000\.parquet: no space left on the device"):
        writer.begin(demonstration(4000, "a"), None)
    writer.drop()


def test_without_views_there_are_no_videos(tmp_path: Path) -> None:
    writer = LeRobotWriter(tmp_path, (), (WIDTH, HEIGHT), FPS)
    writer.begin(EPISODES[0], None)
    writer.end()
    writer.close()
    assert json.loads((tmp_path / "meta/info.json").read_text())["video_path"] is None
    LeRobotReader(tmp_path).check()
