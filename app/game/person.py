"""What a person at the board is asked, and what they may answer.

At every prompt the words that it asks for are taken, and besides them whatever makes sense there: leaving, resigning
and help always; a move of the simulated hand where the board is to be put right; any command where it is their turn.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

import chess

from app import UserError
from app.execution.state import KEPT, LEFT, Told
from app.game.clock import side_name
from app.pieces.inventory import Inventory, Ply
from app.players.game_end import GameEnd
from app.players.person import Hands, Human, Lines, PersonGone
from app.players.typed_commands import (
    CommandError,
    HandVerb,
    MoveHand,
    NewGame,
    Word,
    help_text,
    parse_hand,
    parse_new,
    said_of_square,
    word_of,
)
from app.records import RecordError
from app.rig.arm import Arm, ArmPaused
from app.terminal.game_display import UserInterface
from engine.errors import EngineProblem
from hardware.interfaces import HandRefused, HardwareError, RigGone
from hardware.piece_set import Look
from hardware.table import Place

if TYPE_CHECKING:
    from app.guard.game_guard import GameGuard

POLL: Final = 0.2
"""How long is waited for words at a time [s, wall]."""
DONE: Final = ("done", "ok", "yes", "y", "go", "fix", "look")
"""Words that say that the board was put right; whether it is, the camera sees."""
_SQUARES: Final = re.compile(r"([a-h][1-8])[-x ]?([a-h][1-8])[qrbn]?")


class NeedsHand(UserError):
    """Something has to be put right by hand, and nobody is there to do it."""

    def __init__(self, sentence: str) -> None:
        super().__init__(f"{sentence}: put it right by hand, then continue with 'touchmove resume'")


class NeedsGo(UserError):
    """The arm was stopped, and nobody is there to say that it may move again."""

    def __init__(self, sentence: str) -> None:
        super().__init__(
            f"{sentence}; nobody is there to say so: make sure that the arm may move, "
            "then continue with 'touchmove resume'"
        )


class GameLeft(UserError):
    """The person leaves the game, or gives it up, where they were asked something else.

    Attributes:
        word: what they said: quit, resign, new or keep.
        wish: what another game shall be like.
    """

    def __init__(self, word: Word, wish: NewGame | None = None) -> None:
        super().__init__(f"the person at the board said '{word}'")
        self.word, self.wish = word, wish


ENDS_TURNS: Final = (PersonGone, RecordError, RigGone, ArmPaused, NeedsHand, NeedsGo, GameLeft)
"""With these no turn goes on; after any other error the game stands where it stood."""
LEAVES: Final = (Word.QUIT, Word.RESIGN, Word.NEW, Word.KEEP)


def end_of(word: Word, wish: NewGame | None, colour: chess.Color) -> GameEnd:
    """How a game has ended for a person of a colour who said quit, resign, new or keep."""
    if word is Word.KEEP:
        return KEPT
    if word is Word.RESIGN:
        return GameEnd("0-1" if colour else "1-0", f"{side_name(colour)} resigns", True)
    if word is Word.QUIT:
        return LEFT
    return GameEnd("*", "given up for a new game", complete=True, again=True, wish=wish)


class Respondent(Protocol):
    """Who is asked something: a person who plays, or somebody else who can say something."""

    @property
    def lines(self) -> Lines:
        """What they say."""

    @property
    def require(self) -> Callable[[NewGame], None]:
        """As of ``Human``."""

    @property
    def refusal(self) -> Callable[[str], str | None]:
        """As of ``Human``."""


def ask(
    human: Respondent, ui: UserInterface, question: str, valid: Collection[str], other: Callable[[str], bool],
    how: str | None = None, leaves: Collection[Word] = LEAVES, *, offers: Collection[str] | None = None,
    squares: Collection[str] = (),
) -> str:  # fmt: skip
    """Ask until the answer is one of some words.

    Args:
        human: who is asked.
        ui: shows the question.
        question: for people.
        valid: answers, in lower case.
        other: takes any other line; False: it makes no sense here.
        how: what can be answered, for people, where that is more than those words.
        leaves: words by which they leave.
        offers: answers to choose from where nobody types; None: ``valid``, but for what is short for another one.
        squares: that the question is about.

    Returns:
        The answer, in lower case.

    Raises:
        GameLeft: they quit, resign, want a new game, or one from what stands on the board.
        PersonGone: nobody types any more.
    """
    words = [word for word in valid if len(word) > 1] or valid
    ui.prompt(question, words if offers is None else offers, squares)
    while True:
        line = human.lines.next(POLL)
        if line is None:
            continue
        ui.answered()
        if (answer := line.strip().lower()) in valid:
            return answer
        word = word_of(line)
        if (refusal := human.refusal(line)) is not None:
            ui.say(refusal)
            ui.prompt(question, words if offers is None else offers, squares)
            continue
        if word is not None and word in leaves:
            raise GameLeft(word)
        if (wish := _wish(human, ui, line)) is not None and Word.NEW in leaves:
            raise GameLeft(Word.NEW, wish)
        if word is Word.HELP:
            ui.say(help_text() if how is None else how)
        elif not other(line):
            ui.say(f"'{line.strip()}' is not an answer: {how or 'say ' + ' or '.join(valid)}, or quit or resign")
        ui.prompt(question, words if offers is None else offers, squares)


def _wish(human: Respondent, ui: UserInterface, line: str) -> NewGame | None:
    """What another game shall be like, where a line says that; None: it does not, or there can be no such game."""
    first, *rest = line.split()
    if first.lower() != Word.NEW or not rest:
        return None
    try:
        wish = parse_new(rest)
        human.require(wish)
    except (UserError, EngineProblem) as error:
        ui.say(str(error))
        return None
    return wish


class HandNotice:
    """Notices that a hand was over the board and has gone, also one that came and went while nobody asked.

    Args:
        guard: that watches for hands; None: nothing is noticed.
    """

    def __init__(self, guard: GameGuard | None) -> None:
        self._guard = guard
        self._known = 0 if guard is None else guard.departures

    @property
    def watches(self) -> bool:
        """Whether anything is noticed at all."""
        return self._guard is not None

    def there(self) -> bool:
        """Whether a hand is over the board.

        Raises:
            UserError: hands cannot be seen any more.
        """
        seen = None if self._guard is None else self._guard.newest()
        return seen is not None and seen.hand_present

    def leaving(self) -> bool:
        """Whether a hand has gone of which ``gone`` will tell once the board lies still."""
        return self._guard is not None and self._guard.leaving

    def gone(self) -> float | None:
        """When a hand has gone [s, plant], if one has, and the board lies still, since this was last said."""
        if self._guard is None or (at := self._guard.gone_at) is None or not self.untold:
            return None
        self._known = self._guard.departures
        return at

    @property
    def untold(self) -> bool:
        """Whether ``gone`` would tell of a hand."""
        return self._guard is not None and self._guard.departures != self._known

    @property
    def last_gone(self) -> float | None:
        """When the last hand had gone [s, plant], told or not."""
        return None if self._guard is None else self._guard.gone_at

    def wake(self, awake: bool) -> None:
        """Whether somebody waits for a hand; see ``GameGuard.wake``."""
        if self._guard is not None:
            self._guard.wake(awake)


class UnattendedAsker:
    """``Asker`` where nobody is there."""

    def mend(self, sentence: str, squares: tuple[str, ...], stands: Inventory) -> Told:
        """Nobody can be asked.

        Raises:
            NeedsHand: always.
        """
        raise NeedsHand(sentence)


class PersonAsker:
    """``Asker`` of the person who plays."""

    def __init__(self, human: Human, ui: UserInterface) -> None:
        self._human, self._ui = human, ui

    def mend(self, sentence: str, squares: tuple[str, ...], stands: Inventory) -> Told:
        """See ``Asker.mend``. A simulated hand does what it is told meanwhile: 'hand move c8 c1', or simply 'c8c1'."""
        told = dict[Place, Look]()
        by_hand = " yourself" if self._human.hands is None else " by 'hand move …'"
        self._ui.say(f"{sentence}. Put it right{by_hand} and say 'done'", squares)

        def other(line: str) -> bool:
            if (said := said_of_square(line)) is not None and said[1] is not None:
                told[said[0]] = said[1]
                self._ui.say(f"{said[0]}: {said[1][0]} {said[1][1]}; say 'done' when that is all")
                return True
            try:
                command = hand_command(line)
            except CommandError as error:
                self._ui.say(str(error))
                return True
            if command is None:
                return False
            self._move(command, stands)
            return True

        ask(self._human, self._ui, "done?", DONE, other, offers=DONE[:1], squares=squares)
        return told

    def _move(self, command: MoveHand, stands: Inventory) -> None:
        hands = self._human.hands
        if hands is None:
            self._ui.say("only a simulated hand can be told what to do: move the piece yourself, then say 'done'")
            return
        try:
            hands.do(command, stands)
        except HandRefused as error:
            self._ui.say(str(error))


@dataclass(frozen=True, slots=True)
class PersonAttendant:
    """``Attendant`` who is there.

    Attributes:
        lines: what they say.
        ui: shows them what is asked.
        leaves: words by which they leave instead.
        require: as of ``Human``.
        refusal: likewise.
    """

    lines: Lines
    ui: UserInterface
    leaves: tuple[Word, ...] = LEAVES
    require: Callable[[NewGame], None] = lambda _: None
    refusal: Callable[[str], str | None] = lambda _: None

    def wait_for_go(self, sentence: str) -> None:
        """See ``Attendant.wait_for_go``. A 'go' that was said before, twice by mistake perhaps, lifts no later STOP.

        Raises:
            GameLeft: they leave instead.
            PersonGone: nobody says anything any more.
        """
        self.lines.forget(Word.GO)
        self.wait(sentence)

    def wait(self, sentence: str) -> None:
        """Wait for a 'go' where the arm was not stopped, so that it may have been said already, as by a script.

        Raises as ``wait_for_go``.
        """
        self.ui.say(sentence)
        ask(self, self.ui, "go on?", (Word.GO.value,), lambda _: False, leaves=self.leaves)


class UnattendedAttendant:
    """``Attendant`` where nobody plays: whoever watches and can say something is asked; else nobody can be.

    Args:
        lines: what they say; None: nobody can say anything.
        ui: shows them what is asked.
    """

    def __init__(self, lines: Lines | None, ui: UserInterface) -> None:
        self._lines, self._ui = lines, ui

    def wait_for_go(self, sentence: str) -> None:
        """See ``Attendant.wait_for_go``.

        Raises:
            NeedsGo: nobody is there, or they have gone.
            GameLeft: they end it; it can be gone on with.
        """
        if self._lines is None or not self._lines.accompanied:
            raise NeedsGo(sentence)
        try:
            PersonAttendant(self._lines, self._ui, (Word.QUIT,)).wait_for_go(sentence)
        except PersonGone as gone:
            raise NeedsGo(sentence) from gone


def hand_command(line: str) -> MoveHand | None:
    """What a line tells a hand to do: its own command, or a move as its two squares; None: neither.

    Raises:
        CommandError: it begins like the hand's command, and is none.
    """
    words = line.strip().lower().split()
    if words and words[0] == "hand":
        return parse_hand(words[1:])
    squares = _SQUARES.fullmatch(line.strip().lower())
    if squares is None:
        return None
    return MoveHand(HandVerb.MOVE, (Place.parse(squares[1]), Place.parse(squares[2])))


class SettledHands:
    """``Hands`` that begin, and draw back, once the arm is at rest.

    In pace fast plant time then stands, so that what the hand does begins at a tick that does not depend on how quickly
    anybody types, or how busy the machine is.
    """

    def __init__(self, hands: Hands, arm: Arm) -> None:
        self._hands, self._arm = hands, arm

    def play(self, ply: Ply, inventory: Inventory) -> None:
        """See ``Hands.play``."""
        self._do(lambda: self._hands.play(ply, inventory))

    def do(self, command: MoveHand, inventory: Inventory) -> None:
        """See ``Hands.do``."""
        self._do(lambda: self._hands.do(command, inventory))

    def withdraw(self) -> None:
        """See ``Hands.withdraw``."""
        self._arm.state()
        self._hands.withdraw()

    def _do(self, act: Callable[[], None]) -> None:
        self._arm.state()
        try:
            act()
        except HardwareError:  # nobody leaves a hand where an arm will move
            self.withdraw()
            raise
