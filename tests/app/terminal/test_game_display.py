"""What people see in the terminal, on a terminal and in a log file."""

from __future__ import annotations

import io
from datetime import UTC, datetime

import chess
import pytest
from rich.console import Console

from app.records import PlyEvent
from app.terminal.game_display import Conversation, Terminal, UserInterface, board_text


def event(**changes) -> PlyEvent:
    values = {
        "wall_time": datetime(2026, 1, 1, tzinfo=UTC), "plant_time": 3.0, "ply": 3, "side": "white", "san": "exd5",
        "uci": "e4d5", "kind": "capture", "fen": chess.STARTING_FEN, "planned_s": 3.1, "real_s": 3.14159,
        "placement_mm": {"white-pawn-e": 0.034, "black-pawn-d": 0.056}, "peak_torque_Nm": 4.0, "peak_force_N": 4.1,
        "physical_ok": True, "frame": None, "transfers": (), "inventory": {}, "failures": (),
    }  # fmt: skip
    return PlyEvent.model_validate({**values, **changes})


def shown(terminal: bool, *events: PlyEvent, phases: tuple[str, ...] = ()) -> str:
    out = io.StringIO()
    console = Console(file=out, force_terminal=terminal, width=100, color_system=None)
    board = chess.Board()
    with Terminal(console) as ui:
        ui.position(board)
        for phase in phases:
            ui.phase(phase)
        board.push_san("e4")
        for one in events:
            ui.ply(one, board)
        for phase in phases:
            ui.phase(phase)
    return out.getvalue()


def test_a_terminal_shows_board_phase_and_plies():
    text = shown(True, event(), phases=("pawn e4 to d5",))
    assert "♙ ♙ ♙ ♙ · ♙ ♙ ♙" in text
    assert "pawn e4 to d5" in text
    assert "ply 3" in text
    assert "3.14 s" in text
    assert "0.06 mm" in text, "the worst piece counts"


def test_a_ply_without_a_time_was_moved_by_hand_or_mended():
    assert "by hand" in shown(False, event(by="hand", real_s=None))
    assert "mended" in shown(False, event(mended=True, real_s=None))


def test_a_log_gets_a_line_a_ply_and_no_phases_once_plies_tell():
    text = shown(False, event(), event(ply=4, side="black"), phases=("starting",))
    lines = text.strip().splitlines()
    assert lines == [
        "starting",
        "ply   3  white  exd5    capture      3.14 s   0.06 mm  ok",
        "ply   4  black  exd5    capture      3.14 s   0.06 mm  ok",
    ]


@pytest.mark.parametrize(("ok", "word"), [(True, "ok"), (False, "WRONG"), (None, "unjudged")])
def test_the_verdict_is_plain(ok, word):
    assert shown(False, event(physical_ok=ok, placement_mm=None)).strip().endswith(f"-  {word}")


def test_quiet_shows_nothing(capsys):
    ui = UserInterface()
    ui.phase("x")
    ui.position(chess.Board())
    ui.ply(event(), chess.Board())
    assert capsys.readouterr() == ("", "")


def test_without_colours_white_and_black_pieces_still_differ() -> None:
    board = chess.Board()
    plain, coloured = board_text(board, plain=True).plain, board_text(board).plain
    assert plain.count("♙") == plain.count("♟") == 8
    assert coloured.count("♟") == 16, "in colours both are filled, and their ink differs"


@pytest.mark.parametrize("echoes", [True, False])
def test_what_comes_unasked_does_not_run_on_from_a_prompt(echoes: bool) -> None:
    out = io.StringIO()
    ui = Conversation(Console(file=out), echoes=echoes)
    ui.prompt("your move")
    ui.heard("e4")
    ui.phase("thinks")
    ui.prompt("your move")
    ui.say("the camera is back")
    typed = "" if echoes else "e4\n"  # a terminal shows itself what is typed
    assert out.getvalue() == f"your move > {typed}  … thinks\nyour move > \nthe camera is back\n"
