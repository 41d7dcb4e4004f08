"""At every prompt what makes sense there is taken: answers, leaving, help, and what a simulated hand is told."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import chess
import pytest

from app.game.person import DONE, GameLeft, PersonAsker, SettledHands, ask
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.players.person import Human, PersonGone
from app.players.typed_commands import HandVerb, MoveHand, Word
from hardware.interfaces import HandRefused
from hardware.piece_set import Colour, Kind
from hardware.table import Place, TableSettings

TABLE = TableSettings()
STANDS = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)


class Script:
    """Lines that come one after the other, with a pause before each; then nobody types any more."""

    def __init__(self, *lines: str) -> None:
        self._lines = [one for line in lines for one in (None, line)]

    def forget(self, word: str) -> None:
        """What comes is said when it is asked for, never before."""

    def next(self, timeout: float) -> str | None:
        if not self._lines:
            raise PersonGone
        return self._lines.pop(0)


class UserInterface:
    def __init__(self) -> None:
        self.said: list[str] = []
        self.asked: list[str] = []

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.said.append(sentence)

    def prompt(self, question: str, answers: Collection[str] = (), squares: Collection[str] = ()) -> None:
        self.asked.append(question)

    def answered(self) -> None:
        pass


class Hands:
    def __init__(self, refuses: bool = False) -> None:
        self.did: list[Any] = []
        self.refuses = refuses

    def play(self, ply: Any, inventory: Inventory) -> None:
        self.do(ply, inventory)

    def do(self, command: Any, inventory: Inventory) -> None:
        if self.refuses:
            raise HandRefused("the white king stands there: move that first")
        self.did.append(command)

    def withdraw(self) -> None:
        self.did.append("withdraw")


def asked(*lines: str, hands: Hands | None = None) -> UserInterface:
    ui: Any = UserInterface()
    PersonAsker(Human(chess.WHITE, Script(*lines), hands), ui).mend("put the white bishop on c1", ("c1",), STANDS)
    return ui


def prompts() -> list[Callable[[Script, Any], None]]:
    """Each prompt that there is, as a function that asks it."""

    def done(script: Script, ui: Any) -> None:
        PersonAsker(Human(chess.WHITE, script, Hands()), ui).mend("put it on c1", ("c1",), STANDS)

    def go_on(script: Script, ui: Any) -> None:
        ask(Human(chess.WHITE, script, None), ui, "go on?", ("go",), lambda _: False)

    def yes_or_no(script: Script, ui: Any) -> None:
        ask(Human(chess.WHITE, script, None), ui, "was it?", ("yes", "no"), lambda _: False)

    return [done, go_on, yes_or_no]


@pytest.mark.parametrize("prompt", prompts())
@pytest.mark.parametrize("word", ["quit", "exit", "Resign", " new ", "keep"])
def test_a_person_can_leave_wherever_they_are_asked(prompt: Callable[[Script, Any], None], word: str) -> None:
    with pytest.raises(GameLeft) as left:
        prompt(Script("help", "what?", word, "done"), UserInterface())
    assert left.value.word is (Word.QUIT if word == "exit" else Word(word.strip().lower()))


@pytest.mark.parametrize("prompt", prompts())
def test_the_end_of_input_ends_every_prompt(prompt: Callable[[Script, Any], None]) -> None:
    with pytest.raises(PersonGone):
        prompt(Script("help"), UserInterface())


@pytest.mark.parametrize("prompt", prompts())
def test_help_is_given_and_the_question_asked_again(prompt: Callable[[Script, Any], None]) -> None:
    ui = UserInterface()
    with pytest.raises(PersonGone):
        prompt(Script("help"), ui)
    assert any("resign" in said and "quit" in said for said in ui.said)
    assert len(ui.asked) == 2
    assert ui.asked[0] == ui.asked[1]


@pytest.mark.parametrize("word", DONE)
def test_every_way_to_say_that_the_board_was_put_right_is_understood(word: str) -> None:
    assert len(asked(word.upper()).asked) == 1


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("hand move d2 c1", MoveHand(HandVerb.MOVE, (Place.parse("d2"), Place.parse("c1")))),
        ("hand knock e4", MoveHand(HandVerb.KNOCK, (Place.parse("e4"),))),
        ("d2c1", MoveHand(HandVerb.MOVE, (Place.parse("d2"), Place.parse("c1")))),
        ("D2-c1", MoveHand(HandVerb.MOVE, (Place.parse("d2"), Place.parse("c1")))),
        ("e7e8q", MoveHand(HandVerb.MOVE, (Place.parse("e7"), Place.parse("e8")))),
    ],
)
def test_a_simulated_hand_does_what_it_is_told_while_the_board_is_put_right(line: str, command: MoveHand) -> None:
    hands = Hands()
    ui = asked(line, "done", hands=hands)
    assert hands.did == [command]
    assert len(ui.asked) == 2


def test_what_stands_on_a_square_can_be_said() -> None:
    ui = UserInterface()
    asker = PersonAsker(Human(chess.WHITE, Script("g6 white knight", "A1 wR", "e4 empty", "done"), None), ui)
    told = asker.mend("it is not clear", (), Inventory.of((), TableSettings()))
    assert told == {
        Place.parse("g6"): (Colour.WHITE, Kind.KNIGHT), Place.parse("a1"): (Colour.WHITE, Kind.ROOK),
    }  # fmt: skip
    assert any("g6: white knight" in said for said in ui.said)
    assert any("'e4 empty' is not an answer" in said for said in ui.said)


def test_a_person_with_hands_of_their_own_is_told_to_use_them() -> None:
    ui = asked("hand move d2 c1", "done")
    assert ui.said[-1] == "only a simulated hand can be told what to do: move the piece yourself, then say 'done'"


@pytest.mark.parametrize("line", ["hand", "hand jump e4", "hand move e4"])
def test_a_hand_that_is_told_nonsense_says_what_it_can_do(line: str) -> None:
    assert any("say 'hand move b1 b4'" in said for said in asked(line, "done", hands=Hands()).said)


def test_what_the_hand_cannot_do_is_said_and_the_question_asked_again() -> None:
    ui = asked("hand move d2 e1", "done", hands=Hands(refuses=True))
    assert "the white king stands there: move that first" in ui.said


def test_anything_else_is_answered_with_what_would_be_understood() -> None:
    (sentence, answer) = asked("draw", "done").said
    assert sentence == "put the white bishop on c1. Put it right yourself and say 'done'"
    assert answer.startswith("'draw' is not an answer: say done or ")
    assert answer.endswith("or quit or resign")


def test_hands_begin_and_draw_back_once_the_arm_rests() -> None:
    order: list[str] = []

    class Arm:
        def state(self) -> None:
            order.append("rests")

    class Clumsy(Hands):
        def do(self, command: Any, inventory: Inventory) -> None:
            order.append("does")
            super().do(command, inventory)

        def withdraw(self) -> None:
            order.append("withdraws")

    arm: Any = Arm()
    SettledHands(Clumsy(), arm).do(MoveHand(HandVerb.KNOCK, (Place.parse("e4"),)), STANDS)
    assert order == ["rests", "does"]
    with pytest.raises(HandRefused):
        SettledHands(Clumsy(refuses=True), arm).do(MoveHand(HandVerb.KNOCK, (Place.parse("e4"),)), STANDS)
    assert order[2:] == ["rests", "does", "rests", "withdraws"]
