"""Whatever the server's list becomes, the table that does what the ledger says has the same moves in the end."""

from __future__ import annotations

import random

import chess
import pytest

from app.online.ledger import MoveLedger, moves_of
from app.players.remote import RemoteMove, TakenBack

LINE = moves_of("e2e4 e7e5 g1f3 b8c6 f1b5 a7a6")


class Table:
    """Does what it is told, and checks that it can be done."""

    def __init__(self) -> None:
        self.board = chess.Board()

    def do(self, events: list[RemoteMove | TakenBack]) -> None:
        for event in events:
            if isinstance(event, TakenBack):
                assert event.plies < len(self.board.move_stack)
                while len(self.board.move_stack) > event.plies:
                    self.board.pop()
            else:
                assert event.ply == len(self.board.move_stack)
                assert self.board.is_legal(event.move)
                self.board.push(event.move)


def test_moves_are_read_also_where_castling_is_written_as_king_takes_rook() -> None:
    text = "e2e4 e7e5 g1f3 g8f6 f1e2 f8e7 "
    assert moves_of(text + "e1h1") == moves_of(text + "e1g1")
    for text in ("e2e5", "e2e4 0000"):
        with pytest.raises(ValueError, match="illegal"):
            moves_of(text)


def test_what_the_table_lacks_is_made_and_what_it_has_too_much_is_taken_back() -> None:
    assert MoveLedger(chess.WHITE, ()).hear(LINE[:2]) == [RemoteMove(0, LINE[0]), RemoteMove(1, LINE[1])]
    ledger = MoveLedger(chess.WHITE, LINE[:4])
    assert ledger.hear(LINE[:4]) == []
    assert ledger.hear(LINE[:2]) == [TakenBack(2)]


def test_a_move_of_ours_is_on_its_way_until_the_server_has_it() -> None:
    ledger = MoveLedger(chess.WHITE, LINE[:2])
    assert ledger.play(2, LINE[2])
    assert ledger.hear(LINE[:2]) == []
    assert ledger.unconfirmed == (2, LINE[2])
    assert ledger.hear(LINE[:3]) == []
    assert ledger.unconfirmed is None
    assert not ledger.play(2, LINE[2]), "it was said already"
    assert not ledger.play(5, LINE[5]), "there is a gap"
    assert not ledger.play(3, chess.Move.from_uci("a1a8")), "it is not legal"


def test_a_move_of_ours_that_the_server_had_and_has_no_more_was_taken_back() -> None:
    """By agreement, while the opponent thought: only a program before this one leaves moves that are not known of."""
    ledger = MoveLedger(chess.WHITE, LINE[:2])
    assert ledger.play(2, LINE[2])
    assert ledger.hear(LINE[:3]) == []
    assert ledger.hear(LINE[:2]) == [TakenBack(2)]
    assert ledger.unconfirmed is None


def test_a_move_that_was_made_here_before_this_program_began_is_on_its_way_too() -> None:
    ledger = MoveLedger(chess.WHITE, LINE[:3])
    assert ledger.hear(LINE[:2]) == []
    assert ledger.unconfirmed == (2, LINE[2])
    assert ledger.give_up() == [TakenBack(2)]
    theirs = MoveLedger(chess.BLACK, LINE[:3])
    assert theirs.hear(LINE[:2]) == [TakenBack(2)], "a move of theirs that they do not have is none"


def test_a_take_back_overtakes_a_move_of_ours() -> None:
    ledger = MoveLedger(chess.WHITE, LINE[:4])
    assert ledger.play(4, LINE[4])
    assert ledger.hear(LINE[:3]) == [TakenBack(3)]
    assert ledger.unconfirmed is None


@pytest.mark.parametrize("seed", range(40))
def test_table_and_server_agree_whatever_happens(seed: int) -> None:
    drawn = random.Random(seed)
    server, table, colour = chess.Board(), Table(), drawn.random() < 0.5
    ledger, on_the_way = MoveLedger(colour, ()), list[tuple[int, chess.Move]]()
    for _ in range(120):
        match drawn.randrange(5):
            case 0 if server.turn is not colour and any(server.legal_moves):
                server.push(drawn.choice(list(server.legal_moves)))
            case 1 if server.move_stack and drawn.random() < 0.4:
                for _ in range(min(drawn.choice([1, 2]), len(server.move_stack))):
                    server.pop()
            case 2 if table.board.turn is colour and any(table.board.legal_moves):
                ply, move = len(table.board.move_stack), drawn.choice(list(table.board.legal_moves))
                if ledger.play(ply, move):
                    on_the_way.append((ply, move))
                table.board.push(move)  # it stands on the table, whether it is one of the game or not
                if ledger.unconfirmed != (ply, move):
                    while len(table.board.move_stack) > ply:  # what the opponent queues in such a case
                        table.board.pop()
            case 3 if on_the_way:
                ply, move = on_the_way.pop(0)
                if ledger.unconfirmed == (ply, move) and server.turn is colour and server.is_legal(move):
                    server.push(move)
            case _:
                table.do(ledger.hear(tuple(server.move_stack)))
    table.do(ledger.hear(tuple(server.move_stack)))
    table.do(ledger.give_up())
    assert table.board.move_stack == server.move_stack
