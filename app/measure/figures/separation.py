"""Where the guarded arm may be fast: how much farther than a hand's reach the tool is from what the camera misses."""

from __future__ import annotations

from typing import Final

import numpy as np

from app.guard.game_guard import LATENCY
from app.guard.separation import HAND_SPEED, borders, reach
from app.measure.figures.drawing import axes, board_map, label, picture, table_grid
from app.measure.figures.result import Bar, FigureResult, Progress
from app.motion.timing.reference import Vector
from app.rig.simulation.nominal_view import nominal_view
from hardware.contact_speeds import CONTACT_PROFILES, ContactSpeeds
from hardware.sim.render.d435 import GLANCE, LEFT_IMAGER, colour_intrinsics, depth_intrinsics
from hardware.table import TableSettings

HEIGHTS: Final = (0.04, 0.09, 0.14)  # of the tool over the board [m]: low with a piece, over others, and at home
INTERVAL: Final = 1.0 / 30.0
LEAST: Final = 0.3
"""Of the table, in the middle height: where less than this is fast, the camera hangs wrong."""


def separation(progress: Progress) -> FigureResult:
    """Draw it for the simulated rig's own camera, and say what distances belong to it."""
    progress("looking where a hand comes from")
    table = TableSettings(limits=CONTACT_PROFILES["separation"])
    fast, slow = table.limits.tool_speed, ContactSpeeds().tool_speed
    aside = reach(LATENCY, INTERVAL, fast, slow)
    view = nominal_view(colour_intrinsics(640, 480), table).beside(depth_intrinsics(GLANCE), LEFT_IMAGER)
    planes, grid = borders(view, aside), table_grid(table)
    margins: dict[float, Vector] = {}
    for height in HEIGHTS:
        margins[height] = np.empty(grid.shape)
        for place, point in grid.points(height):
            margins[height][place] = (planes[:, :3] @ point + planes[:, 3]).min()
    sheet = picture(12.0, 3.9)
    for panel, (height, margin) in zip(axes(sheet, 1, len(HEIGHTS)), margins.items(), strict=True):
        board_map(panel, grid, 1e3 * margin, "farther from out of sight than needed [mm]", (-150.0, 150.0), "RdBu")
        panel.contour(1e3 * np.array(grid.x), 1e3 * np.array(grid.y), margin, [0.0], colors="black")
        label(panel, title=f"tool {1e3 * height:.0f} mm over the board: fast within the line")
    shares = {f"{1e3 * height:.0f} mm": float((margin >= 0.0).mean()) for height, margin in margins.items()}
    return FigureResult(
        f"A hand at {HAND_SPEED} m/s and {1e3 * LATENCY:.0f} ms of latency need {1e3 * aside:.0f} mm",
        {"share_fast": Bar(shares[f"{1e3 * HEIGHTS[1]:.0f} mm"], "1", low=LEAST)},
        {
            "reach_m": aside,
            "reach_of_a_frame_twice_as_old_m": reach(2.0 * LATENCY, INTERVAL, fast, slow),
            "shares": dict(shares),
        },
        {"": sheet},
    )
