"""What was begun and not finished: another program goes on with it, or the game goes on without it, never half of both.

On the table of paper of `test_mending`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import chess
import pytest

from app import UserError
from app.execution.interruption import CarryFailed, Loss
from app.execution.recovery import Recovery
from app.execution.repair import Whereabouts
from app.execution.state import Carried, Devices, Job, Position
from app.execution.table import Table
from app.game.person import GameLeft, NeedsHand
from app.motion import MotionSettings
from app.pieces.inventory import Inventory, Stage, Transfer
from app.pieces.manipulation import transfers
from app.players.typed_commands import Word
from app.records import EVENTS_FILE, GameRecord, read_history
from app.rig.arm import Outcome
from app.rig.board import BoardRig
from app.terminal.game_display import UserInterface
from hardware.interfaces import HardwareError
from hardware.parameters import load_parameters
from hardware.table import Captured, Place, TableSettings
from tests.app.execution import test_mending
from tests.app.execution.test_mending import Paper, Unattended, same, table_of

CAPTURE = "4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1"
DONE = Carried(1.0, Outcome(1.0, 1.0, 1.0, 100), False)


class Killed(BaseException):
    """The program ends here."""


def see_all(paper: Paper) -> None:
    """Eyes with depth: what stands in sight is known, also in the trays."""

    def whereabouts(stands: Inventory) -> Whereabouts:
        table = stands.table
        standing = {piece.name: table.xy(piece.place) for piece in paper.truth if not piece.place.in_box}
        gone = tuple(piece for piece in stands if piece.place.on_board and piece.name not in standing)
        moved = {piece.name for piece in paper.truth if piece.name in standing and stands.find(piece.name) != piece}
        return Whereabouts(standing, frozenset(moved), gone)

    paper.whereabouts = whereabouts  # type: ignore[method-assign]
    paper.strange = lambda stands: ()  # type: ignore[method-assign]


def feeling(paper: Paper) -> list[Transfer]:
    """The fingers feel what they take; what they close on in vain."""
    missed = list[Transfer]()

    def carry(job: Job, inventory: Inventory, begun: Any = None, seen: Any = None) -> Carried:
        done = inventory
        for number, transfer in enumerate(job.transfers):
            if all(piece.name != transfer.name for piece in paper.truth):
                missed.append(transfer)
                raise CarryFailed(Loss.NOT_GRIPPED, transfer, number, done, "the fingers felt nothing")
            paper.put(transfer.name, transfer.target)
            done = done.moved(transfer)
        return DONE

    paper.carry = carry  # type: ignore[method-assign]
    return missed


def killed_in(record: GameRecord, paper: Paper, now: Callable[[Job], bool], stage: Stage = Stage.APPROACH) -> None:
    """The program is killed as a job's last transfer comes to a stage; all before it is done."""
    carry = paper.carry

    def dies(job: Job, inventory: Inventory, begun: Any = None, seen: Any = None) -> Carried:
        if not now(job):
            if not paper.visits:
                record.step(job.uci, 0, Stage.APPROACH, 0.5, durable=True)
            return carry(job, inventory, begun, seen)
        if stage is Stage.RELEASE:
            carry(job, inventory, begun, seen)
        record.step(job.uci, len(job.transfers) - 1, stage, 1.0, durable=True)
        raise Killed

    paper.carry = dies  # type: ignore[method-assign]


def go_on(folder: Path, truth: Inventory) -> tuple[Table, Paper, GameRecord, list[Job]]:
    """Another program takes up the record, and what it carries; transfers that were begun count as done."""
    history = read_history(folder / EVENTS_FILE, truth.table)
    paper: Any = Paper(truth)
    see_all(paper)
    jobs, carry = list[Job](), paper.carry

    def carries(job: Job, inventory: Inventory, begun: Any = None, seen: Any = None) -> Carried:
        jobs.append(job)
        return DONE if begun is not None and begun.stage is Stage.RELEASE else carry(job, inventory, begun, seen)

    paper.carry = carries
    record = GameRecord.go_on(folder, history)
    rig = BoardRig(MotionSettings().home, load_parameters())
    recovery = Recovery(paper, paper, Unattended(paper), record, UserInterface(), rig.clock)
    table = Table(
        Position.of(history), Devices(rig.arm, rig.clock, None, None), paper, recovery, record, UserInterface()
    )
    return table, paper, record, jobs


# a piece is missing


def test_a_repair_around_a_missing_piece_can_be_gone_on_with(tmp_path: Path) -> None:
    """The captured pawn was lost out of sight; the program dies as the capturing one goes to where that has stood."""
    table, paper, record = table_of(tmp_path / "game", CAPTURE)
    see_all(paper)
    paper.losses[0] = None
    killed_in(record, paper, lambda job: job.uci is None)
    with record, pytest.raises(Killed):
        table.arm_ply(chess.Move.from_uci("e4d5"))
    later, seen, again, _ = go_on(tmp_path / "game", paper.truth)
    with again, pytest.raises(NeedsHand, match="a piece is missing: put the black pawn on"):
        later.begin()
    assert str(seen.truth.find("white-pawn-e").place) == "d5"
    history = read_history(tmp_path / "game" / EVENTS_FILE, seen.truth.table)
    brought = history.inventory.find("black-pawn-d")
    last, _, again, _ = go_on(tmp_path / "game", Inventory.of([*seen.truth, brought], seen.truth.table))
    with again:
        assert last.begin(), "somebody has put it there"
    assert [move.uci() for move in last.board.move_stack] == ["e4d5"]


def test_what_was_taken_off_against_the_rules_leaves_a_record_that_can_be_read(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game", "4k3/8/8/3p4/8/8/8/3QK3 w - - 0 1")
    see_all(paper)
    paper.put("black-pawn-d", None)
    paper.put("white-queen", Place.parse("d5"))
    killed_in(record, paper, lambda _: True)
    with record, pytest.raises(Killed):
        table.repair()
    history = read_history(tmp_path / "game" / EVENTS_FILE, table.inventory.table)
    assert str(history.inventory.find("white-queen").place) == "d5"
    assert same(record.stands(table.inventory), history.inventory)


def test_a_captured_piece_that_is_lost_out_of_sight_is_asked_for(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game", CAPTURE)
    see_all(paper)
    paper.losses[0] = None
    with record, pytest.raises(NeedsHand, match="a piece is missing: put the black pawn on"):
        table.arm_ply(chess.Move.from_uci("e4d5"))
    assert str(paper.truth.find("white-pawn-e").place) == "d5", "what can be done without it is done"


@pytest.mark.parametrize("hidden", [False, True])
def test_a_spare_that_is_gone_is_asked_for_instead_of_grasped_at_forty_times(tmp_path: Path, hidden: bool) -> None:
    table, paper, record = table_of(tmp_path / "game", "8/4P3/8/8/8/8/k7/4K3 w - - 0 1")
    see_all(paper)
    move = chess.Move.from_uci("e7e8q")
    spare = transfers(table.board, move, table.inventory).transfers[-1]
    paper.put(spare.name, None)
    if hidden:
        whereabouts: Any = paper.whereabouts

        def hides(stands: Inventory) -> Whereabouts:
            seen = whereabouts(stands)
            return Whereabouts(seen.standing, seen.moved, seen.missing, hidden=frozenset({spare.source}))

        paper.whereabouts = hides  # type: ignore[method-assign]
    missed = feeling(paper)
    with record, pytest.raises(NeedsHand, match="a piece is missing: put the white queen on e8"):
        table.arm_ply(move)
    assert [one.name for one in missed] == [spare.name] * (2 if hidden else 1)


# something fails, and the game goes on, or does not


def test_a_task_of_which_something_was_moved_is_not_dropped(tmp_path: Path) -> None:
    """Of a move that is taken back the second piece falls, and does not come up."""
    table, paper, record = table_of(tmp_path / "game")
    with record:
        table.arm_ply(chess.Move.from_uci("e2e4"))
        table.arm_ply(chess.Move.from_uci("d7d5"))
        paper.falls[paper.carried + 1], paper.prop = Place.parse("e3"), "white-rook-h"
        paper.untouched = True  # as where the last thing it tried was to stand something up
        with pytest.raises(NeedsHand):
            table.take_back(2)
    unfinished = read_history(tmp_path / "game" / EVENTS_FILE, table.inventory.table).unfinished
    assert unfinished is not None
    assert unfinished.task is not None
    assert unfinished.task.taken_back == 2


def test_a_game_that_goes_on_after_half_a_task_stands_where_it_stood(tmp_path: Path) -> None:
    """The camera fails in the middle of taking back, and works again: the record counts the same plies as the table."""
    table, paper, record = table_of(tmp_path / "game")
    verify = paper.verify
    with record:
        table.arm_ply(chess.Move.from_uci("e2e4"))
        table.arm_ply(chess.Move.from_uci("d7d5"))

        def broken(*_: object) -> Any:
            raise HardwareError("the camera gave no new picture")

        paper.verify = broken  # type: ignore[method-assign]
        with pytest.raises(HardwareError):
            table.take_back(1)
        assert table.give_up("the camera gave no new picture")
        paper.verify = verify  # type: ignore[method-assign]
        assert table.repair()
    history = read_history(tmp_path / "game" / EVENTS_FILE, table.inventory.table)
    assert history.unfinished is None
    assert [move.uci() for move in history.board.move_stack] == ["e2e4", "d7d5"]
    assert same(history.inventory, paper.truth)
    assert same(table.inventory, paper.truth)


def test_nothing_is_given_up_with_a_piece_in_the_fingers(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    paper.midway = True
    with record:
        assert not table.give_up("the camera gave no new picture")


def test_the_arms_next_move_is_no_part_of_a_repair_that_was_left_open(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    see_all(paper)
    carry, verify = paper.carry, paper.verify

    def broken(*_: object) -> Any:
        raise HardwareError("the camera gave no new picture")

    def last(*arguments: Any, **named: Any) -> Carried:
        done = carry(*arguments, **named)
        paper.verify = broken  # type: ignore[method-assign]
        return done

    with record:
        paper.put("white-pawn-e", Place.parse("e4"))
        paper.put("white-knight-b", Place.parse("c4"))
        paper.carry = last  # type: ignore[method-assign]
        with pytest.raises(HardwareError):
            table.hand_ply(chess.Move.from_uci("e2e4"))
        paper.verify = verify  # type: ignore[method-assign]
        assert table.give_up("the camera gave no new picture")
        assert record.unfinished is not None
        record.step("e7e5", 0, Stage.CARRY, 1.0)
        assert (record.unfinished.uci, record.unfinished.repair) == ("e7e5", None)
        assert table.repair()
        assert record.unfinished is None, "a look that finds all right ends what was open"


@pytest.mark.parametrize("captured", Captured)
def test_a_ply_before_which_somebody_touched_the_board_is_that_ply_yet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, captured: Captured
) -> None:
    """The program dies as the arm goes home from it: another one does not undo it."""
    monkeypatch.setattr(test_mending, "TABLE", TableSettings(captured=captured))
    table, paper, record = table_of(tmp_path / "game", CAPTURE)
    see_all(paper)
    king = paper.truth.find("black-king")
    paper.visits = [(king.name, king.place)]  # a hand came and went, and nothing was moved
    killed_in(record, paper, lambda _: not paper.visits, Stage.RELEASE)
    with record, pytest.raises(Killed):
        table.arm_ply(chess.Move.from_uci("e4d5"))
    later, seen, again, _ = go_on(tmp_path / "game", paper.truth)
    with again:
        assert later.begin()
    assert [move.uci() for move in later.board.move_stack] == ["e4d5"]
    assert str(seen.truth.find("white-pawn-e").place) == "d5"


def test_an_arm_that_was_stopped_as_it_stood_a_piece_up_goes_home_before_anything_else(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    home = list[Inventory]()
    paper.bring_home = home.append  # type: ignore[method-assign]
    with record:
        assert table.finish()
    assert home == [table.inventory]


# people


def test_who_leaves_where_the_arm_asks_leave_before_it_mends_is_not_asked_to_mend(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    paper.put("white-knight-b", Place.parse("c4"))

    def leaves(*_: object, **__: object) -> Carried:
        raise GameLeft(Word.QUIT)

    paper.carry = leaves  # type: ignore[method-assign]
    with record, pytest.raises(GameLeft):
        table.repair()
    assert paper.asked == []


@pytest.mark.parametrize("answers", [True, False])
def test_of_two_people_one_may_answer_before_anybody_has_looked(tmp_path: Path, answers: bool) -> None:
    table, paper, record = table_of(tmp_path / "game")
    see_all(paper)
    paper.put("white-pawn-e", Place.parse("e4"))
    paper.put("black-pawn-e", Place.parse("e5"))
    with record:
        assert table.hand_ply(chess.Move.from_uci("e2e4"), answers=answers)
    assert table.replied is answers
    assert str(paper.truth.find("black-pawn-e").place) == ("e5" if answers else "e7")
    assert record.unfinished is None


def test_what_is_no_matter_of_the_board_is_told_as_what_it_is(tmp_path: Path) -> None:
    table, paper, record = table_of(tmp_path / "game")
    paper.put("white-knight-b", Place.parse("c4"))

    def breaks(*_: object, **__: object) -> Carried:
        raise UserError("the guard sees nothing any more")

    paper.carry = breaks  # type: ignore[method-assign]
    with record, pytest.raises(UserError, match=r"^the guard sees nothing any more$"):
        table.repair()
