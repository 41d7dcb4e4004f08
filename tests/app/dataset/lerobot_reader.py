"""Reads a dataset as LeRobot does, and refuses what it would refuse.

Written from huggingface/lerobot at 7427f31: ``datasets/utils.py`` (``DatasetInfo``), ``datasets/feature_utils.py``
(``get_hf_features_from_features``), ``datasets/io_utils.py`` (``load_nested_dataset``, ``load_tasks``),
``datasets/dataset_metadata.py``, ``datasets/dataset_reader.py`` (``get_item``) and ``datasets/video_utils.py``
(``decode_video_frames_pyav``).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

INFO = {
    "codebase_version", "fps", "features", "total_episodes", "total_frames", "total_tasks", "chunks_size",
    "data_files_size_in_mb", "video_files_size_in_mb", "data_path", "video_path", "robot_type", "splits",
}  # fmt: skip
DEFAULT_FEATURES = {
    "timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64",
}  # fmt: skip
STATISTICS = {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}
TOLERANCE = 1e-4
"""``tolerance_s``, LeRobot's default [s]."""


class LeRobotReader:
    """A dataset, read as ``LeRobotDataset`` reads it."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.info = json.loads((root / "meta/info.json").read_text())
        assert set(self.info) == INFO
        assert self.info["codebase_version"] == "v3.0"
        assert isinstance(self.info["fps"], int)
        assert self.info["fps"] > 0
        self.features: dict[str, dict[str, Any]] = self.info["features"]
        self.video_keys = [key for key, feature in self.features.items() if feature["dtype"] == "video"]
        self.tasks = _tasks(root / "meta/tasks.parquet")
        self.stats = json.loads((root / "meta/stats.json").read_text())
        self.episodes = _nested(root / "meta/episodes")
        self.frames = _nested(root / "data")

    def check(self) -> None:
        """All that its loader and its metadata rely on."""
        self._check_features()
        self._check_counts()
        self._check_stats()
        start = 0
        for index, episode in enumerate(self.episodes.to_pylist()):
            self._check_episode(index, episode, start)
            start = episode["dataset_to_index"]
        assert start == self.info["total_frames"]

    def item(self, index: int) -> dict[str, Any]:
        """One frame, as ``DatasetReader.get_item``: its columns, its task, and its picture of each view."""
        row = {name: self.frames[name][index].as_py() for name in self.frames.column_names}
        episode = self.episodes.slice(row["episode_index"], 1).to_pylist()[0]
        for key in self.video_keys:
            time = episode[f"videos/{key}/from_timestamp"] + float(np.float32(row["timestamp"]))
            row[key] = decoded(self.video(episode, key), time)
        return row | {"task": self.tasks[row["task_index"]]}

    def video(self, episode: dict[str, Any], key: str) -> Path:
        """The file that holds an episode's pictures of a view."""
        place = {what: episode[f"videos/{key}/{what}"] for what in ("chunk_index", "file_index")}
        return self.root / self.info["video_path"].format(video_key=key, **place)

    def _check_features(self) -> None:
        for name, dtype in DEFAULT_FEATURES.items():
            assert self.features[name] == {"dtype": dtype, "shape": [1], "names": None}
        for name, feature in self.features.items():
            assert "/" not in name
            if feature["dtype"] == "video":
                assert feature["names"] == ["height", "width", "channels"]
                assert feature["shape"][2] == 3
            elif feature["shape"] == [1]:
                assert str(self.frames.schema.field(name).type) == {"float64": "double", "float32": "float"}.get(
                    feature["dtype"], feature["dtype"]
                )
            else:
                assert self.frames.schema.field(name).type == pa.list_(pa.float32(), feature["shape"][0])
                assert len(feature["names"]) == feature["shape"][0]
        assert set(self.frames.column_names) == set(self.features) - set(self.video_keys)

    def _check_counts(self) -> None:
        assert self.info["total_episodes"] == len(self.episodes)
        assert self.info["total_frames"] == len(self.frames)
        assert self.info["total_tasks"] == len(self.tasks)
        assert self.info["splits"] == {"train": f"0:{len(self.episodes)}"}
        assert self.frames["index"].to_pylist() == list(range(len(self.frames)))

    def _check_stats(self) -> None:
        assert set(self.stats) == set(self.features)
        for name, feature in self.features.items():
            assert set(self.stats[name]) == STATISTICS
            shape = (3, 1, 1) if feature["dtype"] == "video" else tuple(feature["shape"])
            for what, value in self.stats[name].items():
                assert np.shape(value) == ((1,) if what == "count" else shape), (name, what)

    def _check_episode(self, index: int, episode: dict[str, Any], start: int) -> None:
        length, fps = episode["length"], self.info["fps"]
        assert episode["episode_index"] == index
        assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (start, start + length)
        rows = self.frames.slice(start, length)
        assert set(rows["episode_index"].to_pylist()) == {index}
        assert rows["frame_index"].to_pylist() == list(range(length))
        assert np.allclose(rows["timestamp"].to_numpy(), np.arange(length) / fps, atol=1e-6)
        assert [self.tasks[task] for task in set(rows["task_index"].to_pylist())] == episode["tasks"]
        place = {what: episode[f"data/{what}"] for what in ("chunk_index", "file_index")}
        own = pq.read_table(self.root / self.info["data_path"].format(**place), columns=["episode_index"])
        assert own["episode_index"].to_pylist().count(index) == length
        for key in self.video_keys:
            begins, ends = (episode[f"videos/{key}/{what}_timestamp"] for what in ("from", "to"))
            assert ends - begins == length / fps or abs(ends - begins - length / fps) < 1e-9
            with av.open(str(self.video(episode, key))) as container:
                stream = container.streams.video[0]
                assert stream.duration is not None
                assert stream.time_base is not None
                assert float(stream.duration * stream.time_base) >= ends - 1e-6


def decoded(path: Path, time: float) -> np.ndarray:
    """The picture of a time in a video [s], RGB (h, w, 3), by the rule of ``decode_video_frames_pyav``."""
    pictures, times = [], []
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.time_base is not None
        container.seek(round(time / stream.time_base) - 1, backward=True, any_frame=False, stream=stream)
        for frame in container.decode(stream):
            assert frame.pts is not None
            times.append(float(frame.pts * stream.time_base))
            pictures.append(frame.to_ndarray(format="rgb24"))
            if times[-1] >= time:
                break
    off = np.abs(np.array(times, dtype=np.float32) - np.float32(time))
    assert off.min() <= TOLERANCE, f"no picture at {time} s"
    return pictures[int(off.argmin())]


def _tasks(path: Path) -> list[str]:
    """As pandas reads it: the column that its metadata name is the index, and the index is the task."""
    table = pq.read_table(path)
    assert json.loads(table.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    assert table["task_index"].to_pylist() == list(range(len(table)))
    return [str(task) for task in table["task"].to_pylist()]


def _nested(folder: Path) -> pa.Table:
    return pa.concat_tables([pq.read_table(path) for path in sorted(folder.glob("*/*.parquet"))])
