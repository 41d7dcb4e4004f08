"""Time controls: what is read, what is refused, and which period a move belongs to."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app import UserError
from app.settings.time_control import Extra, Period, TimeControl, clock_text


@pytest.mark.parametrize(
    ("text", "periods", "extra", "kind", "pgn"),
    [
        ("5+3", [(300, None)], 3, Extra.INCREMENT, "300+3"),
        ("15+10", [(900, None)], 10, Extra.INCREMENT, "900+10"),
        (" 90 + 30 ", [(5400, None)], 30, Extra.INCREMENT, "5400+30"),
        ("0:30+1", [(30, None)], 1, Extra.INCREMENT, "30+1"),
        ("0.5+1", [(30, None)], 1, Extra.INCREMENT, "30+1"),
        ("10", [(600, None)], 0, Extra.INCREMENT, "600"),
        ("1:30:15", [(5415, None)], 0, Extra.INCREMENT, "5415"),
        ("5d3", [(300, None)], 3, Extra.DELAY, "300"),
        ("5B2.5", [(300, None)], 2.5, Extra.BRONSTEIN, "300"),
        ("40/90+30", [(5400, 40)], 30, Extra.INCREMENT, "40/5400+30"),
        ("40/90+30,30+30", [(5400, 40), (1800, None)], 30, Extra.INCREMENT, "40/5400+30:1800+30"),
        (
            "40/90,20/60,15+30",
            [(5400, 40), (3600, 20), (900, None)],
            30,
            Extra.INCREMENT,
            "40/5400+30:20/3600+30:900+30",
        ),
    ],
)
def test_what_is_read(text: str, periods: list[tuple[float, int | None]], extra: float, kind: Extra, pgn: str) -> None:
    control = TimeControl.parse(text)
    assert [(p.base, p.moves) for p in control.periods] == periods
    assert (control.extra, control.kind) == (extra, kind)
    assert control.pgn == pgn
    assert TimeControl.parse(str(control)) == control


@pytest.mark.parametrize(
    "text",
    [
        "", "five", "5 and 3", "0+3", "-5", "5+", "+3", "5+3+1", "0/5", "40/", "5,5", "40/90+30,30+10", "1:75", "nan",
        "5e3", ",",
    ],
)  # fmt: skip
def test_what_is_none_is_refused_with_how_to_write_one(text: str) -> None:
    with pytest.raises(UserError) as caught:
        TimeControl.parse(text)
    assert str(caught.value) == (
        f"'{text}' is not a time control: write minutes, at most 999, and seconds per move such as 5+3, 0:30+1, 5d3 "
        "(delay) or 40/90,30+30 (90 minutes for 40 moves, then 30)"
    )


@given(
    bases=st.lists(st.integers(1, 99 * 3600), min_size=1, max_size=3),
    extra=st.integers(0, 99),
    kind=st.sampled_from(list(Extra)),
    repeats=st.booleans(),
)
def test_what_is_written_is_read_again(bases: list[int], extra: int, kind: Extra, repeats: bool) -> None:
    periods = [Period(base=base, moves=10 + i) for i, base in enumerate(bases)]
    if not repeats:
        periods[-1] = Period(base=bases[-1])
    control = TimeControl(periods=tuple(periods), extra=extra, kind=kind if extra else Extra.INCREMENT)
    assert TimeControl.parse(str(control)) == control


def test_periods_by_moves() -> None:
    control = TimeControl.parse("40/90,20/60,15")
    assert [control.period_of(n)[1] for n in (0, 39, 40, 59, 60, 200)] == [40, 1, 20, 1, None, None]
    begun = {n: p.base for n in range(1, 200) if (p := control.begins_period(n)) is not None}
    assert begun == {40: 3600, 60: 900}


def test_a_last_period_with_moves_repeats() -> None:
    control = TimeControl.parse("40/90")
    assert [n for n in range(1, 170) if control.begins_period(n) is not None] == [40, 80, 120, 160]
    assert [control.period_of(n)[1] for n in (0, 39, 40, 41, 79, 80)] == [40, 1, 40, 39, 1, 40]


def test_a_game_in_one_period_gets_nothing_more() -> None:
    assert not any(TimeControl.parse("5+3").begins_period(n) for n in range(100))


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (3723.9, "1:02:03"), (300.0, "5:00"), (245.99, "4:05"), (20.0, "0:20"), (19.99, "0:19.9"), (9.4, "0:09.4"),
        (0.0, "0:00.0"), (-3.0, "0:00.0"), (59.999, "0:59"),
    ],
)  # fmt: skip
def test_how_clocks_show_time(seconds: float, text: str) -> None:
    assert clock_text(seconds) == text


@given(st.floats(0.0, 1e5))
def test_no_more_time_is_shown_than_there_is(seconds: float) -> None:
    shown = 0.0
    for part in clock_text(seconds).split(":"):
        shown = 60.0 * shown + float(part)
    assert -1e-5 <= seconds - shown < 1.0
    assert seconds >= 19.99 or math.isclose(seconds, shown, abs_tol=0.1 + 1e-5)
