"""Opening books: what is drawn, by weight and seed, and what is refused."""

from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path

import chess
import chess.polyglot
import pytest

from engine.book import Book, BookSettings
from engine.errors import BookBroken

REMEDY = "name a book in Polyglot's format (often .bin), or leave it out"


def entry(board: chess.Board, uci: str, weight: int) -> bytes:
    """One entry; castling as Polyglot writes it, the king takes its rook."""
    move = chess.Move.from_uci(uci)
    raw = move.to_square | move.from_square << 6 | ((move.promotion or 1) - 1) << 12
    return struct.pack(">QHHI", chess.polyglot.zobrist_hash(board), raw, weight, 0)


def write_book(path: Path, *entries: bytes) -> Path:
    path.write_bytes(b"".join(sorted(entries)))
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    start, after = chess.Board(), chess.Board()
    after.push_uci("e2e4")
    castle = chess.Board("4k3/8/8/8/8/8/8/4K2R w K - 0 1")
    return write_book(
        tmp_path / "book.bin",
        entry(start, "e2e4", 60), entry(start, "d2d4", 30), entry(start, "c2c4", 9), entry(start, "f2f3", 0),
        entry(start, "e2e5", 50), entry(after, "e7e5", 1), entry(castle, "e1h1", 1),
    )  # fmt: skip


def drawn(path: Path, seed: int, **settings: int) -> str:
    with Book(BookSettings(path=path, max_plies=20, **settings), seed) as book:
        move = book.move(chess.Board())
        assert move is not None
        return move.uci()


def test_moves_are_drawn_by_weight_and_only_legal_ones(path: Path) -> None:
    counts = Counter(drawn(path, seed) for seed in range(600))
    assert set(counts) == {"e2e4", "d2d4", "c2c4"}  # neither weight 0 nor e2e5
    for uci, weight in (("e2e4", 60), ("d2d4", 30), ("c2c4", 9)):
        assert counts[uci] / 600 == pytest.approx(weight / 99, abs=0.06)


def test_light_moves_are_left_out(path: Path) -> None:
    assert {drawn(path, seed, min_weight=30) for seed in range(60)} == {"e2e4", "d2d4"}


def test_a_seed_draws_the_same_however_often_it_is_asked(path: Path) -> None:
    with Book(BookSettings(path=path, max_plies=20), 5) as book:
        moves = {book.move(chess.Board()) for _ in range(20)}
    assert moves == {chess.Move.from_uci(drawn(path, 5))}


def test_a_book_ends(path: Path) -> None:
    board = chess.Board()
    board.push_uci("e2e4")
    with Book(BookSettings(path=path, max_plies=20)) as book:
        assert book.move(board) == chess.Move.from_uci("e7e5")
        board.push_uci("e7e5")
        assert book.move(board) is None
    with Book(BookSettings(path=path, max_plies=1)) as book:
        assert book.move(chess.Board()) is not None
        board.pop()
        assert book.move(board) is None


def test_castling_is_read_as_polyglot_writes_it(path: Path) -> None:
    with Book(BookSettings(path=path, max_plies=20)) as book:
        assert book.move(chess.Board("4k3/8/8/8/8/8/8/4K2R w K - 0 1")) == chess.Move.from_uci("e1g1")


def test_what_is_no_book_is_refused(tmp_path: Path) -> None:
    cases = {
        "missing": (None, f"opening book {tmp_path}/missing cannot be read: No such file or directory: {REMEDY}"),
        "empty": (b"", f"{tmp_path}/empty is not an opening book, its 0 bytes are not whole entries of 16: {REMEDY}"),
        "cut": (b"x" * 40, f"{tmp_path}/cut is not an opening book, its 40 bytes are not whole entries of 16: "
                           f"{REMEDY}"),
        "text": (b"zz 45678 9abcdef" + b"aa 45678 9abcdef", f"{tmp_path}/text is not an opening book, its entries are "
                 f"not sorted: {REMEDY}"),
    }  # fmt: skip
    for name, (content, sentence) in cases.items():
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(BookBroken) as caught:
            Book(BookSettings(path=tmp_path / name, max_plies=20))
        assert str(caught.value) == sentence
    with pytest.raises(BookBroken, match=f"^opening book {tmp_path} cannot be read: Is a directory|{tmp_path} is no"):
        Book(BookSettings(path=tmp_path, max_plies=20))
