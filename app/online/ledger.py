"""The moves that the server has, against those that this table has or will have: what to do so that they agree.

Pure bookkeeping. The server's list is the truth, but for the move of this side that is on its way there.
"""

from __future__ import annotations

from collections.abc import Sequence

import chess

from app.players.remote import RemoteMove, TakenBack


def moves_of(text: str) -> tuple[chess.Move, ...]:
    """The server's list, in UCI, from the usual position.

    Raises:
        ValueError: a move is not legal.
    """
    board, moves = chess.Board(), list[chess.Move]()
    for uci in text.split():
        move = board.parse_uci(uci)
        if not move:  # python-chess takes 0000 for a move
            raise chess.IllegalMoveError(f"illegal uci: {uci!r} in {board.fen()}")
        moves.append(move)
        board.push(move)
    return tuple(moves)


class MoveLedger:
    """The moves of a game as this table will have them once it has done all that it was told.

    Args:
        colour: of this side.
        standing: moves that stand on the table.
    """

    def __init__(self, colour: chess.Color, standing: Sequence[chess.Move]) -> None:
        self._colour = colour
        self._moves = list(standing)
        self._unconfirmed: int | None = None
        self._heard = False

    @property
    def unconfirmed(self) -> tuple[int, chess.Move] | None:
        """The ply and the move of this side that the server is not known to have; None: it has all."""
        return None if self._unconfirmed is None else (self._unconfirmed, self._moves[self._unconfirmed])

    def play(self, ply: int, move: chess.Move) -> bool:
        """Take a move of this side; False: that is no move of the game any more, and the table will hear why."""
        if ply < len(self._moves):
            return False
        if ply > len(self._moves) or not self._board().is_legal(move):
            return False
        self._moves.append(move)
        self._unconfirmed = ply
        return True

    def hear(self, theirs: Sequence[chess.Move]) -> list[RemoteMove | TakenBack]:
        """The server has these moves: what this table has to do, in order."""
        same = 0
        while same < min(len(theirs), len(self._moves)) and theirs[same] == self._moves[same]:
            same += 1
        behind = same == len(theirs) and len(self._moves) == same + 1
        left_before, self._heard = not self._heard and self._ours(same), True  # by another program
        if behind and (self._unconfirmed == same or (self._unconfirmed is None and left_before)):
            self._unconfirmed = same  # it is on its way
            return []
        self._unconfirmed = None
        return self._follow(theirs, same)

    def give_up(self) -> list[RemoteMove | TakenBack]:
        """The server does not take the unconfirmed move: what this table has to do."""
        if self._unconfirmed is None:
            return []
        kept, self._unconfirmed = self._unconfirmed, None
        return self._follow(self._moves[:kept], kept)

    def _follow(self, theirs: Sequence[chess.Move], same: int) -> list[RemoteMove | TakenBack]:
        events: list[RemoteMove | TakenBack] = []
        if same < len(self._moves):
            events.append(TakenBack(same))
        events += [RemoteMove(ply, theirs[ply]) for ply in range(same, len(theirs))]
        self._moves = list(theirs)
        return events

    def _ours(self, ply: int) -> bool:
        return (ply % 2 == 0) is self._colour

    def _board(self) -> chess.Board:
        board = chess.Board()
        for move in self._moves:
            board.push(move)
        return board
