"""A gate judges bounds, says each bar in a sentence, and refuses what it does not know."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.campaign.report.analysis.rows import CampaignRows, RowTable
from app.campaign.report.findings import findings
from app.campaign.report.gate import GateBars, GateVerdict, judged, load_bars
from app.settings.toml import ConfigError
from tests.app.campaign.report.synthetic import campaign, captures_are_slower

EXAMPLE = Path("docs/examples/bars.toml")


def gate(text: str) -> GateBars:
    return GateBars.model_validate(tomllib.loads(text))


def one_of(text: str, rows: CampaignRows) -> GateVerdict:
    (verdict,) = judged(gate(text), rows)
    return verdict


def outcomes(**counts: int) -> CampaignRows:
    ends = [outcome for outcome, count in counts.items() for _ in range(count)]
    return CampaignRows("x", RowTable.of([{"seed": n, "outcome": o} for n, o in enumerate(ends)]), RowTable.of([]))


@pytest.mark.parametrize(("games", "held"), [(597, False), (598, True)])
def test_a_rate_is_held_once_so_many_games_show_it(games: int, held: bool) -> None:
    verdict = one_of("[wrong]\nat_most = 0.005", outcomes(right=games))
    assert verdict.held is held
    assert verdict.sentence.startswith(f"games silently wrong: 0 of {games}, so at most 0.5")
    assert verdict.sentence.endswith("the bar is 0.5 %" if held else "which takes 598 games without one")


def test_of_more_games_some_may_fail() -> None:
    bar = "[failed]\nat_most = 0.03\nconfidence = 0.9"
    assert one_of(bar, outcomes(right=491, unmended=8, crashed=1)).held
    missed = one_of(bar, outcomes(right=485, unmended=9, crashed=6))
    assert not missed.held
    assert "15 of 500, so at most 4.2" in missed.sentence
    assert "with 90 % confidence; the bar is 3 %" in missed.sentence
    assert "without one" not in missed.sentence
    assert "without one" not in one_of("[failed]\nat_most = 0.005", outcomes(right=110, wrong=10)).sentence


def test_nothing_can_show_that_something_never_happens() -> None:
    assert "more than any number of games" in one_of("[wrong]\nat_most = 0", outcomes(right=9)).sentence
    assert not one_of("[wrong]\nat_most = 0.5", outcomes()).held


def test_quantiles_are_judged_by_the_share_beyond_them() -> None:
    rows = campaign(range(50), 1)
    times = rows.plies.numbers("real_s")[rows.plies.words("kind") == "quiet"]
    asked = "[duration.quiet]\nquantile = 0.9\nat_most = {:.3f}"
    held, missed = (one_of(asked.format(np.quantile(times, share)), rows) for share in (0.93, 0.905))
    assert held.held
    assert not missed.held, "the share is held, its bound is not"
    assert held.sentence.startswith("quiet plies, from home to home: 90 % of the plies are within 1.4")
    assert f"of {times.size} are beyond" in held.sentence
    assert held.sentence.endswith("the bar is 10 %")


def test_plies_of_few_games_show_no_small_share() -> None:
    """2000 plies of 50 games: two games of a hundred may be bad in each of theirs."""
    verdict = one_of("[placement]\nquantile = 0.99\nat_most = 50", campaign(range(50), 1))
    assert not verdict.held
    assert verdict.sentence.endswith(
        "0 of 2000 are beyond 50 mm, so at most 5.82 % with 95 % confidence; the bar is 1 %, which takes 299 games "
        "without one"
    )


def test_counts_of_games_are_judged_likewise() -> None:
    rows = campaign(range(60), 1)
    assert one_of("[missed_ticks]\nquantile = 0.95\nat_most = 0", rows).held
    verdict = one_of("[repairs]\nquantile = 0.99\nat_most = 0", rows)
    assert not verdict.held
    assert "of 60 are beyond 0" in verdict.sentence


def counts(column: str, **told: tuple[int, float]) -> CampaignRows:
    """Of each outcome so many games, each with so much in a column."""
    rows = [(outcome, value) for outcome, (games, value) in told.items() for _ in range(games)]
    games = [{"seed": seed, "outcome": outcome, column: value} for seed, (outcome, value) in enumerate(rows)]
    return CampaignRows("x", RowTable.of(games), RowTable.of([]))


def test_games_that_ended_early_hold_no_bar_of_counts() -> None:
    """In them less happened; what had happened all the same did."""
    bar = "[repairs]\nquantile = 0.5\nat_most = 2"
    rows = counts("repairs", crashed=(97, 0), mended=(3, 9))
    assert not one_of(bar, rows).held
    assert "3 of 3 are beyond 2" in one_of(bar, rows).sentence
    rows = counts("repairs", right=(60, 0), unmended=(7, 9), crashed=(30, 0))
    assert "50 % of the games played to the end are within 0; 7 of 67 are beyond 2" in one_of(bar, rows).sentence
    assert one_of(bar, rows).held
    assert "none to judge" in one_of(bar, counts("repairs", crashed=(9, 0), unmended=(9, 1))).sentence


def test_what_nobody_measured_holds_no_bar() -> None:
    verdict = one_of("[duration.castling]\nquantile = 0.9\nat_most = 9", outcomes(right=10))
    assert not verdict.held
    assert verdict.sentence == "castling plies, from home to home: there was none to judge"


def test_games_and_comparisons() -> None:
    assert one_of("[games]\nat_least = 10", outcomes(right=10)).held
    assert one_of("[games]\nat_least = 11", outcomes(right=10)).sentence == (
        "10 games were played, at least 11 are wanted"
    )
    bars, older = gate("[compare]\nnothing_worse = true"), campaign(range(40), 1)
    (worse,) = findings(campaign(range(40), 2, captures_are_slower), older, bars).verdicts or ()
    assert not worse.held
    assert worse.sentence == "worse than before: time of capture plies"
    (same,) = findings(campaign(range(40), 2), older, bars).verdicts or ()
    assert same.held
    for rows, before in ((outcomes(), older), (older, outcomes()), (outcomes(), outcomes())):
        (empty,) = findings(rows, before, bars).verdicts or ()
        assert not empty.held, "of no game nothing was worse"
        assert empty.sentence == "there was nothing to compare, as no game is done in 'x': compare again once some are"
    with pytest.raises(ConfigError, match="say which, by --compare"):
        findings(older, None, bars)


def test_a_campaign_holds_by_its_gate_alone_or_without_failures() -> None:
    some = outcomes(right=99, unmended=1)
    assert not findings(some).holds
    assert findings(some, None, gate("[failed]\nat_most = 0.2")).holds
    assert not findings(some, None, gate("[failed]\nat_most = 0.02")).holds
    assert findings(outcomes(right=5, mended=5)).holds


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[wrnog]\nat_most = 0.1", "there is no setting wrnog: did you mean wrong?"),
        ("[wrong]\nat_least = 0.1", "there is no setting wrong.at_least: did you mean at_most?"),
        ("[wrong]", "wrong.at_most is missing: give it a value"),
        ("[wrong]\nat_most = 2.0", "wrong.at_most: it should be less than 1"),
        ("[duration.quite]\nat_most = 2.0", "there is no setting duration.quite: did you mean quiet?"),
        ("[placement]\nquantile = 1.0\nat_most = 2.0", "placement.quantile: it should be less than 1"),
        ("[placement]\nquantile = 0.9\nat_most = nan", "placement.at_most: it should be a finite number"),
        ("", "asks for nothing"),
        ("[duration]", "asks for nothing"),
        ("[compare]\nnothing_worse = false", "asks for nothing"),
        ("[wrong", "is not valid TOML"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "bars.toml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_bars(tmp_path / "bars.toml")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        load_bars(tmp_path / "none.toml")


def test_the_example_holds_every_table_that_there_is() -> None:
    bars = load_bars(EXAMPLE)
    text = EXAMPLE.read_text(encoding="utf-8")
    assert all(name in text for name in GateBars.model_fields)
    assert {figure.key for figure, _ in bars.of_figures()} >= {"duration.quiet", "placement", "missed_ticks"}
    content: dict[str, Any] = tomllib.loads(text)
    assert GateBars.model_validate(content) == bars
