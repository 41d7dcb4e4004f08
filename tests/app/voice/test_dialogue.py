"""What follows from what was heard: nothing is played that was not confirmed."""

from __future__ import annotations

import pytest

from app.players.typed_commands import Word
from app.voice.dialogue import AT_ONCE, Reply, reply

MOVES = ("e4", "Nbd7", "O-O-O", "exd8=Q")


@pytest.mark.parametrize("waiting", [None, "a4", "resign"])
@pytest.mark.parametrize("line", [*MOVES, "done", "white", *(word for word in Word if word not in AT_ONCE)])
def test_moves_and_what_changes_the_game_are_asked_about(line: str, waiting: str | None) -> None:
    asked = reply(line, waiting)
    assert asked.line is None
    assert asked.waiting == line
    assert asked.sentence is not None
    assert reply("yes", asked.waiting) == Reply(line)
    refused = reply("no", asked.waiting)
    assert refused.line is refused.waiting is None
    assert refused.sentence is not None


@pytest.mark.parametrize("word", sorted(AT_ONCE))
def test_what_does_no_harm_is_done_at_once_and_a_question_stays(word: Word) -> None:
    assert reply(word, "e4") == Reply(word, waiting="e4")


@pytest.mark.parametrize("answer", ["yes", "no"])
def test_answers_to_the_program_pass_where_nothing_was_heard_before(answer: str) -> None:
    assert reply(answer, None) == Reply(answer)


def test_the_question_says_the_move_as_people_do() -> None:
    assert reply("Nxf3", None).sentence == "I heard 'knight takes f3': yes or no?"


def test_what_could_be_two_moves_is_asked_about() -> None:
    asked = reply(None, "e4")
    assert asked.line is asked.waiting is None
    assert asked.sentence == "that could be two moves: say from which square"
