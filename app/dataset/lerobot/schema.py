"""What LeRobot's format v3.0 prescribes: names of files, features, and what ``meta/info.json`` says.

Source: ``datasets/utils.py`` (paths, ``DatasetInfo``), ``datasets/feature_utils.py``, ``utils/constants.py`` and
``datasets/video_utils.py`` (``get_video_info``) of LeRobot.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import pyarrow as pa

from app.dataset.signals import ACTION, REFERENCE, STATE, Signal

VERSION: Final = "v3.0"
INFO_PATH: Final = "meta/info.json"
STATS_PATH: Final = "meta/stats.json"
TASKS_PATH: Final = "meta/tasks.parquet"
_SHARD: Final = "chunk-{chunk_index:03d}/file-{file_index:03d}"
EPISODES_PATH: Final = f"meta/episodes/{_SHARD}.parquet"
DATA_PATH: Final = f"data/{_SHARD}.parquet"
VIDEO_PATH: Final = f"videos/{{video_key}}/{_SHARD}.mp4"
ROBOT_TYPE: Final = "touchmove_delta"

CODEC: Final = "libsvtav1"
PIXELS: Final = "yuv420p"
GROUP, QUALITY, PRESET = 2, 30, 8
"""Frames from key frame to key frame and constant rate factor, as LeRobot's own default has them; preset of the encoder
(LeRobot's 12 is made into 11 by the encoder, which warns of what it may look like)."""

ENCODER: Final = {"svtav1-params": "lookahead=0"}
"""More of the encoder: with key frames so near there is nothing to look ahead for, and fewer pictures wait in it."""

Feature = dict[str, Any]
"""As in ``info.json``: dtype, shape, names, and for videos what they are encoded like."""


@dataclass(frozen=True, slots=True)
class ShardLimits:
    """How much goes into one file, and how many files into one folder."""

    data_mb: float = 100
    """[MiB]"""
    video_mb: float = 200
    """[MiB]"""
    chunk: int = 1000


def video_key(view: str) -> str:
    """Name of the feature of a view."""
    return f"observation.images.{view}"


def features(views: Iterable[str], width: int, height: int, fps: int) -> dict[str, Feature]:
    """All features of a dataset, in the order of its columns; those of videos have no column.

    Args:
        views: names of the views.
        width: of their pictures [px].
        height: of their pictures [px].
        fps: frames a second.
    """
    own = {
        "observation.state": _vector(STATE),
        "observation.reference": _vector(REFERENCE),
        "action": _vector(ACTION),
        **{video_key(view): _video(width, height, fps) for view in views},
        "plant_time": _scalar("float64"),
        "next.done": _scalar("bool"),
        "next.success": _scalar("bool"),
    }
    default = {
        "timestamp": "float32",
        **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64"),
    }
    return own | {name: _scalar(dtype) for name, dtype in default.items()}


def data_schema(found: dict[str, Feature]) -> pa.Schema:
    """Columns of the data files: a feature of shape (1,) is a number, others are lists of one length."""
    columns = []
    for name, feature in found.items():
        if feature["dtype"] == "video":
            continue
        kind = {"bool": pa.bool_(), "int64": pa.int64(), "float32": pa.float32(), "float64": pa.float64()}
        value, (length,) = kind[feature["dtype"]], feature["shape"]
        columns.append(pa.field(name, value if length == 1 else pa.list_(value, length)))
    return pa.schema(columns)


def info(
    found: dict[str, Feature], fps: int, episodes: int, frames: int, tasks: int, limits: ShardLimits
) -> dict[str, Any]:
    """The content of ``meta/info.json``.

    Args:
        found: the features.
        fps: frames a second.
        episodes: how many there are.
        frames: of all of them.
        tasks: how many different ones.
        limits: of the files.
    """
    return {
        "codebase_version": VERSION, "fps": fps, "features": found, "total_episodes": episodes, "total_frames": frames,
        "total_tasks": tasks, "chunks_size": limits.chunk, "data_files_size_in_mb": limits.data_mb,
        "video_files_size_in_mb": limits.video_mb, "data_path": DATA_PATH,
        "video_path": VIDEO_PATH if any(feature["dtype"] == "video" for feature in found.values()) else None,
        "robot_type": ROBOT_TYPE, "splits": {"train": f"0:{episodes}"},
    }  # fmt: skip


def _vector(signals: tuple[Signal, ...]) -> Feature:
    return {"dtype": "float32", "shape": [len(signals)], "names": [signal.name for signal in signals]}


def _scalar(dtype: str) -> Feature:
    return {"dtype": dtype, "shape": [1], "names": None}


def _video(width: int, height: int, fps: int) -> Feature:
    return {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height, "video.width": width, "video.codec": "av1", "video.pix_fmt": PIXELS,
            "video.fps": fps, "video.channels": 3, "has_audio": False, "video.g": GROUP, "video.crf": QUALITY,
            "video.preset": PRESET, "video.fast_decode": 0, "video.video_backend": "pyav",
            "video.extra_options": ENCODER, "is_depth_map": False,
        },
    }  # fmt: skip
