"""Setting positions up and taking moves back: the table shows what it shall, by as few transfers as it can take."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.motion import MotionSettings, Planner
from app.pieces.inventory import Inventory, InventoryError, Transfer
from app.pieces.layout import colour_of, kind_of, start_layout
from app.pieces.manipulation import NoSpare, transfers
from app.pieces.order import NowhereAside, rearrange
from app.pieces.position import PiecesMissing, PlacesMissing, arranged, set_up
from hardware.parameters import load_parameters
from hardware.piece_set import Colour, Kind
from hardware.table import Captured, PieceSpec, Place, TableSettings, square_place

TRAYS, BOXES = TableSettings(), TableSettings(captured=Captured.BOX)
SEEDS = st.integers(min_value=0, max_value=2**32)
GAMES = st.integers(min_value=0, max_value=15)
"""Each is played once."""
ENDINGS = (
    chess.STARTING_FEN,
    "4k3/PPPPPPPP/8/8/8/8/pppppppp/4K3 w - - 0 1",
    "r3k2r/1P4P1/8/pP1pPp1P/P1PpPp1p/8/1p4p1/R3K2R w KQkq d6 0 1",
)


class Played(NamedTuple):
    board: chess.Board
    history: list[Inventory]

    @property
    def now(self) -> Inventory:
        return self.history[-1]


def stock(board: chess.Board, table: TableSettings = TRAYS) -> Inventory:
    return Inventory.of(start_layout(board, table), table)


@cache
def play(seed: int, table: TableSettings = TRAYS, most: int = 150) -> Played:
    """A random game of random length, with many captures and promotions."""
    draw = random.Random(seed)
    board = chess.Board(draw.choice(ENDINGS))
    history = [stock(board, table)]
    for _ in range(draw.randrange(most)):
        moves = list(board.legal_moves)
        draw.shuffle(moves)
        moves.sort(key=lambda move: draw.random() < 0.3 and bool(move.promotion or board.is_capture(move)))
        try:
            ply = transfers(board, moves.pop(), history[-1])
        except IndexError:
            break
        except NoSpare:
            continue
        history.append(history[-1].after(ply))
        board.push_uci(ply.uci)
    return Played(board, history)


def follow(now: Inventory, plan: Sequence[Transfer]) -> dict[str, Place]:
    """Carry pieces by name on a table of our own; a wrong source or a taken target fails."""
    places = {piece.name: piece.place for piece in now}
    for transfer in plan:
        assert places[transfer.name] == transfer.source, transfer
        assert not transfer.source.in_box, transfer
        assert transfer.target not in places.values(), transfer
        places[transfer.name] = transfer.target
    return places


def looks(pieces: Inventory | dict[str, Place], now: Inventory) -> dict[int, tuple[Colour, Kind]]:
    """What a camera would see on the squares."""
    places = pieces if isinstance(pieces, dict) else {piece.name: piece.place for piece in pieces}
    return {p.index: (now.find(name).colour, now.find(name).kind) for name, p in places.items() if p.on_board}


def shown(board: chess.BaseBoard) -> dict[int, tuple[Colour, Kind]]:
    return {square: (colour_of(piece.color), kind_of(piece)) for square, piece in board.piece_map().items()}


def fewest(here: dict[int, tuple[Colour, Kind]], wanted: dict[int, tuple[Colour, Kind]]) -> int:
    """A lower bound by counting, without choosing pieces or an order.

    Each look moves at least as often as it has squares too many or too few. Looks that stand on each other's squares
    belong together; where those together leave and need the very same squares, none of which is free, one more
    transfer is needed to begin with.
    """
    kinds = set(here.values()) | set(wanted.values())
    leave = {k: {s for s, look in here.items() if look == k and wanted.get(s) != k} for k in kinds}
    need = {k: {s for s, look in wanted.items() if look == k and here.get(s) != k} for k in kinds}
    together = {k: {k} for k in kinds}
    for one in kinds:
        for other in kinds:
            if leave[one] & need[other]:
                union = together[one] | together[other]
                for k in union:
                    together[k] = union
    closed = 0
    for group in {frozenset(union) for union in together.values()}:
        leaving = set().union(*(leave[k] for k in group))
        balanced = all(len(leave[k]) == len(need[k]) for k in group)
        closed += bool(leaving) and balanced and leaving == set().union(*(need[k] for k in group))
    return sum(max(len(leave[k]), len(need[k])) for k in kinds) + closed


def check_position(now: Inventory, board: chess.BaseBoard) -> tuple[Transfer, ...]:
    plan = set_up(now, board)
    places = follow(now, plan)
    assert looks(places, now) == shown(board)
    assert places == {piece.name: piece.place for piece in arranged(now, board)}
    assert len(plan) == fewest(looks(now, now), shown(board))
    after = now
    for transfer in plan:
        after = after.moved(transfer)
    assert set_up(after, board) == ()
    return plan


@given(GAMES, GAMES)
@settings(max_examples=20)
def test_any_position_is_set_up_from_any_other_by_the_fewest_transfers(one: int, other: int) -> None:
    check_position(play(one).now, play(other).board)


@given(GAMES, SEEDS, st.integers(min_value=0, max_value=6))
@settings(max_examples=15)
def test_so_are_positions_in_which_pieces_stand_on_each_others_squares(game: int, seed: int, swaps: int) -> None:
    """Rings, which positions of games seldom have: the same squares with other pieces on them."""
    board, draw = play(game).board.copy(), random.Random(seed)
    now = arranged(stock(chess.Board()), board)
    squares = list(board.piece_map())
    for _ in range(swaps):
        a, b = draw.choice(squares), draw.choice(squares)
        one, two = board.piece_at(a), board.piece_at(b)
        board.set_piece_at(a, two)
        board.set_piece_at(b, one)
    check_position(now, board)


def test_a_ring_costs_one_more_transfer_and_alike_pieces_open_it() -> None:
    now = stock(chess.Board("4k3/8/8/8/8/8/8/RB2K3 w - - 0 1"))
    assert [(t.source, t.target) for t in check_position(now, chess.Board("4k3/8/8/8/8/8/8/BR2K3 w - - 0 1"))] == [
        (square_place(0), square_place(8)), (square_place(1), square_place(0)), (square_place(8), square_place(1))
    ]  # fmt: skip
    now = stock(chess.Board("4k3/8/8/8/8/8/8/RB2K2R w - - 0 1"))
    assert len(check_position(now, chess.Board("4k3/8/8/8/8/7R/8/BR2K3 w - - 0 1"))) == 3


@pytest.mark.parametrize("fen", ["kkkk4/8/8/8/8/8/8/K7", "8/8/8/8/3Q4/8/8/K7", "QQQQ4/RRRR4/BBBB4/NNNN4/8/8/8/qq6"])
def test_a_position_need_not_be_legal(fen: str) -> None:
    """As long as the set has it: 50 pieces, of which the trays hold 48."""
    kings = [PieceSpec(f"black-king-{i}", Kind.KING, Colour.BLACK, square_place(chess.C5 + i)) for i in range(3)]
    now = [piece for piece in stock(chess.Board()) if piece.kind is not Kind.PAWN]
    check_position(Inventory.of([*now, *kings], TRAYS), chess.BaseBoard(fen))


def test_what_is_missing_is_named() -> None:
    everything = list(start_layout(chess.Board(), TRAYS))
    now = Inventory.of((p for p in everything if p.name not in ("white-queen", "black-king")), TRAYS)
    with pytest.raises(PiecesMissing) as refused:
        set_up(now, chess.Board("4k3/8/8/8/8/8/8/QQQQK3 w - - 0 1"))
    assert str(refused.value) == (
        "the position needs 4 white queens, only 3 stand on board and trays, and 1 black king, none stands on board "
        "and trays: put the missing pieces on free places of the trays"
    )
    assert [(lack.kind, lack.colour, lack.needed, lack.there) for lack in refused.value.lacks] == [
        (Kind.QUEEN, Colour.WHITE, 4, 3), (Kind.KING, Colour.BLACK, 1, 0)
    ]  # fmt: skip


def test_what_lies_in_a_box_is_named() -> None:
    board, now = chess.Board(), stock(chess.Board(), BOXES)
    for san in ("e4", "d5", "exd5"):
        now = now.after(transfers(board, board.parse_san(san), now))
        board.push_san(san)
    with pytest.raises(PiecesMissing, match=r"needs 8 black pawns, only 7 stand .*: black-pawn-d lies in a box"):
        set_up(now, chess.Board())
    check_position(now, chess.Board("4k3/8/8/8/8/8/8/4K3 w - - 0 1"))


@given(GAMES, GAMES)
@settings(max_examples=12)
def test_with_boxes_a_position_is_set_up_or_refused_for_a_true_reason(one: int, other: int) -> None:
    now, board = play(one, BOXES).now, play(other, BOXES).board
    there = Counter((p.colour, p.kind) for p in now if not p.place.in_box)
    lacking = Counter(shown(board).values()) - there
    if lacking:
        with pytest.raises(PiecesMissing) as refused:
            set_up(now, board)
        assert {(k.colour, k.kind): k.needed - k.there for k in refused.value.lacks} == dict(lacking)
        return
    boxed = {t.name for t in check_position(now, board) if t.target.in_box}
    trays = {piece.place for piece in arranged(now, board) if not piece.place.on_board and not piece.place.in_box}
    assert not boxed or len(trays) == len(BOXES.tray_places()), "boxes only when the trays are full"


def test_trays_that_are_too_small_are_named_with_both_numbers() -> None:
    small = TableSettings(tray_rows=10)
    now = Inventory.of((p for p in start_layout(chess.Board(), TRAYS) if p.place.on_board), small)
    check_position(now, chess.BaseBoard("8/8/8/8/8/8/8/8"))
    smaller = TableSettings(tray_rows=7)
    now = Inventory.of(now, smaller)
    with pytest.raises(PlacesMissing) as refused:
        set_up(now, chess.BaseBoard("8/8/8/8/8/8/8/8"))
    assert str(refused.value) == (
        "32 pieces must leave the board, and trays and boxes have 28 free places: choose a position with at least 4 "
        "more of the pieces on the board, or enlarge the trays of the table"
    )


def test_pieces_that_leave_stay_clear_of_the_places_for_captures() -> None:
    board = chess.Board()
    plan = check_position(stock(board), chess.Board("rnbqkbnr/8/8/8/8/8/8/RNBQKBNR w KQkq - 0 1"))
    outer = max(abs(TRAYS.xy(place)[0]) for place in TRAYS.tray_places())
    free = 24 - 18
    assert sum(abs(TRAYS.xy(t.target)[0]) > outer - 1e-9 for t in plan) == min(free, len(plan))


@given(SEEDS, st.booleans())
@settings(max_examples=15)
def test_any_inventory_becomes_any_other(seed: int, full: bool) -> None:
    """Also where nearly all places are taken: pieces are carried once, and one of each ring twice."""
    draw = random.Random(seed)
    table = TableSettings(tray_rows=1, tray_columns=1) if full else TRAYS
    places = [*map(square_place, range(64)), *table.tray_places()]
    number = draw.randrange(1, len(places)) if full else draw.randrange(50)
    pieces = [PieceSpec(f"piece-{i}", draw.choice(list(Kind)), Colour.WHITE, Place("L", 0)) for i in range(number)]

    def scattered() -> Inventory:
        chosen = draw.sample(places, number)
        return Inventory.of(
            (PieceSpec(p.name, p.kind, p.colour, place) for p, place in zip(pieces, chosen, strict=True)), table
        )

    now, target = scattered(), scattered()
    if draw.random() < 0.5:  # the same places, so that there are many rings
        order = draw.sample(list(now), number)
        stand = [piece.place for piece in now]
        target = Inventory.of(
            (PieceSpec(p.name, p.kind, p.colour, place) for p, place in zip(order, stand, strict=True)), table
        )
    plan = rearrange(now, target)
    goals = {piece.name: piece.place for piece in target}
    assert follow(now, plan) == goals
    carried = Counter(transfer.name for transfer in plan)
    moving = {piece.name: (piece.place, goals[piece.name]) for piece in now if piece.place != goals[piece.name]}
    assert set(carried) == set(moving)
    assert set(carried.values()) <= {1, 2}
    assert sum(carried.values()) == len(moving) + rings(moving)
    assert rearrange(target, target) == ()


def rings(moving: dict[str, tuple[Place, Place]]) -> int:
    """Cycles of a permutation, by taking away whatever can move until nothing can."""
    left = dict(moving)
    while free := [name for name, (_, goal) in left.items() if goal not in {source for source, _ in left.values()}]:
        del left[free[0]]
    count = 0
    while left:
        count, (_, goal) = count + 1, left.popitem()[1]
        while step := next((name for name, (source, _) in left.items() if source == goal), None):
            goal = left.pop(step)[1]
    return count


def test_with_no_place_free_a_ring_is_refused() -> None:
    table = TableSettings(tray_rows=1, tray_columns=1)
    places = [*map(square_place, range(64)), *table.tray_places()]
    now = [PieceSpec(f"p{i}", Kind.PAWN, Colour.WHITE, place) for i, place in enumerate(places)]
    swapped = [PieceSpec("p0", Kind.PAWN, Colour.WHITE, places[1]), PieceSpec("p1", Kind.PAWN, Colour.WHITE, places[0])]
    with pytest.raises(NowhereAside, match=r"^p0, p1 stand on each other's places, and there is no free place"):
        rearrange(Inventory.of(now, table), Inventory.of([*swapped, *now[2:]], table))


def test_inventories_of_other_pieces_are_a_bug() -> None:
    now = stock(chess.Board())
    with pytest.raises(InventoryError, match="only one of both inventories has this black king: black-king"):
        rearrange(now, Inventory.of((p for p in now if p.name != "black-king"), TRAYS))


@pytest.mark.parametrize("table", [TRAYS, BOXES], ids=["trays", "boxes"])
def test_the_arm_can_do_what_is_planned(table: TableSettings) -> None:
    """Every transfer has room for the fingers, among all that stands there at its time."""
    parameters, motion = load_parameters(), MotionSettings()
    done = 0
    for seed in range(2):
        now, board = play(seed, table, 30 if table is BOXES else 150).now, play(100 + seed, table).board
        try:
            plan = set_up(now, board)
        except PiecesMissing:
            continue
        arm = Planner.of(motion, parameters, now.table, np.array(motion.home), 0.008, 8).ply("set up", plan, now)
        assert [m.transfer for m in arm.motions if m.grips] == list(range(len(plan)))
        done += len(plan)
    assert done > 10


@given(GAMES, st.integers(min_value=1, max_value=8))
@settings(max_examples=10)
def test_moves_are_taken_back_by_setting_the_position_before_up(seed: int, plies: int) -> None:
    """Captures, castling, en passant and promotions alike, with pieces alike standing in for each other."""
    played = play(seed)
    board = played.board.copy()
    for _ in range(min(plies, len(board.move_stack))):
        board.pop()
    inventory = played.now
    for transfer in set_up(inventory, board):
        inventory = inventory.moved(transfer)
    inventory.check_against(board)
