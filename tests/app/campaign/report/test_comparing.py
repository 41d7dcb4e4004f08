"""Two campaigns: what is planted between them is found and placed, and where nothing is planted nothing is found.

Rates that stand here were measured over 200 synthetic pairs of campaigns of 100 games; the tests look at fewer.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app import UserError
from app.campaign.environment import CampaignEnvironment
from app.campaign.folder import KeptCampaign
from app.campaign.report.analysis import comparing
from app.campaign.report.analysis.comparing import matched, with_the_same_plies
from app.campaign.report.analysis.conditions import DrawnRange, drawn_ranges
from app.campaign.report.analysis.explaining import explained, where_a_change_sits
from app.campaign.report.analysis.metrics import FAILED, MetricSort
from app.campaign.report.analysis.rows import CampaignRows, RowTable
from app.campaign.report.analysis.statistics import fisher
from app.campaign.report.findings import CampaignComparison, compared
from app.campaign.report.sentences import comparison_lead, comparison_sentences
from app.campaign.schema import TaskKind
from app.campaign.spec import CampaignSpec
from tests.app.campaign.report.synthetic import (
    Plant,
    blows_are_harder,
    campaign,
    captures_are_slower,
    dark_rooms_fail,
    knights_stand_off,
)


def pair(
    number: int, paired: bool, plant: Plant | None = None, games: int = 100, length: int = 40
) -> tuple[CampaignRows, CampaignRows]:
    """An older and a newer campaign, of the same seeds or of others."""
    first = 1000 * number
    seeds = range(first, first + games) if paired else range(first + 500, first + 500 + games)
    older = campaign(range(first, first + games), 2 * number, name="old", length=length)
    return older, campaign(seeds, 2 * number + 1, plant, length=length)


def comparisons(count: int, paired: bool, plant: Plant) -> list[CampaignComparison]:
    return [compared(*pair(number, paired, plant)) for number in range(count)]


def found_in(comparison: CampaignComparison, metric: str) -> bool:
    return any(change.metric.key == metric and change.worse for change in comparison.found)


def named_in(comparison: CampaignComparison, metric: str) -> set[str]:
    return {one.name for change in comparison.found if change.metric.key == metric for one in change.where if one.holds}


@pytest.mark.parametrize(("paired", "count"), [(True, 200), (False, 60)])
def test_without_a_difference_at_most_one_comparison_in_twenty_finds_one(paired: bool, count: int) -> None:
    """Of 600 pairs of campaigns of 100 games it was 1.8 % in pairs and 1.3 % of other seeds."""
    alarms = 0
    for number in range(count):
        match = with_the_same_plies(matched(*pair(number, paired, games=30, length=8)))
        alarms += any(one.corrected < 0.05 for one in comparing.tested(match))
    assert alarms <= 0.05 * count


def test_a_planted_failure_is_found_and_its_range_named() -> None:
    """Found, and the range named, in 174 of 200 pairs of campaigns (181 of other seeds)."""
    found = [one for one in comparisons(6, True, dark_rooms_fail) if found_in(one, "failed")]
    assert len(found) >= 4
    assert all("randomisation.light_brightness" in named_in(one, "failed") for one in found)
    change = next(change for change in found[0].found if change.metric.key == "failed")
    place = next(one for one in change.where if one.holds)
    assert place.standing_out is place.groups[0], "the darkest"


def test_planted_figures_are_found_at_their_size() -> None:
    slower = comparisons(4, True, captures_are_slower)
    assert all(found_in(one, "duration.capture") for one in slower)
    assert not any(found_in(one, "duration.quiet") for one in slower)
    for one in slower:
        change = next(change for change in one.found if change.metric.key == "duration.capture")
        assert change.estimate.low < 0.06 < change.estimate.high
    harder = comparisons(4, False, blows_are_harder)
    assert all(found_in(one, "force") for one in harder)


@pytest.mark.parametrize("paired", [True, False])
def test_of_so_few_games_that_nothing_can_be_found_it_is_not_said_what_would_have_been(paired: bool) -> None:
    """Three games of either campaign: the surest that there is has p = 0.1, or in pairs 0.25."""

    def slower(games: dict[str, np.ndarray], plies: dict[str, np.ndarray], rng: np.random.Generator) -> None:
        plies["real_s"] = plies["real_s"] + 5.0

    comparison = compared(*pair(1, paired, slower, games=3))
    assert not comparison.found
    assert all(one.visible is None for one in comparison.changes if one.metric.sort is not MetricSort.RATE)
    said = " ".join(comparison_sentences(comparison))
    assert "There are too few games for a change of these to be found, however large: " in said
    assert "would have been seen with 80 % power: time" not in said


def test_a_piece_and_a_range_are_named() -> None:
    def strongly(games: dict[str, np.ndarray], plies: dict[str, np.ndarray], rng: np.random.Generator) -> None:
        for _ in range(4):
            knights_stand_off(games, plies, rng)

    for paired in (True, False):
        for one in comparisons(3, paired, strongly):
            assert found_in(one, "placement")
            assert named_in(one, "placement") >= {"randomisation.friction", "the piece"}


def test_what_is_better_is_said_to_be() -> None:
    older, newer = pair(1, True, captures_are_slower)
    (change,) = [one for one in compared(newer, older).found if one.metric.key == "duration.capture"]
    assert not change.worse
    said = comparison_sentences(compared(newer, older))
    assert said[0].startswith("Better: time of capture plies: 0.0")


def test_games_that_fail_are_told_before_a_surer_change_of_a_figure() -> None:
    def both(games: dict[str, np.ndarray], plies: dict[str, np.ndarray], rng: np.random.Generator) -> None:
        captures_are_slower(games, plies, rng)
        dark_rooms_fail(games, plies, rng)

    older, newer = pair(1, True, both)
    found = compared(older, newer).found
    assert [one.metric.key for one in found][:2] == ["failed", "unmended"]
    assert found[0].corrected > min(one.corrected for one in found)
    assert not compared(newer, older).found[0].worse, "fewer failures are no news to begin with"


@pytest.mark.parametrize("paired", [True, False])
def test_games_that_end_early_are_no_better_for_what_did_not_happen_in_them(paired: bool) -> None:
    def with_repairs(rows: CampaignRows, early: np.ndarray) -> CampaignRows:
        """In every whole game something was mended, twice; none had time for it in those that ended early."""
        happened = {
            "outcome": np.where(early, "unmended", "mended").astype(np.object_),
            **{column: np.where(early, 0.0, 2.0) for column in ("repairs", "asked", "grips_lost", "peak_force_N")},
        }
        return replace(rows, games=RowTable({**rows.games.columns, **happened}))

    older, newer = pair(1, paired)
    half = np.arange(100) % 2 == 0
    comparison = compared(with_repairs(older, np.zeros(100, bool)), with_repairs(newer, half))
    assert {one.metric.key for one in comparison.found} == {"failed", "unmended"}
    assert all(one.worse for one in comparison.found)


def test_the_same_campaign_again_is_the_same_to_the_last_bit() -> None:
    older = campaign(range(30), 1)
    comparison = compared(older, campaign(range(30), 1))
    assert comparison.changes == ()
    assert comparison.match.alike == 30
    assert "30 pairs ended with the world the same to the last bit." in comparison_lead(comparison)
    said = " ".join(comparison_sentences(comparison))
    assert "No difference was found in anything: every figure is the same." in said
    assert "games silently wrong" in said
    assert "would have been seen with 80 % power" in said


def test_pairs_are_games_of_one_seed_and_the_rest_is_left_out_and_said() -> None:
    comparison = compared(campaign(range(40), 1), campaign(range(10, 60), 2))
    assert comparison.match.paired
    assert comparison.match.older.seeds.tolist() == comparison.match.newer.seeds.tolist() == list(range(10, 40))
    assert comparison.match.left_out == 30
    assert any(sentence.startswith("30 games of either campaign") for sentence in comparison_lead(comparison))


def test_with_few_seeds_in_both_they_are_two_samples() -> None:
    match = matched(campaign(range(40), 1), campaign(range(30, 70), 2))
    assert not match.paired
    assert len(match.older.games) == len(match.newer.games) == 40


def test_only_the_same_moves_are_held_against_each_other() -> None:
    """Where a move is another one, its time is another move's."""
    older, newer = campaign(range(10), 1), campaign(range(10), 1)
    uci = newer.plies.words("uci").copy()
    real = newer.plies.numbers("real_s").copy()
    uci[5:], real[5:] = "other", 9.0
    plies = RowTable({**newer.plies.columns, "uci": uci, "real_s": real})
    match = with_the_same_plies(matched(older, replace(newer, plies=plies)))
    assert len(match.older.plies) == len(match.newer.plies) == 5
    assert comparing.tested(match) == ()


@pytest.mark.parametrize("worse", [True, False])
def test_a_ply_that_could_not_be_measured_makes_nothing_faster(worse: bool) -> None:
    """The slowest capture of each game was put right on the way in one campaign, and has no time there."""
    older = campaign(range(40), 1)
    real = older.plies.numbers("real_s").copy()
    captures = np.where(older.plies.words("kind") == "capture", real, -np.inf).reshape(40, -1)
    real[np.arange(40) * captures.shape[1] + captures.argmax(axis=1)] = np.nan
    newer = replace(older, plies=RowTable({**older.plies.columns, "real_s": real}))
    sides = (older, newer) if worse else (newer, older)
    assert compared(*sides).changes == ()


def test_where_a_change_sits_is_found_in_plies_that_both_have_measured() -> None:
    """All take 0.1 s longer; only the quick ones of knights, and the slow ones of the others, have a time."""
    older, newer = campaign(range(40), 1), campaign(range(40), 2)
    real, quiet = newer.plies.numbers("real_s") + 0.1, newer.plies.words("kind") == "quiet"
    knight = np.isin(newer.plies.words("piece"), ("N", "n"))
    real[quiet & (knight == (real > 1.4))] = np.nan
    comparison = compared(older, replace(newer, plies=RowTable({**newer.plies.columns, "real_s": real})))
    (change,) = [one for one in comparison.found if one.metric.key == "duration.quiet"]
    assert change.estimate.value == pytest.approx(0.1, abs=0.02)
    assert "the piece" not in {one.name for one in change.where if one.holds}


@pytest.mark.parametrize("column", ["kind", "piece", "by"])
def test_plies_of_another_kind_piece_or_hand_are_not_held_against_each_other(column: str) -> None:
    older, newer = campaign(range(10), 1), campaign(range(10), 1)
    real, other = newer.plies.numbers("real_s").copy(), newer.plies.words(column).copy()
    real[:5], other[:5] = 9.0, "other"
    plies = RowTable({**newer.plies.columns, "real_s": real, column: other})
    assert compared(older, replace(newer, plies=plies)).changes == ()


def nothing() -> CampaignRows:
    return CampaignRows("none", RowTable.of([], ["seed", "outcome"]), RowTable.of([], ["seed", "ply"]))


@pytest.mark.parametrize(
    ("older", "newer", "empty"),
    [(nothing(), campaign(range(5), 1), "'none'"), (campaign(range(5), 1), nothing(), "'none'"),
     (nothing(), replace(nothing(), name="new"), "'none' and 'new'")],
)  # fmt: skip
def test_without_a_game_there_is_nothing_to_compare(older: CampaignRows, newer: CampaignRows, empty: str) -> None:
    comparison = compared(older, newer)
    assert comparison.changes == ()
    assert comparison_lead(comparison)[0] == f"{len(older.games)} older games and {len(newer.games)} newer."
    assert comparison_sentences(comparison) == [
        f"There was nothing to compare, as no game is done in {empty}: compare again once some are."
    ]


def test_a_pair_of_which_nothing_is_known_is_not_one_without_a_change() -> None:
    """How many games were mended is counted among those that went right: those that failed stand in no group."""
    older, newer = pair(1, True)
    light = newer.games.numbers("drawn.randomisation.light_brightness")
    ends = np.where(light > 1.2, "mended", np.where(light < 0.7, "crashed", "right")).astype(np.object_)
    before = RowTable({**older.games.columns, "outcome": np.full(100, "right", dtype=np.object_)})
    after = RowTable({**newer.games.columns, "outcome": ends})
    comparison = compared(replace(older, games=before), replace(newer, games=after))
    (change,) = [one for one in comparison.found if one.metric.key == "mended"]
    assert {sum(group.games for group in one.groups) for one in change.where} == {int(np.sum(light >= 0.7))}


def with_file(rows: CampaignRows, kind: TaskKind, **draw: object) -> CampaignRows:
    environment = CampaignEnvironment(sources="abc", python="3", packages={}, engine="", files={}, threads={})
    spec = CampaignSpec(kind=kind, draw={name.replace("_", "."): value for name, value in draw.items()})
    return replace(rows, kept=KeptCampaign(games=len(rows.games), spec=spec, environment=environment))


def test_games_are_not_compared_with_sessions() -> None:
    older, newer = campaign(range(5), 1, name="old"), campaign(range(5), 2)
    session = RowTable({**older.games.columns, "kind": np.full(5, "session", dtype=np.object_)})
    for other in (with_file(older, TaskKind.SESSION), replace(older, games=session)):
        with pytest.raises(UserError, match=r"'new' is .* kind game, and 'old' one of kind session: compare two of"):
            compared(other, newer)


def test_what_grows_with_games_is_not_compared_where_they_are_longer() -> None:
    older, newer = campaign(range(30), 1, length=10), campaign(range(30), 2, blows_are_harder)
    files = [with_file(rows, TaskKind.GAME, game_plies=plies) for rows, plies in ((older, 10), (newer, 40))]
    comparison = compared(*files)
    keys = {one.metric.key for one in comparison.changes} | {one.key for one in comparison.same}
    assert not keys & {"repairs", "asked", "grips_lost", "placement_max_mm", "peak_force_N", "peak_torque_Nm"}
    assert {"force", "failed"} <= keys
    assert any("another number of plies" in sentence for sentence in comparison_lead(comparison))
    assert "peak_force_N" in {one.metric.key for one in compared(older, newer).changes}


def test_an_engine_that_is_none_has_a_word() -> None:
    older = with_file(campaign(range(5), 1), TaskKind.GAME)
    assert older.kept is not None
    plays = older.kept.environment.model_copy(update={"engine": "Stockfish 15.1"})
    newer = replace(older, kept=older.kept.model_copy(update={"environment": plays}))
    assert compared(older, newer).differences == ("engine is Stockfish 15.1 instead of none",)


# ----------------------------------------------------------------------------------------------- what explains failures


def test_failures_that_depend_on_nothing_are_explained_in_one_campaign_of_twenty() -> None:
    rng, named = np.random.default_rng(4), 0
    ranges = [drawn_ranges(campaign(range(100 * number, 100 * number + 100), number)) for number in range(8)]
    for number in range(120):
        named += any(one.holds for one in explained(rng.random(100) < 0.12, ranges[number % 8]))
    assert named <= 0.05 * 120


def in_groups(sizes: tuple[int, ...]) -> DrawnRange:
    """Words of which so many games have each."""
    group = np.repeat(np.arange(len(sizes)), sizes)
    return DrawnRange("the machine", None, group, tuple("abc"[: len(sizes)]))


def test_the_group_that_is_named_is_the_one_that_the_p_value_is_of() -> None:
    """One game in one of a group is a rate of 100 %, and next to no evidence."""
    failed = np.concatenate([[True], np.arange(49) < 10, np.zeros(50, bool)])
    (one,) = explained(failed, [in_groups((1, 49, 50))])
    assert one.standing_out.label == "b"
    assert one.p == pytest.approx(3.0 * fisher(10, 49, 1, 51))
    (rare,) = explained(np.concatenate([[True], np.arange(99) < 10]), [in_groups((1, 99))])
    assert rare.p == pytest.approx(fisher(1, 1, 10, 99)), "two groups are one test"
    assert not rare.holds


def test_where_nothing_differs_no_group_is_named() -> None:
    (same,) = explained(np.ones(20, bool), [in_groups((5, 15))])
    assert same.p == 1.0


def test_of_two_samples_the_group_named_is_the_surest_too() -> None:
    """In a group of four games the change is large by chance, in one of a hundred it is there."""
    rng = np.random.default_rng(2)
    older, newer = rng.normal(size=(2, 100))
    newer[50:] += 1.2
    older[:2], newer[:2] = -1.0, 1.0
    both = in_groups((2, 48, 50))
    (one,) = where_a_change_sits(older, newer, [replace(both, group=np.tile(both.group, 2))], 1.0)
    assert one.groups[0].value > one.groups[2].value
    assert one.standing_out.label == "c"
    assert one.holds


@pytest.mark.parametrize("rate", [None, 0.05, 0.2])
def test_groups_of_any_size_are_named_by_chance_in_one_of_twenty(rate: float | None) -> None:
    """Of 800 it was 2 to 5 %; by one test of all groups together it had been up to 8 %."""
    rng, named = np.random.default_rng(6), 0
    for _ in range(200):
        group = rng.choice(3, 200, p=(0.04, 0.48, 0.48))
        values = rng.normal(size=200) if rate is None else (rng.random(200) < rate).astype(float)
        found = where_a_change_sits(values[:100], values[100:], [DrawnRange("x", None, group, ("a", "b", "c"))], 1.0)
        named += any(one.holds for one in found)
    assert named <= 0.06 * 200


@pytest.mark.parametrize("where", ["low", "high", "ends", "middle", "category"])
def test_the_range_that_failures_come_in_is_named(where: str) -> None:
    rows = campaign(range(200), 3)
    light, profile = rows.games.numbers("drawn.randomisation.light_brightness"), rows.games.words("drawn.rig.profile")
    inside = {
        "low": light < 0.7,
        "high": light > 1.3,
        "ends": np.abs(light - 1.0) > 0.4,
        "middle": np.abs(light - 1.0) < 0.1,
        "category": profile == "fast",
    }[where]
    failed = inside & (np.random.default_rng(1).random(200) < 0.6)
    first, second = explained(failed, drawn_ranges(rows))[:2]
    assert first.name == ("rig.profile" if where == "category" else "randomisation.light_brightness")
    assert first.holds
    assert not second.holds
    assert first.both_ends == (where == "ends")
    expected = {"low": (0,), "high": (4,), "ends": (0, 4), "middle": (2,), "category": (1,)}
    assert first.most in expected[where]


def test_ranges_that_do_not_vary_or_are_other_in_each_game_are_left_out() -> None:
    rows = campaign(range(60), 3)
    fens = np.array([f"position {number}" for number in range(60)], dtype=object)
    games = {**rows.games.columns, "drawn.fen": fens, "drawn.rig.pads": np.full(60, "flat", dtype=object)}
    names = [one.name for one in drawn_ranges(replace(rows, games=RowTable(games)))]
    assert "fen" not in names
    assert "rig.pads" not in names
    assert "the kind of game" not in names
    assert len(names) == 6


def test_values_that_were_not_drawn_belong_to_no_group() -> None:
    rows = campaign(range(60), 3)
    grip = rows.games.numbers("drawn.faults.grip").copy()
    grip[:20] = np.nan
    games = RowTable({**rows.games.columns, "drawn.faults.grip": grip})
    (drawn,) = [one for one in drawn_ranges(replace(rows, games=games)) if one.name == "faults.grip"]
    assert drawn.group[:20].tolist() == [-1] * 20
    assert np.bincount(drawn.group[20:]).tolist() == [8] * 5
    failed = np.arange(60) < 20
    assert all(one.standing_out.games <= 8 for one in explained(failed, [drawn]))


def test_failed_outcomes_are_those_that_are_not_right() -> None:
    rows = CampaignRows("x", RowTable.of([{"seed": n, "outcome": o} for n, o in enumerate(
        ("right", "mended", "unmended", "wrong", "crashed"))]), RowTable.of([]))  # fmt: skip
    assert rows.outcome_is(*FAILED).tolist() == [False, False, True, True, True]
