"""How large a difference is: intervals hold as often as they say, and what is called visible is seen as often."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.campaign.report.analysis.effects import (
    EffectEstimate,
    mean_change,
    paired_rate_change,
    paired_shift,
    rate_change,
    unpaired_shift,
    visible_mean_change,
    visible_paired_shift,
    visible_shift,
)
from app.campaign.report.analysis.statistics import mann_whitney, signed_rank


def test_shifts_by_hand() -> None:
    assert paired_shift(np.array([1.0, 2.0, 6.0])).value == 2.75
    assert unpaired_shift(np.array([1.0, 2.0]), np.array([4.0, 8.0])).value == 4.5


def test_newcombe_s_interval_of_pairs_is_that_of_his_method_10() -> None:
    """Against an independent implementation; 3 pairs have both, 1 only the older, 6 only the newer."""
    older, newer = np.repeat([1, 1, 0, 0], (3, 1, 6, 90)) > 0, np.repeat([1, 0, 1, 0], (3, 1, 6, 90)) > 0
    found = paired_rate_change(older, newer)
    assert found == pytest.approx((0.05, -0.0074, 0.1169), abs=5e-5)


def pairs_of_one_game(rng: np.random.Generator) -> EffectEstimate:
    """Half of what fails in the newer one failed in the older one, too."""
    older = rng.random(100) < 0.1
    return paired_rate_change(older, older | (rng.random(100) < 0.1 / 0.9))


@pytest.mark.parametrize(
    ("estimate", "truth"),
    [
        (lambda rng: paired_shift(rng.standard_t(3, 40) + 0.5), 0.5),
        (lambda rng: unpaired_shift(rng.exponential(1.0, 40), rng.exponential(1.0, 60) + 0.5), 0.5),
        (lambda rng: mean_change(rng.poisson(0.3, 80) - rng.poisson(0.1, 80).astype(float), None), 0.2),
        (lambda rng: mean_change(rng.normal(1.0, 1.0, 50), rng.normal(1.5, 2.0, 70)), 0.5),
        (lambda rng: rate_change(rng.random(100) < 0.05, rng.random(80) < 0.15), 0.1),
        (pairs_of_one_game, 0.1),
    ],
    ids=["pairs", "samples", "counts", "means", "rates", "rates of pairs"],
)
def test_intervals_hold_in_19_of_20(estimate: Callable[[np.random.Generator], EffectEstimate], truth: float) -> None:
    rng = np.random.default_rng(8)
    found = [estimate(rng) for _ in range(200)]
    assert all(one.low <= one.value <= one.high for one in found)
    assert 0.91 * 200 <= sum(one.low <= truth <= one.high for one in found) <= 0.995 * 200


def test_rates_without_hits_have_an_interval() -> None:
    nothing = np.zeros(100, dtype=bool)
    for estimate in (rate_change(nothing, nothing), paired_rate_change(nothing, nothing)):
        assert estimate.value == 0.0
        assert -0.06 < estimate.low < 0.0 < estimate.high < 0.06


def test_the_same_rows_give_the_same_interval() -> None:
    figures = np.random.default_rng(2).normal(size=3000)
    assert mean_change(figures, None) == mean_change(figures, None)
    assert paired_shift(figures) == paired_shift(figures), "of which only some are looked at"


def test_what_is_called_visible_is_seen_four_times_of_five() -> None:
    rng, seen = np.random.default_rng(9), {"pairs": 0, "samples": 0, "means": 0}
    level = 0.01
    for _ in range(200):
        apart, older, newer = rng.normal(size=(3, 60))
        shift = visible_paired_shift(apart, level)
        assert shift is not None
        seen["pairs"] += signed_rank(rng.normal(shift, 1.0, 60)) <= level
        shift = visible_shift(older, newer, level)
        assert shift is not None
        seen["samples"] += mann_whitney(older, rng.normal(shift, 1.0, 60)) <= level
        seen["means"] += signed_rank(rng.normal(visible_mean_change(apart, None, level), 1.0, 60)) <= level
    for name, count in seen.items():
        assert 0.68 * 200 <= count <= 0.92 * 200, name


def test_with_few_games_nothing_would_have_been_seen() -> None:
    assert visible_paired_shift(np.array([0.1, 0.2, -0.1]), 0.01) is None
    assert visible_shift(np.array([0.1, 0.2]), np.array([0.3, 0.1]), 0.01) is None
    assert visible_shift(np.array([]), np.array([0.3]), 0.01) is None
