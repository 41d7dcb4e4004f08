"""Makes what takes long or loads much, in a process of its own: ``python -m app.page.recorded.maker WHAT FOLDER …``.

``record FOLDER ID NUMBER SETS_UP``: a record with all that a slider over it needs. ``robot FOLDER TICK``: what 3-D
draws of the robot and table of a record, or of the usual ones. ``telemetry FOLDER SINCE UNTIL``: the telemetry of a
record as columns. ``report FOLDER``: the page of a record. Each goes to stdout; where it cannot be made, a sentence
goes to stderr, and the status is 2. What one of them alone needs is loaded for that one: a record is there a second
sooner.
"""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from app import UserError
from app.motion.settings import MotionSettings
from app.page.live.hub import encoded
from app.page.live.telemetry import telemetry_shown
from app.page.recorded.catalogue import RecordPlace, match_of_record
from app.page.recorded.record import record_shown
from app.records.events import AnyEvent
from app.records.files import EVENTS_FILE, RecordError
from app.records.history import read_events
from app.records.robot import RobotRecord, kept_robot
from app.records.telemetry import TELEMETRY_FILE, read_telemetry
from controller.protocol.messages import Telemetry
from hardware.parameters import load_parameters
from hardware.table import TableSettings

RATE: Final = 20.0
"""Rows of a second at most [1/s, plant]."""
ROWS: Final = 20000
"""Rows at most: a quarter of an hour at full rate; what is longer is thinned evenly."""
NICE: Final = 5
"""This steps back behind the page [steps of the scheduler's niceness]."""


def robot_json(folder: Path | None, tick: float) -> str:
    """``robot.json`` of a record, or of the usual robot.

    Raises:
        RecordError: the record's robot cannot be read.
    """
    from app.page.robot_scene import robot_scene

    robot = _robot(folder)
    home = MotionSettings().at(robot.table).home
    return encoded(robot_scene(robot.parameters, robot.table, home, tick))


def _robot(folder: Path | None) -> RobotRecord:
    found = None if folder is None else kept_robot(folder)
    return found or RobotRecord(parameters=load_parameters(), table=TableSettings())


def telemetry_json(folder: Path, since: float, until: float) -> str:
    """``telemetry.json``: columns of what the controller said in a span of plant time [s] of a record.

    Raises:
        RecordError: there is none, or it cannot be read.
    """
    files = sorted(match_of_record(folder).glob(f"{Path(TELEMETRY_FILE).stem}*.mcap"))
    if not files:
        raise RecordError(f"{folder} has no {TELEMETRY_FILE}: games on the rig 'board' have none")
    begin, end = _span(read_events(folder / EVENTS_FILE))
    begin, end = max(begin, since), min(end, until)
    period = max(1.0 / RATE, (end - begin) / ROWS)
    rows = itertools.chain.from_iterable(read_telemetry(file, begin, end) for file in files)
    return encoded({"since": begin, "until": end, "period": period, "columns": _columns(rows, period)})


def _span(events: Iterable[AnyEvent]) -> tuple[float, float]:
    times = [event.plant_time for event in events]
    return min(times), max(times)


def _columns(rows: Iterable[tuple[float, Telemetry]], period: float) -> dict[str, Any]:
    """A list for each number of the message ``telemetry``, of vectors a list of such lists."""
    columns: dict[str, Any] = {}
    due = -float("inf")
    for when, telemetry in rows:
        if when < due:
            continue
        due = max(due + period, when + 0.5 * period)  # at the wanted rate on average, whenever rows come
        tick = when / telemetry.tick if telemetry.tick else 0.0
        for name, value in telemetry_shown(telemetry, tick).items():
            if isinstance(value, list):
                for column, one in zip(columns.setdefault(name, [[] for _ in value]), value, strict=True):
                    column.append(one)
            else:
                columns.setdefault(name, []).append(value)
    return columns


def report_html(folder: Path) -> str:
    """``report.html`` of a record.

    Raises:
        RecordError: the record cannot be read.
    """
    from app.report.page import report_page
    from app.report.source import read_source

    return report_page(read_source(folder))


def main(arguments: list[str]) -> int:
    """Make one thing; the exit status."""
    os.nice(NICE)
    try:
        match arguments:
            case ["record", folder, record, number, sets_up]:
                place = RecordPlace(record, Path(folder), int(number), bool(sets_up))
                made = encoded(record_shown(place, read_events(place.folder / EVENTS_FILE)))
            case ["robot", folder, tick]:
                made = robot_json(Path(folder) if folder else None, float(tick))
            case ["telemetry", folder, since, until]:
                made = telemetry_json(Path(folder), float(since), float(until))
            case ["report", folder]:
                made = report_html(Path(folder))
            case _:
                raise SystemExit(__doc__)
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    sys.stdout.buffer.write(made.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
