"""The tables of ``meta/``: episodes and tasks."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from app.dataset.games import RecordedPly
from app.dataset.lerobot.schema import TASKS_PATH, Feature, video_key
from app.dataset.lerobot.shards import FilePlace
from app.dataset.lerobot.statistics import NAMES, FeatureStats
from app.records.files import recording


def episodes_schema(found: Mapping[str, Feature], views: Iterable[str]) -> pa.Schema:
    """Columns of ``meta/episodes``: LeRobot's, and which ply of which game it was.

    Args:
        found: the features.
        views: names of the views.
    """
    number, moment = pa.int64(), pa.float64()
    columns: dict[str, pa.DataType] = {
        "episode_index": number, "tasks": pa.list_(pa.string()), "length": number, "data/chunk_index": number,
        "data/file_index": number, "dataset_from_index": number, "dataset_to_index": number,
    }  # fmt: skip
    for view in views:
        key = f"videos/{video_key(view)}"
        columns |= {f"{key}/chunk_index": number, f"{key}/file_index": number}
        columns |= {f"{key}/from_timestamp": moment, f"{key}/to_timestamp": moment}
    for name, feature in found.items():
        values = pa.list_(pa.list_(pa.list_(moment))) if feature["dtype"] == "video" else pa.list_(moment)
        columns |= {f"stats/{name}/{what}": pa.list_(number) if what == "count" else values for what in NAMES}
    columns |= {"meta/episodes/chunk_index": number, "meta/episodes/file_index": number}
    columns |= dict.fromkeys(("game", "uci", "fen"), pa.string()) | dict.fromkeys(("seed", "ply"), number)
    return pa.schema(list(columns.items()))


def played(ply: RecordedPly) -> dict[str, Any]:
    """Which ply of which game an episode is."""
    return {"game": ply.game, "uci": ply.uci, "fen": ply.fen, "seed": ply.seed, "ply": ply.number}


def placed(key: str, shard: FilePlace) -> dict[str, int]:
    """In which file something of an episode is."""
    return {f"{key}/chunk_index": shard.chunk, f"{key}/file_index": shard.file}


def stats_columns(stats: Mapping[str, FeatureStats]) -> dict[str, Any]:
    """Statistics of an episode, flat."""
    return {f"stats/{name}/{what}": value for name, one in stats.items() for what, value in one.items()}


def write_tasks(root: Path, tasks: Iterable[str]) -> None:
    """Write ``meta/tasks.parquet``, in which tasks are the index of a table of pandas, and their numbers its column.

    Raises:
        RecordError: it cannot be written.
    """
    names = list(tasks)
    schema = pa.schema([("task_index", pa.int64()), ("task", pa.string())], metadata={"pandas": _of_pandas()})
    table = pa.table({"task_index": list(range(len(names))), "task": names}, schema=schema)
    path = root / TASKS_PATH
    with recording(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, path)


def _of_pandas() -> str:
    """What pandas writes of a table with an index of its own name, so that it makes it an index again."""
    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": dtype, "metadata": None}
        for name, (kind, dtype) in kinds.items()
    ]
    names = {"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object"}
    return json.dumps({
        "index_columns": ["task"], "column_indexes": [names | {"metadata": {"encoding": "UTF-8"}}], "columns": columns,
        "creator": {"library": "pyarrow", "version": pa.__version__}, "pandas_version": "2.0.0",
    })  # fmt: skip
