"""Numbers as people read them."""

from __future__ import annotations

import math

from app.report.plot import number


def percent(share: float) -> str:
    """A share in per cent, to three digits; only what is 0 or 100 % is said to be."""
    value = 100.0 * share
    if 0.0 < value < 0.001:
        return "less than 0.001 %"
    if 99.0 < value < 100.0:
        return f"{number(100.0 - float(f'{100.0 - value:.2g}'), 6)} %"
    return f"{number(value)} %"


def interval(low: float, high: float) -> str:
    """Two shares in per cent, with as many decimals each as tell them apart; only what is 0 or 100 % is said to be."""
    width = 100.0 * (high - low)
    places = min(max(1, 1 - math.floor(math.log10(width))), 4) if width > 0.0 else 1

    def said(share: float) -> str:
        text = f"{100.0 * share:.{places}f}"
        return percent(share) if float(text) in (0.0, 100.0) else f"{text} %"

    return f"{said(low)} to {said(high)}"


def amount(value: float) -> str:
    """Any figure, with three significant digits."""
    return number(value)


def signed(value: float) -> str:
    """A difference, with its sign."""
    return f"+{number(value)}" if value > 0.0 else number(value)


def chance(p: float) -> str:
    """A p-value."""
    return "< 0.0001" if p < 1e-4 else f"{p:.4f}" if p < 0.01 else f"{p:.2f}"


def counted(count: int, what: str) -> str:
    """So many of something."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def capital(text: str) -> str:
    """As a heading begins."""
    return f"{text[:1].upper()}{text[1:]}"
