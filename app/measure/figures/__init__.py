"""The paper's figures and some of our own, each computed anew: ``touchmove figures NAME``; a module for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from pydantic import JsonValue

from app import UserError
from app.measure.figures.encoder import encoder
from app.measure.figures.figure_5_admittance import figure_5
from app.measure.figures.figure_6_7_grasp import figure_6, figure_7
from app.measure.figures.figure_9_game import figure_9
from app.measure.figures.move import MOVE, move_figure
from app.measure.figures.newton import newton
from app.measure.figures.result import FigureResult, Progress, save
from app.measure.figures.separation import separation
from app.measure.figures.touch import touch
from app.measure.figures.workspace import workspace
from app.measure.names import require_name
from app.records.files import check_folder

FIGURES: Mapping[str, Callable[[Progress], FigureResult]] = MappingProxyType({
    "5": figure_5, "6": figure_6, "7": figure_7, "9": figure_9, "newton": newton, "encoder": encoder, "touch": touch,
    "workspace": workspace, "separation": separation,
})  # fmt: skip
"""By name; numbers are the paper's."""


def make_figure(
    name: str, folder: Path, progress: Progress, move: str = MOVE, fen: str | None = None
) -> dict[str, JsonValue]:
    """Compute a figure of ``FIGURES`` or ``move`` and write ``figure-NAME.png`` and ``figure-NAME.json`` to a folder.

    Figure ``move`` draws a move (SAN or UCI) in a position; ``fen`` None: the usual start.

    Returns:
        What the JSON file holds; ``holds`` says whether all bars do.

    Raises:
        UserError: there is no such figure, or a move or a position is given for another one than ``move``.
        RecordError, FolderUnusable: the folder cannot be written.
        HardwareError: a figure needs OpenGL, and there is none.
    """
    if name == "move":
        return save(name, move_figure(move, fen, progress), folder)
    require_name("figure", name, (*FIGURES, "move"))
    if move != MOVE or fen is not None:
        raise UserError(f"figure {name} shows no single move: leave out move and --fen, or draw figure move")
    check_folder(folder)
    return save(name, FIGURES[name](progress), folder)
