"""The events of a game, one JSON object a line in ``events.jsonl``.

Places are written as on the table: ``e4``, ``L3``, ``R24``. A field that only a referee can know is null in a lab.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final, Literal

import chess
import chess.engine
from pydantic import AwareDatetime, Field, TypeAdapter, ValidationError

from app.pieces.inventory import Inventory, MoveKind, Ply, Stage, Transfer
from app.pieces.layout import colour_of
from app.players.game_end import Result
from app.records.files import RecordError, is_object
from hardware.frozen import Frozen
from hardware.piece_set import Colour, Kind

Pace = Literal["real", "fast"]
By = Literal["arm", "hand"]
RepairedBy = Literal["arm", "person"]


Measured = Annotated[float, Field(ge=-1e12, le=1e12, allow_inf_nan=False)]
"""A quantity that was measured or planned: far from where sums of it overflow."""


class Purpose(StrEnum):
    """What the arm moves pieces for, if not for a ply."""

    SET_UP = "set_up"
    TAKE_BACK = "take_back"
    REPAIR = "repair"


class Record(Frozen):
    """Base of all that is written: frozen, and unknown fields are refused."""


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
    seen: tuple[Measured, Measured] | None = None
    """Where it stood, if not at the centre of its source: board frame (x, y) [m]."""
    raised: Measured = 0.0
    """So much higher than usual the fingers take it [m]."""


class _Stamped(Record):
    wall_time: AwareDatetime
    """UTC, ISO 8601."""
    plant_time: Measured
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
    site: str = "?"
    time_control: str | None = None
    """As in PGN, and so is the site; null: played without a clock."""
    inventory: tuple[PieceRecord, ...]


class StepEvent(_Stamped):
    """The arm begins a part of a ply or of a task; written before it does, so that another program can finish it."""

    event: Literal["step"] = "step"
    uci: str | None
    """The move; null: it belongs to the task that was begun last."""
    transfer: Annotated[int, Field(ge=0)]
    """Of the transfers: which, from 0."""
    stage: Stage


class TaskEvent(_Stamped):
    """The arm begins to move pieces for something else than a ply; written before it does.

    A repair may belong to the ply or task that is under way, which is then done when that is.
    """

    event: Literal["task"] = "task"
    purpose: Purpose
    label: str
    """What is done, for people."""
    transfers: tuple[TransferRecord, ...]
    fen: str | None = None
    """The position that is set up; null: that of the game."""
    taken_back: int = 0
    """So many of the plies before do not count any more once it is done."""


class TaskDoneEvent(_Stamped):
    """The task begun last was done by the arm, or by a person."""

    event: Literal["task_done"] = "task_done"
    real_s: Measured | None
    """Plant time from home to home [s]; null: by a person, or, where it was mended, not measured."""
    inventory: dict[str, str]
    """Where each piece that stands elsewhere than before stands now, by name."""
    physical_ok: bool | None
    """True when all pieces stood where the record says, by the referee."""
    failures: tuple[str, ...] = ()
    """What went wrong, a sentence each."""
    resumed: bool = False
    """Another program finished it, or the same one after a pause."""
    mended: bool = False
    """Something went wrong on the way, such as a piece that slipped, and was put right before it was done."""


class TaskDroppedEvent(_Stamped):
    """The task begun last could not be done, and nothing was moved for it."""

    event: Literal["task_dropped"] = "task_dropped"
    reason: str


class FoundEvent(_Stamped):
    """Pieces stand elsewhere than they should, as the camera says: a repair follows, by the arm or by hand."""

    event: Literal["found"] = "found"
    inventory: dict[str, str]
    """Where each piece that stands elsewhere than recorded stands, by name."""
    reason: str


STOPPED: Final = "stopped"
"""The kind of trouble that is none of the board's: somebody pressed STOP."""


class TroubleEvent(_Stamped):
    """Something went wrong at the board, and what became of it."""

    event: Literal["trouble"] = "trouble"
    kind: str
    """One word: what sort."""
    squares: tuple[str, ...]
    sentence: str
    mended_by: RepairedBy | None
    """Who put it right; null: nobody has."""


class PlyEvent(_Stamped):
    """A ply was done."""

    event: Literal["ply"] = "ply"
    side: Colour
    san: str
    uci: str
    kind: MoveKind
    fen: str
    """The position after it."""
    by: By = "arm"
    """Who moved the pieces. Of a hand, the times are null, and so are the peaks."""
    planned_s: Measured | None
    """Plant time from home to home, as planned [s]."""
    real_s: Measured | None
    """Plant time from home to home, as it was [s]."""
    placement_mm: dict[str, Measured] | None
    """Distance of each moved piece from the centre of its place at the end, by name [mm]."""
    peak_torque_Nm: Measured | None  # noqa: N815  # the name in the file, with its unit
    peak_force_N: Measured | None  # noqa: N815  # the name in the file, with its unit
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
    """Another program finished it, or this one after a pause: planned, real and peaks are those of its last part."""
    mended: bool = False
    """Something went wrong on the way, such as a piece that slipped, and was put right before the ply was done: the
    times are null, since nobody measured them from home to home."""
    score: str | None = None
    """What the player thinks of it: pawns from White's side such as +0.31, or #-3."""
    clock_s: dict[Colour, Measured] | None = None
    """What both clocks show after it [s]; null where there are none."""
    comment: str = ""
    """Of the game that is replayed."""


class ResumeEvent(_Stamped):
    """Another program goes on with the game."""

    event: Literal["resume"] = "resume"


class SideEvent(_Stamped):
    """The person at the board plays this side from now on, and the engine theirs."""

    event: Literal["side"] = "side"
    person: Colour


class EndEvent(_Stamped):
    """The game is over or was left."""

    event: Literal["end"] = "end"
    result: Result
    reason: str


AnyEvent = (
    StartEvent | StepEvent | PlyEvent | TaskEvent | TaskDoneEvent | TaskDroppedEvent
    | FoundEvent | TroubleEvent | ResumeEvent | SideEvent | EndEvent
)  # fmt: skip
Event = Annotated[AnyEvent, Field(discriminator="event")]
_EVENT: TypeAdapter[AnyEvent] = TypeAdapter(Event)


def piece_records(inventory: Inventory) -> tuple[PieceRecord, ...]:
    """All pieces of an inventory, sorted by name."""
    pieces = sorted(inventory, key=lambda piece: piece.name)
    return tuple(PieceRecord(name=p.name, kind=p.kind, colour=p.colour, place=str(p.place)) for p in pieces)


def transfer_records(transfers: Iterable[Transfer]) -> tuple[TransferRecord, ...]:
    """Transfers in the order of execution."""
    return tuple(
        TransferRecord(
            piece=t.name, kind=t.kind, colour=t.colour, source=str(t.source), target=str(t.target), seen=t.seen,
            raised=t.raised,
        )
        for t in transfers
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class GameSetup:
    """Who plays, and how."""

    white: str
    black: str
    seed: int
    pace: Pace
    site: str = "?"
    time_control: str | None = None
    """As in PGN; None: played without a clock."""


@dataclass(frozen=True, slots=True)
class PlyOutcome:
    """What is known of a ply or task that was done; None: what a referee alone knows in a lab, or an arm of a hand."""

    planned: float | None = None
    """Plant time from home to home, as planned [s]."""
    real: float | None = None
    """Plant time from home to home, as it was [s]."""
    peak_torque: float | None = None
    """Largest servomotor torque [N m]."""
    placement_mm: Mapping[str, float] | None = None
    """Distance of each moved piece from the centre of its place, by name [mm]."""
    peak_force: float | None = None
    """Largest contact force [N]."""
    physical_ok: bool | None = None
    frame: str | None = None
    """Name of the camera's picture in the folder."""
    failures: tuple[str, ...] = ()
    resumed: bool = False
    """Another program had begun it, or it was paused."""
    mended: bool = False
    """Something had to be put right before it was done."""
    by: By = "arm"
    """Who moved the pieces."""
    score: chess.engine.PovScore | None = None
    """What the player thinks of it."""
    clocks: Mapping[chess.Color, float] | None = None
    """What both clocks show after it [s]."""
    comment: str = ""
    """For the PGN."""


def start_event(
    wall_time: datetime, plant_time: float, setup: GameSetup, board: chess.Board, inventory: Inventory
) -> StartEvent:
    """The first event of a record: who plays, from which position, and what stands where."""
    return StartEvent(
        wall_time=wall_time, plant_time=plant_time, ply=0, fen=board.fen(), chess960=board.chess960, white=setup.white,
        black=setup.black, seed=setup.seed, pace=setup.pace, site=setup.site, time_control=setup.time_control,
        inventory=piece_records(inventory),
    )  # fmt: skip


def ply_event(
    wall_time: datetime, plant_time: float, *, number: int, ply: Ply, outcome: PlyOutcome, fen: str,
    places: dict[str, str],
) -> PlyEvent:  # fmt: skip
    """The event of a ply that is done."""
    return PlyEvent(
        wall_time=wall_time, plant_time=plant_time, ply=number, side=ply.colour, san=ply.san, uci=ply.uci,
        kind=ply.kind, fen=fen, by=outcome.by, planned_s=outcome.planned, real_s=outcome.real,
        peak_torque_Nm=outcome.peak_torque, peak_force_N=outcome.peak_force, physical_ok=outcome.physical_ok,
        frame=outcome.frame, failures=outcome.failures, resumed=outcome.resumed,
        mended=outcome.mended, comment=outcome.comment,
        placement_mm=None if outcome.placement_mm is None else dict(outcome.placement_mm),
        transfers=transfer_records(ply.transfers),
        inventory=places,
        score=None if outcome.score is None else score_text(outcome.score),
        clock_s=None if outcome.clocks is None else {colour_of(c): left for c, left in outcome.clocks.items()},
    )  # fmt: skip


def own_clock(event: PlyEvent) -> float | None:
    """What the clock of the side that moved showed after its ply [s]; None: there is none."""
    return None if event.clock_s is None else event.clock_s.get(event.side)


def score_text(score: chess.engine.PovScore) -> str:
    """Pawns from White's side with two decimals and sign, or #3 and #-3 for mates."""
    white = score.white()
    mate, pawns = white.mate(), white.score()
    if mate is not None:
        return f"#{mate}"
    assert pawns is not None
    return f"{pawns / 100.0:+.2f}"


def score_of(text: str) -> chess.engine.PovScore:
    """What ``score_text`` has written."""
    score = chess.engine.Mate(int(text[1:])) if text.startswith("#") else chess.engine.Cp(round(100.0 * float(text)))
    return chess.engine.PovScore(score, chess.WHITE)


MENDED: Final = "correct it, or remove it and all lines after it: the game before it is kept"
"""What can be done about a line of a record that is wrong."""


def unsaid(_sentence: str) -> None:
    """For those whom nobody listens to."""


def read_event(path: Path, number: int, line: bytes) -> AnyEvent:
    """One line of ``events.jsonl``, from 1.

    Raises:
        RecordError: it is damaged, or no event of this version.
    """
    try:
        return _EVENT.validate_json(line)
    except ValidationError as error:
        if not is_object(line):
            raise RecordError(f"{path}, line {number}, is damaged: {MENDED}") from error
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or "the line"
        reason = f"{field}: {first['msg']}: read it with the version that wrote it"
        raise RecordError(f"{path}, line {number}, is not an event of this version: {reason}") from error
