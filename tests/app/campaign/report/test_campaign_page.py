"""The page of a campaign: whole and safe HTML that says what was found; and the same for programs."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from app.campaign.environment import CampaignEnvironment
from app.campaign.folder import KeptCampaign
from app.campaign.report.analysis.distributions import ProductBar
from app.campaign.report.analysis.rows import CampaignRows, RowTable
from app.campaign.report.charts import _uprights
from app.campaign.report.findings import CampaignFindings, findings
from app.campaign.report.gate import GateBars
from app.campaign.report.page import MOST_FAILURES, campaign_page, repeat_command
from app.campaign.report.sentences import all_sentences, throughput_sentence
from app.campaign.report.summary import summary_json
from app.campaign.report.wording import interval, percent
from app.campaign.spec import CampaignSpec
from app.report.markup import joined
from app.report.plot import PlotArea
from tests.app.campaign.report.synthetic import Columns, campaign, captures_are_slower, dark_rooms_fail
from tests.app.report.test_page import HOSTILE, Walk

GATE = {
    "wrong": {"at_most": 0.001},
    "failed": {"at_most": 0.5},
    "duration": {"quiet": {"quantile": 0.5, "at_most": 2.0}},
    "compare": {"nothing_worse": True},
}


def worse(games: Columns, plies: Columns, rng: np.random.Generator) -> None:
    dark_rooms_fail(games, plies, rng)
    captures_are_slower(games, plies, rng)
    failed = games["outcome"] == "unmended"
    games["reason"][failed] = "the camera saw no board"
    games["outcome"][3], games["reason"][3], games["said"][3] = "crashed", "the worker died twice", "Good game!"


@pytest.fixture(scope="module")
def compared() -> CampaignFindings:
    older = campaign(range(120), 1, name="campaigns/older one")
    return findings(campaign(range(120), 2, worse, "campaigns/newer one"), older, GateBars.model_validate(GATE))


@pytest.fixture(scope="module")
def page(compared: CampaignFindings) -> Walk:
    return Walk(campaign_page(compared))


def test_it_says_how_games_ended_with_bounds(compared: CampaignFindings, page: Walk) -> None:
    count = len(compared.failures)
    assert f"120 games, 4800 plies: {count} failed." in page.said("p")
    assert "No game of 120 was silently wrong: at most 2.47 % are, with 95 % confidence." in page.said("p")
    failed = next(rate for rate in compared.rates if rate.outcome == "failed")
    assert failed.bounds.low < count / 120 < failed.bounds.high
    assert str(count) in page.said("td")


def test_what_holds_up_is_said_and_what_does_not_is_in_the_table(compared: CampaignFindings, page: Walk) -> None:
    said = [text for text in page.said("p") if text.startswith("Failures come where ")]
    assert said[0].startswith("Failures come where randomisation.light_brightness is 0.5")
    assert said[0].endswith("corrected for 6 ranges).")
    held = [one for one in compared.explains_failures if one.holds]
    assert len(said) == len(held)
    rows = [text for text in page.said("th") if text.startswith(("randomisation.", "rig.", "faults."))]
    assert set(rows) >= {one.name for one in compared.explains_failures}


def test_the_comparison_is_told_in_words_and_numbers(page: Walk) -> None:
    said = " ".join(page.said("p"))
    assert "Worse: time of capture plies: 0.0" in said
    assert "Worse: games that failed: " in said
    assert "It sits where randomisation.light_brightness is" in said
    assert "would have been seen with 80 % power" in said
    assert {"worse", "not\u00a0found"} <= set(page.said("td"))


def ended(outcomes: list[str], wanted: int | None = None) -> CampaignRows:
    games = RowTable.of([{"seed": seed, "outcome": outcome} for seed, outcome in enumerate(outcomes)])
    return CampaignRows("x", games, RowTable.of([], ["seed", "ply"]), wanted)


@pytest.mark.parametrize(
    ("wrong", "said"), [(1, "1 of 12 games was silently wrong"), (2, "2 of 12 games were silently")]
)
def test_one_was_and_several_were(wrong: int, said: str) -> None:
    found = findings(ended(["wrong"] * wrong + ["right"] * (12 - wrong)))
    assert any(sentence.startswith(said) for sentence in all_sentences(found))


def test_a_gate_says_that_games_are_still_to_come() -> None:
    found = findings(ended(["right"] * 9, 100), None, GateBars.model_validate({"wrong": {"at_most": 0.5}}))
    assert any(sentence.startswith("Held: so far, games silently wrong: 0 of 9") for sentence in all_sentences(found))
    text = Walk(campaign_page(found)).text
    assert "The one bar is held so far." in text
    done = findings(ended(["right"] * 9, 9), None, GateBars.model_validate({"wrong": {"at_most": 0.5}}))
    assert "so far" not in Walk(campaign_page(done)).text


def test_where_a_change_sits_is_told_once_of_the_same_games() -> None:
    """All that failed ended early: it is one change, and not two."""
    found = findings(campaign(range(120), 2, dark_rooms_fail), campaign(range(120), 1))
    assert found.comparison is not None
    assert {"failed", "unmended"} <= {one.metric.key for one in found.comparison.found}
    page = Walk(campaign_page(found))
    assert [text for text in page.said("summary") if text.endswith(("that failed", "that ended early"))] == [
        "Where it sits: games that ended early"
    ]
    assert "Change of games that failed by randomisation.light_brightness" not in page.text


@pytest.mark.parametrize("bars", [(8.0, 8.4), (15.0, 15.0), (3.0, 3.1, 3.2, 12.0)])
def test_letters_of_near_bars_stand_beside_each_other(bars: tuple[float, ...]) -> None:
    area = PlotArea((0.0, 5.0, 10.0, 15.0), (0.0, 1.0), left=60.0)
    drawn = Walk(joined(_uprights(area, [ProductBar(value, "bar") for value in bars])))
    at = [float(attributes["x"] or 0.0) for attributes in drawn.all("text")]
    assert len(at) == len(bars)
    assert all(after - before >= 9.9 for before, after in pairwise(at))


def test_every_failure_has_its_reason_and_its_command(compared: CampaignFindings, page: Walk) -> None:
    commands = page.said("code")
    assert commands == [
        f"touchmove campaign repeat 'campaigns/newer one' {one.seed} --film" for one in compared.failures
    ]
    assert "The worker died twice. Good game! " in page.said("li")
    assert "The camera saw no board. " in page.said("li")


def test_bars_are_the_product_s_and_the_gate_s(page: Walk) -> None:
    named = page.said("span")
    assert any(": peak of the drives, " in text for text in named)
    assert any(": lets go at " in text for text in named)
    assert {"a", "b"} <= set(page.said("text"))
    assert "a quarter square" in page.text
    assert "2 bars of 4 missed." in page.said("p")
    assert [text for text in page.said("span") if text.endswith(": missed")] == ["wrong: missed", "compare: missed"]


def test_a_smaller_square_is_a_nearer_bar() -> None:
    rows = campaign(range(5), 1)
    few = findings(rows).product_bars["placement"][0].value
    games = {**rows.games.columns, "drawn.rig.square": np.full(5, np.nan)}
    usual = findings(replace(rows, games=RowTable(games))).product_bars["placement"][0].value
    assert few == 45.0 / 4.0
    assert usual != few
    campaign_file = kept("default", "abc").model_copy(update={"spec": CampaignSpec(draw={"rig.square": 55.0})})
    plain = findings(replace(rows, games=RowTable(games), kept=campaign_file)).product_bars["placement"][0]
    assert plain.value == pytest.approx(13.75)


@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_a_bar_has_one_bound_wherever_it_is_said(confidence: float) -> None:
    asked = {"placement": {"quantile": 0.9, "at_most": 0.5, "confidence": confidence}}
    found = findings(campaign(range(30), 1), None, GateBars.model_validate(asked))
    (verdict,) = found.verdicts or ()
    (bound,) = re.findall("at most [0-9.]+ % with [0-9]+ % confidence", verdict.sentence)
    (cell,) = [text for text in Walk(campaign_page(found)).said("td") if "the gate's bar, 90 % within 0.5 mm" in text]
    assert cell.endswith(bound)
    told = json.loads(summary_json(found))["figures"]["placement"]["bars"][-1]
    assert f"at most {percent(told['share_at_most'])} with {percent(told['confidence'])} confidence" == bound


def test_peaks_of_plies_are_not_counted_beyond_a_bar_of_averages() -> None:
    found = findings(campaign(range(5), 1))
    page = Walk(campaign_page(found))
    assert any(": rated, on average" in text for text in page.said("span"))
    assert not any("rated, on average" in text for text in page.said("td"))
    assert len(json.loads(summary_json(found))["figures"]["torque"]["bars"]) == 1


def test_every_chart_has_its_numbers_and_says_what_it_shows(page: Walk) -> None:
    pictures = [one for one in page.all("svg") if one.get("role") == "img"]
    assert len(pictures) >= 6
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert all({one["aria-labelledby"], one["aria-describedby"]} <= set(ids) for one in pictures)
    assert len(page.all("details")) >= len(pictures)
    assert all(head.get("scope") in {"col", "row"} for head in page.all("th"))
    assert len(page.all("caption")) == len(page.all("table"))
    levels = [int(element[1]) for element, _ in page.elements if re.fullmatch(r"h\d", element)]
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_it_needs_nothing_and_runs_nothing(compared: CampaignFindings, page: Walk) -> None:
    text = campaign_page(compared)
    assert not page.all("script") + page.all("link") + page.all("img")
    assert all("style" not in attributes and "src" not in attributes for _, attributes in page.elements)
    assert not re.search(r"url\(|@import", text)
    assert set(re.findall(r"https?://[^\"' ]*", text)) <= {"http://www.w3.org/2000/svg"}
    assert not re.search(r"\bnan\b|\binf\b|None", page.text)
    assert len(text) < 250_000


def with_texts(called: str) -> str:
    rows = campaign(range(30), 1, worse, name=f"campaigns/{called}")
    games = dict(rows.games.columns)
    for name in ("reason", "said", "host", "cpu", "folder", "log"):
        games[name] = np.full(30, called, dtype=object)
    games["drawn.rig.profile"] = np.array([called, "other"] * 15, dtype=object)
    return campaign_page(findings(replace(rows, games=RowTable(games))))


@pytest.mark.parametrize("called", HOSTILE)
def test_words_change_no_markup(called: str) -> None:
    plain, hostile = Walk(with_texts("plain")), Walk(with_texts(called))
    assert [element for element, _ in hostile.elements] == [element for element, _ in plain.elements]
    assert [set(a) for _, a in hostile.elements] == [set(a) for _, a in plain.elements]


@pytest.mark.parametrize("games", [0, 1, 2])
def test_campaigns_that_have_just_begun_have_a_page(games: int) -> None:
    rows = campaign(range(30), 1, worse)
    first = rows.seeds < games
    begun = CampaignRows("x", rows.games.where(first), rows.plies.where(rows.plies.numbers("seed") < games), 1000)
    older = campaign(range(30), 2)
    for found in (findings(begun), findings(begun, older, GateBars.model_validate(GATE)), findings(older, begun)):
        text = Walk(campaign_page(found)).text
        assert not re.search(r"\bnan\b|None", text)
        json.loads(summary_json(found))
    assert f"{games} of 1000 games so far" in Walk(campaign_page(findings(begun))).text


def test_the_older_campaign_is_drawn_whole() -> None:
    """Also with plies of which the newer one has no partner: its moves were other ones."""
    older, newer = campaign(range(30), 1), campaign(range(30), 2)
    moves = np.where(newer.plies.numbers("ply") > 8, "other", newer.plies.words("uci")).astype(np.object_)
    moved = replace(newer, plies=RowTable({**newer.plies.columns, "uci": moves}))
    pages = [campaign_page(findings(rows, older)) for rows in (newer, moved)]
    lines = [re.findall('<path [^>]*class="line two"', page) for page in pages]
    assert len(lines[0]) == 3
    assert lines[0] == lines[1]


def test_many_failures_are_cut_off_and_said() -> None:
    games = [{"seed": seed, "outcome": "unmended", "reason": "left"} for seed in range(MOST_FAILURES + 7)]
    page = Walk(campaign_page(findings(CampaignRows("x", RowTable.of(games), RowTable.of([])))))
    assert len(page.all("code")) == MOST_FAILURES
    assert "7 more are in games.parquet." in page.said("p")


def kept(profile: str, sources: str) -> KeptCampaign:
    environment = CampaignEnvironment(sources=sources, python="3", packages={}, engine="x", files={}, threads={})
    draw = {"rig.profile": profile, "engine.nodes": {"from": 100, "to": 500}}
    return KeptCampaign(games=12, spec=CampaignSpec(title="Slowly", draw=draw), environment=environment)


def test_what_differs_between_the_campaigns_is_said_where_it_is_known() -> None:
    rows = campaign(range(12), 1)
    older, newer = replace(rows, kept=kept("default", "abc")), replace(rows, kept=kept("gentle", "xyz"))
    text = Walk(campaign_page(findings(newer, older))).text
    assert (
        'What differs in this campaign: rig.profile is "gentle" instead of "default"; sources is xyz instead of abc.'
        in text
    )
    assert "Slowly" in text
    assert "Both draw the same, and were played by the same program" in Walk(campaign_page(findings(older, older))).text
    unknown = Walk(campaign_page(findings(rows, older))).text
    assert "What differs" not in unknown
    assert "Both draw" not in unknown


def test_what_only_one_campaign_gives_is_said_so() -> None:
    rows = campaign(range(12), 1)
    plain = kept("default", "abc")
    more = plain.model_copy(update={"spec": CampaignSpec(draw={**plain.spec.draw, "faults.grip": 0.5})})
    for newer, older, said in (
        (more, plain, "What differs in this campaign: faults.grip is given only here, as 0.5."),
        (plain, more, "What differs in this campaign: faults.grip is not given here, and was 0.5."),
    ):
        found = findings(replace(rows, kept=newer), replace(rows, kept=older))
        assert said in all_sentences(found)


def test_how_many_pairs_ended_the_same_is_said_of_none_too(compared: CampaignFindings) -> None:
    assert "No pair ended with the world the same to the last bit." in all_sentences(compared)


def test_captions_and_cells_say_what_they_mean(compared: CampaignFindings, page: Walk) -> None:
    captions = [text for text in page.said("p") if text.startswith("For each value, the share of plies with more")]
    assert len(captions) == 3
    assert not any(":" in caption.partition(": ")[2] for caption in captions)
    assert any("Far beyond the drawing: the referee's bar, a quarter square, " in caption for caption in captions)
    assert "a: rated, on average, 2.4 N m" in page.said("span")
    assert "all\u00a0are\u00a00" in page.said("td"), "of missed ticks there were none"
    assert any(text.startswith("A change is found where p is below 0.05 once") for text in page.said("p"))


def test_what_was_not_measured_is_left_out() -> None:
    found = findings(ended(["right"] * 9))
    text = Walk(campaign_page(found)).text
    assert "No game failed, and nothing was mended or asked in any." in text
    rows = RowTable.of([{"seed": 1, "outcome": "crashed", "wall_s": 3.0, "host": "h", "cpu": "c"}])
    crashed = findings(CampaignRows("x", rows, RowTable.of([], ["seed", "ply"])))
    assert throughput_sentence(crashed) == "1200 games an hour and core: a game took 3 s of a worker."
    assert "0 times" not in Walk(campaign_page(crashed)).text


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (0.194, 0.9937, "19.4 % to 99.4 %"), (0.0, 0.0247, "0 % to 2.5 %"), (0.0, 1.0, "0 % to 100 %"),
        (0.9901, 0.9999, "99.01 % to 99.99 %"), (0.00001, 0.5, "0.001 % to 50.0 %"),
    ],
)  # fmt: skip
def test_both_ends_of_an_interval_have_the_same_decimals(low: float, high: float, said: str) -> None:
    assert interval(low, high) == said


def test_programs_are_told_the_same(compared: CampaignFindings) -> None:
    told = json.loads(summary_json(compared))
    assert told["games"] == 120
    assert told["holds"] is False
    assert told["rates"]["failed"]["games"] == len(told["failures"]) == len(compared.failures)
    assert told["failures"][0]["repeat"] == repeat_command("campaigns/newer one", told["failures"][0]["seed"])
    capture = next(one for one in told["comparison"]["metrics"] if one["metric"] == "duration.capture")
    assert capture["found"]
    assert capture["worse"]
    assert capture["low"] < 0.06 < capture["high"]
    assert [one["bar"] for one in told["gate"] if not one["held"]] == ["wrong", "compare"]
    assert told["figures"]["placement"]["bars"][0]["beyond"] == 0
