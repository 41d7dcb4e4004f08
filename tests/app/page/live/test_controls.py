"""Who holds the controls, whatever happens in whatever order."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.page.live.controls import GRACE, Controls, ControlsRefused

WATCHERS = st.integers(1, 4)
STEPS = st.tuples(
    st.sampled_from(["join", "gone", "take", "ask", "give", "keep", "release", "expire"]),
    WATCHERS,
    st.floats(0.0, 2.0 * GRACE),
)


def step(before: Controls, what: str, who: int, now: float) -> Controls:
    """As ``People`` does it: only who is there does something."""
    if what == "join":
        return before.joined(who, now)
    if what == "gone":
        return before.gone(who, now)
    if what == "expire" or who not in before.watchers:
        return before.expired(now)
    here = before.expired(now)
    try:
        return {
            "take": here.taken, "ask": here.asked, "give": here.given, "keep": here.kept, "release": here.released,
        }[what](who)  # fmt: skip
    except ControlsRefused:
        return here


@given(st.lists(STEPS, max_size=40))
def test_whatever_happens_the_controls_are_somewhere_sensible(steps: list[tuple[str, int, float]]) -> None:
    now, here = 0.0, Controls()
    for what, who, waited in steps:
        now += waited
        before = here.expired(now)
        if before.holder != here.holder:
            assert (here.holder not in here.watchers, before.holder) == (True, here.asking), "who asks inherits"
        here = step(here, what, who, now)
        assert here.asking is None or here.asking in here.watchers, "who asks is there"
        assert here.asking is None or here.asking != here.holder, "nobody asks themselves"
        assert (here.left is not None) == (here.holder is not None and here.holder not in here.watchers)
        assert here.left is None or now - here.left < GRACE, "who has been gone for long holds nothing"
        if here.holder != before.holder and before.holder is not None and before.holder in here.watchers:
            assert (what, who) in {("give", before.holder), ("release", before.holder)}, "nobody is robbed"
        if before.asking is not None and before.asking in here.watchers and here.asking is None:
            answered = here.holder == before.asking or (what, who) == ("keep", before.holder)
            assert answered, "who asks is answered"


def holding(holder: int, *others: int) -> Controls:
    here = Controls().joined(holder, 0.0)
    for other in others:
        here = here.joined(other, 0.0)
    return here


def test_who_comes_first_holds_the_controls() -> None:
    assert holding(7, 8, 9).holder == 7


def test_a_page_that_is_loaded_anew_holds_the_controls_still() -> None:
    here = holding(1, 2).gone(1, 5.0)
    assert here.holder == 1
    here = here.joined(1, 5.0 + 0.9 * GRACE)
    assert (here.holder, here.deadline) == (1, None)
    assert here.expired(1000.0).holder == 1


def test_who_stays_away_loses_them_to_who_asks() -> None:
    here = holding(1, 2).asked(2).gone(1, 5.0)
    assert here.expired(5.0 + 0.99 * GRACE).holder == 1
    assert here.deadline is not None
    assert here.expired(here.deadline).holder == 2


def test_where_nobody_asks_nobody_holds_them_and_anybody_takes_them() -> None:
    here = holding(1, 2).gone(1, 0.0).expired(GRACE)
    assert here.holder is None
    assert here.joined(3, GRACE).holder is None, "others are there: nobody gets them by coming"
    assert here.taken(2).holder == 2
    assert here.asked(2).holder == 2


def test_they_are_handed_over() -> None:
    here = holding(1, 2, 3).asked(2)
    with pytest.raises(ControlsRefused, match="somebody else has already asked"):
        here.asked(3)
    given = here.given(1)
    assert (given.holder, given.asking) == (2, None)
    assert here.released(1).holder == 2
    kept = here.kept(1)
    assert (kept.holder, kept.asking) == (1, None)


@pytest.mark.parametrize("action", ["given", "kept", "released"])
def test_only_the_holder_lets_go(action: str) -> None:
    with pytest.raises(ControlsRefused, match="you do not hold the controls"):
        getattr(holding(1, 2).asked(2), action)(2)


def test_they_are_not_taken_from_anybody() -> None:
    with pytest.raises(ControlsRefused, match="somebody else holds the controls"):
        holding(1, 2).taken(2)
    with pytest.raises(ControlsRefused, match="nobody asks"):
        holding(1, 2).given(1)
    with pytest.raises(ControlsRefused, match="already"):
        holding(1).asked(1)
