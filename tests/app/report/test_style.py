"""The colours of the page: what is read and what is seen stands out from what it lies on, in light, dark and print."""

from __future__ import annotations

import re

import pytest

from app.report.style import STYLE

TEXTS = ("ink", "soft", "link", "bad", "good", "limit")
MARKS = ("quiet", "capture", "castling", "en-passant", "promotion", "one", "two", "axis", "plan")


def palettes() -> dict[str, dict[str, str]]:
    """Of each scheme what its variables are; those it does not say are the first one's."""
    blocks = [
        dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})", block))
        for block in re.findall(r":root \{(.*?)\}", STYLE, re.S)
    ]
    assert len(blocks) == 3
    return {name: blocks[0] | block for name, block in zip(("light", "dark", "print"), blocks, strict=True)}


def luminance(colour: str) -> float:
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    channels = [int(digits[k : k + 2], 16) / 255.0 for k in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark", "print"])
def test_texts_and_marks_stand_out(scheme: str) -> None:
    colours = palettes()[scheme]
    for ground in ("bg", "panel"):
        for text in TEXTS:
            assert contrast(colours[text], colours[ground]) >= 4.5, (text, ground)
        for mark in MARKS:
            assert contrast(colours[mark], colours[ground]) >= 3.0, (mark, ground)
    for patch in ("q0", "q1", "q2", "q3", "q4"):
        assert contrast(colours["q-ink"], colours[patch]) >= 4.5, patch
    assert contrast("#ffffff", colours["q5"]) >= 4.5


def test_the_measure_is_the_usual_one() -> None:
    assert contrast("#000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#767676", "#fff") == pytest.approx(4.54, abs=0.01)
