"""Figure ``encoder``: one count of a 22-bit encoder at the tool, over board and trays; the paper: below 5 µm."""

from __future__ import annotations

from itertools import product

import numpy as np
from pydantic import JsonValue

from app.measure.figures.drawing import TableGrid, axes, board_map, picture, table_grid
from app.measure.figures.result import Bar, FigureResult, Picture, Progress
from app.motion.timing.reference import Vector
from controller.model.constants import DeltaModel
from controller.model.kinematics import arm_directions, control_jacobian
from controller.model.reach import posture_at, tool_point_at
from hardware.parameters import load_parameters
from hardware.table import TableSettings

PAPER_LIMIT = 5e-6  # the paper's bound on the resolution in task space [m]
HEIGHTS = (0.0, 0.10)  # of the tool over the playing surface: the board, and a king carried over kings [m]
_SIGNS = np.array(list(product((-1.0, 1.0), repeat=3))).T


def resolutions(model: DeltaModel, grid: TableGrid, height: float) -> tuple[Vector, Vector]:
    """How far the tool moves, worst case, over a grid (rows, columns) [m]: one encoder a count further; all three off
    by one.
    """
    count = 2.0 * np.pi / 2**model.parameters.drive.encoder_bits
    single, combined = np.empty(grid.shape), np.empty(grid.shape)
    for where, point in grid.points(height):
        angle, jacobian = posture_at(model, point).y, np.empty((3, 3))
        z1, z2, z3 = tool_point_at(model, angle).tolist()
        control_jacobian(
            model.constants, *arm_directions(model.constants, angle, (z1, z2, z3)), jacobian, np.empty((3, 3))
        )
        moved = count * jacobian
        single[where] = np.linalg.norm(moved, axis=0).max()
        combined[where] = np.linalg.norm(moved @ _SIGNS, axis=0).max()
    return single, combined


def encoder(progress: Progress) -> FigureResult:
    """Compute and draw."""
    progress("computing J_c over the table")
    model, grid = DeltaModel(load_parameters()), table_grid(TableSettings())
    found = {height: resolutions(model, grid, height) for height in HEIGHTS}
    bits, tick = model.parameters.drive.encoder_bits, model.parameters.drive.tick
    worst = max(float(combined.max()) for _, combined in found.values())
    bars = {"worst_resolution": Bar(1e6 * worst, "µm", high=1e6 * PAPER_LIMIT)}
    numbers: dict[str, JsonValue] = {
        "encoder_bits": bits,
        "count_rad": 2.0 * np.pi / 2**bits,
        "velocity_of_one_count_a_tick_mm_s": 1e3 * worst / tick,
        "one_encoder_um": {f"{h:.2f}": _range(single) for h, (single, _) in found.items()},
        "all_three_um": {f"{h:.2f}": _range(combined) for h, (_, combined) in found.items()},
    }
    title = f"One count of the {bits}-bit encoders at the tool"
    return FigureResult(title, bars, numbers, {"": _draw(grid, found, title)})


def _range(values: Vector) -> dict[str, JsonValue]:
    return {"least": 1e6 * float(values.min()), "mean": 1e6 * float(values.mean()), "most": 1e6 * float(values.max())}


def _draw(grid: TableGrid, found: dict[float, tuple[Vector, Vector]], title: str) -> Picture:
    sheet = picture(10.4, 4.9)
    for axis, (height, (_, combined)) in zip(axes(sheet, 1, 2), found.items(), strict=True):
        board_map(axis, grid, 1e6 * combined, "worst case of all three [µm]")
        axis.set_title(f"{title}, {1e3 * height:.0f} mm over the board", fontsize=9, pad=8)
    return sheet
