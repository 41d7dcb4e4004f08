"""Random legal games of every sort: the table always shows the position, and no two pieces ever meet."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence

import chess
from hypothesis import given, settings
from hypothesis import strategies as st

from app.pieces.inventory import Inventory, MoveKind, Ply
from app.pieces.layout import colour_of, kind_of, start_layout
from app.pieces.manipulation import NoSpare, transfers
from hardware.table import Place, TableSettings

TABLE = TableSettings()
PLIES = 80
GAMES = 60
ENDINGS = (
    "4k3/p1p1p1p1/8/1P1P1P1P/1p1p1p1p/8/P1P1P1P1/4K3 w - - 0 1",
    "4k3/PPPPPPPP/8/8/8/8/pppppppp/4K3 w - - 0 1",
    "r1b1k1nr/PPPPPPPP/8/8/8/8/pppppppp/R1B1K1NR w KQkq - 0 1",
    "r3k2r/1P4P1/8/pP1pPp1P/P1PpPp1p/8/1p4p1/R3K2R w KQkq d6 0 1",
)


def show(board: chess.Board) -> dict[str, tuple[str, str]]:
    return {chess.square_name(sq): (str(colour_of(p.color)), str(kind_of(p))) for sq, p in board.piece_map().items()}


def follow(places: dict[str, Place], ply: Ply) -> None:
    """Carry pieces by name on a table of our own; a wrong source or a taken target fails."""
    for transfer in ply.transfers:
        assert places[transfer.name] == transfer.source, transfer
        assert transfer.target not in places.values(), transfer
        places[transfer.name] = transfer.target


def pick(board: chess.Board, inventory: Inventory, draw: random.Random) -> Ply | None:
    """A random legal move that set and spares allow; a refusal must be true."""
    moves = list(board.legal_moves)
    draw.shuffle(moves)
    moves.sort(key=lambda move: _interest(board, move) if draw.random() < 0.7 else 0, reverse=True)
    for move in moves:
        try:
            return transfers(board, move, inventory)
        except NoSpare as refusal:
            owned = [p for p in inventory if p.kind is refusal.kind and p.colour is refusal.colour]
            assert all(piece.place.on_board for piece in owned)
    return None


def _interest(board: chess.Board, move: chess.Move) -> int:
    """How much a move adds to the test; a pawn's double step invites en passant."""
    if board.is_en_passant(move):
        return 3
    if move.promotion or board.is_castling(move):
        return 2
    pawn = bool(board.pawns & chess.BB_SQUARES[move.from_square])
    return int(pawn and abs(move.to_square - move.from_square) == 16)


def play(board: chess.Board, draw: random.Random) -> Counter[MoveKind]:
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    places = {piece.name: piece.place for piece in inventory}
    looks = {piece.name: (str(piece.colour), str(piece.kind)) for piece in inventory}
    seen: Counter[MoveKind] = Counter()
    for _ in range(PLIES):
        ply = pick(board, inventory, draw)
        if ply is None:
            break
        inventory = inventory.after(ply)
        follow(places, ply)
        board.push_uci(ply.uci)
        assert {str(place): looks[name] for name, place in places.items() if place.on_board} == show(board)
        assert {piece.name: piece.place for piece in inventory} == places
        seen[ply.kind] += 1
    return seen


def starts(draw: random.Random, number: int) -> chess.Board:
    match number % 3:
        case 0:
            return chess.Board()
        case 1:
            return chess.Board.from_chess960_pos(draw.randrange(960))
        case _:
            return chess.Board(ENDINGS[number // 3 % len(ENDINGS)])


def total(seen: Sequence[Counter[MoveKind]]) -> Counter[MoveKind]:
    return sum(seen, Counter())


def test_random_games_of_all_lengths() -> None:
    games = []
    for number in range(GAMES):
        draw = random.Random(number)
        games.append(play(starts(draw, number), draw))
    seen = total(games)
    assert seen.total() > GAMES * PLIES * 0.75
    assert min(seen[kind] for kind in MoveKind) >= 25, seen


@settings(max_examples=30)
@given(number=st.integers(0, 959), seed=st.integers(0, 2**32))
def test_games_from_any_chess960_start(number: int, seed: int) -> None:
    play(chess.Board.from_chess960_pos(number), random.Random(seed))


def test_castling_from_every_chess960_start() -> None:
    """With king and rook alone on their rank; colour and wing alternate."""
    castlings = {True: 0, False: 0}
    for number in range(960):
        board = chess.Board.from_chess960_pos(number)
        board.turn = number % 2 == 0
        rank = chess.BB_RANK_1 if board.turn else chess.BB_RANK_8
        rook = list(chess.SquareSet(board.rooks & rank))[number // 2 % 2]
        for square in chess.SquareSet(rank & ~board.kings & ~chess.BB_SQUARES[rook]):
            board.remove_piece_at(square)
        (move,) = (move for move in board.legal_moves if board.is_castling(move))
        castle(board, move)
        castlings[board.is_kingside_castling(move)] += 1
    assert castlings == {True: 480, False: 480}


def castle(board: chess.Board, move: chess.Move) -> None:
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    ply = transfers(board, move, inventory)
    after = board.copy(stack=False)
    after.push(move)
    inventory.after(ply).check_against(after)
    follow({piece.name: piece.place for piece in inventory}, ply)


def test_the_trays_hold_everything_but_the_kings() -> None:
    """Both sides lose all, with promotions in between: the last piece still finds a place."""
    board = chess.Board("4k3/PPPPPPPP/8/8/8/8/pppppppp/4K3 w - - 0 1")
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    draw = random.Random(3)
    for _ in range(600):
        captures = [m for m in board.legal_moves if board.is_capture(m)]
        quiet = [m for m in board.legal_moves if not m.promotion] or list(board.legal_moves)
        if not quiet:
            break
        move = draw.choice(captures or quiet)
        try:
            ply = transfers(board, move, inventory)
        except NoSpare:
            continue
        inventory = inventory.after(ply)
        board.push(move)
        inventory.check_against(board)
    assert sum(not piece.place.on_board for piece in inventory) >= 44
