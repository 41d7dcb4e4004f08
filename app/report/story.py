"""What went wrong in a game, what was asked, and how it was put right: in sentences, from its events."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from app.records.events import (
    STOPPED,
    AnyEvent,
    FoundEvent,
    PlyEvent,
    Purpose,
    ResumeEvent,
    SideEvent,
    TaskDoneEvent,
    TaskDroppedEvent,
    TaskEvent,
    TransferRecord,
    TroubleEvent,
)
from app.records.history import RecordState
from app.report.source import ReportSource

MENDED: Final = {"arm": "The arm put it right.", "person": "A person put it right.", None: "It was noted."}
JUDGED: Final = {True: "All pieces then stood where they should.", False: "The board was still wrong.", None: ""}
UNSURE: Final = frozenset({"legal", "unfinished", "nothing", "wrong board"})
"""Kinds of trouble in which the camera was not sure, or saw something half made, and asked."""


@dataclass(frozen=True, slots=True)
class Incident:
    """One thing that happened: after which ply and when [s, plant time], what sort, a sentence, squares, who mended."""

    ply: int
    plant_time: float
    sort: str
    sentence: str
    squares: tuple[str, ...] = ()
    mended: str = ""


def incidents(source: ReportSource) -> tuple[Incident, ...]:
    """All that went wrong, was found, asked or put right, in its order."""
    told = [one for event in source.events for one in _of(event)]
    left = _left_open(source)
    return (*told, left) if left is not None else tuple(told)


def seen(source: ReportSource) -> tuple[Incident, ...]:
    """Of those, what the camera said."""
    return tuple(one for one in incidents(source) if one.sort.startswith(("seen", "found", "asked")))


def _of(event: AnyEvent) -> Iterable[Incident]:
    ply, at = event.ply, event.plant_time
    match event:
        case TroubleEvent() if event.kind == STOPPED:
            yield Incident(ply, at, STOPPED, _sentence(event.sentence))
        case TroubleEvent():
            sort = "asked" if event.kind in UNSURE and event.mended_by is None else "seen"
            yield Incident(
                ply, at, f"{sort}: {event.kind}", _sentence(event.sentence), event.squares, MENDED[event.mended_by]
            )
        case FoundEvent():
            where = "; ".join(f"{_piece(name)} on {place}" for name, place in event.inventory.items())
            says = _sentence(event.reason) + (f" Pieces were found elsewhere: {where}." if where else "")
            yield Incident(ply, at, "found", says, tuple(event.inventory.values()))
        case TaskEvent():
            doing = {Purpose.REPAIR: "repair", Purpose.TAKE_BACK: "take-back", Purpose.SET_UP: "set-up"}[event.purpose]
            carried = "; ".join(map(_carried, event.transfers)) or "nothing had to be carried"
            yield Incident(ply, at, doing, f"{_sentence(event.label)} The arm started: {carried}.")
        case TaskDoneEvent():
            took = "with mending" if event.mended else "by a person"
            took = took if event.real_s is None else f"by the arm in {event.real_s:.2f} s"
            says = " ".join(filter(None, (f"Done {took}.", JUDGED[event.physical_ok], *map(_sentence, event.failures))))
            yield Incident(ply, at, "done", says)
        case TaskDroppedEvent():
            yield Incident(ply, at, "dropped", _sentence(event.reason))
        case ResumeEvent():
            yield Incident(ply, at, "resumed", "Another program continued the game.")
        case SideEvent():
            yield Incident(ply, at, "sides", f"The person plays {event.person.value} from now on.")
        case PlyEvent(failures=failures) if failures:
            for reason in failures:
                yield Incident(ply, at, "failed", _sentence(reason))
        case _:
            pass


def _left_open(source: ReportSource) -> Incident | None:
    """What was under way when the record broke off."""
    if source.end is not None:
        return None
    last, state = source.events[-1], RecordState.after(source.events)
    begun = state.unfinished
    says = "The record breaks off here: the program was killed, the power failed, or the game is still running."
    if begun is not None:
        what = begun.uci or (None if begun.task is None else begun.task.label) or "a repair"
        stage = f", in its {begun.stage.value}" if begun.stage is not None else ""
        says += f" Under way was {what}{stage}; 'touchmove resume' finishes it."
    return Incident(last.ply, last.plant_time, "broke off", says)


def _carried(transfer: TransferRecord) -> str:
    if transfer.source == transfer.target:
        return f"{_piece(transfer.piece)} set right on {transfer.target}"
    return f"{_piece(transfer.piece)} from {transfer.source} to {transfer.target}"


def _piece(name: str) -> str:
    return name.replace("-", " ")


def _sentence(text: str) -> str:
    text = text.strip()
    text = text[:1].upper() + text[1:] if text[:2].isalpha() else text
    return text if text.endswith((".", "!", "?")) else f"{text}."
