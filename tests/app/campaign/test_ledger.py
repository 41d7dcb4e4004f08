from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from app.campaign.ledger import Ledger, LedgerError, Shard, results_in
from app.campaign.schema import GameRow, PlyRow, TaskKind, TaskOutcome, TaskResult
from app.campaign.spec import CampaignSpec
from app.campaign.tables import arrow_schema, write_tables
from app.records import RecordError

SPEC = CampaignSpec.model_validate({
    "draw": {
        "engine.nodes": {"from": 1, "to": 9}, "rig.profile": {"one_of": ["default", "fast"]},
        "start.line": {"one_of": [True, False]},
    },
})  # fmt: skip


def result(index: int, plies: int = 2, **game: object) -> TaskResult:
    row = {
        "index": index, "seed": 100 + index, "kind": TaskKind.GAME, "outcome": TaskOutcome.RIGHT,
        "reason": "é \u2028 \"",
        "environment": "e", "host": "h", "cpu": "c", "placement_mean_mm": 0.1 + 0.2,
        "drawn": {"engine.nodes": 3.0, "rig.profile": "fast", "start.line": 1.0}, **game,
    }  # fmt: skip
    ply = {"index": index, "seed": 100 + index, "san": "e4", "uci": "e2e4", "kind": "quiet", "by": "arm", "piece": "P",
           "planned_s": 1.1, "real_s": None, "error_mm": 1e-17, "peak_torque_Nm": 1.0, "peak_force_N": 1.0,
           "physical_ok": None, "transfers": 1, "repairs": 0}  # fmt: skip
    return TaskResult(
        game=GameRow.model_validate(row),
        plies=tuple(PlyRow.model_validate({**ply, "ply": n + 1}) for n in range(plies)),
    )


def test_what_was_added_is_read_back_the_same_and_nothing_twice(tmp_path: Path) -> None:
    path, given_ = tmp_path / "results.jsonl", [result(3), result(0, 0), result(7)]
    with Ledger(path) as ledger:
        assert [ledger.add(one) for one in [*given_, result(3, reason="again")]] == [True, True, True, False]
    assert list(results_in(path)) == given_
    with Ledger(path) as ledger:
        assert ledger.done == {0, 3, 7}
        assert ledger.before == tuple(one.game for one in given_)
        assert not ledger.add(result(0))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(min_value=0, max_value=5000), rubbish=st.binary(max_size=40))
def test_whatever_a_crash_left_at_the_end_costs_the_last_result_at_most(
    tmp_path: Path, cut: int, rubbish: bytes
) -> None:
    path, whole = tmp_path / "results.jsonl", [result(n) for n in range(3)]
    lines = [one.model_dump_json().encode() + b"\n" for one in whole]
    content = b"".join(lines)[:cut]
    complete = max(n for n in range(4) if len(b"".join(lines[:n])) - (n > 0) <= len(content))
    path.write_bytes(content + rubbish.replace(b"\n", b" ") if cut < sum(map(len, lines)) else content)
    kept = len(b"".join(lines[:complete])) <= len(content)
    with Ledger(path) as ledger:
        assert ledger.done >= set(range(complete - (not kept)))
        assert ledger.done <= set(range(3))
        for one in whole:
            ledger.add(one)
    assert sorted(one.game.index for one in results_in(path)) == [0, 1, 2]
    assert {one.game.index: one for one in results_in(path)} == dict(enumerate(whole))


def test_two_programs_cannot_write_it(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    with Ledger(path) as ledger:
        ledger.add(result(0))
        with pytest.raises(RecordError, match="is being written by another program"):
            Ledger(path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b"{", b"{{{", "line 2 is damaged: remove that line, and its game is played again"),
        (b'"seed":', b'"sead":', r"line 2 is damaged \(game.seed: Field required\): remove that line"),
        (
            b'"schema_version":1',
            b'"schema_version":2',
            "line 2 is of version 2 and not 1: read it with a program of th",
        ),
    ],
)
def test_a_line_that_is_no_result_is_said(tmp_path: Path, old: bytes, new: bytes, said: str) -> None:
    path = tmp_path / "results.jsonl"
    lines = [result(n).model_dump_json().encode() for n in range(3)]
    path.write_bytes(b"\n".join((lines[0], lines[1].replace(old, new, 1), lines[2], b"")))
    with pytest.raises(LedgerError, match=said):
        Ledger(path)


@given(games=st.integers(1, 60), parts=st.integers(1, 9))
def test_shards_part_a_campaign(games: int, parts: int) -> None:
    found = [index for number in range(1, parts + 1) for index in Shard((number, parts)).indices(games)]
    assert sorted(found) == list(range(games))


def test_shards_are_named_and_have_ledgers_of_their_own() -> None:
    assert Shard.parse("2/8") == (2, 8)
    assert Shard.parse("2/8").ledger == "results-2-of-8.jsonl"
    assert Shard.parse("1/1").ledger == "results.jsonl"
    for wrong in ("0/8", "9/8", "2", "a/b", "1/0", "-1/8"):
        with pytest.raises(LedgerError, match="from 1/8 to 8/8"):
            Shard.parse(wrong)
    with pytest.raises(LedgerError, match="from 1/2 to 2/2"):
        Shard.parse("3/2")


def test_tables_hold_what_the_ledgers_of_all_shards_hold_once(tmp_path: Path) -> None:
    for number, indices in ((1, (0, 2)), (2, (1, 2))):
        with Ledger(tmp_path / Shard((number, 2)).ledger) as ledger:
            for index in indices:
                ledger.add(result(index))
    write_tables(tmp_path, SPEC)
    games, plies = (parquet.read_table(tmp_path / name) for name in ("games.parquet", "plies.parquet"))
    assert sorted(games["index"].to_pylist()) == [0, 1, 2]
    assert len(plies) == 6
    row = games.to_pylist()[0]
    assert row == {**result(row["index"]).game.columns()}
    assert games.schema.metadata == {b"touchmove_campaign": b"1"}
    assert arrow_schema(PlyRow).field("real_s").nullable
    assert not arrow_schema(PlyRow).field("ply").nullable
    assert not list(tmp_path.glob("*.part"))
