"""``record.json``: a recorded game with all that a slider over it needs, in plant time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from app.analysis.kept import kept_analysis
from app.page.recorded.catalogue import RecordPlace, telemetry_file
from app.page.recorded.follower import table_of
from app.page.recorded.game_fold import GameFold, RecordContradicts, RoundShown
from app.records.events import AnyEvent, FoundEvent, PlyEvent, StartEvent, StepEvent, TaskEvent, TroubleEvent
from app.records.files import EVENTS_FILE, FILM_FILE, RecordError
from app.records.film_start import film_begins

_DIGITS: Final = 4
"""Of times [s]."""


def record_shown(place: RecordPlace, events: Sequence[AnyEvent]) -> dict[str, Any]:
    """What the page shows of a record; docs/page.md lists the fields.

    Raises:
        RecordError: the events contradict each other.
    """
    path = place.folder / EVENTS_FILE
    if not events or not isinstance(events[0], StartEvent):
        raise RecordError(f"{path} does not begin with the start of a game: name the folder of a recorded game")
    try:
        game = GameFold(events[0], table_of(place.folder))
    except ValueError as error:
        raise RecordError(f"{path} starts from no position: {error}") from error
    before: dict[str, list[float]] = {}
    moments = list[dict[str, Any]]()
    troubles = list[dict[str, Any]]()
    for number, event in enumerate(events, start=1):
        if number > 1:
            try:
                game.take(event)
            except RecordContradicts as error:
                raise RecordError(f"{path}, line {number}: {error}") from error
        now = game.pieces()
        at = {one["name"]: one["at"] for one in now["pieces"]}
        moments.append({
            "t": round(event.plant_time, _DIGITS), "event": event.event, "plies": len(game.plies),
            "fen": game.board.fen(), "moved": {name: xy for name, xy in at.items() if before.get(name) != xy},
            "held": now["held"], "text": _text(event),
        })  # fmt: skip
        before = at
        if isinstance(event, TroubleEvent):
            troubles.append({
                "t": round(event.plant_time, _DIGITS), "kind": event.kind, "text": event.sentence,
                "squares": event.squares, "mended_by": event.mended_by,
            })  # fmt: skip
    plies = [ply.uci for ply in game.plies]
    analysis = kept_analysis(place.folder, plies) if plies else None
    return {
        "analysis": None if analysis is None else analysis.model_dump(mode="json"),
        "game": game.section(RoundShown(place.id, place.number, place.sets_up)),
        "began": events[0].wall_time.isoformat(), "pace": events[0].pace, "seed": events[0].seed,
        "span": [round(events[0].plant_time, _DIGITS), round(events[-1].plant_time, _DIGITS)],
        "moments": moments, "troubles": troubles,
        "film": (place.folder / FILM_FILE).is_file(), "telemetry": telemetry_file(place.folder).is_file(),
        "film_begins": film_begins(place.folder / FILM_FILE), "first_frame": _first_frame(place),
    }  # fmt: skip


def _first_frame(place: RecordPlace) -> str | None:
    """Name of the picture of the position that the record begins with."""
    return FIRST_FRAME if (place.folder / "frames" / FIRST_FRAME).is_file() else None


FIRST_FRAME: Final = "ply-000.jpg"


def _text(event: AnyEvent) -> str:
    """What happens then, for people."""
    match event:
        case PlyEvent():
            return event.san
        case StepEvent():
            return event.stage.value
        case TaskEvent():
            return event.label
        case FoundEvent():
            return event.reason
        case TroubleEvent():
            return event.sentence
        case _:
            return ""
