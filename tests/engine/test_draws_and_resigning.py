"""When an engine resigns, offers, accepts and claims."""

from __future__ import annotations

import chess
import chess.engine
from hypothesis import given
from hypothesis import strategies as st

from engine.draws_and_resigning import DrawResignPolicy

Cp, Mate = chess.engine.Cp, chess.engine.Mate
LATE = chess.Board("4k3/8/8/8/8/8/8/4K2R w - - 0 60")
LOST = [Cp(-2000), Cp(-1500), Mate(-3), Mate(-2)]
SCORES = st.lists(st.integers(-3000, 3000).map(Cp), max_size=12)


@given(SCORES)
def test_by_default_it_neither_resigns_nor_offers(scores: list[chess.engine.Score]) -> None:
    assert not DrawResignPolicy().resigns([*scores, *LOST])
    assert not DrawResignPolicy().offers_draw([*scores, *[Cp(0)] * 6], LATE)


def test_it_resigns_after_enough_bad_scores_in_a_row() -> None:
    policy = DrawResignPolicy(resign_below=1000, resign_for=3)
    assert policy.resigns(LOST)
    assert policy.resigns([Cp(500), *LOST])
    assert not policy.resigns(LOST[:2])
    assert not policy.resigns([*LOST, Cp(-999)])
    assert policy.resigns([Cp(-1000)] * 3)
    assert not policy.resigns([])
    assert not policy.resigns([*LOST, Mate(2)])


def test_draws_are_for_late_and_level_games() -> None:
    policy, level = DrawResignPolicy(offer_within=20), [Cp(-20), Cp(20), Cp(0), Cp(5), Cp(-5), Cp(0)]
    assert policy.offers_draw(level, LATE)
    assert policy.accepts_draw(level, LATE)
    assert not policy.offers_draw(level, chess.Board())
    assert not policy.accepts_draw(level, chess.Board())
    assert not policy.offers_draw(level[1:], LATE)
    assert not policy.offers_draw([*level, Cp(21)], LATE)
    assert not policy.accepts_draw([*level, Cp(31)], LATE)
    assert not DrawResignPolicy(accept_within=None).accepts_draw(level, LATE)


def test_who_is_worse_accepts_but_does_not_offer() -> None:
    policy, worse = DrawResignPolicy(offer_within=20), [Cp(-400)] * 6
    assert policy.accepts_draw(worse, LATE)
    assert not policy.offers_draw(worse, LATE)
    assert policy.accepts_draw([Mate(-4)] * 6, LATE)
    assert not policy.accepts_draw([Mate(4)] * 6, LATE)


def test_a_draw_is_claimed_unless_it_is_winning() -> None:
    fifty = chess.Board("4k3/8/8/8/8/8/8/4K2R w - - 100 90")
    assert DrawResignPolicy().claims_draw([Cp(30)], fifty)
    assert DrawResignPolicy().claims_draw([], fifty)
    assert not DrawResignPolicy().claims_draw([Cp(60)], fifty)
    assert not DrawResignPolicy().claims_draw([Cp(0)], LATE)
    assert not DrawResignPolicy(claim_within=None).claims_draw([Cp(0)], fifty)
