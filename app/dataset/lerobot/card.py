"""The dataset's card, ``README.md``: what its numbers are, which LeRobot's schema has no room for."""

from __future__ import annotations

from typing import Any, Final

from app.dataset.signals import ACTION, REFERENCE, STATE, Signal

_HEAD: Final = """---
task_categories:
- robotics
tags:
- LeRobot
configs:
- config_name: default
  data_files: data/*/*.parquet
---
"""


def dataset_card(info: dict[str, Any]) -> str:
    """In Markdown, with what the Hugging Face hub reads at its head.

    Args:
        info: the content of ``meta/info.json``.
    """
    parts = [
        _HEAD,
        "# Chess moves by an impedance-controlled delta robot\n",
        f"{info['total_episodes']} episodes, {info['total_frames']} frames at {info['fps']} a second, in LeRobot's "
        f"format {info['codebase_version']}. An episode is a ply, from home to home; each frame is a moment of a game "
        "played by touchmove, and `plant_time` has its true time [s].\n",
        *(_table(name, signals) for name, signals in _SIGNALS.items()),
    ]
    return "\n".join(parts)


_SIGNALS: Final = {"observation.state": STATE, "observation.reference": REFERENCE, "action": ACTION}


def _table(name: str, signals: tuple[Signal, ...]) -> str:
    rows = [f"| `{signal.name}` | {signal.unit} | {signal.meaning} |" for signal in signals]
    return "\n".join((f"## `{name}`\n", "| name | unit | meaning |", "| --- | --- | --- |", *rows, ""))
