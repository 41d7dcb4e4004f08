"""Plans in files: what comes back is the plan, to the bit, and moves the arm as it did."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import chess
import numpy as np
import pytest

from app import UserError
from app.measure.bench.plies import Bed, Disorder
from app.motion import PROFILES, Plan, Planner, Profile
from app.pieces.layout import start_layout
from app.pieces.manipulation import Inventory, transfers
from app.records.plans import PlanUnreadable, load_plan, save_plan
from hardware.parameters import load_parameters
from hardware.table import TableSettings

PARAMETERS, TABLE = load_parameters(), TableSettings()
CASTLES = "r3k2r/8/8/8/8/8/8/R3K2R w KQkq - 0 1"


def planned(fen: str, move: str, profile: Profile) -> Plan:
    board = chess.Board(fen)
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    ply, settings = transfers(board, chess.Move.from_uci(move), inventory), PROFILES[profile]
    home = np.array(settings.home)
    return Planner.of(settings, PARAMETERS, inventory.table, home, 0.01, 8).ply(ply.san, ply.transfers, inventory)


@pytest.mark.parametrize("profile", Profile)
def test_a_plan_comes_back_as_it_was(tmp_path: Path, profile: Profile) -> None:
    plan = planned(CASTLES, "e1g1", profile)
    save_plan(plan, tmp_path / "plan.npz")
    back = load_plan(tmp_path / "plan.npz")
    assert (back.label, back.lead, back.style, back.expected) == (plan.label, plan.lead, plan.style, plan.expected)
    for one, other in zip(plan.motions, back.motions, strict=True):
        np.testing.assert_array_equal(one.samples, other.samples)
        assert not other.samples.flags.writeable
        for field in ("label", "expected", "grips", "touches", "transfer", "stage"):
            assert getattr(one, field) == getattr(other, field)
        assert one.route is not None
        assert other.route is not None
        for field in dataclasses.fields(one.route):
            np.testing.assert_array_equal(getattr(one.route, field.name), getattr(other.route, field.name))
        for way, same in zip(one.paths, other.paths, strict=True):
            np.testing.assert_array_equal(way.table, same.table)
    low = plan.motions[2].samples["position"][-100]
    np.testing.assert_array_equal(plan.continued(3, low).samples, back.continued(3, low).samples)


def test_a_stored_plan_moves_the_arm_and_the_piece_to_the_same_bit(tmp_path: Path) -> None:
    ends = []
    for stored in (False, True):
        bed = Bed(chess.Board(), PROFILES[Profile.DEFAULT], PARAMETERS, TABLE, Disorder(), 1)
        _, plan, _ = bed.begin(chess.Move.from_uci("g1f3"))
        if stored:
            save_plan(plan, tmp_path / "plan.npz")
            plan = load_plan(tmp_path / "plan.npz")
        for index in range(len(plan.motions)):
            motion = plan.continued(index, bed.cell.supervisor.reference.position)
            bed.cell.carry_out(motion, followed=index < len(plan.motions) - 1)
        ends.append(bed.cell.plant.digest())
    assert ends[0] == ends[1]


def test_what_is_no_plan_is_refused_in_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "plan.npz"
    with pytest.raises(PlanUnreadable, match="No such file"):
        load_plan(path)
    for content in (b"", b"no archive", b"PK\x03\x04 cut off"):
        path.write_bytes(content)
        with pytest.raises(UserError, match="holds no plan"):
            load_plan(path)
    plan = planned(CASTLES, "e1g1", Profile.DEFAULT)
    save_plan(plan, path)
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name, changed in (
        ("0.samples", arrays["0.samples"]["position"]),
        ("2.points", arrays["2.points"][:-1]),
        ("0.path0", arrays["0.path0"][:, :5]),
        ("plan", np.frombuffer(b'{"format": 2}', dtype=np.uint8)),
    ):
        np.savez(path, **{**arrays, name: changed})
        with pytest.raises(PlanUnreadable):
            load_plan(path)
    np.savez(path, **{name: array for name, array in arrays.items() if name != "3.samples"})
    with pytest.raises(PlanUnreadable, match=r"3\.samples"):
        load_plan(path)
    np.savez(path, plan=np.array([object()]))
    with pytest.raises(PlanUnreadable, match="allow_pickle"):
        load_plan(path)
