"""Plans in files: what was asked for, and every sample, so that a plan can be drawn or carried out again."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeInt, ValidationError

from app import UserError
from app.motion.gains import Softness
from app.motion.path import Path as Way
from app.motion.plan import Motion, Plan, Style
from app.motion.route import Route
from app.motion.settings import MotionSettings
from app.motion.timing.time_law import Bounds
from app.pieces.manipulation import Stage
from app.records.files import write_atomically
from controller.protocol import SAMPLE
from hardware.frozen import FrozenFinite
from hardware.table import TableSettings

FORMAT: Final = 1
_MOST: Final = 64
"""Motions of a plan; the longest ply has ten."""


class _Route(FrozenFinite):
    """As `Route`; its arrays lie beside it."""

    bounds: tuple[tuple[float, float, float, float | None], ...]
    contact: tuple[float, float]
    finger: float
    wait: float
    opens: float | None
    then: float | None
    closes: float | None
    soft_start: Softness
    touches: bool
    grips: bool
    holds: bool = False


class _Motion(FrozenFinite):
    """As `Motion`; its arrays lie beside it."""

    label: str
    expected: float
    grips: bool
    touches: bool
    transfer: NonNegativeInt | None
    stage: Stage | None
    route: _Route | None
    paths: NonNegativeInt


class _Style(FrozenFinite):
    settings: MotionSettings
    table: TableSettings
    tick: float


class _Plan(FrozenFinite):
    format: Literal[1] = FORMAT
    label: str
    lead: float
    style: _Style | None
    motions: tuple[_Motion, ...]


class PlanUnreadable(UserError):
    """A file holds no plan."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path} holds no plan ({reason}): name a file that save_plan wrote")


def save_plan(plan: Plan, path: Path) -> None:
    """Write a plan as one NumPy archive (.npz): its data as JSON, its arrays beside.

    Raises:
        RecordError: the file cannot be written.
    """
    arrays: dict[str, NDArray[Any]] = {}
    motions = []
    for index, motion in enumerate(plan.motions):
        arrays[f"{index}.samples"] = motion.samples
        for number, way in enumerate(motion.paths):
            arrays[f"{index}.path{number}"] = way.table
        if motion.route is not None:
            arrays[f"{index}.points"], arrays[f"{index}.tangents"] = motion.route.points, motion.route.tangents
        motions.append(_Motion(
            label=motion.label, expected=motion.expected, grips=motion.grips, touches=motion.touches,
            transfer=motion.transfer, stage=motion.stage, paths=len(motion.paths),
            route=None if motion.route is None else _route_data(motion.route),
        ))  # fmt: skip
    style = None if plan.style is None else _Style(**plan.style._asdict())
    data = _Plan(label=plan.label, lead=plan.lead, style=style, motions=tuple(motions))
    file = io.BytesIO()
    text = np.frombuffer(data.model_dump_json().encode(), dtype=np.uint8)
    np.savez_compressed(file, plan=text, **arrays)  # type: ignore[arg-type]  # its stubs take names for options
    write_atomically(path, file.getvalue())


def load_plan(path: Path) -> Plan:
    """Read a plan.

    Raises:
        PlanUnreadable: there is none, or it is not whole.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        data = _Plan.model_validate_json(arrays["plan"].tobytes())
        if len(data.motions) > _MOST:
            raise PlanUnreadable(path, f"{len(data.motions)} motions, at most {_MOST}")
        motions = tuple(_motion(motion, index, arrays) for index, motion in enumerate(data.motions))
    except OSError as error:
        raise PlanUnreadable(path, error.strerror or str(error)) from error
    except ValidationError as error:
        raise PlanUnreadable(path, str(error.errors()[0]["msg"])) from error
    except (KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise PlanUnreadable(path, str(error)) from error
    style = None if data.style is None else Style(data.style.settings, data.style.table, data.style.tick)
    return Plan(data.label, motions, data.lead, style)


def _route_data(route: Route) -> _Route:
    return _Route(
        bounds=tuple(
            (b.speed, b.acceleration, b.jerk, b.downward if math.isfinite(b.downward) else None) for b in route.bounds
        ),
        contact=route.contact, finger=route.finger, wait=route.wait, opens=route.opens, then=route.then,
        closes=route.closes, soft_start=route.soft_start, touches=route.touches, grips=route.grips,
        holds=route.holds,
    )  # fmt: skip


def _motion(data: _Motion, index: int, arrays: Mapping[str, NDArray[Any]]) -> Motion:
    samples = arrays[f"{index}.samples"]
    if samples.dtype != SAMPLE or samples.ndim != 1 or not samples.size:
        raise ValueError(f"motion {index} has no samples")
    samples.flags.writeable = False
    paths = tuple(Way(_table(arrays[f"{index}.path{number}"], 14)) for number in range(data.paths))
    route = None if data.route is None else _route(data.route, index, arrays)
    return Motion(data.label, samples, data.expected, data.grips, data.touches, route, paths, data.transfer, data.stage)


def _route(data: _Route, index: int, arrays: Mapping[str, NDArray[Any]]) -> Route:
    bounds = tuple(
        Bounds(speed, acceleration, jerk, math.inf if down is None else down)
        for speed, acceleration, jerk, down in data.bounds
    )
    points, tangents = _table(arrays[f"{index}.points"], 3), np.asarray(arrays[f"{index}.tangents"], dtype=float)
    if len(bounds) != len(points) - 1 or tangents.shape != (max(0, len(points) - 2),):
        raise ValueError(f"the way of motion {index} is not whole")
    return Route(
        points, tangents, bounds, data.contact, data.finger, data.wait, data.opens, data.then, data.closes,
        data.soft_start, data.touches, data.grips, data.holds,
    )  # fmt: skip


def _table(array: NDArray[Any], columns: int) -> NDArray[np.float64]:
    table = np.asarray(array, dtype=float)
    if table.ndim != 2 or table.shape[1] != columns or not len(table) or not np.isfinite(table).all():
        raise ValueError(f"a table of {columns} columns has shape {table.shape}")
    return table
