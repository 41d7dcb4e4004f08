"""Figure ``9``: reference and measured tool point over six plies of a game, as in the paper; the last one captures."""

from __future__ import annotations

from typing import Final

import chess
import numpy as np

from app.measure.bench.beds.plies import Disorder, GameBed
from app.measure.figures.drawing import GREY, WITH, WITHOUT, axes, label, picture
from app.measure.figures.result import Bar, FigureResult, Picture, Progress
from app.motion import PROFILES, Profile
from app.motion.path import Vector
from app.players.given_line import parse_line
from controller.loop.supervisor import Supervisor
from hardware.table import TableSettings

LINE: Final = "e4 d5 Nc3 Nf6 Bc4 dxe4"
SEED: Final = 9
STIFF: Final = 4800.0
"""k_p of an axis that is as stiff as in the air [1/s²]."""
IN_AIR: Final = 1.0  # largest error in the air [mm]; the reference moves by up to 0.7 mm in a tick


def figure_9(progress: Progress) -> FigureResult:
    """Play the plies in the simulated world and draw them."""
    board = chess.Board()
    bed = GameBed(board, PROFILES[Profile.DEFAULT], TableSettings(), Disorder((0.002, 0.002), 0.03), SEED)
    rows: list[Vector] = []
    homes: list[float] = []
    tick = bed.parameters.drive.tick

    def note(supervisor: Supervisor) -> None:
        law, reference = supervisor.law.state, supervisor.reference.row
        rows.append(np.concatenate([[bed.plant.tick * tick], reference[0:3], law.position, reference[9:12]]))

    bed.listeners.append(note)
    durations: list[float] = []
    for move in parse_line(LINE, board):
        progress(board.san(move))
        homes.append(bed.plant.tick * tick)
        durations.append(bed.play(move).duration)
    homes.append(bed.plant.tick * tick)
    seen = np.array(rows)
    seen[:, 0] -= homes[0]
    error = 1e3 * (seen[:, 4:7] - seen[:, 1:4])
    stiff = (seen[:, 7:10] > STIFF).all(axis=1)
    softer = float(np.abs(error[~stiff, 2]).max() / np.abs(error[stiff, 2]).max())
    bars = {
        "in_the_air": Bar(float(np.abs(error[stiff]).max()), "mm", high=IN_AIR),
        "z3_near_the_board_over_in_the_air": Bar(softer, "1", low=1.0),
    }
    title = f"Six plies, {LINE}: reference and measured"
    numbers = {
        "plies_s": durations,
        "rms_error_in_the_air_mm": np.sqrt((error[stiff] ** 2).mean(axis=0)).tolist(),
        "rms_error_near_the_board_mm": np.sqrt((error[~stiff] ** 2).mean(axis=0)).tolist(),
    }
    return FigureResult(title, bars, numbers, {"": _draw(seen, error, [home - homes[0] for home in homes], title)})


def _draw(seen: Vector, error: Vector, homes: list[float], title: str) -> Picture:
    sheet = picture(12.0, 8.5)
    panels = axes(sheet, 4, 1, sharex=True)
    sheet.suptitle(title, fontsize=11)
    for i, axis in enumerate(panels[:3]):
        axis.plot(seen[:, 0], seen[:, 1 + i], color=WITHOUT, lw=1.0, label="reference")
        axis.plot(seen[:, 0], seen[:, 4 + i], color=WITH, lw=0.8, ls="--", label="measured")
        label(axis, ylabel=f"z{'₁₂₃'[i]} [m]")
    panels[2].invert_yaxis()  # z₃ points down
    for i, colour in enumerate((WITHOUT, GREY, WITH)):
        panels[3].plot(seen[:, 0], error[:, i], color=colour, lw=0.7, label=f"z{'₁₂₃'[i]}")
    label(panels[3], ylabel="error [mm]", xlabel="time [s]; lines: the arm is at home")
    for axis in panels:
        for home in homes:
            axis.axvline(home, color=GREY, lw=0.7, ls=":")
    panels[0].legend(fontsize=8, loc="upper right", ncols=2)
    panels[3].legend(fontsize=8, loc="upper right", ncols=3)
    return sheet
