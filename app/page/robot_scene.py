"""What the page draws in three dimensions, as ``robot.json``: the arm, the table, each kind of piece, and the limits.

The browser gets numbers only: solids, outlines and places. How they look is its own affair, and where the arm's joints
lie for three angles it works out from the lengths.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from app.scene.arm import (
    PROXIMAL_RADIUS,
    ROD_HALF_DISTANCE,
    ROD_RADIUS,
    base_solids,
    finger_solids,
    tool_solids,
)
from app.scene.solids import Cuboid, Finish, Solid
from app.scene.table import PLACE_RADIUS
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from controller.protection.limits import default_limits
from hardware.interfaces import Triple
from hardware.parameters import RobotParameters
from hardware.piece_set import PIECE_PROFILES, PIECE_SHAPES, Kind, piece_profile
from hardware.table import TableSettings, square_place
from hardware.turned_shapes import CARVINGS, KING_CROSS, KNIGHT_HEAD, KNIGHT_LAYERS

FELT_POINTS: Final = 2
"""So many points of an outline belong to the felt."""
_DIGITS: Final = 6
"""Of a length in metres: micrometres."""


def robot_scene(parameters: RobotParameters, table: TableSettings, home: Triple, tick: float) -> dict[str, Any]:
    """Everything that is drawn, ready for JSON. Lengths [m], angles [rad], base frame unless it says otherwise.

    Args:
        parameters: of the robot.
        table: that it works at.
        home: the tool point at rest, base frame [m].
        tick: length of a tick [s].
    """
    geometry, limits = parameters.geometry, default_limits(parameters, table)
    angles = posture_at(DeltaModel(parameters), np.array(home)).y.tolist()
    return {
        "tick": tick,
        "geometry": geometry.model_dump(),
        "home": {"tool": home, "angles": angles, "finger": 0.5 * parameters.gripper.stroke},
        "links": {
            "proximal": {"radius": PROXIMAL_RADIUS, "finish": Finish.ALUMINIUM},
            "rod": {"radius": ROD_RADIUS, "aside": ROD_HALF_DISTANCE, "finish": Finish.CARBON},
            "axle": {"radius": ROD_RADIUS, "finish": Finish.METAL},
        },
        "base": [_solid(one) for one in base_solids(parameters)],
        "tool": [_solid(one) for one in tool_solids(parameters)],
        "fingers": {
            name: [_solid(one) for one in finger_solids(parameters, side)]
            for name, side in (("right", 1), ("left", -1))
        },
        "table": _table(table),
        "kinds": {kind.value: _kind(kind) for kind in Kind},
        "limits": {
            "tracking": {
                "acceleration": limits.tracking_acceleration,
                "least": limits.tracking_least,
                "most": limits.tracking_most,
            },
            "torque": parameters.drive.peak_torque,
            "finger": parameters.gripper.max_force,
            "tick": tick,
        },
    }


def _table(table: TableSettings) -> dict[str, Any]:
    """Board, places and boxes; board frame, but for the pose of the board in the base frame, row by row."""
    places = [square_place(square) for square in range(64)] + [*table.tray_places(), *table.box_places()]
    half_y = max(4.0 * table.square, 0.5 * table.tray_rows * table.tray_row_pitch) + 0.018
    boxes = table.boxes()
    return {
        "pose": _rounded(table.pose_in_base()),
        "square": table.square,
        "half": [table.half_width, max([half_y, *(box.half_y + box.wall for box in boxes)])],
        "places": {str(place): _rounded(table.xy(place)) for place in places},
        "place_radius": PLACE_RADIUS,
        "boxes": [
            {"at": [box.x, box.y], "half": [box.half_x, box.half_y], "height": box.height, "wall": box.wall}
            for box in boxes
        ],
    }


def _kind(kind: Kind) -> dict[str, Any]:
    """A kind of piece: its outline as radius and height from the foot up, what is carved, and where it is held."""
    shape, outline = PIECE_SHAPES[kind], piece_profile(kind)
    low, span, stem = shape.foot_height, shape.height - shape.foot_height, shape.stem_radius
    content: dict[str, Any] = {
        "outline": _rounded(outline),
        "felt": FELT_POINTS,
        "height": shape.height,
        "grip": shape.grip_height,
    }
    if carving := CARVINGS.get(kind):
        first = len(outline) - 1 - len(PIECE_PROFILES[kind])
        content["carving"] = {
            "rings": [first + ring for ring in carving.rings],
            "height": round(carving.height * max(height for _, height in outline), _DIGITS),
            "teeth": carving.teeth,
            "square": carving.square,
        }
    if kind is Kind.KNIGHT:
        content["head"] = {
            "outline": _rounded([(y * stem, low + height * span) for y, height in KNIGHT_HEAD]),
            "half": round(max(x for x, _ in KNIGHT_LAYERS) * stem, _DIGITS),
        }
    if kind is Kind.KING:
        content["blocks"] = [
            {
                "size": _rounded((2.0 * x * stem, 2.0 * y * stem, 2.0 * z * span)),
                "height": round(shape.height - below * span, _DIGITS),
            }
            for (x, y, z), below in KING_CROSS
        ]
    return content


def _solid(solid: Solid) -> dict[str, Any]:
    if isinstance(solid, Cuboid):
        return {"centre": _rounded(solid.centre), "size": _rounded(solid.size), "finish": solid.finish}
    end_radius = solid.radius if solid.end_radius is None else solid.end_radius
    return {
        "start": _rounded(solid.start),
        "end": _rounded(solid.end),
        "radii": [solid.radius, end_radius],
        "finish": solid.finish,
    }


def _rounded(values: Any) -> Any:
    return np.round(np.asarray(values, dtype=float), _DIGITS).tolist()
