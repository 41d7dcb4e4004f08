"""Axes and numbers of charts, and what the telemetry says of each ply."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.records.telemetry import TELEMETRY_FILE, TelemetryRecorder
from app.report import report_page
from app.report.plot import PlotArea, nice_ticks, number
from app.report.source import read_source
from controller.protocol.datagram_fields import TELEMETRY, Flag
from controller.protocol.messages import Telemetry
from tests.app.played_game import PlayedGame

TICK = 0.00088
BLANK = Telemetry.unpack(bytes(TELEMETRY.size))


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
def test_ticks_are_even_hold_all_and_are_few(low: float, span: float) -> None:
    high = low + span
    ticks = nice_ticks(low, high)
    assert ticks[0] <= low + 1e-6 * span
    assert ticks[-1] >= high - 1e-6 * span
    assert 2 <= len(ticks) <= 9
    steps = [after - before for before, after in pairwise(ticks)]
    assert max(steps) == pytest.approx(min(steps), rel=1e-3)
    leading = steps[0] / 10.0 ** math.floor(math.log10(steps[0]) + 1e-6)
    assert min(abs(leading - nice) for nice in (1.0, 2.0, 5.0)) < 1e-2


@given(st.floats(-1e12, 1e12))
def test_ticks_about_a_single_value_are_two_at_least(value: float) -> None:
    ticks = nice_ticks(value, value)
    assert ticks[0] < ticks[-1]


@given(st.floats(-1e5, 1e5))
def test_numbers_keep_three_digits(value: float) -> None:
    text = number(value)
    assert "e" not in text
    assert float(text.replace("−", "-")) == pytest.approx(value, rel=6e-3, abs=1e-6)


def test_the_area_ends_at_its_ticks() -> None:
    area = PlotArea((0.0, 10.0), (0.0, 4.0))
    assert area.x(0.0) == area.left
    assert area.x(10.0) > area.x(5.0) > area.x(0.0)
    assert area.y(0.0) > area.y(4.0) > 0.0
    assert "↑ far" in area.limit(5.0, "far")
    assert "<line" not in area.limit(5.0, "far")
    assert "<line" in area.limit(3.0, "near")


TOLD = (
    (0.5, 9.0, 9.0, 1),
    (1.5, 0.001, 0.002, 1),
    (2.0, 0.003, 0.001, 1),
    (2.5, 0.002, 0.5, 0),
    (4.0, 0.0, 0.004, 2),
    (6.0, 9.0, 9.0, 1),
)
"""When [s], late by [s], off its reference by [m], which motion: some while no ply is made, or no motion runs."""


def test_of_each_ply_the_worst_that_was_told_while_it_was_made(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game").play("Nf3 Nf6")  # from 1 to 3 s and from 3 to 5 s
    with TelemetryRecorder(tmp_path / "game" / TELEMETRY_FILE, TICK) as recorder:
        for seconds, late, off, motion in TOLD:
            away = (0.0, 0.0, 0.4 - off)
            told = BLANK._replace(tick=round(seconds / TICK), lateness=late, work=1e-4, flags=Flag.NONE)
            recorder.take(told._replace(position=(0.0, 0.0, 0.4), reference=away, motion=motion, force=(0.0, 3.0, 4.0)))
    loop = read_source(game.record.folder).loop
    assert not loop.lockstep
    assert [one.ply for one in loop.plies] == [1, 2]
    assert [one.lateness for one in loop.plies] == [0.003, 0.0]
    assert [one.tracking for one in loop.plies] == pytest.approx([0.002, 0.004])
    assert [one.force for one in loop.plies] == [5.0, 5.0]


def test_telemetry_that_is_missing_or_broken_is_told(tmp_path: Path) -> None:
    game = PlayedGame(tmp_path / "game").play("Nf3")
    assert "There is no telemetry.mcap" in report_page(read_source(game.record.folder))
    (game.record.folder / TELEMETRY_FILE).write_bytes(b"no telemetry at all")
    assert "The telemetry cannot be read" in report_page(read_source(game.record.folder))
