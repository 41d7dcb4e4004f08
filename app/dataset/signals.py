"""What of the telemetry an observation is, and what a policy would command: names, units, and the rows themselves."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.protocol.datagram_fields import TELEMETRY
from controller.protocol.messages import Telemetry

Rows = NDArray[np.float64]

_OBSERVED: Final = (
    "angle", "angle_velocity", "position", "velocity", "torque", "force", "finger_position", "tactile",
)  # fmt: skip
"""Fields of the telemetry, in the order of the state; what they mean and their units stand in its layout."""
_ELEMENTS: Final = {1: ("",), 2: (".right", ".left"), 3: (".x", ".y", ".z")}
_BY_JOINT: Final = {
    "angle": "angle of this servomotor", "angle_velocity": "velocity of this servomotor",
    "torque": "torque of this servomotor in the next exchange, after the limits",
}  # fmt: skip
_MEANINGS: Final = {
    **_BY_JOINT, "position": "tool point, base frame", "velocity": "velocity of the tool point, base frame",
    "tactile": "force on this pad",
}  # fmt: skip
"""What one element is, where the layout of the telemetry says it of all of them."""


class Signal(NamedTuple):
    """One number of a row."""

    name: str
    unit: str
    meaning: str


def _observed() -> tuple[Signal, ...]:
    layout = {field.name: field for field in TELEMETRY.fields}
    return tuple(
        Signal(name + element, layout[name].unit, _MEANINGS.get(name, layout[name].meaning))
        for name in _OBSERVED
        for element in ((".1", ".2", ".3") if name in _BY_JOINT else _ELEMENTS[layout[name].count])
    )


STATE: Final[tuple[Signal, ...]] = _observed()
"""Of ``observation.state``: what the controller measured and commanded at the frame's tick."""
REFERENCE: Final = tuple(Signal(f"reference.{axis}", "m", "reference of the tool point, base frame") for axis in "xyz")
"""Of ``observation.reference``: where the arm was meant to be at the frame's tick."""
ACTION: Final = (
    *(Signal(f"reference.{axis}", "m", "reference of the tool point at the next frame, base frame") for axis in "xyz"),
    *(Signal(f"reference_velocity.{axis}", "m/s", "its mean velocity from this frame to that") for axis in "xyz"),
    Signal("finger_velocity", "m/s", "mean velocity of each finger from this frame to the next, positive opening"),
)  # fmt: skip
"""Of ``action``: what a policy above the impedance law commands, once a frame. The law below follows it softly."""
FINGER: Final = [signal.name for signal in STATE].index("finger_position")


def state_row(told: Telemetry) -> list[float]:
    """The numbers of ``STATE`` in a telemetry."""
    row = list[float]()
    for name in _OBSERVED:
        value = getattr(told, name)
        row += value if isinstance(value, tuple) else (value,)
    return row


def actions(state: Rows, reference: Rows, time: NDArray[np.float64]) -> Rows:
    """What was commanded from each frame to the next.

    Args:
        state: rows of ``STATE``, shape (n + 1, 21), with the frame after the last.
        reference: rows of ``REFERENCE``, shape (n + 1, 3) [m].
        time: plant time of the rows, shape (n + 1,), rising [s].

    Returns:
        Rows of ``ACTION``, shape (n, 7).
    """
    lasts = np.diff(time)[:, None]
    velocity = np.diff(reference, axis=0) / lasts
    finger = np.diff(state[:, FINGER, None], axis=0) / lasts
    return np.hstack((reference[1:], velocity, finger))
