"""Figure ``workspace``: over board and trays, what is in reach, how good J_c is there, and what torques leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import JsonValue

from app.measure.figures.drawing import TableGrid, axes, board_map, label, picture, table_grid
from app.measure.figures.result import Bar, FigureResult, Picture, Progress
from app.motion import MotionSettings
from app.motion.timing.reference import Vector
from controller.model.constants import DeltaModel
from controller.model.workspace import (
    LARGEST_CONDITION,
    LargestBoard,
    Survey,
    largest_board,
    survey,
    survey_point,
    working_heights,
)
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES
from hardware.table import TableSettings

MARGIN = 0.04  # what is drawn around squares and trays [m]


class Maps(NamedTuple):
    """Quantities over a grid at one height, each of shape (rows, columns); NaN out of reach."""

    condition: Vector
    margin: Vector  # rated torque less the torque that holds the arm [N m]
    acceleration: Vector  # [m/s²]


def maps(model: DeltaModel, grid: TableGrid, height: float) -> Maps:
    """Survey a grid at a height of the tool point above the playing surface [m]."""
    found = np.full((3, *grid.shape), np.nan)
    for where, point in grid.points(height):
        here = survey_point(model, point)
        found[:, *where] = here.condition, model.parameters.drive.rated_torque - here.holding_torque, here.acceleration
    found[:, ~np.isfinite(found[0])] = np.nan
    return Maps(*found)


def workspace(progress: Progress) -> FigureResult:
    """Compute and draw for the heaviest piece at the lowest and the highest height that a game needs."""
    progress("surveying the table")
    heaviest = max(shape.mass for shape in PIECE_SHAPES.values())
    model, table, asked = DeltaModel(load_parameters(), heaviest), TableSettings(), MotionSettings().acceleration
    places = survey(model, table)
    bars = {
        "places_out_of_reach": Bar(float((~places.reachable).any(axis=1).sum()), "places", high=0.0),
        "worst_condition": Bar(float(places.condition.max()), "", high=LARGEST_CONDITION),
        "least_torque_margin": Bar(float(places.torque_margin.min()), "N m", low=0.0),
        "least_acceleration": Bar(float(places.acceleration.min()), "m/s²", low=asked),
    }
    progress("looking for the largest board")
    largest = {"with trays": largest_board(model, table), "without": largest_board(model, table, trays=False)}
    numbers: dict[str, JsonValue] = {
        "largest_board": {
            name: {"square_mm": round(1e3 * one.square, 1), "depth_m": round(one.depth, 2)}
            for name, one in largest.items()
        },
        "places": len(places.places),
        "heights_mm": [1e3 * height for height in working_heights()],
        "payload_kg": heaviest,
        "rated_torque_Nm": model.parameters.drive.rated_torque,
        "acceleration_asked_m_s2": asked,
        "at": {name: _at(places, place) for name, place in _remarkable(places).items()},
    }
    grid = table_grid(table, MARGIN)
    found = {height: maps(model, grid, height) for height in working_heights()}
    pictures = {"": _draw(grid, found), "-largest": _draw_largest(model, table, largest)}
    return FigureResult("What the arm can do over board and trays", bars, numbers, pictures)


def _remarkable(places: Survey) -> dict[str, int]:
    """Some squares, and where each quantity is worst, by their number in the survey."""
    names = [str(place) for place in places.places]
    return {
        "centre (e4)": names.index("e4"),
        "corner (a1)": names.index("a1"),
        "worst condition": int(_told(places.condition.max(axis=1)).argmax()),
        "least torque margin": int(_told(places.torque_margin.min(axis=1)).argmin()),
        "least acceleration": int(_told(places.acceleration.min(axis=1)).argmin()),
    }


def _told(values: Vector) -> Vector:
    """Values of which no rounding decides which is the least: places left and right are alike, and the first counts."""
    return values.round(6)


def _at(places: Survey, index: int) -> dict[str, JsonValue]:
    """Of one place: one value for each height."""
    return {
        "place": str(places.places[index]),
        "condition": places.condition[index].tolist(),
        "torque_margin_Nm": places.torque_margin[index].tolist(),
        "acceleration_m_s2": places.acceleration[index].tolist(),
    }


def _draw_largest(model: DeltaModel, table: TableSettings, largest: dict[str, LargestBoard]) -> Picture:
    """How large squares can be over the depth of the board; and the largest board with trays."""
    sheet = picture(9.0, 4.2)
    curve, board = axes(sheet, 1, 2)
    for (name, one), style in zip(largest.items(), ("-", "--"), strict=True):
        depth, square = one.by_depth[one.by_depth[:, 1] > 0.0].T
        curve.plot(depth, 1e3 * square, style, color="tab:blue", label=name)
        curve.plot(one.depth, 1e3 * one.square, "o", color="tab:blue")
        curve.annotate(f"{1e3 * one.square:.1f} mm", (one.depth, 1e3 * one.square), (6, 3), textcoords="offset points")
    curve.plot(table.centre_in_base[2], 1e3 * table.square, "s", color="tab:orange", label="default")
    curve.axhline(57.0, color="0.7", linewidth=0.8)
    curve.text(curve.get_xlim()[1], 57.4, "tournament ", fontsize=7, color="0.4", ha="right")
    curve.set(xlabel="depth of the board below the base, z₃ [m]", ylabel="largest square [mm]")
    curve.legend(fontsize=8)
    best = largest["with trays"]
    big = table.model_copy(update={"square": best.square, "centre_in_base": (0.0, 0.0, best.depth)})
    grid, height = table_grid(big, MARGIN), working_heights()[1]
    here = maps(model, grid, height)
    board_map(board, grid, here.condition, "condition of J_c", (1.0, LARGEST_CONDITION), "viridis_r")
    label(board, title=f"{1e3 * best.square:.1f} mm, tool {1e3 * height:.0f} mm over the board")
    return sheet


def _draw(grid: TableGrid, found: dict[float, Maps]) -> Picture:
    sheet = picture(12.0, 7.4)
    panels = iter(axes(sheet, 2, 3))
    for height, here in found.items():
        quantities = (
            (here.condition, "condition of J_c", (1.0, 6.0), "viridis_r"),
            (here.margin, "rated less holding torque [N m]", (0.0, 1.4), "viridis"),
            (here.acceleration, "acceleration left [m/s²]", (20.0, 40.0), "viridis"),
        )
        for quantity in quantities:
            panel = next(panels)
            board_map(panel, grid, *quantity)
            label(panel, title=f"tool {1e3 * height:.0f} mm over the board")
    return sheet
