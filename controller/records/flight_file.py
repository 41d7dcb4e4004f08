"""Files of the flight recorder: what each tick holds, and how to write and read them.

A file is an ordinary ``.npz`` archive, not compressed: ``ticks.npy``, one row a tick as `FLIGHT` says, oldest first,
and ``flight.json`` with the rest. NumPy alone reads it: ``numpy.load(path)["ticks"]``.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.protocol.cause_sentences import explain
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import VERSION, CommandCode, Field, Layout, MotionFlag
from controller.protocol.messages import Announce

FLIGHT: Final = Layout(
    "flight",
    (
        Field("tick", "Q", "tick", "tick of the measurement"),
        Field("wall", "d", "s", "wall time after the exchange: seconds since 1970, UTC, never going back"),
        Field("work", "d", "s", "wall time from the end of the exchange until this row was written"),
        Field("state", "Q", "", "state of the controller after the tick"),
        Field("cause", "Q", "", "why it stopped or faulted last, 0 once a motion is admitted"),
        Field("drive_status", "Q", "", "status word of the drives"),
        Field("motion", "Q", "", "motion admitted and not ended, else 0"),
        Field("index", "Q", "samples", "samples of it executed"),
        Field("angle", "3d", "rad", "servomotor angles y"),
        Field("angle_velocity", "3d", "rad/s", "their velocities"),
        Field("torque", "3d", "N m", "torques commanded for the next exchange, after the limits"),
        Field("finger_position", "d", "m", "a pad's front edge from the tool centre"),
        Field("finger_velocity", "d", "m/s", "commanded for the next exchange, of each finger, positive opening"),
        Field("tactile", "2d", "N", "forces on the right and the left pad"),
        Field("force", "3d", "N", "force on the tool, estimated from torques and motion, base frame"),
        Field("position", "3d", "m", "tool point z, base frame"),
        Field("velocity", "3d", "m/s", "its velocity"),
        Field("torque_asked", "3d", "N m", "torques that the law gave last, before the limits"),
        Field("reference", "3d", "m", "reference r, base frame"),
        Field("reference_velocity", "3d", "m/s", "its first derivative"),
        Field("reference_acceleration", "3d", "m/s²", "its second derivative"),
        Field("stiffness", "3d", "1/s²", "k_p of each axis"),
        Field("damping", "3d", "1/s", "k_v of each axis"),
        Field("tactile_gain", "d", "1/kg", "k*"),
    ),
)
"""One tick. Every number has eight bytes."""

TICKS: Final = "ticks.npy"
HEAD: Final = "flight.json"
_CHUNK: Final = 1 << 20
"""Bytes summed up and written at a time, both without holding the interpreter's lock."""


class FlightFileError(Exception):
    """A file is no readable flight; the message says which and why."""


class Trigger(NamedTuple):
    """Why a flight was written: tick and wall time (UTC, since 1970) [s] of a stop or fault, its cause and numbers."""

    tick: int
    wall: float
    cause: Cause
    value: float
    limit: float

    def explain(self) -> str:
        """What happened, as one sentence."""
        return explain(self.cause, self.value, self.limit)


class Order(NamedTuple):
    """A command or an announcement of the client, with the last tick before it and its wall time [s]."""

    tick: int
    wall: float
    order: CommandCode | Announce


class FlightHead(NamedTuple):
    """What a file says beside its ticks.

    Attributes:
        period: length of a tick [s].
        abnormal: the process ended without bringing the arm to rest: drives lost, or a defect.
        triggers: the stops and faults it was written for, oldest first; none if the end alone was the reason.
        orders: the last commands and announcements, oldest first.
    """

    period: float
    abnormal: bool
    triggers: tuple[Trigger, ...]
    orders: tuple[Order, ...]


@dataclass(frozen=True, slots=True)
class FlightRecord:
    """A recorded flight; arrays cannot be written to."""

    head: FlightHead
    ticks: NDArray[Any]
    """Shape (n,), one element a tick, oldest first; columns and their units as in `FLIGHT`."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column, shape (n,) or (n, 2) or (n, 3).

        Raises:
            KeyError: there is no such column; the message names those there are.
        """
        names = self.ticks.dtype.names or ()
        if name not in names:
            raise KeyError(f"a flight has no column '{name}': choose one of {', '.join(names)}")
        column: NDArray[Any] = self.ticks[name]
        return column


def write_flight(path: Path, head: FlightHead, parts: Sequence[NDArray[Any]]) -> None:
    """Write a file; whoever reads it, also after a crash, finds all of it or nothing.

    It is written in large pieces without copies, so that a thread that must be on time hardly notices: the lock of the
    interpreter is held for microseconds between two pieces.

    Args:
        path: replaced if it exists.
        head: what belongs to the ticks.
        parts: arrays of `FLIGHT` one after the other, oldest ticks first.

    Raises:
        OSError: it cannot be written; there is no file of this name then.
    """
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb") as file:
            with zipfile.ZipFile(file, "w") as archive:
                archive.writestr(HEAD, json.dumps(_head_to_json(head)))
                with archive.open(TICKS, "w", force_zip64=True) as entry:
                    entry.write(_array_header(sum(len(rows) for rows in parts)))
                    for rows in parts:
                        raw = rows.view(np.uint8).data
                        for start in range(0, len(raw), _CHUNK):
                            entry.write(raw[start : start + _CHUNK])
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def load_flight(path: Path) -> FlightRecord:
    """Read a file that the recorder wrote.

    Raises:
        FlightFileError: it cannot be read, is none, or was written by another version.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            head = json.loads(archive.read(HEAD))
            ticks = np.lib.format.read_array(io.BytesIO(archive.read(TICKS)), allow_pickle=False)
        columns = [field["name"] for field in head["columns"]]
        if ticks.dtype != FLIGHT.dtype:
            wanted = ", ".join(field.name for field in FLIGHT.fields)
            raise FlightFileError(
                f"{path} has the columns {', '.join(columns)}, this version reads {wanted}: "
                "read it with the version that wrote it"
            )
        found = _head_from_json(head)
    except OSError as error:
        raise FlightFileError(f"{path} cannot be read: {error.strerror}: name a flight-*.npz file") from error
    except (ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        raise FlightFileError(f"{path} is not a flight record ({error}): name a flight-*.npz file") from error
    ticks.setflags(write=False)
    return FlightRecord(found, ticks)


def _array_header(rows: int) -> bytes:
    text = io.BytesIO()
    shape = {"descr": np.lib.format.dtype_to_descr(FLIGHT.dtype), "fortran_order": False, "shape": (rows,)}
    np.lib.format.write_array_header_1_0(text, shape)
    return text.getvalue()


def _head_to_json(head: FlightHead) -> dict[str, Any]:
    return {
        "protocol": VERSION,
        "period": head.period,
        "abnormal": head.abnormal,
        "triggers": [
            {"tick": t.tick, "wall": t.wall, "cause": t.cause.name, "value": _number(t.value),
             "limit": _number(t.limit), "sentence": t.explain()}
            for t in head.triggers
        ],
        "orders": [_order_to_json(order) for order in head.orders],
        "columns": [{"name": f.name, "type": f.type_name, "unit": f.unit, "meaning": f.meaning} for f in FLIGHT.fields],
    }  # fmt: skip


def _order_to_json(order: Order) -> dict[str, Any]:
    what = order.order
    if isinstance(what, Announce):
        content: dict[str, Any] = {"announce": what._asdict() | {"flags": int(what.flags)}}
    else:
        content = {"command": what.name}
    return {"tick": order.tick, "wall": order.wall, **content}


def _head_from_json(head: dict[str, Any]) -> FlightHead:
    triggers = tuple(
        Trigger(t["tick"], t["wall"], Cause[t["cause"]], float(t["value"]), float(t["limit"])) for t in head["triggers"]
    )
    orders = tuple(Order(o["tick"], o["wall"], _order_from_json(o)) for o in head["orders"])
    return FlightHead(head["period"], head["abnormal"], triggers, orders)


def _order_from_json(order: dict[str, Any]) -> CommandCode | Announce:
    if "command" in order:
        return CommandCode[order["command"]]
    content = order["announce"]
    return Announce(**content | {"flags": MotionFlag(content["flags"])})


def _number(value: float) -> float | str:
    """JSON has no infinity and no NaN: those as text, which ``float`` reads."""
    return value if np.isfinite(value) else str(value)
