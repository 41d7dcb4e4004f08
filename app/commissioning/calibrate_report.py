"""What ``touchmove calibrate`` says: for people a table, for programs JSON."""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.text import Text

from app.settings.calibration import Calibration
from app.terminal.report_table import judged, rows_table
from hardware.frozen import Frozen


class ShownPoint(Frozen):
    """One point at which the arm showed its marker."""

    point: tuple[float, float, float]  # the marker's centre, base frame [m]
    seen: bool  # whether the camera saw it
    counted: bool  # whether it counts
    residual: float | None  # how far across the view it is seen from where it should be [m]; None if it was not seen

    def said(self) -> str | Text:
        """Its residual, for people."""
        if self.residual is None:
            return judged("not in sight", None)
        residual = f"{1e3 * self.residual:.2f}"
        return residual if self.counted else judged(f"{residual} left out", False)


class CalibrateReport(Frozen):
    """A calibration, or why there is none."""

    rig: str  # whose
    holds: bool  # whether there is one
    failure: str | None  # one sentence where there is none
    file: str | None  # it was written to
    calibration: Calibration | None  # itself
    shown: tuple[ShownPoint, ...]  # all points

    def table(self) -> RenderableType:
        """One screen for people."""
        if self.calibration is None:
            return f"rig {self.rig}: not calibrated: {self.failure}"
        found = self.calibration
        columns = ("point", "z1 [mm]", "z2 [mm]", "z3 [mm]", "residual [mm]")
        rows = [
            (str(number), *(f"{1e3 * value:z.1f}" for value in one.point), one.said())
            for number, one in enumerate(self.shown, start=1)
        ]
        table = rows_table([f">{name}" for name in columns], rows, f"rig {self.rig}: calibrated")
        return Group(table, *self._lines(found))

    def _lines(self, found: Calibration) -> list[str]:
        lines = [
            f"residuals: mean {1e3 * found.mean_residual:.2f} mm, worst {1e3 * found.worst_residual:.2f} mm; "
            f"expected error on the board: mean {1e3 * found.mean_error:.2f} mm, "
            f"worst {1e3 * found.worst_error:.2f} mm",
        ]
        if found.depth_factor != 1.0:
            lines.append(f"depth is multiplied by {found.depth_factor:.4f}, as measured at the marker")
        if found.board is not None:
            x, y, z = (1e3 * value for value in found.board.centre)
            tilt, yaw = math.degrees(found.board.tilt), math.degrees(found.board.yaw)
            lines.append(
                f"board: centre at ({x:z.1f}, {y:z.1f}, {z:z.1f}) mm in the base frame, turned by {yaw:z.2f}°, "
                f"tilted by {tilt:z.2f}°" + ("" if found.board.by_corners else "; place and turn are the settings'")
            )
        return [*lines, f"written to {self.file}"]
