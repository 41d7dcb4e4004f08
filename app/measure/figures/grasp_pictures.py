"""Figure ``7``: block and fingers before and after the soft grasp, without and with tactile feedback.

White lines on block and surface are aligned at the start, as in the paper's pictures.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from pydantic import JsonValue

from app.measure.figures.drawing import DARK, GREY, picture
from app.measure.figures.grasp import HEIGHT, Run
from app.measure.figures.grasp_motion import Grasps, bars, both_grasps, run_numbers
from app.measure.figures.grasp_views import views
from app.measure.figures.result import FigureResult, Picture, Progress
from app.measure.figures.sensitivity import GAINS

_WOOD = "#b8864e"
_PAD = (0.003, 0.006)
"""Thickness and half height of a pad as drawn [m]."""
_ROWS = slice(40, 440)
"""Of a rendered picture: block and pads."""


def figure_7(progress: Progress) -> FigureResult:
    """Compute and draw."""
    grasps = both_grasps(progress)
    poses = [grasps.mujoco[0].start, *(one.end for one in grasps.mujoco)]
    start, *ends = views(grasps.mujoco[0].run.grasp, poses)
    names = [f"k*={gain:g}" for gain in GAINS]
    numbers: dict[str, JsonValue] = {
        "dae": {name: run_numbers(run) for name, run in zip(names, grasps.dae, strict=True)},
        "mujoco": {name: run_numbers(one.run) for name, one in zip(names, grasps.mujoco, strict=True)},
    }
    return FigureResult(
        "Block before and after the soft grasp", bars(grasps), numbers, {"": _draw(grasps, start, ends)}
    )


def _draw(grasps: Grasps, start: NDArray[np.uint8], ends: list[NDArray[np.uint8]]) -> Picture:
    sheet = picture(10.6, 5.4)
    grid = sheet.subplots(2, 3, squeeze=False)
    rows = zip(grid, GAINS, ends, grasps.mujoco, grasps.dae, strict=True)
    for (before, after, drawn), gain, end, mujoco, dae in rows:
        _photo(before, start, f"k* = {gain:g}: start")
        _photo(after, end, f"end, MuJoCo: {_moved(mujoco.run)}")
        _schematic(drawn, dae)
        drawn.set_title(f"end, constrained dynamics: {_moved(dae)}", fontsize=9)
    return sheet


def _moved(run: Run) -> str:
    return f"block moved {1e3 * abs(run.final):.1f} mm"


def _photo(axis: Axes, pixels: NDArray[np.uint8], title: str) -> None:
    axis.imshow(pixels[_ROWS])
    axis.set_title(title, fontsize=9)
    axis.set_axis_off()


def _schematic(axis: Axes, run: Run) -> None:
    """Side view to scale in mm, z1 to the right; the surface's line is where the block's was."""
    block = run.grasp.block
    half, _, high = (1e3 * v for v in block.half_size)
    middle = 1e3 * (block.offset + run.block[-1])
    axis.add_patch(Rectangle((middle - half, 0.0), 2 * half, 2 * high, fc=_WOOD, ec=DARK, lw=0.8))
    axis.plot([middle, middle], [0.0, 2 * high], color="white", lw=1.6)
    axis.plot([1e3 * block.offset] * 2, [-7.0, 0.0], color="white", lw=1.6, zorder=3)
    axis.add_patch(Rectangle((-24.0, -7.0), 56.0, 7.0, fc=GREY, ec="none"))
    thickness, half_height = (1e3 * v for v in _PAD)
    for face, outward in ((run.right[-1], 0.0), (run.left[-1], -thickness)):
        corner = (1e3 * face + outward, 1e3 * HEIGHT - half_height)
        axis.add_patch(Rectangle(corner, thickness, 2 * half_height + 16.0, fc="#e8e6df", ec=DARK, lw=0.8))
    axis.set_xlim(-24.0, 32.0)
    axis.set_ylim(-7.0, 36.0)
    axis.set_aspect("equal")
    axis.set_yticks([])
    axis.tick_params(labelsize=8)
    axis.set_xlabel("z₁ from the gripper's middle at the start [mm]", fontsize=8)
    axis.spines[["top", "right", "left"]].set_visible(False)
