"""Bounds and tests against scipy, printed tables and the laws that they promise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from app.campaign.report.analysis.statistics import (
    clustered_at_most,
    fisher,
    hits_needed,
    holm,
    mann_whitney,
    mcnemar,
    rank_correlation,
    ranks_from_the_ends,
    rate_at_most,
    rate_bounds,
    rate_that_gives,
    signed_rank,
)

# --------------------------------------------------------------------------------------------------------------- bounds


@pytest.mark.parametrize(("hits", "trials"), [(0, 1), (0, 1000), (1, 10), (5, 200), (199, 200), (200, 200)])
def test_bounds_are_clopper_and_pearson_s(hits: int, trials: int) -> None:
    interval = stats.binomtest(hits, trials).proportion_ci(0.95, "exact")
    assert rate_bounds(hits, trials) == pytest.approx((interval.low, interval.high), abs=1e-12)


@pytest.mark.parametrize(("trials", "share"), [(59, 0.05), (299, 0.01), (598, 0.005), (2995, 0.001)])
def test_of_none_the_bound_is_the_textbook_s(trials: int, share: float) -> None:
    """The rule of three, exactly: so many games without a failure it takes to show so small a rate."""
    assert rate_at_most(0, trials) <= share < rate_at_most(0, trials - 1)
    assert rate_at_most(0, trials) == pytest.approx(1.0 - 0.05 ** (1.0 / trials))
    assert rate_at_most(0, 0) == 1.0


@pytest.mark.parametrize("rate", [0.003, 0.05, 0.5])
@pytest.mark.parametrize("trials", [20, 200])
def test_bounds_hold_as_often_as_they_say(rate: float, trials: int) -> None:
    """Exactly: summed over all that can be counted, weighted by how often it is."""
    hits = np.arange(trials + 1)
    chances = stats.binom.pmf(hits, trials, rate)
    bounds = [rate_bounds(int(count), trials) for count in hits]
    assert sum(c for c, b in zip(chances, bounds, strict=True) if b.low <= rate <= b.high) >= 0.95
    at_most = sum(c for c, count in zip(chances, hits, strict=True) if rate <= rate_at_most(int(count), trials))
    assert at_most >= 0.95


@pytest.mark.parametrize(
    ("games", "bad", "share"),
    [(25, 0.04, 1.0), (100, 0.01, 1.0), (100, 0.02, 0.5), (1000, 0.002, 1.0), (100, 0.05, 1.0), (40, 0.5, 0.5)],
)
def test_bounds_of_plies_hold_where_few_games_are_bad(games: int, bad: float, share: float) -> None:
    """A few games are bad in many of their 40 plies: as independent plies, 0 to 36 of 100 bounds would be too low."""
    rng, trials = np.random.default_rng(6), np.full(games, 40.0)
    hits = rng.binomial(40, np.where(rng.random((300, games)) < bad, share, 0.0)).astype(float)
    missed = sum(clustered_at_most(one, trials) < bad * share for one in hits)
    assert missed <= 0.06 * 300


def test_plies_of_games_that_differ_count_as_fewer() -> None:
    """In half of the games half of the plies are late, else none: 40 games do not say what 1600 plies would."""
    trials, rng = np.full(40, 40.0), np.random.default_rng(1)
    hits = rng.binomial(40, np.where(rng.random((300, 40)) < 0.5, 0.5, 0.0)).astype(float)
    assert sum(rate_at_most(one.sum(), 1600) >= 0.25 for one in hits) < 0.8 * 300, "this is what would be claimed"
    alike = rng.binomial(40, 0.25, 40).astype(float)
    assert rate_at_most(alike.sum(), 1600) < clustered_at_most(alike, trials) < rate_at_most(alike.sum() / 2.0, 800)


def test_bounds_of_plies_by_hand() -> None:
    trials = np.full(120, 12.0)
    unseen = 1.0 - 0.05 ** (1.0 / 120.0)
    one, three = np.zeros(120), np.zeros(120)
    one[5], three[:3] = 1.0, (6.0, 12.0, 3.0)
    assert clustered_at_most(np.zeros(120), trials) == pytest.approx(unseen)
    assert clustered_at_most(one, trials) == pytest.approx(unseen), "a hit more makes no bound lower"
    assert clustered_at_most(three, trials) == pytest.approx(rate_at_most(3, 120))
    assert clustered_at_most(trials, trials) == clustered_at_most(np.zeros(0), np.zeros(0)) == 1.0
    assert clustered_at_most(np.zeros(120), trials, 0.9) == pytest.approx(1.0 - 0.1 ** (1.0 / 120.0))


# ---------------------------------------------------------------------------------------------------------------- tests


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


def test_mcnemar_and_fisher_by_their_textbook_examples() -> None:
    assert mcnemar(1, 9) == pytest.approx(22 / 1024)
    assert mcnemar(0, 0) == mcnemar(7, 7) == 1.0
    assert fisher(3, 4, 1, 4) == pytest.approx(34 / 70), "the lady tasting tea"


@pytest.mark.parametrize("count", [1, 5, 12, 40])
def test_signed_ranks_without_ties_are_scipy_s(count: int) -> None:
    moved = np.random.default_rng(count).normal(0.3, 1.0, count)
    assert signed_rank(moved) == pytest.approx(stats.wilcoxon(moved, method="exact").pvalue)


def test_signed_ranks_with_ties_are_all_signs_counted() -> None:
    moved = np.array([1.0, 1.0, -1.0, 2.0, 2.0, 3.0, -3.0, 5.0, 0.0, 0.0])
    expected = stats.wilcoxon(moved[moved != 0.0], method=stats.PermutationMethod()).pvalue
    assert signed_rank(moved) == pytest.approx(expected)
    assert signed_rank(np.zeros(9)) == 1.0


def test_many_signed_ranks_are_the_normal_limit() -> None:
    moved = np.round(np.random.default_rng(3).normal(0.1, 1.0, 300), 1)
    expected = stats.wilcoxon(moved[moved != 0.0], method="asymptotic", correction=False).pvalue
    assert signed_rank(moved) == pytest.approx(expected)


def test_where_nothing_differs_p_values_are_even() -> None:
    """Of each test the share of p-values below a level is no more than that level, and not far less."""
    rng, p_values = np.random.default_rng(5), dict[str, list[float]]()
    for _ in range(200):
        one, other = rng.normal(size=(2, 40))
        p_values.setdefault("signed_rank", []).append(signed_rank(one - other))
        p_values.setdefault("mann_whitney", []).append(mann_whitney(one, other))
        p_values.setdefault("correlation", []).append(rank_correlation(one, other))
        p_values.setdefault("ends", []).append(mann_whitney(ranks_from_the_ends(one)[:5], ranks_from_the_ends(one)[5:]))
    for name, found in p_values.items():
        assert stats.kstest(found, "uniform").pvalue > 0.01, name
    counts = [(int(rng.binomial(50, 0.2)), int(rng.binomial(50, 0.2))) for _ in range(200)]
    for level in (0.05, 0.2):
        assert np.mean([fisher(one, 50, other, 50) <= level for one, other in counts]) <= level
        assert np.mean([mcnemar(one, other) <= level for one, other in counts]) <= level + 0.02


def test_what_is_the_same_throughout_says_nothing() -> None:
    same = np.ones(10)
    assert mann_whitney(same, same) == rank_correlation(same, np.arange(10.0)) == mann_whitney(same, same[:0]) == 1.0


def test_ranks_from_the_ends_by_hand() -> None:
    assert ranks_from_the_ends(np.array([10.0, 30.0, 20.0, 60.0, 50.0, 40.0])).tolist() == [1, 5, 4, 2, 3, 6]
    tied = ranks_from_the_ends(np.array([1.0, 1.0, 2.0, 3.0]))
    assert tied.tolist() == [2.5, 2.5, 3.0, 2.0]


@given(st.lists(st.integers(-5, 5), min_size=1, max_size=30))
def test_ranks_from_the_ends_are_all_ranks(values: list[int]) -> None:
    ranks = ranks_from_the_ends(np.array(values, dtype=float))
    assert ranks.sum() == pytest.approx(len(values) * (len(values) + 1) / 2)


# ----------------------------------------------------------------------------------------------------------- visibility


@pytest.mark.parametrize("other_trials", [None, 100, 300])
@pytest.mark.parametrize("other_hits", [0, 4])
def test_so_many_hits_tell_and_one_fewer_does_not(other_hits: int, other_trials: int | None) -> None:
    level = 0.01
    needed = hits_needed(other_hits, 100, level, other_trials)
    assert needed is not None

    def p(hits: int) -> float:
        return mcnemar(other_hits, hits) if other_trials is None else fisher(hits, 100, other_hits, other_trials)

    assert p(needed) <= level < p(needed - 1)
    rate = rate_that_gives(needed, 100, 0.8)
    assert stats.binom.sf(needed - 1, 100, rate) == pytest.approx(0.8)


def test_few_games_can_tell_nothing() -> None:
    assert hits_needed(0, 4, 0.01, None) is None
    assert hits_needed(0, 3, 0.01, 3) is None
    assert rate_that_gives(0, 10, 0.8) == 0.0
