"""How much slower a motion goes on while the servomotors are warm, where it would be stopped at their rating."""

from typing import Final

from controller.model.compiled import SCALAR, compiled_as

WARM: Final = 0.92
"""Servomotors whose mean square of torque is a larger share of what they are rated for are spared."""
SLOWEST: Final = 0.3
"""The least σ of warm servomotors: nine tenths less acceleration, and what is left is little more than holding."""
_CALM: Final = 1.0
"""So quickly that σ falls and rises [1/s]: the tool's deceleration for it, up to 2 m/s², is not to add to what braking
takes already."""


@compiled_as(SCALAR(SCALAR, SCALAR, SCALAR))
def warm_pace(pace: float, time: float, heat: float) -> float:
    """Share of the planned speed that servomotors admit.

    Args:
        pace: before; negative as the motion begins.
        time: since then [s].
        heat: mean square of the torque of the warmest servomotor, as a share of what it is rated for.
    """
    goal, change = min(1.0, max(SLOWEST, (1.0 - heat) / (1.0 - WARM))), _CALM * time
    return goal if pace < 0.0 else min(max(goal, pace - change), pace + change)
