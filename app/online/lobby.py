"""Finds opponents on Lichess: by a seek, by a challenge, or by waiting for one; and goes on with a game."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Final, Self

from app import UserError
from app.execution.state import LEFT
from app.game.person import PersonAttendant, ask
from app.online.client import BACK_OFF, CONNECTING, Cut, LichessClient, RequestRefused, Stream
from app.online.messages import (
    Account,
    Challenge,
    Challenged,
    ChallengeGone,
    GameFull,
    GameStart,
    game_line,
)
from app.online.opponent import LichessOpponent
from app.online.seeks_and_events import EventFeed, Seek
from app.online.terms import BLITZ, TablePace, Terms, of_challenge
from app.players.game_end import GameEnd
from app.players.person import Lines, PersonGone
from app.players.typed_commands import Word, word_of
from app.settings.defaults import OnlineSection, OnlineUse
from app.terminal.game_display import UserInterface

POLL: Final = 0.2
"""How long is waited for events before it is asked what is said here [s, wall]."""
EXPIRY: Final = 20.0
"""A challenge to a game at the board is gone after so long, unless it is made anew [s, wall]."""
CHALLENGES: Final = 3
"""So often somebody is challenged who does not answer."""
AGAIN: Final = "rematch"
"""What a person says after a game who wants another one with the same opponent."""
REMATCH: Final = 3.0
"""How long their own proposal of a rematch is waited for, before they are challenged [s, wall]."""
_FIRST_LINE: Final = 5
"""So often a game's stream is opened until its first line has come."""


class WaitingLines:
    """``Lines`` of a person who waits for a game: what is meant for the game is kept until it begins."""

    def __init__(self, lines: Lines) -> None:
        self._lines = lines
        self._kept = deque[str]()

    @property
    def accompanied(self) -> bool:
        """See ``Lines.accompanied``."""
        return self._lines.accompanied

    def next(self, timeout: float) -> str | None:
        """See ``Lines.next``."""
        return self._kept.popleft() if self._kept else self._lines.next(timeout)

    def forget(self, word: str) -> None:
        """See ``Lines.forget``."""
        self._kept = deque(line for line in self._kept if line.lower() != word)
        self._lines.forget(word)

    def quits(self) -> bool:
        """Whether they say 'quit' before there is a game.

        Raises:
            PersonGone: nobody is there any more, and nothing is kept.
        """
        try:
            line = self._lines.next(0.0)
        except PersonGone:
            if self._kept:
                return False
            raise
        if line is not None and word_of(line) is not Word.QUIT:
            self._kept.append(line)
        return line is not None and word_of(line) is Word.QUIT


class Lobby:
    """``OpponentSource`` of Lichess. A context manager: at its end nothing is asked, and no thread is left.

    Args:
        client: of the account.
        account: whose token it is.
        online: the settings.
        terms: of the games.
        pace: of this table.
        ui: shown what is waited for.
        lines: what is said here.
        games: so many are played at most without anybody asking for more.
        going_on: id of a game to go on with first; None: one is begun.
    """

    def __init__(
        self, client: LichessClient, account: Account, online: OnlineSection, terms: Terms, pace: TablePace,
        ui: UserInterface, lines: WaitingLines, games: int = 1, going_on: str | None = None,
    ) -> None:  # fmt: skip
        self._client, self._account, self._online = client, account, online
        self._terms, self._pace, self._ui, self._lines = terms, pace, ui, lines
        self._left, self._going_on = games, going_on
        self._kind = "bot" if online.use is OnlineUse.BOT else "board"
        self._feed: EventFeed | None = None
        self._opponent: LichessOpponent | None = None
        self._rematch = False
        self._played = False
        """A game of these was taken up."""
        self._accepted: str | None = None
        """The challenge that becomes the next game."""
        self._over = set[str]()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.closed.set()
        if self._opponent is not None:
            self._opponent.close()
        if self._feed is not None:
            self._feed.close()

    # ------------------------------------------------------------------------------------------ as of OpponentSource

    def find(self) -> LichessOpponent | None:
        """See ``OpponentSource.find``; None where somebody here says 'quit'.

        Raises:
            UserError: the server, or whoever was challenged, does not want such a game.
        """
        last, self._opponent = self._opponent, None
        if last is not None:
            last.close()
        if self._feed is None:
            self._feed = EventFeed(self._client)
            self._feed.open.wait(CONNECTING)  # before anything is asked that it would tell of
        try:
            game = self._going_on or self._begin(last)
            self._going_on = None
            return None if game is None else self._enter(game)
        except RequestRefused as refusal:
            raise UserError(f"{self._client.server} refuses: {refusal}") from refusal
        except Cut as cut:
            raise UserError(f"{self._client.server} does not answer ({cut}): look at your network") from cut

    def again(self, end: GameEnd) -> bool:
        """See ``OpponentSource.again``; a person is asked, and may want a rematch."""
        self._left -= 1
        self._rematch = False
        if end is LEFT or not end.complete:
            return False
        if self._kind == "bot" or self._left > 0:
            return self._left > 0
        known = self._opponent is not None and self._opponent.opponent_id is not None
        said = self._next_wish(f"{end.reason}, result {end.result}", rematch=known)
        self._rematch = said == AGAIN
        return said != Word.QUIT

    def _next_wish(self, before: str, *, rematch: bool) -> str:
        """What the person here wants next, at the terminal or at a page; who is gone wants to quit.

        Args:
            before: what the question is about.
            rematch: whether there can be one.
        """
        proposed = f"'{AGAIN}', " if rematch else ""
        question = f"{before}: say {proposed}'{Word.NEW}' for another opponent, or '{Word.QUIT}'"
        words = (*([AGAIN] if rematch else []), Word.NEW.value, Word.QUIT.value)
        try:
            return ask(
                PersonAttendant(self._lines, self._ui), self._ui, question, words, lambda _: False, leaves=()
            )  # fmt: skip
        except PersonGone:
            return Word.QUIT

    # ---------------------------------------------------------------------------------------------------- a new game

    def _begin(self, last: LichessOpponent | None) -> str | None:
        """The id of a game that has begun; None: somebody here does not want one any more."""
        known, self._accepted = self._client.playing(), None
        self._over |= known
        if self._rematch and last is not None and last.opponent_id is not None:
            try:
                return self._challenge(last.opponent_id, rematch_of=last.game)
            except (UserError, RequestRefused) as refusal:  # the game before is over and well: another one may follow
                if self._next_wish(str(refusal), rematch=False) == Word.QUIT:
                    return None
        if self._online.opponent is not None:
            return self._challenge(self._online.opponent)
        if self._kind == "bot" or self._online.accept:
            self._ui.phase(f"waiting for a challenge to {self._account.username} ({self._terms})")
            return self._until(self._answer)
        return self._seek()

    def _challenge(self, name: str, rematch_of: str | None = None) -> str | None:
        """Challenge somebody, again and again where that expires; or accept what they propose of that game."""
        self._ui.phase(f"challenging {name} ({self._terms})")

        def answer(challenge: Challenge) -> None:
            if rematch_of is not None and challenge.rematch_of == rematch_of:
                self._answer(challenge)

        if rematch_of is not None:
            try:
                return self._until(answer, expiry=REMATCH)
            except _Expired:
                pass  # then they are asked
        expiry = None if self._terms.limit is None else EXPIRY
        for _ in range(CHALLENGES):
            mine: str | None = None
            try:
                mine = self._client.challenge(name, self._terms.for_challenge())
            except Cut:
                expiry = EXPIRY  # it may have been made all the same: nobody is challenged twice at once
            try:
                game = self._until(answer, mine, expiry)
            except _Declined as declined:
                raise UserError(f"{name} does not accept: {declined}") from declined
            except _Expired:
                continue
            if game is None and mine is not None:
                self._client.cancel(mine)
            return game
        raise UserError(f"{name} has not answered for {CHALLENGES * EXPIRY:.0f} s: ask again another time")

    def _seek(self) -> str | None:
        self._ui.phase(f"looking for an opponent ({self._terms}); say 'quit' to leave")
        if self._terms.limit is None:
            self._client.seek_days(self._terms.for_seek())
            return self._until(lambda _: None)
        seek = Seek(self._client, self._terms, frozenset(self._over))
        try:
            return self._until(lambda _: None, trouble=seek.trouble)
        finally:
            seek.close()

    def _until(
        self, answer: Callable[[Challenge], None], mine: str | None = None, expiry: float | None = None,
        trouble: Callable[[], None] = lambda: None,
    ) -> str | None:  # fmt: skip
        """Until a game begins: its id; None: somebody here has said 'quit'.

        Args:
            answer: takes challenges.
            mine: id of a challenge of ours, which is waited for.
            expiry: of that [s].
            trouble: raises what stands in the way.
        """
        assert self._feed is not None
        until = None if expiry is None else self._client.waiting.now() + expiry
        while until is None or self._client.waiting.now() < until:
            line = self._feed.next(POLL)
            match line:
                case GameStart() if line.game.game_id not in self._over:
                    return line.game.game_id
                case Challenged() if line.challenge.challenger.id != self._account.id:
                    answer(line.challenge)
                case ChallengeGone() if line.challenge.id == self._accepted:
                    self._accepted = None
                case ChallengeGone() if line.challenge.id == mine:
                    raise _Declined("the challenge was declined or taken back")
                case _:
                    trouble()
            if self._quits():
                return None
        raise _Expired

    def _quits(self) -> bool:
        try:
            return self._lines.quits()
        except PersonGone:
            if self._kind == "board" and not self._played:
                raise
            return self._kind == "board"

    def _answer(self, challenge: Challenge) -> None:
        reason = "later" if self._accepted is not None else self._suits(challenge)
        name = challenge.challenger.shown
        try:
            if reason is None:
                self._ui.phase(f"accepting the challenge of {name} ({of_challenge(challenge)})")
                self._client.accept(challenge.id)
                self._accepted = challenge.id
            else:
                self._ui.say(f"the challenge of {name} ({of_challenge(challenge)}) is declined: {reason}")
                self._client.decline(challenge.id, reason)
        except RequestRefused as refusal:
            self._ui.say(f"the challenge of {name} is gone: {refusal}")

    def _suits(self, challenge: Challenge) -> str | None:
        """Why a challenge is not accepted, in the server's words; None: it is."""
        terms = of_challenge(challenge)
        if challenge.variant.key != "standard" or challenge.initial_fen not in (None, "startpos"):
            return "standard"
        if challenge.rated and not self._online.rated:
            return "casual"
        too_fast = self._kind == "board" and terms.estimate < BLITZ
        if too_fast or not self._pace.keeps(terms):
            return "tooFast"
        return "noBot" if self._kind == "board" and challenge.challenger.title == "BOT" else None

    # --------------------------------------------------------------------------------------------- into a game

    def _enter(self, game: str) -> LichessOpponent:
        """Take up a game that has begun."""
        full, stream = self._first_line(game)
        self._over.add(game)
        self._played = True
        if not full.usual:
            stream.close()
            self._client.act(self._kind, game, "abort")
            raise UserError(f"the game {game} is no usual chess, and this table knows no other: it was aborted")
        self._opponent = LichessOpponent(
            self._client,
            self._kind,
            full,
            stream,
            self._account.id,
            claims=self._kind == "bot",
            takes_back=self._kind == "board" or self._online.take_backs,
        )
        self._ui.say(
            f"{full.white.shown} plays {full.black.shown} at {self._client.server}/{game}; the server answers in "
            f"{self._client.latency:.2f} s, and arm and link take {self._pace.per_move:.1f} s of each move"
        )
        return self._opponent

    def _first_line(self, game: str) -> tuple[GameFull, Stream]:
        for delay in BACK_OFF[:_FIRST_LINE]:
            with suppress(Cut), ExitStack() as in_vain:  # it is tried again
                stream = self._client.game(self._kind, game)
                in_vain.callback(stream.close)
                for said in stream:
                    line = None if said is None else game_line(said)
                    if isinstance(line, GameFull):
                        in_vain.pop_all()
                        return line, stream
            self._client.waiting.wait(delay, self._client.closed)
        raise UserError(f"{self._client.server} does not show the game {game}: look at it there, and try again")


class _Declined(Exception):
    """Who was challenged does not want to."""


class _Expired(Exception):
    """Who was challenged did not answer."""
