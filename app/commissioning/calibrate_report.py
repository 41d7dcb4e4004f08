"""What ``touchmove calibrate`` says: for people a table, for programs JSON."""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.table import Table

from app.settings.calibration import Calibration
from hardware.frozen import Frozen


class ShownPoint(Frozen):
    """One point at which the arm showed its marker.

    Attributes:
        point: the marker's centre, base frame [m].
        seen: whether the camera saw it.
        counted: whether it counts.
        residual: how far across the view it is seen from where it should be [m]; None if it was not seen.
    """

    point: tuple[float, float, float]
    seen: bool
    counted: bool
    residual: float | None


class CalibrateReport(Frozen):
    """A calibration, or why there is none.

    Attributes:
        rig: whose.
        holds: whether there is one.
        failure: one sentence where there is none.
        file: it was written to.
        calibration: itself.
        shown: all points.
    """

    rig: str
    holds: bool
    failure: str | None
    file: str | None
    calibration: Calibration | None
    shown: tuple[ShownPoint, ...]

    def table(self) -> RenderableType:
        """One screen for people."""
        if self.calibration is None:
            return f"rig {self.rig}: not calibrated: {self.failure}"
        found = self.calibration
        table = Table(title=f"rig {self.rig}: calibrated", title_justify="left", box=None, padding=(0, 1))
        for column in ("point", "z1 [mm]", "z2 [mm]", "z3 [mm]", "residual [mm]"):
            table.add_column(column, justify="right")
        for number, one in enumerate(self.shown, start=1):
            if one.residual is None:
                said = "[dim]not in sight[/]"
            else:
                said = f"{1e3 * one.residual:.2f}" + ("" if one.counted else " [red]left out[/]")
            table.add_row(str(number), *(f"{1e3 * value:z.1f}" for value in one.point), said)
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
