"""The game loop: the side to move moves, by the arm or by hand, until the game is over."""

from __future__ import annotations

import time
from collections.abc import Callable

import chess

from app import UserError
from app.execution.state import LEFT, WRONG, Remark
from app.execution.table import Table
from app.game.bystander import Bystander
from app.game.clock import side_name
from app.game.human_turn import HumanTurn
from app.game.person import GameLeft, end_of
from app.game.remote_turn import RemoteTurn
from app.game.timing import Timing
from app.players.game_end import GameEnd, Result, plies_in_words
from app.players.person import Human, Lines
from app.players.players import Decision, Players
from app.players.remote import RemoteOpponent
from app.rig.arm import FELT
from app.terminal.game_display import UserInterface
from engine.errors import EngineProblem


class Game:
    """One game at one table.

    Args:
        table: where it is played.
        players: who choose the moves that the arm makes.
        ui: shown what happens.
        human: who plays one side by hand; None: the arm makes all moves.
        comments: recorded with each ply, from the first one of the game on.
        result: of a game that is played again; its moves are made to their end, whatever might have been claimed
            before. None: the rules end the game, and draws are claimed.
        timing: chess clocks; None: none.
        bystander: who may interrupt engines; None: nobody.
        opponent: who plays one side from somewhere else; None: nobody does.
        lines: what is said here to an opponent elsewhere; None: nobody says anything.
    """

    def __init__(
        self,
        table: Table,
        players: Players,
        ui: UserInterface,
        human: Human | None = None,
        comments: tuple[str, ...] = (),
        result: Result | None = None,
        timing: Timing | None = None,
        bystander: Bystander | None = None,
        opponent: RemoteOpponent | None = None,
        lines: Lines | None = None,
    ) -> None:
        self._table, self._players, self._ui = table, players, ui
        self._timing = timing or Timing(None, table.now)
        self._comments, self._result, self._bystander = comments, result, bystander
        moves_pieces = None if human is None else lambda colour: human.hands is None and colour is human.colour
        self._remote = None
        if opponent is not None:
            self._remote = RemoteTurn(opponent, table, players, self._timing, ui, lines, moves_pieces)
        self._human = None if human is None else HumanTurn(human, table, players, self._timing, ui, self._remote)
        self._most = 0
        self.thinking = 0.0
        """Wall time that the arm rested because a player thought [s]."""

    def play(self, plies: int) -> GameEnd:
        """Play until the game is over, a player has no more moves, or so many plies are done.

        A ply that fails physically ends the game; what went wrong is in the record.
        """
        try:
            return self._play(plies)
        except GameLeft as left:
            return leave(self._table, left, self._left)
        finally:
            self._timing.pause()  # nobody's time runs when it is over
            if self._remote is not None:
                self._remote.close()

    def _left(self, left: GameLeft) -> GameEnd:
        if self._remote is not None:
            return self._remote.leave(left.word)
        return (
            end_of(left.word, left.wish, chess.WHITE) if self._human is None else self._human.left(left.word, left.wish)
        )

    def _play(self, plies: int) -> GameEnd:
        board = self._table.board
        self._ui.position(board)
        if self._remote is not None:
            self._remote.show()  # what an earlier program has left undone may be their move
        self._most = plies
        by_hand = frozenset() if self._human is None else frozenset(filter(self._human.plays, chess.COLORS))
        if not self._table.begin(by_hand):
            return WRONG
        self._table.subscribe(self._think_ahead)
        if self._remote is not None:
            self._remote.stands()
        while True:
            end = self._over(plies)
            end = end or self._turn()
            if end is not None:
                return end

    def _over(self, plies: int) -> GameEnd | None:
        board = self._table.board
        again = self._result is not None
        outcome = board.outcome(claim_draw=self._human is None and self._remote is None)
        done = len(board.move_stack) >= plies
        if outcome is not None and (done or not again):
            end = GameEnd(result_of(outcome), outcome.termination.name.lower().replace("_", " "), True)
            return end if self._remote is None else self._remote.confirmed(end)
        if done:
            return GameEnd(self._result or "*", f"{plies_in_words(plies)} played", True)
        known = None if self._remote is not None else self._players.adjudicated(board)
        return None if known is None else GameEnd(known, "known from the endgame tables", True)

    def _turn(self) -> GameEnd | None:
        """One ply, or something else in its place."""
        if self._remote is not None and self._remote.plays(self._table.board.turn):
            return self._remote.take()
        if self._human is not None and self._human.plays(self._table.board.turn):
            return self._human.take()
        return (None if self._bystander is None else self._bystander.heed()) or self._ask()

    def _ask(self) -> GameEnd | None:
        """The player to move is asked, and the arm does it."""
        board, colour = self._table.board, self._table.board.turn
        decision = self._choose()
        self._timing.give_back(decision.lost)  # before anybody asks whether it has run out
        if self._remote is not None:
            return self._answer(self._remote, decision)
        if (fallen := self._timing.fallen(board)) is not None:
            return fallen
        if decision.resigns:
            return GameEnd("0-1" if colour else "1-0", f"{side_name(colour)} resigns", True)
        if decision.claims_draw:
            return GameEnd("1/2-1/2", f"{side_name(colour)} claims a draw", True)
        if decision.move is None:
            return GameEnd(self._result or "*", "end of the given line", True)
        return self._make(decision, decision.move)

    def _answer(self, remote: RemoteTurn, decision: Decision) -> GameEnd | None:
        """What the engine here has decided, unless something has come from its opponent meanwhile."""
        before = self._table.board.move_stack.copy()
        end = remote.heed()
        if end is None and decision.claims_draw:
            end = remote.claim_draw()
        if end is not None or self._table.board.move_stack != before:
            return end
        if decision.resigns:
            return remote.resign()
        if decision.move is None:
            return GameEnd("*", "end of the given line", True)
        remote.tell(decision.move, offers_draw=decision.offers_draw)
        end = self._make(decision, decision.move)
        remote.stands()
        return end

    def _make(self, decision: Decision, move: chess.Move) -> GameEnd | None:
        """The arm makes the move of a player."""
        colour, number = self._table.board.turn, len(self._table.board.move_stack)
        self._timing.decided()

        def clocks() -> dict[chess.Color, float] | None:
            self._timing.arm_clear()
            return self._timing.left()

        comment = self._comments[number] if number < len(self._comments) else ""
        remark = Remark(decision.score, comment, clocks)
        answers = self._human is not None and self._human.moves_pieces(not colour)
        with self._timing.motion():
            well = self._table.arm_ply(move, remark, answers)
        if not well:
            return WRONG
        if decision.offers_draw and self._human is not None:
            self._ui.say("I offer a draw: say 'draw' if you agree")
        return None

    def _choose(self) -> Decision:
        """What the player to move decides; where its engine fails for good and a person is there, the game waits."""
        board = self._table.board
        name = self._players.name(board.turn)
        self._ui.phase(f"{side_name(board.turn)} thinks" + (f" ({name})" if name != "?" else ""))  # as PGN writes it
        since = time.perf_counter()
        while True:
            self._timing.start(board.turn)
            try:
                decision = self._players.choose(board, self._timing.limit(board.turn))
                break
            except EngineProblem as problem:
                self._timing.forget()
                self._ui.device("engine", False, f"{name}: {problem}")
                if self._human is None:
                    raise
                self._human.wait(
                    f"{problem} ('quit' first, then 'touchmove resume' takes it); say 'go' when I may ask it again"
                )
        self._ui.device("engine", True, f"{name} answers")
        for trouble in decision.troubles:
            self._ui.phase(f"the engine was started again: {trouble}")
        self.thinking += time.perf_counter() - since
        return decision

    def _think_ahead(self, uci: str) -> None:
        """While the arm lets go of the last piece of a move and goes home, the next player thinks already; or, where a
        person is next, the engine about what they will play.
        """
        board = self._table.board.copy()
        board.push_uci(uci)
        if len(board.move_stack) >= self._most or board.outcome(claim_draw=True) is not None:
            return
        by_others = self._human is not None and self._human.plays(board.turn)
        if by_others or (self._remote is not None and self._remote.plays(board.turn)):
            self._players.ponder(board, self._timing.limit(not board.turn))
        else:
            self._players.begin(board, self._timing.limit(board.turn))


def leave(table: Table, left: GameLeft, end: Callable[[GameLeft], GameEnd]) -> GameEnd:
    """How it ends at a table for a person who has left; ``end`` says so of what they said.

    Where they go on otherwise, after a STOP, the arm first finishes what it was stopped in, once they say 'go': nothing
    else begins with a piece in its fingers.
    """
    while (how := end(left)) is not LEFT:
        try:
            return how if table.finish() else WRONG
        except GameLeft as again:
            left = again
    return how


def require_empty_fingers(felt: float) -> None:
    """Before a game begins: ``felt`` by both pads [N].

    Raises:
        UserError: something is between them.
    """
    if felt >= FELT:
        raise UserError(
            "something is between the fingers: take it out by hand, or continue its game with 'touchmove resume'"
        )


def result_of(outcome: chess.Outcome) -> Result:
    """In PGN's words."""
    if outcome.winner is None:
        return "1/2-1/2"
    return "1-0" if outcome.winner else "0-1"
