"""What the controller recorded of a motion, tick by tick, and what of it the estimation looks at."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from app import UserError
from controller.model.compiled import FloatArray
from controller.records.flight_file import FlightFileError, FlightRecord, load_flight

SMOOTH: Final = 60.0
"""Angles are freed of what is quicker, without delay, before they are differentiated [Hz]: twenty times what the motion
asks for, and above the ripple that a motor of five pole pairs has at 6 rad/s."""
_ORDER: Final = 3
MOST_MISSED: Final = 0.05
"""Share of ticks that may be missing …"""
LONGEST_MISSED: Final = 10
"""… and so many in a row: 9 ms, in which the arm does nothing that its neighbours do not show."""
_EDGE: Final = 0.1
"""At either end of the record filters have not settled [s]."""


class NoRecord(UserError):
    """The record of a motion is not there, or is not whole."""


@dataclass(frozen=True, slots=True, eq=False)
class JointRecord:
    """Servomotors, one row a tick."""

    period: float
    """Of a tick [s]."""
    angle: FloatArray
    """Measured at the tick, (n, 3) [rad]."""
    torque: FloatArray
    """That acted from this tick to the next, (n, 3) [N m]."""


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion:
    """The same between ticks, smoothed."""

    period: float
    """Of a tick [s]."""
    angle: FloatArray
    """(n, 3) [rad]"""
    rate: FloatArray
    """(n, 3) [rad/s]"""
    change: FloatArray
    """(n, 3) [rad/s²]"""
    torque: FloatArray
    """As it was commanded, (n, 3) [N m]."""


def of_flight(record: FlightRecord, motion: int) -> JointRecord:
    """The part of a flight record that belongs to a motion.

    A row's torque is given to the drives with the next exchange, and acts from the measurement that this one brings.

    In ticks that the controller missed the drives kept their torque, and the arm went on between its neighbours.

    Raises:
        NoRecord: the motion is not in it, or too many ticks of it are missing.
    """
    rows = record.ticks[record["motion"] == motion]
    if len(rows) < 2:
        raise NoRecord(f"motion {motion} is not in the controller's record: run the controller on the same PC")
    missed = np.diff(rows["tick"]) - 1
    if missed.max() > LONGEST_MISSED or missed.sum() > MOST_MISSED * len(rows):
        raise NoRecord(
            f"the controller missed {missed.sum()} ticks of the motion, {missed.max()} of them in a row: end other "
            "programs, then identify again"
        )
    seen = joint_record(record.head.period, rows["angle"], rows["torque"])
    return _filled(seen, rows["tick"][1:]) if missed.any() else seen


def _filled(record: JointRecord, ticks: NDArray[np.int64]) -> JointRecord:
    """A row for each tick, given those that there are, (n,)."""
    every = np.arange(ticks[0], ticks[-1] + 1)
    last = np.searchsorted(ticks, every, side="right") - 1
    return JointRecord(record.period, CubicSpline(ticks, record.angle)(every), record.torque[last])


def joint_record(period: float, angle: FloatArray, torque: FloatArray) -> JointRecord:
    """Of angles measured and torques computed in the same ticks: the latter act a tick later."""
    return JointRecord(period, np.ascontiguousarray(angle[1:]), np.ascontiguousarray(torque[:-1]))


def load_record(path: Path, motion: int) -> JointRecord:
    """Read a flight record's file; raises ``NoRecord`` if it cannot be read, and as `of_flight`."""
    try:
        return of_flight(load_flight(path), motion)
    except FlightFileError as error:
        raise NoRecord(str(error)) from error


def between_ticks(record: JointRecord) -> JointMotion:
    """Angles, rates and their changes in the middles of the ticks in which each torque acted.

    All of them pass one filter forwards and backwards; the torque passes it later, together with what explains it.
    """
    tick = record.period
    smooth = low_pass(record.angle, SMOOTH, tick)
    rate = np.diff(smooth, axis=0) / tick
    change = np.gradient(rate, tick, axis=0)
    middle = 0.5 * (smooth[1:] + smooth[:-1])
    edge = round(_EDGE / tick)
    inner = slice(edge, -edge)
    return JointMotion(tick, middle[inner], rate[inner], change[inner], record.torque[:-1][inner])


def low_pass(rows: FloatArray, frequency: float, tick: float) -> FloatArray:
    """Rows a tick apart [s], (n, …), without what is quicker than a frequency [Hz]; nothing is delayed."""
    sections = butter(_ORDER, frequency, fs=1.0 / tick, output="sos")
    filtered: FloatArray = sosfiltfilt(sections, rows, axis=0)
    return filtered
