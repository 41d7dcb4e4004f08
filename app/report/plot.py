"""Axes and marks of a chart as SVG.

Drawn by hand and not by matplotlib: text stays text, colours are CSS variables that follow light, dark and print, a
mark carries a title that says its ply, and a chart weighs some kilobytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from app.pieces.inventory import MoveKind
from app.report.markup import Html, joined, tag

WIDTH: Final = 400.0
HEIGHT: Final = 230.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 46.0, 12.0, 12.0, 38.0
MARK: Final = 3.6
"""Half the extent of a mark."""
_STEPS: Final = (1.0, 2.0, 5.0, 10.0)


def nice_ticks(low: float, high: float, most: int = 6) -> tuple[float, ...]:
    """Round numbers from at or below ``low`` to at or above ``high``, at most some more than ``most``."""
    low, high = sorted((low, high))
    span = max(high - low, 1e-6 * max(abs(low), abs(high), 1e-3))
    magnitude = 10.0 ** math.floor(math.log10(span / most))
    step = next(s * magnitude for s in _STEPS if span / (s * magnitude) <= most or s == _STEPS[-1])
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return tuple(round(n * step, 12) for n in range(first, max(last, first + 1) + 1))


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, without an exponent; minus as a typographer has it."""
    if value == 0.0:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{min(places, 6)}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", "−")


@dataclass(frozen=True, slots=True)
class PlotArea:
    """What a chart shows, and where: values from ``x_ticks`` and ``y_ticks`` fill the area within the axes."""

    x_ticks: tuple[float, ...]
    y_ticks: tuple[float, ...]
    left: float = _LEFT
    height: float = HEIGHT

    def x(self, value: float) -> float:
        """Where a value lies along the drawing."""
        low, high = self.x_ticks[0], self.x_ticks[-1]
        return self.left + (value - low) / (high - low) * (WIDTH - self.left - _RIGHT)

    def y(self, value: float) -> float:
        """Where a value lies down the drawing."""
        low, high = self.y_ticks[0], self.y_ticks[-1]
        return self.height - _BOTTOM - (value - low) / (high - low) * (self.height - _TOP - _BOTTOM)

    def axes(self, x_label: str, y_label: str, y_names: Sequence[str] | None = None) -> Html:
        """Grid, numbers and what they are; ``y_names`` stand for the numbers of the second axis."""
        right, bottom = WIDTH - _RIGHT, self.height - _BOTTOM
        parts = []
        for tick in self.x_ticks:
            at = self.x(tick)
            parts.append(tag("line", x1=at, y1=_TOP, x2=at, y2=bottom, class_="grid"))
            parts.append(tag("text", number(tick), x=at, y=bottom + 14.0, class_="tick", text_anchor="middle"))
        for row, tick in enumerate(self.y_ticks):
            if y_names is not None and not 0 < row <= len(y_names):
                continue
            at = self.y(tick)
            name = number(tick) if y_names is None else y_names[row - 1]
            parts.append(tag("line", x1=self.left, y1=at, x2=right, y2=at, class_="grid"))
            parts.append(tag("text", name, x=self.left - 5.0, y=at + 4.0, class_="tick", text_anchor="end"))
        parts.append(tag("line", x1=self.left, y1=bottom, x2=right, y2=bottom, class_="axis"))
        middle = (self.left + right) / 2.0
        parts.append(tag("text", x_label, x=middle, y=self.height - 6.0, class_="label", text_anchor="middle"))
        if y_label:
            at, half = 11.0, (_TOP + bottom) / 2.0
            turned = f"rotate(-90 {at} {half})"
            parts.append(tag("text", y_label, x=at, y=half, class_="label", text_anchor="middle", transform=turned))
        return joined(parts)

    def limit(self, value: float, name: str) -> Html:
        """A line across, with its name; of one beyond the drawing, the name alone, with an arrow at the upper edge."""
        right = WIDTH - _RIGHT
        if value > self.y_ticks[-1]:
            return tag("text", f"↑ {name}", x=self.left + 4.0, y=_TOP + 10.0, class_="limit-name")
        at = self.y(value)
        beside = at - 4.0 if at - _TOP > 14.0 else at + 12.0
        return joined([
            tag("line", x1=self.left, y1=at, x2=right, y2=at, class_="limit"),
            tag("text", name, x=right - 2.0, y=beside, class_="limit-name", text_anchor="end"),
        ])  # fmt: skip

    def steps(self, points: Sequence[tuple[float, float]], look: str) -> Html:
        """A line that keeps each value until the next."""
        if not points:
            return Html("")
        way = [f"M{self.x(points[0][0]):.1f} {self.y(points[0][1]):.1f}"]
        for x, y in points[1:]:
            way.append(f"H{self.x(x):.1f}V{self.y(y):.1f}")
        return tag("path", d="".join(way), class_=f"line {look}")

    def line(self, points: Sequence[tuple[float, float]], look: str) -> Html:
        """A line from value to value."""
        if not points:
            return Html("")
        way = "M" + "L".join(f"{self.x(x):.1f} {self.y(y):.1f}" for x, y in points)
        return tag("path", d=way, class_=f"line {look}")


def mark(kind: MoveKind | None, x: float, y: float, says: str, size: float = MARK, look: str = "") -> Html:
    """A mark whose shape says the kind of move, for those who see no colours; None: a plain dot, that may look so."""
    title = tag("title", says)
    look = f"m {look}".rstrip() if kind is None else f"m k-{kind.value}"
    r = size
    match kind:
        case MoveKind.CAPTURE:
            return tag("rect", title, x=x - r, y=y - r, width=2.0 * r, height=2.0 * r, class_=look)
        case MoveKind.CASTLING:
            return _polygon([(x, y - 1.3 * r), (x + 1.3 * r, y), (x, y + 1.3 * r), (x - 1.3 * r, y)], title, look)
        case MoveKind.EN_PASSANT:
            return _polygon([(x - 1.2 * r, y - r), (x + 1.2 * r, y - r), (x, y + 1.2 * r)], title, look)
        case MoveKind.PROMOTION:
            return _polygon([(x - 1.2 * r, y + r), (x + 1.2 * r, y + r), (x, y - 1.2 * r)], title, look)
        case _:
            return tag("circle", title, cx=x, cy=y, r=r, class_=look)


def _polygon(corners: Iterable[tuple[float, float]], title: Html, look: str) -> Html:
    return tag("polygon", title, points=" ".join(f"{x:.1f},{y:.1f}" for x, y in corners), class_=look)


def drawing(name: str, title: str, description: str, *parts: str, height: float = HEIGHT, width: float = WIDTH) -> Html:
    """A whole picture: ``name`` is unique on its page, title and description say what it shows to who cannot see it."""
    return tag(
        "svg", tag("title", title, id=f"{name}-t"), tag("desc", description, id=f"{name}-d"), *parts,
        viewBox=f"0 0 {width:g} {height:g}", role="img", aria_labelledby=f"{name}-t", aria_describedby=f"{name}-d",
        xmlns="http://www.w3.org/2000/svg",
    )  # fmt: skip
