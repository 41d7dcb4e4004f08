"""Rows are read from ledgers, shards put together, or from Parquet, and what is no campaign is said in one sentence."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from app import UserError
from app.campaign.report.findings import findings
from app.campaign.report.page import campaign_page
from app.campaign.report.reading import CampaignRowsError, read_rows
from app.campaign.schema import GameRow, PlyRow, TaskKind, TaskOutcome, TaskResult


def result(seed: int, outcome: TaskOutcome = TaskOutcome.RIGHT, plies: int = 2) -> TaskResult:
    game = GameRow(
        index=seed, seed=seed, kind=TaskKind.GAME, outcome=outcome, reason="ply limit", plies=plies, environment="abc",
        host="here", cpu="one", wall_s=3.0, sim_s=9.0,
        drawn={"rig.profile": "fast", "randomisation.friction": 0.5 + seed},
    )  # fmt: skip
    rows = [
        PlyRow(
            index=seed, seed=seed, ply=ply, san="e4", uci="e2e4", kind="quiet", by="arm", piece="P", planned_s=1.2,
            real_s=1.3, error_mm=None if ply == 1 else 0.25, peak_torque_Nm=3.0, peak_force_N=6.0, physical_ok=True,
            transfers=1, repairs=0,
        )
        for ply in range(1, plies + 1)
    ]  # fmt: skip
    return TaskResult(game=game, plies=tuple(rows))


def write(path: Path, results: list[TaskResult], torn: str = "") -> None:
    path.write_text("".join(f"{one.model_dump_json()}\n" for one in results) + torn)


def test_shards_are_put_together_in_the_order_of_seeds(tmp_path: Path) -> None:
    write(tmp_path / "results-1-of-2.jsonl", [result(4), result(0, TaskOutcome.WRONG)])
    write(tmp_path / "results-2-of-2.jsonl", [result(1), result(4, TaskOutcome.CRASHED)], torn='{"game": {"index": 9')
    rows = read_rows(tmp_path)
    assert rows.seeds.tolist() == [0, 1, 4], "what two hold counts once, what is cut off not at all"
    assert rows.outcome_is("wrong").tolist() == [True, False, False]
    assert rows.games.numbers("drawn.randomisation.friction").tolist() == [0.5, 1.5, 4.5]
    assert rows.games.words("drawn.rig.profile").tolist() == ["fast"] * 3
    assert rows.plies.numbers("ply").tolist() == [1, 2] * 3
    assert np.isnan(rows.plies.numbers("error_mm")).tolist() == [True, False] * 3
    assert rows.game_of_plies().tolist() == [0, 0, 1, 1, 2, 2]


def test_parquet_says_the_same(tmp_path: Path) -> None:
    results = [result(0), result(1, TaskOutcome.UNMENDED), result(2)]
    (tmp_path / "ledger").mkdir()
    (tmp_path / "tables").mkdir()
    write(tmp_path / "ledger" / "results.jsonl", results)
    games = pyarrow.Table.from_pylist([one.game.columns() for one in results])
    plies = pyarrow.Table.from_pylist([ply.columns() for one in results for ply in one.plies])
    parquet.write_table(games, tmp_path / "tables" / "games.parquet")
    parquet.write_table(plies, tmp_path / "tables" / "plies.parquet")
    ledger, tables = (read_rows(tmp_path / name) for name in ("ledger", "tables"))
    assert set(ledger.games.columns) >= set(tables.games.columns)
    for name in tables.games.columns:
        assert ledger.games.words(name).tolist() == tables.games.words(name).tolist(), name
        np.testing.assert_array_equal(ledger.games.numbers(name), tables.games.numbers(name), name)
    for name in tables.plies.columns:
        np.testing.assert_array_equal(ledger.plies.numbers(name), tables.plies.numbers(name), name)
    pages = [campaign_page(findings(rows)).replace(rows.name, "X") for rows in (ledger, tables)]
    assert pages[0].replace("ledger", "tables") == pages[1]


def test_what_is_no_campaign_is_said(tmp_path: Path) -> None:
    with pytest.raises(CampaignRowsError, match=r"there is no result of a campaign in .*: name a folder"):
        read_rows(tmp_path)
    (tmp_path / "games.parquet").write_bytes(b"no parquet")
    with pytest.raises(CampaignRowsError, match=r"games.parquet' cannot be read as Parquet: .*: make it again"):
        read_rows(tmp_path)


def table_of(rows: list[dict[str, Any]], file: Path) -> None:
    parquet.write_table(pyarrow.Table.from_pylist(rows), file)


def test_a_table_that_holds_something_else_is_named(tmp_path: Path) -> None:
    """Without outcomes none would have failed."""
    one = result(0)
    plies = [ply.columns() for ply in one.plies]
    table_of(plies, tmp_path / "games.parquet")
    table_of(plies, tmp_path / "plies.parquet")
    with pytest.raises(CampaignRowsError, match=r"games.parquet' has no column outcome"):
        read_rows(tmp_path)
    table_of([one.game.columns()], tmp_path / "games.parquet")
    table_of([{name: value for name, value in ply.items() if name != "real_s"} for ply in plies],
             tmp_path / "plies.parquet")  # fmt: skip
    with pytest.raises(CampaignRowsError, match=r"plies.parquet' has no column real_s"):
        read_rows(tmp_path)
    table_of([one.game.columns() | {"repairs": [1, 2]}], tmp_path / "games.parquet")
    with pytest.raises(CampaignRowsError, match=r"column repairs of list<.*, which is neither numbers nor words"):
        read_rows(tmp_path)


@pytest.mark.parametrize(
    ("column", "values", "said"),
    [
        (
            "outcome",
            [None, "right"],
            "has a game without an outcome, and there are right, mended, unmended, wrong, cra",
        ),
        ("outcome", [1, 1], "has a game without an outcome"),
        ("outcome", ["right", "Wrong"], "has a game of outcome 'Wrong', and there are right, mended, unmended, wrong"),
        ("seed", [None, 1], "has 1 row whose seed is no whole number from 0"),
        ("seed", ["0", "1"], "has 2 rows whose seed is no whole number from 0"),
        ("seed", [0.5, 1.0], "has 1 row whose seed is no whole number from 0"),
        ("seed", [-1, 1], "has 1 row whose seed is no whole number from 0"),
        ("seed", [1, 1], "has more than one game of seed 1"),
        ("plies", [2, 3], "plies.parquet' has 2 plies of seed 1, and games.parquet says 3"),
        ("seed", [0, 7], "plies.parquet' has 0 plies of seed 7, and games.parquet says 2"),
    ],
)
def test_a_table_of_games_is_believed_only_so_far(tmp_path: Path, column: str, values: list[Any], said: str) -> None:
    """An outcome that there is not would not count as failed, and a game that is there twice would count twice."""
    results = [result(0), result(1)]
    games = [one.game.columns() | {column: value} for one, value in zip(results, values, strict=True)]
    table_of(games, tmp_path / "games.parquet")
    table_of([ply.columns() for one in results for ply in one.plies], tmp_path / "plies.parquet")
    with pytest.raises(CampaignRowsError, match=re.escape(said)) as caught:
        read_rows(tmp_path)
    assert "again from the ledger" in str(caught.value)


def test_plies_that_are_there_twice_or_of_no_game_are_named(tmp_path: Path) -> None:
    plies = [ply.columns() for seed in (0, 1) for ply in result(seed).plies]
    table_of([result(0).game.columns()], tmp_path / "games.parquet")
    for rows, said in (
        (plies[:2] * 2, "has 4 plies of seed 0, and games.parquet says 2: make both again"),
        (plies, "has 2 plies of seed 1, and games.parquet says 0: make both again"),
        ([plies[0], plies[1] | {"seed": None}], "plies.parquet' has 1 row whose seed is no whole number"),
    ):
        table_of(rows, tmp_path / "plies.parquet")
        with pytest.raises(CampaignRowsError, match=re.escape(said)):
            read_rows(tmp_path)


def test_the_worst_placement_of_a_game_is_the_arm_s(tmp_path: Path) -> None:
    """A person puts pieces down as they like."""
    two, hands = result(0, plies=3), result(1)
    by = [two.plies[1].model_copy(update={"by": "hand", "error_mm": 7.0}), two.plies[2]]
    nobody = [ply.model_copy(update={"by": "hand", "error_mm": 5.0}) for ply in hands.plies]
    worst = {"placement_max_mm": 7.0}
    write(tmp_path / "results.jsonl", [
        TaskResult(game=two.game.model_copy(update=worst), plies=(two.plies[0], *by)),
        TaskResult(game=hands.game.model_copy(update=worst), plies=tuple(nobody)),
        TaskResult(game=result(2, plies=0).game),
    ])  # fmt: skip
    np.testing.assert_array_equal(read_rows(tmp_path).games.numbers("placement_max_mm"), [0.25, np.nan, np.nan])


def test_a_table_that_is_missing_is_said_to_be(tmp_path: Path) -> None:
    table_of([result(0).game.columns()], tmp_path / "games.parquet")
    with pytest.raises(CampaignRowsError, match=r"plies.parquet' is missing"):
        read_rows(tmp_path)


def test_a_line_of_another_version_is_named(tmp_path: Path) -> None:
    line = json.loads(result(0).model_dump_json())
    line["game"]["schema_version"] = 2
    (tmp_path / "results.jsonl").write_text(result(1).model_dump_json() + "\n" + json.dumps(line) + "\n")
    with pytest.raises(UserError, match=r"line 2 is of version 2 and not 1: read it with"):
        read_rows(tmp_path)


def test_tables_of_a_newer_version_are_refused(tmp_path: Path) -> None:
    games = [result(0).game.columns() | {"schema_version": 2}]
    parquet.write_table(pyarrow.Table.from_pylist(games), tmp_path / "games.parquet")
    with pytest.raises(CampaignRowsError, match="is of a newer version than 1: read it with the one"):
        read_rows(tmp_path)
