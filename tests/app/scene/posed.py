"""The whole robot in a pose, put together from its parts as they stand."""

from __future__ import annotations

from app.scene.arm import ArmJoints, base_solids, finger_solids, leg_solids, moved, tool_solids
from app.scene.solids import Solid
from controller.model.vectors import combine
from hardware.parameters import RobotParameters


def arm_solids(parameters: RobotParameters, joints: ArmJoints, finger: float) -> tuple[Solid, ...]:
    """All of the robot in a pose, base frame; ``finger``: from a pad's front edge to the tool point [m]."""
    parts: list[Solid] = [*base_solids(parameters), *leg_solids(joints)]
    parts += [moved(solid, joints.tool) for solid in tool_solids(parameters)]
    for side in (1, -1):
        at = combine(joints.tool, side * finger, (1.0, 0.0, 0.0))
        parts += [moved(solid, at) for solid in finger_solids(parameters, side)]
    return tuple(parts)
