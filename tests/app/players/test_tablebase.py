"""Endgame tables: results and best moves; the tables here are those of queen, rook or pawn against a king."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import chess
import pytest

from app.players.tablebase import Tablebase, TablebaseError

SYZYGY = Path(__file__).resolve().parents[2] / "data" / "syzygy"


@pytest.fixture(scope="module")
def tables() -> Iterator[Tablebase]:
    with Tablebase(SYZYGY) as tables:
        yield tables


@pytest.mark.parametrize(
    ("fen", "result"),
    [
        ("8/8/8/4k3/8/8/8/R3K3 w - - 0 1", "1-0"),
        ("8/8/8/4k3/8/8/8/R3K3 b - - 0 1", "1-0"),
        ("r3k3/8/8/8/4K3/8/8/8 w - - 0 1", "0-1"),
        ("8/8/8/8/4k3/8/4P3/4K3 b - - 0 1", "1/2-1/2"),
        ("8/8/8/4k3/8/8/8/R3K3 w - - 95 80", None),
        ("8/8/8/4k3/8/8/8/R3K3 w Q - 0 1", None),
        (chess.STARTING_FEN, None),
    ],
)
def test_results(tables: Tablebase, fen: str, result: str | None) -> None:
    assert tables.result(chess.Board(fen)) == result


@pytest.mark.parametrize("fen", ["8/8/8/4k3/8/8/8/R3K3 w - - 0 1", "8/8/8/8/3k4/8/4P3/4K3 w - - 0 1"])
def test_the_best_moves_of_both_sides_lead_to_the_result(tables: Tablebase, fen: str) -> None:
    board = chess.Board(fen)
    expected = tables.result(board)
    for _ in range(80):
        if board.is_game_over() or board.can_claim_draw():
            break
        move = tables.best(board)
        if move is None:
            break
        board.push(move)
        assert board.is_game_over() or tables.result(board) == expected
    assert board.result(claim_draw=True) == expected


def test_an_unknown_position_has_no_best_move(tables: Tablebase) -> None:
    assert tables.best(chess.Board()) is None


def test_what_holds_no_tables_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TablebaseError, match=r"contains no Syzygy tables \(\*.rtbw, \*.rtbz\)"):
        Tablebase(tmp_path)
    with pytest.raises(TablebaseError, match=r"cannot be read \(No such file or directory\)"):
        Tablebase(tmp_path / "none")


def test_a_damaged_table_is_told(tmp_path: Path) -> None:
    for ending in ("rtbw", "rtbz"):
        (tmp_path / f"KRvK.{ending}").write_bytes(b"x" * 80)
    with Tablebase(tmp_path) as tables, pytest.raises(TablebaseError, match=r"is damaged .*: fetch it again"):
        tables.result(chess.Board("8/8/8/4k3/8/8/8/R3K3 w - - 0 1"))
