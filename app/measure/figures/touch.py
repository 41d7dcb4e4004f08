"""Figure ``touch``: how hard a piece is set down where the board is not as high as believed."""

from __future__ import annotations

from typing import Final

import numpy as np

from app.measure.bench.beds.touchdown import FELT, WOOD, Pressed, Touchdown, set_down
from app.measure.figures.drawing import DARK, GREY, WITH, WITHOUT, axes, label, picture
from app.measure.figures.result import Bar, FigureResult, Picture, Progress

ERRORS: Final = 0.001 * np.linspace(-3.0, 3.0, 7)  # how much higher the target is than believed [m]
FEET: Final = {"felt": FELT, "bare wood": WOOD}
WAYS: Final = {
    "guard and schedule": (True, True, WITH),
    "guard alone": (True, False, DARK),
    "schedule alone": (False, True, WITHOUT),
    "neither": (False, False, GREY),
}
LARGEST: Final = 10.0
"""With guard and schedule, on felt [N]."""


def touch(progress: Progress) -> FigureResult:
    """Set a king down in the simulated world, from every error, with and without each."""
    found: dict[tuple[str, str], list[Pressed]] = {}
    for feet, stiffness in FEET.items():
        for way, (guard, schedule, _) in WAYS.items():
            progress(f"{feet}, {way}")
            found[feet, way] = [set_down(Touchdown(error, stiffness, guard, schedule)) for error in ERRORS.tolist()]
    peak = max(pressed.peak for pressed in found["felt", "guard and schedule"])
    bars = {"felt_guard_and_schedule": Bar(peak, "N", high=LARGEST)}
    numbers = {
        "height_error_mm": (1e3 * ERRORS).tolist(),
        "peak_N": {f"{feet}, {way}": [one.peak for one in series] for (feet, way), series in found.items()},
        "lasting_N": {f"{feet}, {way}": [one.lasting for one in series] for (feet, way), series in found.items()},
    }
    return FigureResult("A king set down where the board is not as high as believed", bars, numbers, {"": _draw(found)})


def _draw(found: dict[tuple[str, str], list[Pressed]]) -> Picture:
    sheet = picture(11.0, 4.6)
    sheet.suptitle(
        "A king set down at 30 mm/s: largest force (lines), and what it presses with in the end (dots)", fontsize=11
    )
    panels = axes(sheet, 1, 2)
    for panel, (feet, stiffness) in zip(panels, FEET.items(), strict=True):
        for way, (_, _, colour) in WAYS.items():
            series = found[feet, way]
            panel.plot(1e3 * ERRORS, [one.peak for one in series], color=colour, lw=1.4, label=way)
            panel.plot(1e3 * ERRORS, [one.lasting for one in series], "o", color=colour, ms=4)
        label(panel, xlabel="target higher than believed [mm]", ylabel="force [N]")
        panel.set_title(f"{feet}, {1e-3 * stiffness:.0f} N/mm", fontsize=10)
        panel.set_ylim(bottom=0.0)
    sheet.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncol=len(WAYS), fontsize=9)
    return sheet
