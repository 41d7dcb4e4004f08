"""A game that was broken off, read back and gone on with."""

from __future__ import annotations

import io
from pathlib import Path

import chess
import chess.pgn
import pytest

from app.pieces.inventory import Inventory, Stage
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.records import EVENTS_FILE, GameRecord, GameSetup, PlyOutcome, RecordError, read_events, read_history
from hardware.table import TableSettings

TABLE = TableSettings()
DONE = PlyOutcome(planned=1.5, real=1.6, peak_torque=2.0)


class Table:
    """Board, inventory and record of one game."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.board = chess.Board()
        self.inventory = Inventory.of(start_layout(self.board, TABLE), TABLE)
        self.record = GameRecord.begin(folder, GameSetup("a", "b", 1, "fast"), self.board, self.inventory, 0.0)

    def play(self, line: str) -> Table:
        for san in line.split():
            move = self.board.parse_san(san)
            ply = transfers(self.board, move, self.inventory)
            for number, _ in enumerate(ply.transfers):
                for stage in (Stage.APPROACH, Stage.GRASP, Stage.CARRY):
                    self.record.step(ply.uci, number, stage, 1.0)
            self.board.push(move)
            self.inventory = self.inventory.after(ply)
            self.record.ply(ply, DONE, 2.0)
        return self

    @property
    def log(self) -> Path:
        return self.folder / EVENTS_FILE


LINE = "e4 d5 exd5 Qxd5 Nc3 Qd8 Nf3 Nf6 Bc4 e6 O-O"


def test_the_position_and_every_piece_come_back(tmp_path: Path) -> None:
    table = Table(tmp_path / "game").play(LINE)
    table.record.close()
    history = read_history(table.log, TABLE)
    assert history.board.fen() == table.board.fen()
    assert history.board.move_stack == table.board.move_stack
    assert dict(history.inventory.standing) == dict(table.inventory.standing)
    assert len(history.plies) == 11
    assert history.unfinished is None


@pytest.mark.parametrize("stage", list(Stage))
def test_what_was_begun_comes_back(tmp_path: Path, stage: Stage) -> None:
    table = Table(tmp_path / "game").play("e4 d5")
    table.record.step("e4d5", 0, Stage.APPROACH, 3.0)
    table.record.step("e4d5", 1, stage, 3.5)
    table.record.close()
    step = read_history(table.log, TABLE).unfinished
    assert step is not None
    assert (step.uci, step.transfer, step.stage) == ("e4d5", 1, stage)


@pytest.mark.parametrize("torn", [b'{"wall_time":"2026-11-2', b"\0\0\0", b'{"wall_time":\n', b"\n"])
def test_a_record_goes_on_after_a_torn_line(tmp_path: Path, torn: bytes) -> None:
    table = Table(tmp_path / "game").play("e4 d5")
    table.record.close()
    whole = table.log.read_bytes()
    table.log.write_bytes(whole + torn)
    history = read_history(table.log, TABLE)
    assert len(history.plies) == 2
    with GameRecord.go_on(table.folder, history) as record:
        record.resumed(4.0)
        ply = transfers(history.board, chess.Move.from_uci("e4d5"), history.inventory)
        record.ply(ply, PlyOutcome(planned=1.0, real=0.5, peak_torque=1.0, resumed=True), 5.0)
        report = record.end("*", "enough", 6.0)
    assert table.log.read_bytes().startswith(whole), "nothing that was written is lost"
    events = read_events(table.log)
    assert [event.event for event in events[-3:]] == ["resume", "ply", "end"]
    assert report.plies == 3
    assert report.kinds.capture.n == 0, "a ply in two parts says nothing about how long a capture takes"
    game = chess.pgn.read_game(io.StringIO((table.folder / "game.pgn").read_text()))
    assert game is not None
    assert [move.uci() for move in game.mainline_moves()] == ["e2e4", "d7d5", "e4d5"]


def test_what_is_no_game_is_said(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"cannot be read: No such file"):
        read_history(tmp_path / EVENTS_FILE, TABLE)
    (tmp_path / EVENTS_FILE).write_text("")
    with pytest.raises(RecordError, match="does not begin with the start of a game"):
        read_history(tmp_path / EVENTS_FILE, TABLE)
    table = Table(tmp_path / "game").play("e4 e5")
    table.record.close()
    lines = table.log.read_text().splitlines(keepends=True)
    table.log.write_text("".join([lines[0], *lines[5:]]))  # the first ply is missing
    with pytest.raises(RecordError, match=r"line 5, contradicts those before it: ply 2 follows ply 0"):
        read_history(table.log, TABLE)


def test_a_game_that_is_being_played_is_left_alone(tmp_path: Path) -> None:
    table = Table(tmp_path / "game").play("e4")
    with pytest.raises(RecordError, match="is being written by another program: wait for it, or end it"):
        GameRecord.go_on(table.folder, read_history(table.log, TABLE))
    table.play("e5")
    table.record.close()
    with GameRecord.go_on(table.folder, read_history(table.log, TABLE)) as record:
        assert len([event for event in record.events if event.event == "ply"]) == 2


def test_a_last_line_without_its_end_is_kept_whole(tmp_path: Path) -> None:
    table = Table(tmp_path / "game").play("e4 e5")
    table.record.close()
    table.log.write_bytes(table.log.read_bytes().rstrip(b"\n"))
    with GameRecord.go_on(table.folder, read_history(table.log, TABLE)) as record:
        record.resumed(3.0)
    assert len(read_history(table.log, TABLE).plies) == 2
