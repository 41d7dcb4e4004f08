"""Writes episodes as LeRobot's recorder does, file by file and frame by frame."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from app.dataset.demonstrations import Demonstration
from app.dataset.lerobot import schema
from app.dataset.lerobot.card import dataset_card
from app.dataset.lerobot.shards import ParquetShards
from app.dataset.lerobot.statistics import FeatureStats, PictureStats, RunningStats, Values, episode_stats
from app.dataset.lerobot.tables import episodes_schema, placed, played, stats_columns, write_tasks
from app.dataset.lerobot.videos import VideoShards
from app.dataset.writers import Shown
from app.records.files import write_atomically
from app.records.robot import RobotRecord

_MORE = 64
"""Rows of the table of episodes that are written together."""


class LeRobotWriter:
    """An ``EpisodeWriter`` of LeRobot's format v3.0.

    Args:
        root: folder of the dataset, which is there.
        views: names of the views.
        size: width and height of pictures [px].
        fps: frames a second.
        limits: of the files.
    """

    def __init__(
        self, root: Path, views: tuple[str, ...], size: tuple[int, int], fps: int,
        limits: schema.ShardLimits = schema.ShardLimits(),  # noqa: B008  # frozen
    ) -> None:  # fmt: skip
        self._root, self._fps, self._limits = root, fps, limits
        self._features = schema.features(views, *size, fps)
        columns = schema.data_schema(self._features)
        self._columns = columns.names
        self._data = ParquetShards(root, schema.DATA_PATH, columns, limits.data_mb, limits.chunk)
        self._table = ParquetShards(
            root, schema.EPISODES_PATH, episodes_schema(self._features, views), limits.data_mb, limits.chunk
        )
        self._videos = {
            view: VideoShards(
                root, schema.VIDEO_PATH, schema.video_key(view), size, fps, limits.video_mb, limits.chunk
            )
            for view in views
        }  # fmt: skip
        self._parts: tuple[ParquetShards | VideoShards, ...] = (self._data, self._table, *self._videos.values())
        self._tasks = dict[str, int]()
        self._episodes = self._frames = 0
        self._whole = {name: RunningStats() for name in self._columns}
        self._seen = {view: PictureStats() for view in views}
        self._seen_now = dict[str, PictureStats]()
        self._row = dict[str, Any]()
        self._rows = list[dict[str, Any]]()

    def begin(self, episode: Demonstration, robot: RobotRecord | None) -> None:  # of no use here
        """See ``EpisodeWriter.begin``."""
        task = self._tasks.setdefault(episode.ply.task, len(self._tasks))
        columns = self._columns_of(episode, task)
        shard, count = self._data.place(len(episode)), len(episode)
        self._data.write({name: _stored(values) for name, values in columns.items()}, count)
        for name, values in columns.items():
            self._whole[name].take(_wide(values))
        self._row = {
            "episode_index": self._episodes, "tasks": [episode.ply.task], "length": count,
            **placed("data", shard), "dataset_from_index": self._frames, "dataset_to_index": self._frames + count,
            **played(episode.ply), **stats_columns({n: episode_stats(_wide(v)) for n, v in columns.items()}),
        }  # fmt: skip
        for view, video in self._videos.items():
            file, begins = video.place(count)
            key = f"videos/{schema.video_key(view)}"
            self._row |= placed(key, file)
            self._row |= {f"{key}/from_timestamp": begins, f"{key}/to_timestamp": begins + count / self._fps}
        self._seen_now = {view: PictureStats() for view in self._videos}

    def show(self, frame: int, shown: Shown) -> None:  # they come in their order
        """See ``EpisodeWriter.show``."""
        for view, picture in shown.items():
            self._videos[view].put(picture)
            self._seen_now[view].take(picture)

    def end(self) -> None:
        """See ``EpisodeWriter.end``."""
        for view, seen in self._seen_now.items():
            self._seen[view].add(seen)
            self._row |= stats_columns({schema.video_key(view): seen.stats()})
        self._episodes += 1
        self._frames += int(self._row["length"])
        self._rows.append(self._row)
        if len(self._rows) == _MORE:
            self._write_rows()

    def close(self) -> None:
        """See ``EpisodeWriter.close``."""
        if self._rows:
            self._write_rows()
        for part in self._parts:
            part.close()
        write_tasks(self._root, self._tasks)
        self._write_json(schema.STATS_PATH, self._stats())
        found = schema.info(
            self._features, self._fps, self._episodes, self._frames, len(self._tasks), self._limits
        )  # fmt: skip
        self._write_json(schema.INFO_PATH, found)
        write_atomically(self._root / "README.md", dataset_card(found))

    def drop(self) -> None:
        """See ``EpisodeWriter.drop``."""
        for part in self._parts:
            part.drop()

    def _columns_of(self, episode: Demonstration, task: int) -> dict[str, NDArray[Any]]:
        count = len(episode)
        frames, last = np.arange(count), np.arange(count) == count - 1
        columns: dict[str, NDArray[Any]] = {
            "observation.state": episode.state.astype(np.float32),
            "observation.reference": episode.reference.astype(np.float32),
            "action": episode.action.astype(np.float32),
            "plant_time": episode.time, "next.done": last, "next.success": last & episode.ply.success,
            "timestamp": (frames / self._fps).astype(np.float32), "frame_index": frames,
            "episode_index": np.full(count, self._episodes), "index": self._frames + frames,
            "task_index": np.full(count, task),
        }  # fmt: skip
        return {name: columns[name] for name in self._columns}

    def _write_rows(self) -> None:
        shard = self._table.place(len(self._rows))
        rows = [row | placed("meta/episodes", shard) for row in self._rows]
        names = self._table.schema.names
        self._table.write({name: [row[name] for row in rows] for name in names}, len(rows))
        self._rows.clear()

    def _stats(self) -> dict[str, FeatureStats]:
        found = {name: running.stats(self._batches(name)) for name, running in self._whole.items()}
        return found | {schema.video_key(view): seen.stats() for view, seen in self._seen.items()}

    def _batches(self, name: str) -> Iterator[Values]:
        """All values of a feature once more, from the files."""
        for path in self._data.paths:
            for batch in pq.ParquetFile(path).iter_batches(columns=[name]):
                column = batch.column(0)
                flat = column.flatten() if pa.types.is_fixed_size_list(column.type) else column
                yield _wide(flat.to_numpy(zero_copy_only=False).reshape(len(column), -1))

    def _write_json(self, path: str, content: dict[str, Any]) -> None:
        write_atomically(self._root / path, json.dumps(content, indent=4, ensure_ascii=False) + "\n")


def _wide(values: NDArray[Any]) -> Values:
    """As numbers to reckon with, shape (n, d)."""
    return values.astype(np.float64).reshape(len(values), -1)


def _stored(values: NDArray[Any]) -> Any:
    """As pyarrow takes them: a number a row, or a list of numbers."""
    return values if values.ndim == 1 else list(values)
