"""Players: a line is followed by ply, then the engine goes on."""

from __future__ import annotations

import chess
import chess.engine
import pytest

from app.players import Decision, LinePlayer, Players


class Always:
    name = "always"

    def __init__(self, move: str) -> None:
        self.move = chess.Move.from_uci(move)

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        return Decision(self.move)


def test_a_line_is_followed_from_the_position_it_starts_in():
    board = chess.Board("4k3/8/8/8/8/8/4P3/4K3 b - - 0 31")
    line = [chess.Move.from_uci(m) for m in ("e8e7", "e2e4", "e7e6")]
    player = LinePlayer(board, line)
    for expected in line:
        assert player.choose(board).move == expected
        board.push(expected)
    assert player.choose(board).move is None
    assert player.name == "line"


def test_after_the_line_another_player_goes_on():
    board = chess.Board()
    player = LinePlayer(board, [chess.Move.from_uci("e2e4")], Always("e7e5"))
    assert player.choose(board).move == chess.Move.from_uci("e2e4")
    board.push_uci("e2e4")
    assert player.choose(board).move == chess.Move.from_uci("e7e5")
    assert player.name == "always"


class Counting:
    def __init__(self, name: str) -> None:
        self.name = name
        self.positions = list[str]()

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        self.positions.append(board.fen())
        return Decision(next(iter(board.legal_moves)))


def test_what_was_thought_ahead_is_the_answer_and_another_position_is_thought_about_anew():
    white, black = Counting("w"), Counting("b")
    board, other = chess.Board(), chess.Board()
    other.push_san("Nf3")
    with Players(white, black) as players:
        assert (players.name(chess.WHITE), players.name(chess.BLACK)) == ("w", "b")
        players.begin(board)
        players.begin(board)
        first = players.choose(board).move
        assert len(white.positions) == 1
        assert first in board.legal_moves
        players.begin(board)
        assert players.choose(other).move in other.legal_moves
        assert black.positions == [other.fen()]
        board.push_san("Nf3")
        board.push_san("Nf6")
        board.push_san("Ng1")
        board.push_san("Ng8")  # the same position, but seen before: another question
        players.begin(chess.Board())
        players.choose(board)
        assert white.positions[-1] == board.fen()


def test_what_goes_wrong_in_thinking_ahead_shows_when_the_move_is_needed():
    class Broken:
        name = "broken"

        def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
            raise LookupError("no move")

    with Players(Broken(), Broken()) as players:
        players.begin(chess.Board())
        with pytest.raises(LookupError, match="no move"):
            players.choose(chess.Board())
