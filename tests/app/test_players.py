"""Players: a line is followed by ply, then the engine goes on."""

from __future__ import annotations

import chess

from app.players import Decision, LinePlayer


class Always:
    name = "always"

    def __init__(self, move: str) -> None:
        self.move = chess.Move.from_uci(move)

    def choose(self, board: chess.Board) -> Decision:
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
