"""The record of a game on the disk: what is written, that it is never lost, and what a full disk says."""

from __future__ import annotations

import errno
import io
import json
import os
import re
import threading
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import chess
import chess.pgn
import numpy as np
import pytest
from pydantic import ValidationError
from typer.testing import CliRunner

from app.cli.commands import app
from app.pieces.inventory import Inventory, Ply
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.records import (
    EndEvent,
    GameRecord,
    GameSetup,
    PlyEvent,
    PlyOutcome,
    RecordError,
    Report,
    StartEvent,
    new_folder,
    read_events,
    read_history,
    recording,
    summarise,
)
from app.records.files import LineLog, write_atomically
from hardware.table import TableSettings
from tests.waiting import PATIENCE, until

TABLE = TableSettings()
NOON = datetime(2026, 11, 21, 10, 15, 30, tzinfo=UTC)
FULL = r"no space left on the device \(the disk at /\S*\): free some space or choose another folder with --out"
SPECIAL = "r3k2r/2P5/8/3pP3/8/8/6p1/R3K2R w KQkq d6 0 1"


def clock(step: float = 1.0) -> Callable[[], datetime]:
    """Wall time that goes on by ``step`` [s] at each look."""
    ticks = iter(range(10**6))
    return lambda: NOON + timedelta(seconds=step * next(ticks))


class Game:
    """Plays moves on a board and an inventory and hands them to a record."""

    def __init__(self, folder: Path, fen: str = chess.STARTING_FEN, *, chess960: bool = False) -> None:
        self.board = chess.Board(fen, chess960=chess960)
        self.inventory = Inventory.of(start_layout(self.board, TABLE), TABLE)
        setup = GameSetup("Stockfish 1500", "Stockfish 2000", seed=7, pace="fast", site="simulated")
        self.record = GameRecord.begin(folder, setup, self.board, self.inventory, 1.0, now=clock())
        self.time = 1.0

    def play(self, line: str, **changes: Any) -> list[Ply]:
        plies = []
        for san in line.split():
            move = self.board.parse_san(san)
            ply = transfers(self.board, move, self.inventory)
            self.inventory = self.inventory.after(ply)
            self.board.push(move)
            self.time += 2.0 + len(ply.transfers)
            self.record.ply(ply, outcome(ply, **changes), self.time)
            plies.append(ply)
        return plies


def outcome(ply: Ply, **changes: Any) -> PlyOutcome:
    fields: dict[str, Any] = {
        "planned": 1.9,
        "real": 1.0 + len(ply.transfers),
        "peak_torque": 2.5,
        "placement_mm": {name: 0.1 * (number + 1) for number, name in enumerate(ply.changes())},
        "peak_force": 6.0,
        "physical_ok": True,
        "frame": "ply.png",
    }
    return PlyOutcome(**(fields | changes))


def lines(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]


def no_space(*_: object, **__: object) -> int:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


# -- folder --------------------------------------------------------------------------------------------------------


def test_folders_are_named_after_the_time_and_never_shared(tmp_path: Path) -> None:
    names = [new_folder(tmp_path / "games", NOON).name for _ in range(3)]
    assert names == ["2026-11-21T10-15-30Z", "2026-11-21T10-15-30Z-2", "2026-11-21T10-15-30Z-3"]


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "games").write_text("a file")
    message = f"{tmp_path}/games: this is a file, and a folder is needed: choose another folder with --out"
    with pytest.raises(RecordError, match=f"^{re.escape(message)}$"):
        new_folder(tmp_path / "games", NOON)


def test_a_folder_that_holds_a_game_is_refused(tmp_path: Path) -> None:
    Game(tmp_path).record.close()
    before = (tmp_path / "events.jsonl").read_bytes()
    message = f"{tmp_path}/events.jsonl already holds the record of another game: choose another folder with --out"
    with pytest.raises(RecordError, match=f"^{re.escape(message)}$"):
        Game(tmp_path)
    assert (tmp_path / "events.jsonl").read_bytes() == before


# -- events --------------------------------------------------------------------------------------------------------


def test_the_start_event_says_how_the_game_began(tmp_path: Path) -> None:
    game = Game(tmp_path / "new" / "folder")
    (start,) = lines(tmp_path / "new" / "folder")
    assert start["event"] == "start"
    assert start["wall_time"] == "2026-11-21T10:15:30Z"
    assert (start["plant_time"], start["ply"]) == (1.0, 0)
    assert (start["fen"], start["chess960"]) == (chess.STARTING_FEN, False)
    assert (start["white"], start["black"]) == ("Stockfish 1500", "Stockfish 2000")
    assert (start["seed"], start["pace"]) == (7, "fast")
    assert len(start["inventory"]) == 50
    assert {"name": "white-pawn-e", "kind": "pawn", "colour": "white", "place": "e2"} in start["inventory"]
    game.record.close()


def test_a_ply_event_holds_the_move_and_what_was_measured(tmp_path: Path) -> None:
    game = Game(tmp_path)
    *_, ply = game.play("e4 d5 exd5", failures=("white-pawn-e stands 11 mm beside d5",), physical_ok=False)
    event = lines(tmp_path)[3]
    taken, taker = ply.transfers
    assert event == {
        "wall_time": "2026-11-21T10:15:33Z",
        "plant_time": 11.0,
        "ply": 3,
        "event": "ply",
        "side": "white",
        "san": "exd5",
        "uci": "e4d5",
        "kind": "capture",
        "fen": "rnbqkbnr/ppp1pppp/8/3P4/8/8/PPPP1PPP/RNBQKBNR b KQkq - 0 2",
        "planned_s": 1.9,
        "real_s": 3.0,
        "placement_mm": {"black-pawn-d": 0.1, "white-pawn-e": 0.2},
        "peak_torque_Nm": 2.5,
        "peak_force_N": 6.0,
        "physical_ok": False,
        "frame": "ply.png",
        "transfers": [
            {
                "piece": "black-pawn-d",
                "kind": "pawn",
                "colour": "black",
                "source": "d5",
                "target": str(taken.target),
                "seen": None,
                "raised": 0.0,
            },
            {
                "piece": "white-pawn-e",
                "kind": "pawn",
                "colour": "white",
                "source": "e4",
                "target": "d5",
                "seen": None,
                "raised": 0.0,
            },
        ],
        "inventory": {"black-pawn-d": str(taken.target), "white-pawn-e": "d5"},
        "failures": ["white-pawn-e stands 11 mm beside d5"],
        "resumed": False,
        "mended": False,
        "by": "arm",
        "score": None,
        "clock_s": None,
        "comment": "",
    }
    assert taker.name == "white-pawn-e"


def test_events_are_on_the_disk_before_the_next_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    real = os.fsync

    def fsync(descriptor: int) -> None:
        if Path(f"/proc/self/fd/{descriptor}").readlink().name == "events.jsonl":
            synced.append(len((tmp_path / "events.jsonl").read_bytes().splitlines()))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    Game(tmp_path).play("e4 e5")
    assert synced == [1, 2, 3]


def test_read_events_gives_back_what_was_written(tmp_path: Path) -> None:
    game = Game(tmp_path, SPECIAL)
    game.play("exd6 O-O O-O-O")
    game.record.end("*", "stopped", 30.0)
    events = read_events(tmp_path / "events.jsonl")
    assert events == game.record.events
    assert [type(event) for event in events] == [StartEvent, PlyEvent, PlyEvent, PlyEvent, EndEvent]
    assert [event.kind for event in events if isinstance(event, PlyEvent)] == ["en_passant", "castling", "castling"]


def test_the_events_tell_where_every_piece_is(tmp_path: Path) -> None:
    game = Game(tmp_path, SPECIAL)
    game.play("exd6 gxh1=R+ Kd2 Rhxa1 c8=Q+ Rxc8")
    start, *plies = read_events(tmp_path / "events.jsonl")
    assert isinstance(start, StartEvent)
    places = {piece.name: piece.place for piece in start.inventory}
    for event in plies:
        assert isinstance(event, PlyEvent)
        places.update(event.inventory)
    assert places == {piece.name: str(piece.place) for piece in game.inventory}


def test_a_cut_last_line_is_left_out(tmp_path: Path) -> None:
    game = Game(tmp_path)
    game.play("e4 e5")
    path = tmp_path / "events.jsonl"
    whole = path.read_bytes()
    last = whole[:-1].rindex(b"\n") + 1
    for end in range(last, len(whole) - 1):
        path.write_bytes(whole[:end])
        assert read_events(path) == game.record.events[:2], end
    said: list[str] = []
    path.write_bytes(whole[:-1])  # only the end of line is missing
    assert read_events(path, said.append) == game.record.events
    assert not said


@pytest.mark.parametrize(
    "last", [b"\0" * 500, b"\n", b"\xff\xfe\n", b'{"wall_time":"2026-\n', b"12\n", b"[" * 9999 + b"\n"]
)
def test_a_garbled_last_line_is_left_out_and_said(tmp_path: Path, last: bytes) -> None:
    game = Game(tmp_path)
    game.play("e4 e5")
    path, said = tmp_path / "events.jsonl", list[str]()
    path.write_bytes(path.read_bytes() + last)
    assert read_events(path, said.append) == game.record.events
    assert said == [
        f"{path}, line 4, the last one, is cut off or garbled and was skipped: everything before it is complete"
    ]


def test_a_second_start_is_named(tmp_path: Path) -> None:
    game = Game(tmp_path)
    game.play("e4 e5")
    path = tmp_path / "events.jsonl"
    first = path.read_bytes().splitlines(keepends=True)[0]
    path.write_bytes(path.read_bytes() + first)
    with pytest.raises(RecordError, match=r"line 4, starts another game, but a record holds one: keep the lines of"):
        read_events(path)


def test_another_broken_line_is_named(tmp_path: Path) -> None:
    game = Game(tmp_path)
    game.play("e4 e5")
    path = tmp_path / "events.jsonl"
    first, second, third = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(first + second[:40] + b"\n" + third)
    remedy = "correct it, or remove it and all lines after it: the game before it is kept"
    with pytest.raises(RecordError, match=rf"^{re.escape(f'{path}, line 2, is damaged: {remedy}')}$"):
        read_events(path)
    path.write_bytes(first)
    assert len(read_events(path)) == 1, "as the sentence says"
    path.write_bytes(first + second.replace(b'"san"', b'"move"') + third)
    message = f"{path}, line 2, is not an event of this version: ply.san: Field required: read it with the version"
    with pytest.raises(RecordError, match=f"^{re.escape(message)}"):
        read_events(path)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (r".*", "", "does not begin with the start of a game: name the folder of a recorded game"),
        (r"^.*\n", "", "does not begin with the start of a game: name the folder of a recorded game"),
        (r'"fen":"[^"]*"', '"fen":"8/8/8"', "starts from no position: expected 8 rows"),
        (r'"uci":"e7e5"', '"uci":"e7e4"', "line 3, contradicts those before it: illegal uci: 'e7e4' in "),
        (r"\n.*e7e5.*\n", "\n", "line 3, contradicts those before it: ply 3 follows ply 1: correct it, or remove it"),
    ],
)
def test_a_record_that_contradicts_itself_is_refused_wherever_it_is_read(
    before: str, after: str, said: str, tmp_path: Path
) -> None:
    """What takes a record on refuses it as what only looks at it does."""
    game = Game(tmp_path)
    game.play("e4 e5 Nf3")
    path = tmp_path / "events.jsonl"
    whole = path.read_text()
    path.write_text(re.sub(before, after, whole, flags=re.DOTALL if before == ".*" else 0, count=1))
    assert path.read_text() != whole
    for command in (["report"], ["report", "--html"], ["analyse"], ["dataset", "--out", str(tmp_path / "set")]):
        done = CliRunner().invoke(app, [*command, str(tmp_path)])
        assert done.exit_code == 2, done.output
        assert said in done.output.splitlines()[-1]
        assert done.output.splitlines()[-1].startswith("touchmove: ")
    with pytest.raises(RecordError, match=re.escape(said)):
        read_history(path, TABLE)


def test_a_missing_file_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    message = f"{path} cannot be read: No such file or directory: name the folder of a recorded game"
    with pytest.raises(RecordError, match=f"^{re.escape(message)}$"):
        read_events(path)


def test_numbers_that_are_none_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    game = Game(tmp_path)
    with pytest.raises(ValidationError, match="real_s"):
        game.play("e4", real=float("nan"))
    assert len(lines(tmp_path)) == 1


# -- PGN -----------------------------------------------------------------------------------------------------------


def read_pgn(folder: Path) -> chess.pgn.Game:
    game = chess.pgn.read_game(io.StringIO((folder / "game.pgn").read_text()))
    assert game is not None
    assert not game.errors
    return game


def test_the_pgn_is_whole_after_every_ply(tmp_path: Path) -> None:
    game = Game(tmp_path)
    assert read_pgn(tmp_path).headers["Result"] == "*"
    for number, san in enumerate(("f3", "e5", "g4", "Qh4#"), start=1):
        game.play(san)
        assert len(list(read_pgn(tmp_path).mainline_moves())) == number
    game.record.end("0-1", "checkmate", 20.0)
    assert dict(read_pgn(tmp_path).headers) == {
        "Event": "Touchmove",
        "Site": "simulated",
        "Date": "2026.11.21",
        "Round": "?",
        "White": "Stockfish 1500",
        "Black": "Stockfish 2000",
        "Result": "0-1",
        "Termination": "checkmate",
    }
    assert (tmp_path / "game.pgn").read_text().endswith("\n1. f3 e5 2. g4 Qh4# 0-1\n")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["events.jsonl", "game.pgn", "report.json"]


def test_the_pgn_of_another_start_has_its_fen(tmp_path: Path) -> None:
    Game(tmp_path, SPECIAL).play("exd6")
    pgn = read_pgn(tmp_path)
    assert (pgn.headers["FEN"], pgn.headers["SetUp"]) == (SPECIAL, "1")
    assert [move.uci() for move in pgn.mainline_moves()] == ["e5d6"]


def test_the_pgn_of_a_chess960_game_names_the_variant(tmp_path: Path) -> None:
    Game(tmp_path, "5kr1/5ppp/8/8/8/8/5PPP/5KR1 w Gg - 0 1", chess960=True).play("O-O O-O")
    pgn = read_pgn(tmp_path)
    assert pgn.headers["Variant"] == "Chess960"
    assert pgn.end().board().board_fen() == "5rk1/5ppp/8/8/8/8/5PPP/5RK1"


def test_headers_are_one_line_without_quotes(tmp_path: Path) -> None:
    game = Game(tmp_path)
    game.record.end("*", 'the "arm"\nstopped', 2.0)
    assert read_pgn(tmp_path).headers["Termination"] == "the 'arm' stopped"


def test_a_ply_that_does_not_follow_is_refused_and_not_written(tmp_path: Path) -> None:
    game = Game(tmp_path)
    (ply,) = game.play("e4")
    with pytest.raises(chess.IllegalMoveError):
        game.record.ply(ply, outcome(ply), 9.0)
    assert len(lines(tmp_path)) == 2


# -- report --------------------------------------------------------------------------------------------------------


def test_the_report_has_the_fields_of_the_contract(tmp_path: Path) -> None:
    game = Game(tmp_path, SPECIAL)
    game.play("exd6 gxh1=R+ Kd2 Rhxa1")
    game.play("c8=Q+", peak_torque=3.5, peak_force=9.0)
    report = game.record.end("1/2-1/2", "agreed", 40.0, speed=6.5, world_state="abc", details={"video": "game.webm"})
    written = json.loads((tmp_path / "report.json").read_text())
    assert written == json.loads(report.model_dump_json())
    assert list(written) == [
        *("result", "exit_reason", "plies", "sim_s", "wall_s", "pace", "seed", "kinds", "placement_mm"),
        *("peak_torque_Nm", "peak_force_N", "physical_ok", "failures", "troubles", "speed", "world_state", "details"),
    ]
    assert (written["result"], written["exit_reason"], written["plies"]) == ("1/2-1/2", "agreed", 5)
    assert (written["sim_s"], written["wall_s"], written["pace"], written["seed"]) == (39.0, 6.0, "fast", 7)
    assert list(written["kinds"]) == ["quiet", "capture", "castling", "en_passant", "promotion"]
    assert written["kinds"]["quiet"] == {"n": 1, "mean_s": 2.0, "p95_s": 2.0, "max_s": 2.0}
    assert written["kinds"]["castling"] == {"n": 0, "mean_s": None, "p95_s": None, "max_s": None}
    # one promotion captured (three transfers, 4 s), one did not (two transfers, 3 s)
    assert written["kinds"]["promotion"] == {"n": 2, "mean_s": 3.5, "p95_s": pytest.approx(3.95), "max_s": 4.0}
    assert (written["peak_torque_Nm"], written["peak_force_N"]) == (3.5, 9.0)
    assert (written["physical_ok"], written["failures"]) == (True, [])
    assert (written["speed"], written["world_state"], written["details"]) == (6.5, "abc", {"video": "game.webm"})


def test_placement_is_over_all_moved_pieces(tmp_path: Path) -> None:
    game = Game(tmp_path, SPECIAL)
    game.play("exd6 gxh1=R+ Kd2")
    report = game.record.end("*", "stopped", 40.0)
    errors = [0.1, 0.2, 0.1, 0.2, 0.3, 0.1]
    assert report.placement_mm.n == len(errors)
    assert report.placement_mm.mean == pytest.approx(np.mean(errors))
    assert report.placement_mm.p50 == pytest.approx(0.15)
    assert report.placement_mm.p95 == pytest.approx(np.percentile(errors, 95))
    assert report.placement_mm.max == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("verdicts", "total"),
    [
        ((), None),
        ((True, True), True),
        ((True, False), False),
        ((None, False), False),
        ((True, None), None),
        ((None, None), None),
    ],
)
def test_physical_ok_needs_every_ply(tmp_path: Path, verdicts: tuple[bool | None, ...], total: bool | None) -> None:
    game = Game(tmp_path)
    for san, verdict in zip(("e4", "e5"), verdicts, strict=False):
        game.play(san, physical_ok=verdict)
    assert game.record.end("*", "stopped", 9.0).physical_ok is total


def test_failures_name_their_ply(tmp_path: Path) -> None:
    game = Game(tmp_path)
    game.play("e4")
    game.play("e5", failures=("black-pawn-e fell",), physical_ok=False)
    report = game.record.end("*", "the controller was lost", 9.0, failures=("the controller was lost",))
    assert [tuple(failure.model_dump().values()) for failure in report.failures] == [
        (2, "e5", "black-pawn-e fell"),
        (None, None, "the controller was lost"),
    ]


def test_a_lab_without_referee_leaves_nulls(tmp_path: Path) -> None:
    game = Game(tmp_path)
    game.play("e4", physical_ok=None, placement_mm=None, peak_force=None, frame=None)
    event = lines(tmp_path)[1]
    assert [event[key] for key in ("physical_ok", "placement_mm", "peak_force_N", "frame")] == [None] * 4
    report = game.record.end("*", "stopped", 9.0)
    assert (report.physical_ok, report.peak_force_N, report.placement_mm.n) == (None, None, 0)
    assert report.placement_mm.mean is None


def test_the_report_can_be_made_again_from_the_events(tmp_path: Path) -> None:
    game = Game(tmp_path, SPECIAL)
    game.play("exd6 O-O")
    report = game.record.end("*", "stopped", 9.0)
    assert summarise(read_events(tmp_path / "events.jsonl")) == report
    assert Report.model_validate_json((tmp_path / "report.json").read_text()) == report


def test_a_game_without_end_is_reported_as_such(tmp_path: Path) -> None:
    Game(tmp_path).play("e4 e5")
    report = summarise(read_events(tmp_path / "events.jsonl"))
    assert (report.result, report.exit_reason, report.plies) == ("*", "the record breaks off", 2)
    assert [failure.reason for failure in report.failures] == ["the record breaks off"]


def test_nothing_recorded_is_nothing_to_report() -> None:
    message = "the events do not begin with the start of a game: there is nothing to report"
    with pytest.raises(RecordError, match=f"^{message}$"):
        summarise(())


def test_events_and_report_refuse_unknown_fields_and_changes(tmp_path: Path) -> None:
    game = Game(tmp_path)
    report = game.record.end("*", "stopped", 9.0)
    for record in (report, *game.record.events):
        with pytest.raises(ValidationError, match="Extra inputs are not permitted"):
            type(record).model_validate(record.model_dump() | {"colour": "red"})
        with pytest.raises(ValidationError, match="Instance is frozen"):
            record.__setattr__(next(iter(type(record).model_fields)), None)


# -- a disk that is full -------------------------------------------------------------------------------------------


def test_a_full_disk_at_the_start_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "events.jsonl").symlink_to("/dev/full")
    with pytest.raises(RecordError, match=f"^{re.escape(f'{tmp_path}/events.jsonl')}: {FULL}$"):
        Game(tmp_path)


def test_a_full_disk_keeps_the_pgn_before(tmp_path: Path) -> None:
    game = Game(tmp_path)
    game.play("e4")
    before = (tmp_path / "game.pgn").read_text()
    (tmp_path / "game.pgn.part").symlink_to("/dev/full")
    with pytest.raises(RecordError, match=f"^{re.escape(f'{tmp_path}/game.pgn')}: {FULL}$"):
        game.play("e5")
    assert (tmp_path / "game.pgn").read_text() == before
    assert [line.get("san") for line in lines(tmp_path)] == [None, "e4", "e5"]


def test_a_full_disk_keeps_all_but_the_report(tmp_path: Path) -> None:
    game = Game(tmp_path)
    game.play("e4")
    (tmp_path / "report.json.part").symlink_to("/dev/full")
    with pytest.raises(RecordError, match=f"^{re.escape(f'{tmp_path}/report.json')}: {FULL}$"):
        game.record.end("*", "stopped", 9.0)
    assert not (tmp_path / "report.json").exists()
    assert lines(tmp_path)[-1]["event"] == "end"
    assert read_pgn(tmp_path).headers["Termination"] == "stopped"


class FillingDisk:
    """Takes three more bytes, then nothing."""

    def __init__(self) -> None:
        self.write_really = os.write
        self.full = False

    def write(self, descriptor: int, data: bytes) -> int:
        if self.full:
            no_space()
        self.full = True
        return self.write_really(descriptor, data[:3])


@pytest.mark.parametrize("call", ["write", "fsync"])
def test_a_line_that_did_not_fit_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    log = LineLog(tmp_path / "log")
    log.append("first")
    with monkeypatch.context() as full:
        full.setattr(os, call, FillingDisk().write if call == "write" else no_space)
        with pytest.raises(RecordError, match=f"^{re.escape(f'{tmp_path}/log')}: {FULL}$"):
            log.append("second")
    assert (tmp_path / "log").read_text() == "first\n"
    log.append("third")  # space was freed
    assert (tmp_path / "log").read_text() == "first\nthird\n"
    log.close()


def test_a_line_that_nobody_waits_for_comes_to_the_disk_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced, really = threading.Event(), os.fsync

    def fsync(descriptor: int) -> None:
        really(descriptor)
        assert threading.current_thread() is not threading.main_thread(), "nobody waits"
        synced.set()

    log = LineLog(tmp_path / "log")
    with monkeypatch.context() as watched:
        watched.setattr(os, "fsync", fsync)
        log.append("first", durable=False)
        assert synced.wait(PATIENCE)
    log.close()
    assert "sync log" not in {thread.name for thread in threading.enumerate()}


def test_a_line_that_never_came_to_the_disk_is_told_of_at_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = threading.Event()

    def fsync(_: int) -> None:
        failed.set()
        no_space()

    log = LineLog(tmp_path / "log")
    monkeypatch.setattr(os, "fsync", fsync)
    log.append("first", durable=False)
    assert failed.wait(PATIENCE)
    until(lambda: log._failed is not None)
    with pytest.raises(RecordError, match=FULL):
        log.append("second", durable=False)
    log.close()


@pytest.mark.parametrize("call", ["fsync", "write", "replace"])
def test_an_atomic_write_that_fails_leaves_the_old_file_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    path = tmp_path / "file"
    write_atomically(path, "old")
    if call == "write":
        (tmp_path / "file.part").symlink_to("/dev/full")
    else:
        monkeypatch.setattr(os if call == "fsync" else Path, call, no_space)
    with pytest.raises(RecordError, match=f"^{re.escape(f'{path}')}: {FULL}$"):
        write_atomically(path, "new")
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_other_files_of_a_record_speak_alike(tmp_path: Path) -> None:
    video = tmp_path / "game.webm"
    with pytest.raises(RecordError, match=f"^{re.escape(f'{video}')}: {FULL}$"), recording(video):
        no_space()
    with (
        pytest.raises(RecordError, match=r": the disk quota is used up \(the disk at /\S*\): free some"),
        recording(video),
    ):
        raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))
    with pytest.raises(RecordError, match=r": Permission denied: choose another folder with --out$"), recording(video):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def test_closing_twice_is_harmless_and_writing_afterwards_a_bug(tmp_path: Path) -> None:
    with Game(tmp_path).record as record:
        record.close()
    with pytest.raises(ValueError, match=r"events\.jsonl is closed$"):
        record.end("*", "stopped", 9.0)
    assert len(lines(tmp_path)) == 1
