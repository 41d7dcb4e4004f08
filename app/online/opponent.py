"""The opponent of one game on Lichess: a thread hears what the server says, another says what happens here."""

from __future__ import annotations

import queue
import threading
from collections import deque
from typing import Final

import chess

from app import UserError
from app.online.client import BACK_OFF, Cut, LichessClient, RequestRefused, Stream
from app.online.endings import end_of_game
from app.online.ledger import MoveLedger, moves_of
from app.online.messages import (
    ChatLine,
    GameFull,
    GameLine,
    GameState,
    MessageError,
    OpponentGone,
    game_line,
)
from app.online.saying import Saying
from app.players.game_end import GameEnd
from app.players.remote import (
    GameOver,
    Notice,
    Offer,
    OfferAnswered,
    Offered,
    OpponentClock,
    RemoteEvent,
    RemoteListing,
    RemoteMove,
    TakenBack,
)

_SAYS: Final = {Offer.DRAW: "draw", Offer.TAKE_BACK: "takeback"}


class LichessOpponent:
    """``RemoteOpponent`` of a game that has begun. Its threads start at once; ``close`` ends them.

    Args:
        client: of the account.
        kind: of the API, board or bot.
        full: the first line of the game's stream.
        stream: that goes on with it.
        me: id of the account.
        claims: the game is claimed as soon as it can be, once the opponent has left; else when somebody says so.
        takes_back: proposals to take back are told here; else they are declined.
    """

    def __init__(
        self, client: LichessClient, kind: str, full: GameFull, stream: Stream, me: str, *, claims: bool = False,
        takes_back: bool = True,
    ) -> None:  # fmt: skip
        self.game = full.id
        self._client, self._kind, self._full = client, kind, full
        self._claims, self._takes_back = claims, takes_back
        white = full.white.id == me
        self._colour = chess.BLACK if white else chess.WHITE
        mine, theirs = (full.white, full.black) if white else (full.black, full.white)
        self._name, self._mine = theirs.shown, mine.shown
        self.opponent_id = theirs.id
        self._lock = threading.RLock()
        self._events: queue.Queue[RemoteEvent] = queue.Queue()
        self._changes = 0
        """Events in the queue by which the table's position will change."""
        self._ledger: MoveLedger | None = None
        self._state = full.state
        self._clock: OpponentClock | None = None
        self._offers = dict[tuple[bool, Offer], bool]()
        self._claimable_at: float | None = None
        self._cut = self._unsure = False
        self._over = False
        self._outbox: deque[Saying] = deque()
        self._refused = 0
        self._work = threading.Event()
        self._closed = threading.Event()
        self._stream = stream
        client.slowed = lambda sentence: self._put(Notice(sentence))
        self._take(full.state)
        self._threads = [
            threading.Thread(target=self._listen, name="lichess game", daemon=True),
            threading.Thread(target=self._speak, name="lichess moves", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    # ----------------------------------------------------------------------------------------- as of RemoteOpponent

    @property
    def name(self) -> str:
        """See ``RemoteOpponent.name``."""
        return self._name

    @property
    def colour(self) -> chess.Color:
        """See ``RemoteOpponent.colour``."""
        return self._colour

    @property
    def listing(self) -> RemoteListing:
        """See ``RemoteOpponent.listing``."""
        return RemoteListing(self._mine, f"{self._client.server}/{self.game}", self._full.time_control)

    def next(self, timeout: float) -> RemoteEvent | None:
        """See ``RemoteOpponent.next``."""
        try:
            event = self._events.get(timeout=timeout) if timeout > 0.0 else self._events.get_nowait()
        except queue.Empty:
            return None
        if isinstance(event, (RemoteMove, TakenBack)):
            with self._lock:
                self._changes -= 1
        return event

    def play(self, ply: int, move: chess.Move, *, offers_draw: bool = False) -> None:
        """See ``RemoteOpponent.play``; a move of a position that is no more is not said."""
        with self._lock:
            if self._ledger is None or self._changes or self._over or not self._ledger.play(ply, move):
                return
            self._say(Saying(f"move/{move.uci()}" + ("?offeringDraw=true" if offers_draw else ""), ply, move))

    @property
    def unsaid(self) -> bool:
        """See ``RemoteOpponent.unsaid``."""
        return not self._over and self._ledger is not None and self._ledger.unconfirmed is not None

    def stands(self, board: chess.Board) -> None:
        """See ``RemoteOpponent.stands``; what the table lacks follows."""
        with self._lock:
            if self._ledger is not None:
                return
            self._ledger = MoveLedger(not self._colour, board.move_stack)
            try:
                self._agree(fresh=True)
            except ValueError as error:
                self._give_up(str(error))

    def offer(self, what: Offer) -> None:
        """See ``RemoteOpponent.offer``; a rematch is a matter of the lobby."""
        self._propose(what, "yes")

    def decline(self, what: Offer) -> None:
        """See ``RemoteOpponent.decline``."""
        self._propose(what, "no")

    def _propose(self, what: Offer, answer: str) -> None:
        if what in _SAYS:
            theirs = self._offers.get((self._colour, what), False)
            self._say(Saying(f"{_SAYS[what]}/{answer}", answers=what if theirs else None))

    def resign(self) -> None:
        """See ``RemoteOpponent.resign``."""
        self._say(Saying("resign"))

    def abort(self) -> None:
        """See ``RemoteOpponent.abort``."""
        self._say(Saying("abort"))

    def claim(self) -> None:
        """See ``RemoteOpponent.claim``."""
        self._say(Saying("claim-victory"))

    @property
    def claimable(self) -> bool:
        """See ``RemoteOpponent.claimable``."""
        at = self._claimable_at
        return at is not None and self._client.waiting.now() >= at

    def mending(self, busy: bool) -> None:
        """See ``RemoteOpponent.mending``: Lichess stops no clock."""

    def clock(self) -> OpponentClock | None:
        """See ``RemoteOpponent.clock``."""
        return self._clock

    def close(self) -> None:
        """End the threads; what was not said yet is left unsaid."""
        self._closed.set()
        self._work.set()
        self._stream.close()
        for thread in self._threads:
            thread.join(timeout=2.0)

    # ------------------------------------------------------------------------------------------------------- hearing

    def _listen(self) -> None:
        tries = 0
        while True:
            try:
                for said in self._stream:
                    tries = 0
                    if said is not None and (line := game_line(said)) is not None:
                        self._hear(line)
            except Cut:
                pass  # taken up again below
            except (MessageError, ValueError) as error:
                self._give_up(str(error))
            if self._over or self._closed.is_set():
                return
            with self._lock:
                if tries == 1 and not self._cut:  # one that was taken up at once is nobody's concern
                    self._cut = True
                    self._put(Notice(f"the link to {self._client.server} is cut: it is tried again and again"))
            if self._client.waiting.wait(BACK_OFF[min(tries, len(BACK_OFF) - 1)], self._closed):
                return
            tries += 1
            if not self._open():
                return

    def _open(self) -> bool:
        """Take the stream up again, if the server can be reached; False: there is no such game."""
        try:
            self._stream = self._client.game(self._kind, self.game)
        except Cut:
            return True
        except RequestRefused as refusal:
            self._give_up(f"the server does not show the game any more: {refusal}")
            return False
        except UserError as error:
            self._give_up(str(error))
            return False
        if self._closed.is_set():
            self._stream.close()
        with self._lock:
            if self._cut:
                self._cut = False
                self._put(Notice(f"the link to {self._client.server} is back"))
        return True

    def _hear(self, line: GameLine) -> None:
        match line:
            case GameFull():
                self._take(line.state, fresh=True)
            case GameState():
                self._take(line)
            case OpponentGone():
                self._hear_gone(line)
            case ChatLine() if line.room == "player" and line.username not in (self._mine, "lichess"):
                self._put(Notice(f"{self._name} writes: {line.shown}"))
            case _:
                pass

    def _take(self, state: GameState, *, fresh: bool = False) -> None:
        with self._lock:
            self._state = state
            self._set_clock(state)
            self._agree(fresh=fresh)
            self._unsure = self._unsure and not fresh

    def _agree(self, *, fresh: bool) -> None:
        """What the table has to do, so that it agrees with the server; and what was offered; and the end.

        ``fresh``: the state was asked for just now, so that what it lacks of ours was not heard.
        """
        state, ledger = self._state, self._ledger
        if ledger is None or self._over:
            return
        moves = moves_of(state.moves)
        changes = ledger.hear(moves)
        self._change(changes)
        if state.over:
            self._over = True
            self._put(GameOver(end_of_game(state), len(moves)))
            self._work.set()
            return
        self._hear_offers(state, len(moves), back=any(isinstance(change, TakenBack) for change in changes))
        unconfirmed = ledger.unconfirmed
        if fresh and unconfirmed is not None and not any(said.ply == unconfirmed[0] for said in self._outbox):
            if self._refused > 1:
                self._put(Notice(f"the server does not take {unconfirmed[1].uci()}: it is taken back"))
                self._refused = 0
                self._change(ledger.give_up())
            else:
                self._say(Saying(f"move/{unconfirmed[1].uci()}", *unconfirmed))

    def _change(self, events: list[RemoteMove | TakenBack]) -> None:
        for event in events:
            self._changes += 1
            self._put(event)

    def _hear_offers(self, state: GameState, plies: int, *, back: bool) -> None:
        flags = {
            (True, Offer.DRAW): state.wdraw, (False, Offer.DRAW): state.bdraw,
            (True, Offer.TAKE_BACK): state.wtakeback, (False, Offer.TAKE_BACK): state.btakeback,
        }  # fmt: skip
        before, self._offers = self._offers, flags
        for (colour, what), stands in flags.items():
            stood = before.get((colour, what), False)
            if stands and not stood and colour is self._colour and what is Offer.TAKE_BACK and not self._takes_back:
                self.decline(what)
            elif stands and not stood and colour is self._colour:
                to_move = (plies % 2 == 0) is self._colour
                self._put(Offered(what, (2 if to_move else 1) if what is Offer.TAKE_BACK else 0))
            elif stood and not stands and not (back and colour is self._colour):
                self._put(OfferAnswered(what, accepted=back, withdrawn=colour is self._colour))

    def _hear_gone(self, line: OpponentGone) -> None:
        if not line.gone:
            self._claimable_at = None
            self._put(Notice(f"{self._name} is back"))
            return
        after = line.claim_after or 0
        self._claimable_at = self._client.waiting.now() + after
        later = f" after {after} s" if after else ""
        self._put(Notice(f"{self._name} has left the game; say 'claim'{later} to win it"))
        if self._claims:
            timer = threading.Timer(after + 1.0, self.claim)
            timer.daemon = True
            timer.start()

    def _set_clock(self, state: GameState) -> None:
        if self._full.clock is None:
            return
        plies, lag = len(state.moves.split()), 0.5 * self._client.latency
        running = None if state.over or plies < 2 else plies % 2 == 0
        self._clock = OpponentClock(
            1e-3 * state.wtime, 1e-3 * state.btime, running, self._client.waiting.now() - lag,
            1e-3 * state.winc, self._client.latency,
        )  # fmt: skip

    def _give_up(self, sentence: str) -> None:
        with self._lock:
            if not self._over:
                self._over = True
                self._put(GameOver(GameEnd("*", sentence, complete=False)))
                self._work.set()

    def _put(self, event: RemoteEvent) -> None:
        self._events.put(event)

    # ------------------------------------------------------------------------------------------------------ speaking

    def _say(self, said: Saying) -> None:
        with self._lock:
            self._outbox.append(said)
        self._work.set()

    def _speak(self) -> None:
        tries = 0
        while not self._closed.is_set():
            with self._lock:
                said = self._outbox[0] if self._outbox else None
                if said is None:
                    self._work.clear()
            if said is None:
                self._work.wait()
                continue
            if self._pointless(said):
                self._done(said)
                continue
            if said.answers is not None and self._unsure:
                self._client.waiting.wait(BACK_OFF[0], self._closed)
                continue
            try:
                self._client.act(self._kind, self.game, said.what)
            except Cut:
                if said.answers is not None:  # the whole game is asked for: it shows whether that was heard
                    self._unsure = True
                    self._stream.close()
                if self._client.waiting.wait(BACK_OFF[min(tries, len(BACK_OFF) - 1)], self._closed):
                    return
                tries += 1
                continue
            except RequestRefused as refusal:
                self._hear_refusal(said, refusal)
            except UserError as error:
                self._give_up(str(error))
            else:
                self._refused = 0 if said.ply is not None else self._refused
            tries = 0
            self._done(said)

    def _pointless(self, said: Saying) -> bool:
        """A move that the server has, or that was taken back; an answer to no offer; anything once the game is over."""
        with self._lock:
            if self._over:
                return True
            if said.ply is None or self._ledger is None:
                return said.answers is not None and not self._offers.get((self._colour, said.answers), False)
            return self._ledger.unconfirmed != (said.ply, said.move)

    def _done(self, said: Saying) -> None:
        with self._lock:
            if self._outbox and self._outbox[0] is said:
                self._outbox.popleft()

    def _hear_refusal(self, said: Saying, refusal: RequestRefused) -> None:
        if said.ply is not None:  # the whole game is asked for: it shows what has become of the move
            self._refused += 1
            self._done(said)  # first: what is still to be said is neither repeated nor taken back
            self._stream.close()
        elif not self._over:
            self._put(Notice(f"the server does not accept '{said.what}': {refusal}"))
