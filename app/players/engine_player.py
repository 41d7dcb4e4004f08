"""A UCI engine as a player: its book, when it resigns or takes a draw, and what it expects of the other side."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import chess
import chess.engine

from app.players.decision import Decision
from app.players.tablebase import Tablebase
from engine.book import Book
from engine.draws_and_resigning import DrawResignPolicy
from engine.stockfish import Engine, EngineMove

EXPECTING: Final = 0.1
"""Time to find the reply to expect where the engine has named none, such as after a move of the book [s]."""


class EnginePlayer:
    """A UCI engine, with a book of openings and a policy on draws and resigning."""

    def __init__(
        self, engine: Engine, name: str, *, book: Book | None = None, policy: DrawResignPolicy | None = None,
        tablebase: Tablebase | None = None,
    ) -> None:  # fmt: skip
        self._engine = engine
        self._name = name
        self._book, self._tablebase = book, tablebase
        self._policy = policy or DrawResignPolicy()
        self._scores = dict[int, chess.engine.PovScore]()
        self._expected: tuple[str, chess.Move] | None = None

    @property
    def name(self) -> str:
        """For the record."""
        return self._name

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        """The book's move, or the engine's within its deadlines.

        Raises:
            EngineProblem: as ``Engine.choose``; it may be asked anew.
        """
        if self._book is not None and (move := self._book.move(board)) is not None:
            self._expected = None
            return Decision(move, from_book=True)
        answer = self._engine.choose(board, self._engine.settings.limit_by(clock))
        self._remember(board, answer)
        scores = self._own_scores(board, board.ply())
        policy = self._policy
        return replace(
            _decision(answer), resigns=policy.resigns(scores), offers_draw=policy.offers_draw(scores, board),
            claims_draw=policy.claims_draw(scores, board),
        )  # fmt: skip

    def ponder(self, board: chess.Board, clock: chess.engine.Limit | None, *, certain: bool) -> None:
        """As ``Thinker``; nothing unless the engine's settings say that it ponders."""
        if not self._engine.settings.ponders or not any(board.legal_moves):
            return
        ahead = board.copy()
        if not certain:
            reply = self._book_reply(board) or self._reply(board)
            ahead.push(reply)
            if self._book is not None and self._book.move(ahead) is not None:
                return  # nothing to think about
        self._engine.ponder(ahead, self._engine.settings.limit_by(clock))

    def move_now(self) -> None:
        """As ``Thinker``."""
        self._engine.move_now()

    def hint(self, board: chess.Board) -> Decision:
        """What the endgame tables say, else what the engine would play at full strength.

        Raises:
            EngineProblem: as ``Engine.hint``.
            TablebaseError: a table is damaged.
        """
        if self._tablebase is not None and (move := self._tablebase.best(board)) is not None:
            return Decision(move)
        return _decision(self._engine.hint(board))

    def accepts_draw(self, board: chess.Board) -> bool:
        """By its last scores; the engine is not asked."""
        return self._policy.accepts_draw(self._own_scores(board, board.ply()), board)

    def _remember(self, board: chess.Board, answer: EngineMove) -> None:
        for ply in [ply for ply in self._scores if ply >= board.ply()]:  # taken back since, or asked again
            del self._scores[ply]
        if answer.score is not None:
            self._scores[board.ply()] = answer.score
        after = board.copy()
        after.push(answer.move)
        self._expected = None if answer.ponder is None else (after.fen(), answer.ponder)

    def _own_scores(self, board: chess.Board, ply: int) -> list[chess.engine.Score]:
        """Scores up to a ply without a gap, in order, of the side that this player gave them for."""
        plies = [known for known in sorted(self._scores) if known <= ply]
        if not plies or ply - plies[-1] > 1:
            return []
        first = next((n for n in range(len(plies) - 1, 0, -1) if plies[n] - plies[n - 1] > 2), 0)
        return [self._scores[known].relative for known in plies[first:]]

    def _book_reply(self, board: chess.Board) -> chess.Move | None:
        return None if self._book is None else self._book.move(board)

    def _reply(self, board: chess.Board) -> chess.Move:
        """What the other side is expected to play."""
        if self._expected is not None and self._expected[0] == board.fen():
            return self._expected[1]
        return self._engine.choose(board, chess.engine.Limit(time=EXPECTING)).move


def _decision(answer: EngineMove) -> Decision:
    return Decision(
        answer.move, answer.score, answer.pv, answer.ponder, answer.depth, answer.wall, answer.lost, answer.troubles
    )
