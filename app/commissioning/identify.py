"""``touchmove identify``: what a robot weighs and how it rubs, from a motion of its own, into a parameters file."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from rich.console import Group, RenderableType

from app import UserError
from app.commissioning.identification.estimation import Identification, identify
from app.commissioning.identification.excitation import Excitation
from app.commissioning.identification.robot_file import check_robot_file, robot_text, write_robot
from app.commissioning.identification.survey import DURATION, Meter, survey
from app.records.files import GAMES
from app.rig.factory import choose_rig, open_rig
from app.rig.rig_file import RigFile, WorldSection
from app.rig.simulation.settings import NO_PIECES, own_rig
from app.terminal.report_table import judged, rows_table
from controller.wire.client import ControllerClient
from controller.wire.errors import ControllerError
from hardware.frozen import Frozen
from hardware.interfaces import HardwareError, Pace
from hardware.parameters import RobotParameters

FILE: Final = "identified.toml"
POLE_PAIRS: Final = 5
"""Of the servomotors, HG-KR's."""

Progress = Callable[[str], None]


class FoundValue(Frozen):
    """One number that a motion told, or could not tell."""

    name: str
    unit: str
    believed: float
    value: float
    band: float  # half of the 95 % interval
    told: bool  # by the data; otherwise it is as it was believed


class IdentifyReport(Frozen):
    """What was found."""

    rig: str
    holds: bool  # all ten base parameters were told
    file: str  # it was written to
    values: tuple[FoundValue, ...]
    residual: tuple[float, float, float]  # of the torques, each servomotor [N m]
    residual_before: tuple[float, float, float]  # with what was believed [N m]
    ripple: tuple[float, float, float]  # share of the torque
    cogging: tuple[float, float, float]  # [N m]
    delay: float  # of the torques [s]
    condition: float  # of the regressor
    duration: float  # of the motion [s]

    def table(self) -> RenderableType:
        """One screen for people."""
        rows = [
            (one.name, one.unit, f"{one.believed:.5g}", f"{one.value:.5g}", _band(one),
             judged("told" if one.told else "not determined: as before", one.told or None))
            for one in self.values
        ]  # fmt: skip
        columns = ("", "unit", ">believed", ">found", ">± (95 %)", "")
        title = f"rig {self.rig}: what {self.duration:.0f} s of motion showed"
        return Group(
            rows_table(columns, rows, title),
            f"unexplained torques: {_triple(self.residual, 1e3)} mN m; with the previous parameters: "
            f"{_triple(self.residual_before, 1e3)} mN m",
            f"ripple {_triple(self.ripple, 100.0)} %, cogging {_triple(self.cogging, 1e3)} mN m, torques "
            f"{1e3 * abs(self.delay):.2f} ms {'late' if self.delay > 0.0 else 'early'}; condition number "
            f"{self.condition:.1f}",
            f"written to {self.file}: name it as 'parameters' in the rig file, and restart the controller",
        )


def run_identify(
    name: str, out: Path | None, pole_pairs: int, progress: Progress, meter: Meter | None = None
) -> IdentifyReport:
    """Identify the robot of a rig, ``sim``, which is started for it, or a rig file, whose controller runs.

    ``out`` None: ``identified.toml`` beside the rig file, or in ``games`` for a simulation. ``pole_pairs`` of the
    servomotors; 0: their ripple is not looked for.

    Raises:
        UserError: there is no such rig, the file cannot be written, a device failed, or the data tell of no robot.
    """
    rig = choose_rig(name)
    path = out or (Path(name).parent / FILE if rig is not None else GAMES / FILE)
    check_robot_file(path)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="touchmove-")))
        used = rig or own_rig(folder / "run", WorldSection(pace=Pace.FAST, fen=NO_PIECES, cameras=False))
        found, excitation = identify_rig(used, own=rig is None, pole_pairs=pole_pairs, progress=progress, meter=meter)
    write_robot(path, robot_text(found, datetime.now(UTC), f"rig {name}, {DURATION:.0f} s of motion"))
    return report_of(name, path, found, excitation)


def identify_rig(
    rig: RigFile, *, own: bool, pole_pairs: int, progress: Progress, meter: Meter | None = None
) -> tuple[Identification, Excitation]:
    """Open a rig, let it move, and leave it at rest; raises ``UserError`` as `run_identify`."""
    parameters: RobotParameters = rig.robot()
    period = parameters.drive.tick
    listener = None if meter is None else lambda telemetry: meter(telemetry, period)
    try:
        with open_rig(rig, progress, listener, own=own) as devices:
            client = getattr(devices, "client", None)
            assert isinstance(client, ControllerClient)
            record, excitation = survey(devices, client, parameters, rig.table, rig.run_dir, progress, meter)
    except (HardwareError, ControllerError) as error:
        raise UserError(str(error)) from error
    progress("estimating masses and friction")
    return identify(record, parameters, pole_pairs or None), excitation


def report_of(name: str, path: Path, found: Identification, excitation: Excitation) -> IdentifyReport:
    """For people and programs."""
    values = tuple(
        FoundValue(name=one.name, unit=one.unit, believed=one.believed, value=one.value, band=one.band, told=one.told)
        for one in found.estimates
    )
    return IdentifyReport(
        rig=name, holds=all(one.told for one in found.estimates[:10]), file=str(path), values=values,
        residual=_three(found.residual), residual_before=_three(found.before), ripple=_three(found.ripple),
        cogging=_three(found.cogging), delay=found.delay, condition=found.condition, duration=excitation.duration,
    )  # fmt: skip


def _band(one: FoundValue) -> str:
    """As a share of the value."""
    return f"{100.0 * one.band / abs(one.value):.2g} %" if one.told and one.value else ""


def _three(values: object) -> tuple[float, float, float]:
    a, b, c = (float(value) for value in values)  # type: ignore[attr-defined]
    return a, b, c


def _triple(values: tuple[float, float, float], scale: float) -> str:
    return ", ".join(f"{scale * value:.2f}" for value in values)
