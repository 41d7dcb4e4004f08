"""The events of a game, one JSON object a line in ``events.jsonl``.

Places are written as on the table: ``e4``, ``L3``, ``R24``. A field that only a referee can know is null in a lab.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, FiniteFloat, TypeAdapter, ValidationError

from app.manipulation import Inventory, MoveKind, Ply, Stage
from app.records.files import RecordError
from hardware.table import Colour, Kind

Pace = Literal["real", "fast"]
Result = Literal["1-0", "0-1", "1/2-1/2", "*"]


class Record(BaseModel):
    """Base of all that is written: frozen, and unknown fields are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class PieceRecord(Record):
    """One physical piece and where it stands."""

    name: str
    kind: Kind
    colour: Colour
    place: str


class TransferRecord(Record):
    """One piece carried from place to place."""

    piece: str
    kind: Kind
    colour: Colour
    source: str
    target: str


class _Stamped(Record):
    wall_time: AwareDatetime
    """UTC, ISO 8601."""
    plant_time: FiniteFloat
    """[s] since the plant was switched on."""
    ply: int
    """Number of the ply that this belongs to; of the start 0, else of the last ply done."""


class StartEvent(_Stamped):
    """A game begins."""

    event: Literal["start"] = "start"
    fen: str
    chess960: bool
    white: str
    black: str
    seed: int
    pace: Pace
    inventory: tuple[PieceRecord, ...]


class StepEvent(_Stamped):
    """The arm begins a part of a ply; written before it does, so that another program can finish the ply."""

    event: Literal["step"] = "step"
    uci: str
    """The move."""
    transfer: int
    """Of the ply's transfers: which, from 0."""
    stage: Stage


class PlyEvent(_Stamped):
    """The arm has done a ply."""

    event: Literal["ply"] = "ply"
    side: Colour
    san: str
    uci: str
    kind: MoveKind
    fen: str
    """The position after it."""
    planned_s: FiniteFloat
    """Plant time from home to home, as planned [s]."""
    real_s: FiniteFloat
    """Plant time from home to home, as it was [s]."""
    placement_mm: dict[str, FiniteFloat] | None
    """Distance of each moved piece from the centre of its place at the end, by name [mm]."""
    peak_torque_Nm: FiniteFloat  # noqa: N815  # the name in the file, with its unit
    peak_force_N: FiniteFloat | None  # noqa: N815  # the name in the file, with its unit
    physical_ok: bool | None
    """True when all pieces stood where the game says, by the referee."""
    frame: str | None
    """Name of the camera's picture in the folder of the record."""
    transfers: tuple[TransferRecord, ...]
    inventory: dict[str, str]
    """Where each piece that was touched stands now, by name."""
    failures: tuple[str, ...]
    """What went wrong, a sentence each."""
    resumed: bool = False
    """Another program finished it: planned, real and peaks are those of its last part."""


class ResumeEvent(_Stamped):
    """Another program goes on with the game."""

    event: Literal["resume"] = "resume"


class EndEvent(_Stamped):
    """The game is over or was left."""

    event: Literal["end"] = "end"
    result: Result
    reason: str


AnyEvent = StartEvent | StepEvent | PlyEvent | ResumeEvent | EndEvent
Event = Annotated[AnyEvent, Field(discriminator="event")]
_EVENT: TypeAdapter[AnyEvent] = TypeAdapter(Event)


def piece_records(inventory: Inventory) -> tuple[PieceRecord, ...]:
    """All pieces of an inventory, sorted by name."""
    pieces = sorted(inventory, key=lambda piece: piece.name)
    return tuple(PieceRecord(name=p.name, kind=p.kind, colour=p.colour, place=str(p.place)) for p in pieces)


def transfer_records(ply: Ply) -> tuple[TransferRecord, ...]:
    """The transfers of a ply in the order of execution."""
    return tuple(
        TransferRecord(piece=t.name, kind=t.kind, colour=t.colour, source=str(t.source), target=str(t.target))
        for t in ply.transfers
    )


def read_events(path: Path) -> tuple[AnyEvent, ...]:
    """Read ``events.jsonl``; a last line that a crash cut short is left out.

    Raises:
        RecordError: the file cannot be read, or another line is no event.
    """
    try:
        *lines, rest = path.read_bytes().split(b"\n")
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror}: name the folder of a recorded game") from error
    events = [_parse(path, number, line) for number, line in enumerate(lines, start=1)]
    if rest and (last := _parse_cut(rest)) is not None:
        events.append(last)
    return tuple(events)


def _parse(path: Path, number: int, line: bytes) -> AnyEvent:
    try:
        return _EVENT.validate_json(line)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or "the line"
        reason = f"{field}: {first['msg']}: read it with the version that wrote it"
        raise RecordError(f"{path}, line {number}, is no event of this version: {reason}") from error


def _parse_cut(rest: bytes) -> AnyEvent | None:
    try:
        return _EVENT.validate_json(rest)
    except ValidationError:
        return None
