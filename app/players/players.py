"""Who chooses the moves: both sides of a game, and a line that is given."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import chess
import chess.engine

from app.players.decision import Decision, Player, Thinker
from app.players.engine_player import EnginePlayer
from app.players.tablebase import Tablebase, TableResult
from engine.errors import EngineRefused
from engine.stockfish import same_position

__all__ = ["Decision", "EnginePlayer", "LinePlayer", "Player", "Players", "Thinker"]


class LinePlayer:
    """Follows a given line; afterwards another player goes on, or nobody."""

    def __init__(self, start: chess.Board, line: Sequence[chess.Move], then: Player | None = None, name: str = "line"):
        self._first_ply = start.ply()
        self._line = tuple(line)
        self._then = then
        self._name = then.name if then is not None else name

    @property
    def name(self) -> str:
        """For the record."""
        return self._name

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        """The line's move at this ply."""
        move = self._given(board.ply())
        if move is not None:
            return Decision(move)
        return self._then.choose(board, clock) if self._then is not None else Decision(None)

    def ponder(self, board: chess.Board, clock: chess.engine.Limit | None, *, certain: bool) -> None:
        """The player that follows, once it is its turn."""
        given = self._given(board.ply() if certain else board.ply() + 1)
        if given is None and isinstance(self._then, Thinker):
            self._then.ponder(board, clock, certain=certain)

    def move_now(self) -> None:
        """The player that follows."""
        if isinstance(self._then, Thinker):
            self._then.move_now()

    def hint(self, board: chess.Board) -> Decision:
        """Of the player that follows; of nobody, no move."""
        return self._then.hint(board) if isinstance(self._then, Thinker) else Decision(None)

    def accepts_draw(self, board: chess.Board) -> bool:
        """The player that follows; a line goes on."""
        return isinstance(self._then, Thinker) and self._then.accepts_draw(board)

    def _given(self, ply: int) -> chess.Move | None:
        index = ply - self._first_ply
        return self._line[index] if 0 <= index < len(self._line) else None


class Players:
    """Both sides. Each is asked in a thread of its own, so that one can think while the arm or a person still moves.

    A context manager: at its end nobody is waited for, and closing an engine ends what it thinks about.

    Args:
        white: player; None: a person, whose moves are seen and not asked for.
        black: the same.
        ponders: whether anybody thinks in the other side's time of a clock. In pace fast plant time waits for no clock,
            and a thought that may not count would only slow the simulation down.
        tablebase: ends the game where it knows the result; None: it is played out.
    """

    def __init__(
        self, white: Player | None, black: Player | None, *, ponders: bool = True, tablebase: Tablebase | None = None
    ) -> None:
        self._ponders, self._tablebase = ponders, tablebase
        self._players = {chess.WHITE: white, chess.BLACK: black}
        pool = ThreadPoolExecutor(1, "thinking")
        other = pool if white is black else ThreadPoolExecutor(1, "thinking")
        self._pools = {chess.WHITE: pool, chess.BLACK: other}
        self._ahead: tuple[chess.Board, Future[Decision]] | None = None
        self._pondered = dict[chess.Color, tuple[chess.Board, chess.engine.Limit | None, bool]]()

    def __enter__(self) -> Players:
        return self

    def __exit__(self, *_: object) -> None:
        for pool in self._pools.values():
            pool.shutdown(wait=False, cancel_futures=True)

    def adjudicated(self, board: chess.Board) -> TableResult | None:
        """How the game ends by the endgame tables; None: it goes on.

        Raises:
            TablebaseError: a table is damaged.
        """
        return None if self._tablebase is None else self._tablebase.result(board)

    def name(self, colour: chess.Color) -> str:
        """Of the player of a colour, for the record."""
        player = self._players[colour]
        return "Human" if player is None else player.name

    def begin(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> None:
        """Let the side to move think about a position that will be on the board; asked twice, it goes on.

        Without a clock it thinks for its move, and ``choose`` has the answer at once. With one it only ponders, if its
        settings say so, since its time has not begun.
        """
        if self._players[board.turn] is None:
            return
        if clock is None:
            self._ask(board, None)
        elif self._ponders:
            self._ponder(board.turn, board, clock, certain=True)

    def ponder(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> None:
        """Let the side that has moved think about the reply it expects, if its settings say so; returns at once.

        After its move, ``clock`` is what it will be asked with (``ChessClock.limit`` of its colour).
        """
        if self._ponders:
            self._ponder(not board.turn, board, clock, certain=False)

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        """The move, as soon as the side to move knows it; what was thought about another position is dropped.

        The board has its history; ``clock`` is what the chess clock leaves; None: without one.

        Raises:
            EngineProblem: as the player; asked again, it is started again, so that a game can wait until it is mended.
            ValueError: the side is a person's.
        """
        self._ask(board, clock)
        assert self._ahead is not None
        _, decision = self._ahead
        try:
            return decision.result()
        finally:
            self._ahead = None

    def ready(self, board: chess.Board) -> bool:
        """Whether ``choose`` would answer at once, by ``begin``."""
        return self._ahead is not None and same_position(self._ahead[0], board) and self._ahead[1].done()

    def move_now(self) -> None:
        """Hurry the players that think about a move."""
        for player in self._players.values():
            if isinstance(player, Thinker):
                player.move_now()

    def hint(self, board: chess.Board) -> Decision:
        """What to play in this position, for the person to move: by the other side, else by the own, at its best.

        Raises:
            EngineProblem: as the player.
            EngineRefused: no player can say.
        """
        for colour in (not board.turn, board.turn):
            player = self._players[colour]
            if isinstance(player, Thinker):
                said = self._pools[colour].submit(player.hint, board.copy()).result()
                if (pondered := self._pondered.get(colour)) is not None:  # the hint has ended it
                    self._ponder(colour, pondered[0], pondered[1], certain=pondered[2])
                if said.move is not None:
                    return said
        raise EngineRefused("no engine is playing that could give a hint: play against one")

    def accepts_draw(self, board: chess.Board, colour: chess.Color) -> bool:
        """Whether the player of a colour agrees to a draw in this position; one that cannot say does not."""
        player = self._players[colour]
        return isinstance(player, Thinker) and player.accepts_draw(board)

    def _ask(self, board: chess.Board, clock: chess.engine.Limit | None) -> None:
        if self._ahead is not None and same_position(self._ahead[0], board):
            return
        if self._ahead is not None and not self._ahead[1].cancel():
            self.move_now()  # it thinks about a position that did not come
        player = self._players[board.turn]
        if player is None:
            raise ValueError("a person is to move: there is no engine to ask")
        position = board.copy()
        told = () if clock is None else (clock,)
        self._pondered.pop(board.turn, None)
        self._ahead = position, self._pools[board.turn].submit(player.choose, position, *told)

    def _ponder(
        self, colour: chess.Color, board: chess.Board, clock: chess.engine.Limit | None, *, certain: bool
    ) -> None:
        player = self._players[colour]
        if isinstance(player, Thinker):
            position = board.copy()
            self._pondered[colour] = position, clock, certain
            # What goes wrong in it is not lost: ``choose`` meets it again, or it has passed.
            self._pools[colour].submit(player.ponder, position, clock, certain=certain)
