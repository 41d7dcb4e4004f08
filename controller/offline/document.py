"""The generated parts of ``docs/protocol.md`` and ``docs/flight.md``: layouts, numbers, states, causes and limits.

``python -m controller.offline.document docs/protocol.md docs/flight.md`` brings the pages up to date; tests compare.
"""

import re
import sys
from collections.abc import Iterable
from enum import IntEnum, IntFlag
from pathlib import Path

from controller.protection.limits import REACTIONS, WHY, Limits, Reaction, default_limits
from controller.protocol import datagram_fields as wire
from controller.protocol.cause_sentences import template
from controller.protocol.causes import Cause
from controller.protocol.envelope import Envelope
from controller.protocol.states import TRANSITIONS, Event, State
from controller.records.flight_file import FLIGHT
from hardware.parameters import load_parameters
from hardware.table import TableSettings

_MARK = re.compile(r"<!-- generated: (?P<name>[a-z_ ]+) -->\n.*?<!-- end -->", re.DOTALL | re.IGNORECASE)


def refresh(page: str) -> str:
    """The page with every generated part made anew; raises ``KeyError`` if a mark names a part that does not exist."""
    parts = _parts()
    return _MARK.sub(lambda mark: f"<!-- generated: {mark['name']} -->\n{parts[mark['name']]}\n<!-- end -->", page)


def _parts() -> dict[str, str]:
    layouts = (wire.HEADER, wire.SAMPLE_LAYOUT, *wire.PAYLOADS.values())
    enums = (wire.DatagramKind, wire.CommandCode, wire.MotionFlag, wire.Guard, wire.Result, wire.Flag)
    return {
        "version": f"Version of this page: `0x{wire.VERSION:08x}`.",
        **{layout.name: _layout_table(layout) for layout in layouts},
        **{enum.__name__: _number_table(enum) for enum in enums},
        "example": _example(),
        "State": _number_table(State),
        "picture": _state_picture(),
        "transitions": _transition_table(),
        "Cause": _cause_table(),
        "limits": _limit_table(),
        "flight": _layout_table(FLIGHT),
    }


def _example() -> str:
    heartbeat = wire.HEARTBEAT.struct.pack(7)
    datagram = Envelope(bytes(range(wire.KEY_SIZE))).seal(wire.DatagramKind.HEARTBEAT, 1, 2, heartbeat).hex(" ")
    lines = [datagram[start : start + 48].strip() for start in range(0, len(datagram), 48)]
    return "\n".join(["```", *lines, "```"])


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = list(head)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _layout_table(layout: wire.Layout) -> str:
    rows, offset = [], 0
    for field in layout.fields:
        rows.append([str(offset), f"`{field.name}`", field.type_name, field.unit, field.meaning])
        offset += field.size
    return _table(("offset", "field", "type", "unit", "meaning"), rows) + f"\n\nSize: {layout.size} bytes."


def _number_table(enum: type[IntEnum] | type[IntFlag]) -> str:
    return _table(("number", "name"), ([str(int(member)), f"`{member.name}`"] for member in enum))


def _transition_table() -> str:
    rows = [
        [
            f"`{state.name}`",
            *(f"`{TRANSITIONS[state, event].name}`" if (state, event) in TRANSITIONS else "" for event in Event),
        ]
        for state in State
    ]
    return _table(("state", *(f"`{event.name}`" for event in Event)), rows)


def _state_picture() -> str:
    """The transitions that lead elsewhere, as a diagram in Mermaid, which GitHub and most editors draw."""
    arrows: dict[tuple[State, State], list[str]] = {}
    for (state, event), following in TRANSITIONS.items():
        if state is not following:
            arrows.setdefault((state, following), []).append(event.name)
    lines = [f"    {state.name} --> {following.name}: {', '.join(events)}"
             for (state, following), events in arrows.items()]  # fmt: skip
    return "\n".join(["```mermaid", "stateDiagram-v2", "    [*] --> BOOT", *lines, "    OFF --> [*]", "```"])


def _cause_table() -> str:
    rows = ([str(int(cause)), f"`{cause.name}`", _reaction(cause), template(cause)] for cause in Cause)
    return _table(("number", "name", "reaction", "meaning"), rows)


def _reaction(cause: Cause) -> str:
    if cause is Cause.NONE:
        return ""
    return f"`{REACTIONS.get(cause, Reaction.REFUSE).name}`"


def _limit_table() -> str:
    limits: Limits = default_limits(load_parameters(), TableSettings())
    rows = []
    for name, why in WHY.items():
        value = getattr(limits, name)
        values = value if isinstance(value, tuple) else (value,)
        rows.append([f"`{name}`", ", ".join(f"{number:.6g}" for number in values), why.unit, why.reaction, why.why])
    return _table(("limit", "default", "unit", "reaction", "why"), rows)


def main(arguments: list[str]) -> None:
    """Refresh the pages named on the command line."""
    for argument in arguments:
        path = Path(argument)
        path.write_text(refresh(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
