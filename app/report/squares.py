"""The board with how far off the centre of its square each piece was put."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from app.records import PlyEvent
from app.report.figures_of_plies import Chart, DataTable, ply_name
from app.report.markup import Html, joined, tag
from app.report.plot import drawing, number
from app.report.source import ReportSource
from hardware.table import Place, TableSettings, square_place

BOUNDS: Final = (0.01, 0.1, 0.3, 1.0, 3.0)
"""Colours change at these distances [mm]: steps of about three, from what an arm does to what a hand does."""
_SIZE: Final = 400.0
_MARGIN: Final = 14.0
"""For the letters and numbers of files and ranks."""


@dataclass(frozen=True, slots=True)
class Placement:
    """A piece was put somewhere: how far from the centre [mm], in which ply."""

    place: Place
    piece: str
    distance: float
    ply: PlyEvent


def placements(source: ReportSource) -> tuple[Placement, ...]:
    """Of all plies in their order; a piece whose place no event names is left out."""
    found = []
    for ply in source.plies:
        targets = {one.piece: one.target for one in ply.transfers} | ply.inventory
        for piece, distance in (ply.placement_mm or {}).items():
            place = _place(targets.get(piece, ""))
            if place is not None:
                found.append(Placement(place, piece, distance, ply))
    return tuple(found)


def _place(text: str) -> Place | None:
    try:
        return Place.parse(text)
    except ValueError:
        return None  # a record may have been written by anybody


def board_of_placements(source: ReportSource) -> Chart | None:
    """The board from above, White below: on each square the farthest that a piece was put off its centre."""
    found = placements(source)
    if not found:
        return None
    table = TableSettings() if source.robot is None else source.robot.table
    worst: dict[Place, Placement] = {}
    for one in found:
        if one.place not in worst or one.distance > worst[one.place].distance:
            worst[one.place] = one
    drawn = {place: one for place, one in worst.items() if not place.in_box and _is_there(table, place)}
    picture, height = _picture(table, drawn)
    most = max(found, key=lambda one: one.distance)
    by_hand = sum(one.ply.by == "hand" for one in found)
    where = f"{most.piece} on {most.place}, {most.distance:.2f} mm, in ply {most.ply.ply}"
    described = f"{len(found)} placements; the farthest is {where}."
    rows = [
        (
            str(one.ply.ply),
            ply_name(one.ply),
            one.piece.replace("-", " "),
            str(one.place),
            f"{one.distance:.3f}",
            one.ply.by,
        )
        for one in found
    ]
    hands = f" Dashed squares were filled by a hand ({by_hand} times)." if by_hand else ""
    return Chart(
        "Placement",
        "How far from the centre of its place each piece was at the end of a ply that moved it [mm], by the referee: "
        f"the farthest on each square. A record knows the distance, not the direction.{hands}",
        joined([drawing("board", "Placement by square", described, picture, height=height, width=_SIZE), _colours()]),
        DataTable(("ply", "move", "piece", "place", ">off by [mm]", "moved by"), rows).html("Placement"),
    )  # fmt: skip


def _is_there(table: TableSettings, place: Place) -> bool:
    """Whether the table has that place: it may be another table's, where the record does not say which it was."""
    return place.on_board or place in table.tray_places()


def _picture(table: TableSettings, worst: dict[Place, Placement]) -> tuple[Html, float]:
    scale = (_SIZE - 2.0 * _MARGIN) / (2.0 * max(table.half_width, 4.0 * table.square))
    half_y = max(4.0 * table.square, 0.5 * table.tray_rows * table.tray_row_pitch)
    height = 2.0 * (half_y * scale + _MARGIN)
    side = table.square * scale

    def at(place: Place) -> tuple[float, float]:
        x, y = table.xy(place)
        return _SIZE / 2.0 + x * scale, height / 2.0 - y * scale

    parts = []
    for number_of in range(64):
        place = square_place(number_of)
        x, y = at(place)
        shade = "light" if (number_of // 8 + number_of % 8) % 2 else "dark"
        parts.append(tag("rect", x=x - side / 2, y=y - side / 2, width=side, height=side, class_=f"square {shade}"))
    for place in table.tray_places():
        x, y = at(place)
        parts.append(tag("circle", cx=x, cy=y, r=3.0, class_="place"))
    parts += _letters(table, at, side)
    for place, one in sorted(worst.items()):
        parts.append(_value(one, *at(place), side, table.tray_row_pitch * scale))
    return joined(parts), height


def _letters(table: TableSettings, at: object, side: float) -> list[Html]:
    assert callable(at)
    parts = []
    for index in range(8):
        x, y = at(square_place(index))
        parts.append(tag("text", "abcdefgh"[index], x=x, y=y + side / 2 + 11.0, class_="tick", text_anchor="middle"))
        x, y = at(square_place(8 * index))
        parts.append(tag("text", str(index + 1), x=x - side / 2 - 4.0, y=y + 4.0, class_="tick", text_anchor="end"))
    return parts


def _value(one: Placement, x: float, y: float, side: float, pitch: float) -> Html:
    """A disc in the colour of a distance, with the distance on it where there is room."""
    title = tag("title", f"ply {one.ply.ply}, {one.piece} on {one.place}: {one.distance:.3f} mm")
    colour = f"q{_colour(one.distance)}"
    look = f"{colour} by-hand" if one.ply.by == "hand" else colour
    if not one.place.on_board:
        return tag("circle", title, cx=x, cy=y, r=0.32 * min(pitch, side), class_=look)
    inner = side - 4.0
    patch = tag("rect", title, x=x - inner / 2, y=y - inner / 2, width=inner, height=inner, rx=3.0, class_=look)
    text = number(round(one.distance, 2), 2) if one.distance >= BOUNDS[0] / 2.0 else "0"
    return joined([patch, tag("text", text, x=x, y=y + 3.0, class_=f"value on-{colour}", text_anchor="middle")])


def _colour(distance: float) -> int:
    return sum(distance >= bound for bound in BOUNDS)


def _colours() -> Html:
    edges = [number(bound) for bound in BOUNDS]
    between = [f"{low} to {high} mm" for low, high in pairwise(edges)]
    names = (f"below {edges[0]} mm", *between, f"{edges[-1]} mm or more")
    return tag("p", *(
        tag("span", tag("svg", tag("rect", x=1.0, y=1.0, width=12.0, height=12.0, rx=2.0, class_=f"q{rank}"),
                        viewBox="0 0 14 14", aria_hidden="true"), name)
        for rank, name in enumerate(names)
    ), class_="key")  # fmt: skip
