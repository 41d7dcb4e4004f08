"""The other robot's player, as the game loop here sees them: a ``RemoteOpponent`` over the record that both keep.

Whose turn it is writes the next entry, and does so from the loop's thread alone, between two plies: no two entries can
compete for a place, and what the loop carries out is what both have recorded.
"""

from __future__ import annotations

import secrets
import time
from collections import deque
from collections.abc import Callable
from typing import Final

import chess

from app.game.clock import side_name
from app.game.game import result_of
from app.linked.agreements import plies_taken_back
from app.linked.errors import LinkError
from app.linked.log import LinkedState
from app.linked.messages import BeginEntry, EndEntry, Entry, MoveEntry, TakeBackEntry
from app.linked.peer import OFFERS, LinkedPeer
from app.players.game_end import GameEnd
from app.players.remote import (
    ABORTABLE,
    GameOver,
    Notice,
    Offer,
    OfferAnswered,
    OpponentClock,
    RemoteEvent,
    RemoteListing,
    RemoteMove,
    TakenBack,
)

FLAG: Final = 0.1
"""So often it is looked whether the time here has run out [s, wall]."""


class LinkedOpponent:
    """See ``RemoteOpponent``.

    Args:
        peer: the other robot; it and this one know of a game.
        now: monotonic wall time [s].
    """

    def __init__(self, peer: LinkedPeer, now: Callable[[], float] = time.monotonic) -> None:
        self._peer, self._log, self._now = peer, peer.log, now
        self._told = 0
        """So many entries were told to the loop, or come from it."""
        self._catching_up: deque[RemoteEvent] | None = None
        """How the table here comes to where the record was when the loop began; None: it has not begun."""
        self._over = False

    @property
    def name(self) -> str:
        """See ``RemoteOpponent.name``."""
        return self._peer.name

    @property
    def colour(self) -> chess.Color:
        """See ``RemoteOpponent.colour``."""
        return self._log.state.colour(self._peer.role.other)

    @property
    def listing(self) -> RemoteListing:
        """See ``RemoteOpponent.listing``."""
        clock = self._log.state.clock
        return RemoteListing(here=self._peer.here, time_control=None if clock is None else clock.white.pgn)

    def next(self, timeout: float) -> RemoteEvent | None:
        """See ``RemoteOpponent.next``."""
        until = time.monotonic() + timeout
        with self._peer.changed:
            while (event := self._event()) is None:
                left = until - time.monotonic()
                if left <= 0.0:
                    return None
                self._peer.changed.wait(min(left, FLAG) if self._log.state.clock is not None else left)
            return event

    def play(self, ply: int, move: chess.Move, *, offers_draw: bool = False) -> None:
        """See ``RemoteOpponent.play``; a move that came too late, as the game goes on otherwise, is not told.

        Raises:
            LinkError: the game has another move there, made here before.
        """
        with self._peer.changed:
            state = self._log.state
            done = state.board.move_stack
            if ply < len(done) and done[ply] != move:
                raise LinkError(f"both robots know this ply as {done[ply].uci()}: make that move")
            if ply != len(done) or state.over or not self._writes:
                return
            self._peer.append(MoveEntry(ply=ply, uci=move.uci(), thought=round(self._peer.watch.used, 3)))
            self._told = len(self._log)
            if offers_draw:
                self._peer.propose("draw")

    @property
    def unsaid(self) -> bool:
        """See ``RemoteOpponent.unsaid``."""
        with self._peer.changed:
            return self._peer.have < len(self._log)

    def stands(self, board: chess.Board) -> None:
        """See ``RemoteOpponent.stands``; the first time, it is found out what the table lacks of the record."""
        with self._peer.changed:
            if self._catching_up is None:
                self._begin(board)
            if not self._catching_up:
                self._peer.stand(self._told, board.fen())

    def offer(self, what: Offer) -> None:
        """See ``RemoteOpponent.offer``. A draw that the rules grant is claimed by offering it."""
        named = next(name for name, one in OFFERS.items() if one is what)
        with self._peer.changed:
            state = self._log.state
            if self._peer.answer(named, accepted=True):
                return
            if what is Offer.DRAW and not state.over and self._writes and state.board.can_claim_draw():
                by = "threefold repetition" if state.board.can_claim_threefold_repetition() else "fifty moves"
                self._peer.append(EndEntry(result="1/2-1/2", reason=by))
                return
            plies = None if state.over else plies_taken_back(state, self._peer.role)
            if what is Offer.TAKE_BACK and plies is None:
                self._peer.note("there is nothing of yours to take back")
                return
            self._peer.propose(named, plies or 0)

    def decline(self, what: Offer) -> None:
        """See ``RemoteOpponent.decline``."""
        named = next(name for name, one in OFFERS.items() if one is what)
        with self._peer.changed:
            self._peer.answer(named, accepted=False)

    def resign(self) -> None:
        """See ``RemoteOpponent.resign``."""
        with self._peer.changed:
            self._peer.ask("resign")

    def abort(self) -> None:
        """See ``RemoteOpponent.abort``: before both sides have moved."""
        with self._peer.changed:
            if len(self._log.state.board.move_stack) >= ABORTABLE:
                self._peer.note("both sides have moved, so the game cannot be aborted: resign or offer a draw")
            else:
                self._peer.ask("abort")

    def claim(self) -> None:
        """See ``RemoteOpponent.claim``: a robot that is gone may come back."""
        self._peer.note("a robot that has left may come back: wait for it, or say 'quit' and resume the game later")

    @property
    def claimable(self) -> bool:
        """See ``RemoteOpponent.claimable``: never."""
        return False

    def mending(self, busy: bool) -> None:
        """See ``RemoteOpponent.mending``."""
        with self._peer.changed:
            self._peer.mend(busy=busy)

    def clock(self) -> OpponentClock | None:
        """See ``RemoteOpponent.clock``."""
        with self._peer.changed:
            state, watch = self._log.state, self._peer.watch
            if state.clock is None:
                return None
            turn = state.board.turn
            clock = state.clock if state.over else state.clock.start(turn, 0.0)
            white, black = (max(0.0, clock.left(colour, watch.used)) for colour in (chess.WHITE, chess.BLACK))
            return OpponentClock(white, black, turn if watch.running else None, self._now(), state.clock.white.extra)

    # ------------------------------------------------------------------------------------------------------- events

    def _begin(self, board: chess.Board) -> None:
        """The loop begins, with a table that may be behind the record, or before it by what was taken back."""
        self._told, self._over = len(self._log), False
        state, stands = self._log.state, board.move_stack
        recorded = state.board.move_stack
        common = 0
        while common < min(len(stands), len(recorded)) and stands[common] == recorded[common]:
            common += 1
        self._catching_up = deque()
        if common < len(stands):
            self._catching_up.append(TakenBack(common))
        self._catching_up += [RemoteMove(ply, recorded[ply]) for ply in range(common, len(recorded))]
        if state.ended is not None:
            self._catching_up.append(_end(state.ended, len(recorded)))

    def _event(self) -> RemoteEvent | None:
        peer = self._peer
        if peer.notices:
            return Notice(peer.notices.popleft())
        if peer.fault is not None:
            return GameOver(GameEnd("*", peer.fault, complete=False))
        if self._catching_up is None:
            return None
        if self._catching_up:
            return self._catching_up.popleft()
        if self._writes and (entry := self._due()) is not None:
            peer.append(entry)
        return self._entry() or (peer.events.popleft() if peer.events else self._outcome())

    def _entry(self) -> RemoteEvent | None:
        """The next entry that the loop does not know."""
        if self._told == len(self._log):
            return None
        self._told += 1
        entry, plies = self._log.entries[self._told - 1], self._log.plies[self._told]
        match entry:
            case MoveEntry():
                return RemoteMove(entry.ply, chess.Move.from_uci(entry.uci))
            case TakeBackEntry():
                return TakenBack(entry.plies)
            case EndEntry():
                return _end(entry, plies)
            case BeginEntry():
                self._catching_up = None
                return OfferAnswered(Offer.REMATCH, accepted=True)

    def _due(self) -> Entry | None:
        """What this robot, whose turn it is, has to write down for both."""
        peer, state = self._peer, self._log.state
        if state.over:
            assert state.begin is not None
            again = state.begin.model_copy(
                update={"game": secrets.token_hex(8), "host_is_white": not state.begin.host_is_white}
            )
            return again if "rematch" in peer.agreements.agreed else None
        return self._requested(state) or self._agreed() or self._flag(state)

    def _requested(self, state: LinkedState) -> Entry | None:
        peer, turn = self._peer, state.board.turn
        for request, colour in ((peer.asked, not turn), (peer.request, turn)):
            if request == "resign":
                return EndEntry(result="0-1" if colour else "1-0", reason=f"{side_name(colour)} resigns")
            if request == "abort":
                return EndEntry(result="*", reason="aborted")
        return None

    def _agreed(self) -> Entry | None:
        agreed = self._peer.agreements.agreed
        if "draw" in agreed:
            return EndEntry(result="1/2-1/2", reason="draw by agreement")
        back = agreed.get("take back")
        return None if back is None else TakeBackEntry(plies=back.plies)

    def _flag(self, state: LinkedState) -> Entry | None:
        watch = self._peer.watch
        if state.clock is None or not watch.running:
            return None
        fallen = state.clock.start(state.board.turn, 0.0).fallen(state.board, watch.used)
        return None if fallen is None else EndEntry(result=fallen.result, reason=fallen.reason)

    def _outcome(self) -> RemoteEvent | None:
        """The end by the rules, once, when the other robot has the last move, too."""
        outcome = self._log.state.board.outcome()
        if outcome is None or self._over or self._peer.have < len(self._log):
            return None
        self._over = True
        return GameOver(GameEnd(result_of(outcome), outcome.termination.name.lower().replace("_", " "), True))

    @property
    def _writes(self) -> bool:
        return self._peer.writes and self._told == len(self._log)


def new_game(fen: str, *, chess960: bool, host_is_white: bool, clock: str | None, plies: int) -> BeginEntry:
    """A game that the host begins."""
    game = secrets.token_hex(8)
    return BeginEntry(
        game=game, fen=fen, chess960=chess960, host_is_white=host_is_white, clock=clock, plies=plies
    )  # fmt: skip


def _end(entry: EndEntry, plies: int) -> GameOver:
    return GameOver(GameEnd(entry.result, entry.reason, True), plies=plies)
