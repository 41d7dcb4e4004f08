"""The robot and the table of a record, beside its events: ``robot.json``.

Whoever looks at a record later can then say which limits a figure is to be held against, and where board and trays
stood, even where the files that those were read from have changed or gone.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pydantic import ValidationError

from app.records.events import Record
from app.records.files import RecordError, is_object, write_atomically
from hardware.parameters import RobotParameters
from hardware.table import TableSettings

ROBOT_FILE: Final = "robot.json"

Row = tuple[float, float, float, float]


class RobotRecord(Record):
    """What a game was played on."""

    parameters: RobotParameters
    table: TableSettings
    board_from_camera: tuple[Row, Row, Row] | None = None
    """Takes points of the camera's frame (x right, y down, z along its view) into the board's [m]: rotation and
    translation, row by row; None: there is no camera, or nobody knows where it hangs."""


def keep_robot(folder: Path, robot: RobotRecord) -> None:
    """Write it into the folder of a record.

    Raises:
        RecordError: it cannot be written.
    """
    write_atomically(folder / ROBOT_FILE, robot.model_dump_json(indent=2) + "\n")


def kept_robot(folder: Path) -> RobotRecord | None:
    """What a record was played on; None: it does not say, as a version before this one wrote it, or the arm never was.

    Raises:
        RecordError: the file cannot be read, is damaged, or is of another version.
    """
    path = folder / ROBOT_FILE
    try:
        content = path.read_bytes()
        return RobotRecord.model_validate_json(content)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror}: name the folder of a recorded game") from error
    except ValidationError as error:
        if not is_object(content):
            raise RecordError(
                f"{path} is damaged: bring it back from a copy, or delete it: then it is unknown which robot played"
            ) from error
        raise RecordError(f"{path} is of another version: read it with the version that wrote it") from error
