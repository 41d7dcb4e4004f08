"""The turn of an opponent who sits somewhere else, and what is said to them and by them at any time.

What they do arrives as events, which are heeded between two plies, never within one: the arm makes their moves, and
takes back what both sides agree to. Their end of the game holds: what stands here beyond it is taken back.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

import chess

from app import UserError
from app.execution.state import LEFT, WRONG, Remark
from app.execution.table import Table
from app.game.clock import side_name
from app.game.person import ENDS_TURNS
from app.game.timing import Timing
from app.players.game_end import GameEnd
from app.players.person import Lines, PersonGone
from app.players.players import Players
from app.players.remote import (
    ABORTABLE,
    GameOver,
    Notice,
    Offer,
    OfferAnswered,
    Offered,
    RemoteEvent,
    RemoteMove,
    RemoteOpponent,
    TakenBack,
)
from app.players.typed_commands import MEANINGS_ELSEWHERE, Word, help_text, word_of
from app.terminal.game_display import UserInterface
from app.terminal.shown import RemoteShown
from hardware.interfaces import HardwareError
from hardware.piece_set import Colour

POLL: Final = 0.2
"""How long is waited for their move at a time, before it is asked what is said here [s, wall]."""
CONFIRMATION: Final = 30.0
"""How long the end of a game is waited for that must come, where the link may just be cut [s, wall]."""
REPLY: Final = 5.0
"""How long is waited for what an answer from here should bring about, before the game goes on [s, wall]."""
_UNSAID: Final = (
    "{} does not have the last move yet: it is sent until they do; say 'quit' to leave, and 'touchmove resume' sends "
    "it again"
)
_REFUSED: Final = {
    Word.HINT: "there are no hints in a game against somebody elsewhere: the move must be your own",
    Word.SIDE: "nobody can change sides in a game against somebody elsewhere: say 'resign' or 'quit' to leave it",
    Word.NEW: "another game begins once this one is over: say 'resign', 'abort' or offer a draw",
    Word.KEEP: "this game cannot go on from what stands on the board: say 'fix' and the arm puts the pieces back",
    Word.PAUSE: "the clock that counts is not here, so it cannot be stopped: offer a draw, or play on",
}
ANY_TIME: Final = (
    Word.DRAW, Word.TAKE_BACK, Word.DECLINE, Word.RESIGN, Word.ABORT, Word.CLAIM, Word.QUIT, Word.HELP,
)  # fmt: skip
"""What is taken whoever's turn it is; whether it makes sense, ``RemoteTurn.words`` says."""


def refusal(line: str) -> str | None:
    """Why what was said cannot be had in a game against somebody elsewhere; None: it can."""
    words = line.split()
    word = Word.NEW if words and words[0].lower() == Word.NEW else word_of(line)
    return None if word is None else _REFUSED.get(word)


class RemoteTurn:
    """Takes the opponent's turns, and hears them during everybody else's.

    Args:
        opponent: somewhere else.
        table: where their moves are made.
        players: the engine that plays here, if one does.
        timing: shown whenever something arrives.
        ui: shown what happens.
        lines: what is said here; None: nobody says anything.
        answers: whether the person here moves pieces of a colour by themselves, and so whenever they please; None: an
            engine plays here, which answers offers by itself.
    """

    def __init__(
        self, opponent: RemoteOpponent, table: Table, players: Players, timing: Timing, ui: UserInterface,
        lines: Lines | None, answers: Callable[[chess.Color], bool] | None = None,
    ) -> None:  # fmt: skip
        self._opponent, self._table, self._players = opponent, table, players
        self._timing, self._ui, self._lines = timing, ui, lines
        self._answers = answers
        self._running: chess.Color | None = None
        self._offered = dict[Offer, Offered]()
        self._shown: RemoteShown | None = None
        self.spoken = 0
        """So many sentences were said: whoever asks something meanwhile asks again."""

    def plays(self, colour: chess.Color) -> bool:
        """Whether the opponent plays this colour."""
        return colour is self._opponent.colour

    def words(self) -> tuple[Word, ...]:
        """What it makes sense to say now: at the terminal, at the page, or by voice."""
        board = self._table.board
        sense = {
            Word.TAKE_BACK: self._moved() or Offer.TAKE_BACK in self._offered,
            Word.DECLINE: bool(self._offered),
            Word.ABORT: len(board.move_stack) < ABORTABLE,
            Word.CLAIM: self._opponent.claimable,
            Word.LOOK: not self.plays(board.turn) and self._table.observer is not None,
        }
        return tuple(word for word in (*ANY_TIME, Word.LOOK, Word.FIX) if sense.get(word, True))

    def show(self) -> None:
        """Show who plays elsewhere and what can be said, where that has changed."""
        self._show(self.words())

    def close(self) -> None:
        """The game is over, or left: nothing more can be said to them."""
        self._show((Word.QUIT,))

    def _show(self, words: tuple[Word, ...]) -> None:
        side = Colour.WHITE if self._opponent.colour else Colour.BLACK
        shown = RemoteShown(self._opponent.name, side, words)
        if shown != self._shown:
            self._shown = shown
            self._ui.remote(shown)

    # ------------------------------------------------------------------------------------------------- told to them

    def stands(self) -> None:
        """Tell them what stands on the table: at the beginning, and after each ply."""
        self._opponent.stands(self._table.board.copy())

    def tell(self, move: chess.Move, *, offers_draw: bool = False) -> None:
        """A move of this side is decided on: they know it before the table has it."""
        self._opponent.play(len(self._table.board.move_stack), move, offers_draw=offers_draw)
        self._offered.clear()  # who moves has answered

    def resign(self) -> GameEnd | None:
        """Give up; how the game has ended, or None where nobody confirms that yet."""
        self._opponent.resign()
        return self._wait("nobody has confirmed yet that you resign: it is said as soon as the link is back")

    def claim_draw(self) -> GameEnd | None:
        """An engine claims a draw; None: the game goes on."""
        self._opponent.offer(Offer.DRAW)
        return self._wait(None, REPLY)

    def leave(self, word: Word) -> GameEnd:
        """How it ends for a person who has left or resigned where they were asked something else."""
        if word is not Word.RESIGN:
            return LEFT
        ours = side_name(not self._opponent.colour)
        return self.resign() or GameEnd(
            "0-1" if self._opponent.colour is chess.BLACK else "1-0", f"{ours} resigns", True
        )

    def confirmed(self, end: GameEnd) -> GameEnd | None:
        """How the game has ended that the rules end here, by the opponent's word; None: it goes on after all.

        Not before they have the last move: it would be over here alone, and go on there. Who does not want to wait for
        that may quit.
        """
        until, told = time.monotonic() + CONFIRMATION, False
        before = self._table.board.move_stack.copy()
        while time.monotonic() < until or self._opponent.unsaid:
            if (theirs := self.heed(POLL)) is not None:
                return theirs
            if self._table.board.move_stack != before:
                return None
            if told and (line := self._line()) is not None and word_of(line) is Word.QUIT:
                return LEFT
            if not told and time.monotonic() > until:
                told = True
                self._say(_UNSAID.format(self._opponent.name))
        return end

    # ---------------------------------------------------------------------------------------------------- their turn

    def take(self) -> GameEnd | None:
        """Until they have moved, something was taken back, or the game has ended."""
        done = len(self._table.board.move_stack)
        self._ui.phase(f"{side_name(self._opponent.colour)} thinks: {self._opponent.name}")
        while len(self._table.board.move_stack) == done:
            if (end := self.heed(POLL)) is not None:
                return end
            if len(self._table.board.move_stack) != done:
                break
            self._show_clock()
            if (line := self._line()) is not None and (end := self._hear(line)) is not None:
                return end
        return None

    def _show_clock(self) -> None:
        """Where somebody's time has begun or ceased to run: their table shows a position later than this one."""
        clock = self._opponent.clock()
        running = None if clock is None else clock.running
        if running is not self._running:
            self._running = running
            self._timing.show()

    def _line(self) -> str | None:
        try:
            return None if self._lines is None else self._lines.next(0.0)
        except PersonGone:  # who plays here is missed when it is their turn
            return None

    def _hear(self, line: str) -> GameEnd | None:
        word = word_of(line)
        if (why := refusal(line)) is not None:
            self._say(why)
        elif word is Word.FIX:
            return self._fix()
        elif word is Word.GO and self._table.permission.stopped:
            self._table.permission.go_on()
        elif word is not None and word in ANY_TIME:
            return self.obey(word)
        else:
            said = ", ".join(f"'{one}'" for one in self.words())
            self._say(f"it is {self._opponent.name}'s move: you can say {said}")
        return None

    def _fix(self) -> GameEnd | None:
        try:
            return None if self._table.repair() else WRONG
        except ENDS_TURNS:
            raise
        except (UserError, HardwareError) as error:  # the game goes on, as in one's own turn
            if not self._table.give_up(str(error)):
                raise
            self._say(str(error))
            return None

    def obey(self, word: Word) -> GameEnd | None:
        """A word that concerns the opponent, or leaving; how the game has ended, if it has."""
        answers: dict[Word, Callable[[], GameEnd | None]] = {
            Word.QUIT: self._quit,
            Word.RESIGN: self.resign,
            Word.ABORT: lambda: self._ask(self._opponent.abort),
            Word.CLAIM: lambda: self._ask(self._opponent.claim),
            Word.DRAW: lambda: self._propose(Offer.DRAW),
            Word.TAKE_BACK: lambda: self._propose(Offer.TAKE_BACK),
            Word.DECLINE: self._decline,
            Word.HELP: lambda: self._ui.say(help_text(self.words(), MEANINGS_ELSEWHERE)),
        }
        return answers[word]()

    def _quit(self) -> GameEnd:
        self._say(f"the game against {self._opponent.name} is not over, and its clock goes on")
        return LEFT

    def _ask(self, what: Callable[[], None]) -> GameEnd | None:
        what()
        return self._wait(None, REPLY)

    def _propose(self, what: Offer) -> GameEnd | None:
        accepts = self._offered.pop(what, None) is not None
        if what is Offer.TAKE_BACK and not accepts and not self._moved():
            self._say("there is nothing of yours to take back yet")
            return None
        self._opponent.offer(what)
        self._say(f"you have {'accepted' if accepts else 'proposed'} {_NAMES[what]}")
        return self._wait(None, REPLY) if accepts else None

    def _moved(self) -> bool:
        """Whether this side has made a move of the game."""
        board = self._table.board
        return len(board.move_stack) >= (1 if self.plays(board.turn) else 2)

    def _decline(self) -> None:
        if not self._offered:
            self._say("nothing is proposed that you could decline")
        for what in self._offered:
            self._opponent.decline(what)
            self._say(f"you have declined {_NAMES[what]}")
        self._offered.clear()

    def _wait(self, unconfirmed: str | None, longest: float = CONFIRMATION) -> GameEnd | None:
        """Until the game has ended or the position has changed; what is said where neither happens."""
        until, before = time.monotonic() + longest, self._table.board.move_stack.copy()
        while time.monotonic() < until and self._table.board.move_stack == before:
            spoken = self.spoken
            if (end := self.heed(POLL)) is not None:
                return end
            if self.spoken != spoken:
                return None
        if unconfirmed is not None:
            self._say(unconfirmed)
        return None

    # -------------------------------------------------------------------------------------------------------- events

    def heed(self, timeout: float = 0.0) -> GameEnd | None:
        """Do what has arrived, waiting for it at most so long [s, wall]; how the game has ended, if it has."""
        self.show()
        event = self._opponent.next(timeout)
        while event is not None:
            end = self._take(event)
            self._timing.show()
            if end is not None:
                return end
            self.show()
            event = self._opponent.next(0.0)
        return None

    def _take(self, event: RemoteEvent) -> GameEnd | None:
        match event:
            case RemoteMove():
                return self._make(event)
            case TakenBack():
                return self._take_back(event.plies)
            case GameOver():
                surplus = event.plies is not None and event.plies < len(self._table.board.move_stack)
                wrong = self._take_back(event.plies or 0) if surplus else None
                return wrong or event.end
            case Offered():
                self._hear_offer(event)
            case OfferAnswered():
                self._hear_answer(event)
            case Notice():
                self._say(event.sentence)
        return None

    def _make(self, event: RemoteMove) -> GameEnd | None:
        """The arm makes a move of the game."""
        board, done = self._table.board, len(self._table.board.move_stack)
        if event.ply < done and board.move_stack[event.ply] == event.move:
            return None
        if event.ply != done or not board.is_legal(event.move):
            raise UserError(
                f"{self._opponent.name} has {event.move.uci()} as ply {event.ply + 1}, and {done} plies stand on this "
                "board, after which that cannot be: look at the game where it is played, and resume it"
            )
        self._offered.clear()
        answers = self._answers is not None and self._answers(not board.turn)
        with self._timing.motion():
            well = self._table.arm_ply(event.move, Remark(clocks=self._timing.left), answers)
        self.stands()
        return None if well else WRONG

    def _take_back(self, plies: int) -> GameEnd | None:
        """The arm takes back all beyond so many plies."""
        back = len(self._table.board.move_stack) - plies
        if back <= 0:
            return None
        self._offered.clear()
        self._ui.phase(f"the arm takes back {back} {'ply' if back == 1 else 'plies'}")
        with self._timing.motion():
            well = self._table.take_back(back)
        self.stands()
        self.spoken += 1
        return None if well else WRONG

    def _hear_offer(self, event: Offered) -> None:
        """A person is asked; an engine agrees to take back, and to a draw by its own scores."""
        what = event.what
        if self._answers is None and what is not Offer.REMATCH:
            if what is Offer.TAKE_BACK or self._players.accepts_draw(self._table.board, not self._opponent.colour):
                self._opponent.offer(what)
            else:
                self._opponent.decline(what)
            return
        self._offered[what] = event
        word = {Offer.DRAW: Word.DRAW, Offer.TAKE_BACK: Word.TAKE_BACK}.get(what)
        if word is not None:
            self._say(f"{self._opponent.name} proposes {_NAMES[what]}: say '{word}' to accept, or '{Word.DECLINE}'")

    def _hear_answer(self, event: OfferAnswered) -> None:
        if not event.withdrawn:
            self._say(f"{self._opponent.name} {'accepts' if event.accepted else 'declines'} {_NAMES[event.what]}")
        elif self._offered.pop(event.what, None) is not None:
            self._say(f"{self._opponent.name} does not propose {_NAMES[event.what]} any more")

    def _say(self, sentence: str) -> None:
        self.spoken += 1
        self._ui.say(sentence)


_NAMES: Final = {Offer.DRAW: "a draw", Offer.TAKE_BACK: "to take back", Offer.REMATCH: "a rematch"}
