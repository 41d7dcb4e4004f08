"""What comes of a job at the table, and what is recorded with a ply."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import chess
import chess.engine

from app.execution.carrier import Carried
from app.pieces.inventory import Inventory
from app.records import PlyOutcome, recording
from hardware.interfaces import Frame

if TYPE_CHECKING:
    pass


@dataclass(frozen=True, slots=True)
class Remark:
    """What is recorded with a ply: what the player thinks of it, a comment, and what the clocks show after it [s], to
    be asked for once the move stands on the board.
    """

    score: chess.engine.PovScore | None = None
    comment: str = ""
    clocks: Callable[[], dict[chess.Color, float] | None] = lambda: None


NO_REMARK: Final = Remark()


@dataclass(frozen=True, slots=True)
class JobDone:
    """What stands where after a job, what is known of it, and whether a person has made the next move already."""

    inventory: Inventory
    outcome: PlyOutcome
    answered: bool = False


def outcome_of(carried: Carried) -> PlyOutcome:
    """What the record says of what the arm has carried."""
    done = carried.done
    return PlyOutcome(
        planned=carried.planned, real=done.duration, peak_torque=done.peak_torque, peak_force=done.peak_force,
        resumed=carried.resumed,
    )  # fmt: skip


def save_picture(path: Path, frame: Frame) -> None:
    """Write a frame's colours as JPEG.

    Raises:
        RecordError: it cannot be written.
    """
    import cv2  # only where there is a camera

    done, encoded = cv2.imencode(".jpg", cv2.cvtColor(frame.colour, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])
    if not done:
        raise RuntimeError(f"OpenCV could not encode {path.name}")
    with recording(path):
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(encoded.tobytes())
