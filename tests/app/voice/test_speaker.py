"""What is spoken at the terminal: every legal move has words, and nobody waits for a slow voice."""

from __future__ import annotations

import re
from pathlib import Path

import chess
import pytest
from hypothesis import given
from hypothesis import strategies as st

import app
import vision
from app.game.questions import TurnQuestions
from app.players.person import Human
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines
from app.voice.german import MOVES, SENTENCES, in_german
from app.voice.speaker import Speaker, SpeakerMissing
from app.voice.spoken_moves import ENGLISH
from tests.waiting import PATIENCE


@pytest.mark.parametrize(
    ("san", "words"),
    [
        ("e4", "e4"),
        ("Nbxd7+", "knight b takes d7, check"),
        ("O-O", "castles short"),
        ("O-O-O#", "castles long, checkmate"),
        ("exd8=Q+", "e takes d8 becomes a queen, check"),
        ("R1a3", "rook 1 a3"),
        ("Qh4xe1", "queen h4 takes e1"),
    ],
)
def test_moves_as_people_say_them(san: str, words: str) -> None:
    assert ENGLISH.spoken(san) == words


@pytest.mark.parametrize(
    ("sentence", "german"),
    [
        ("I would play Nbxd7+", "ich würde Springer b schlägt d7, Schach spielen"),
        ("White resigns", "Weiß gibt auf"),
        (
            "e2 is empty, a white pawn should stand there and something lies on f4. Put it right by hand, or say 'fix' "
            "and the arm does it",
            "e2 ist leer, dort gehört der weiße Bauer hin und auf f4 liegt etwas. Stellen Sie es richtig, oder sagen "
            "Sie 'fix', und der Arm tut es",
        ),
        ("this looks like O-O-O#: was that your move?", "das sieht aus wie lange Rochade, matt: war das Ihr Zug?"),
        ("which piece?", None),
    ],
)
def test_what_is_asked_most_can_be_said_in_german(sentence: str, german: str | None) -> None:
    assert in_german(sentence) == german


@pytest.mark.parametrize(
    ("question", "german"),
    [
        ("this looks like {}: was that your move?", "das sieht aus wie Springer f3: war das Ihr Zug?"),
        (
            "this looks like {}, but not clearly: was that it?",
            "das sieht aus wie Springer f3, aber undeutlich: war es das?",
        ),
    ],
)
def test_questions_are_german_as_they_are_asked(question: str, german: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[str]()

    def answer(_: TurnQuestions, sentence: str, *_rest: object) -> str:
        asked.append(sentence)
        return "yes"

    monkeypatch.setattr(TurnQuestions, "answer", answer)
    assert TurnQuestions(Human(chess.WHITE, TypedLines(None), None), UserInterface()).yes(
        question.format("Nf3"), chess.Board(), ()
    )
    assert [in_german(sentence) for sentence in asked] == [f"{german} ('yes' oder 'no')"]


def test_german_stands_for_what_the_program_still_says() -> None:
    """Every piece of text between what varies stands in the sources, where strings may be broken over lines."""
    roots = (Path(package.__file__ or "").parent for package in (app, vision))
    sources = (path for root in roots for path in root.rglob("*.py") if path.name != "german.py")
    text = re.sub(r'"\s*\n\s*f?"', "", "\n".join(path.read_text(encoding="utf-8") for path in sources)).lower()
    outcomes = {one.name.lower().replace("_", " ") for one in chess.Termination}
    for english in SENTENCES.keys() - outcomes:
        pieces = [re.sub(r"\\(.)", r"\1", piece) for piece in re.split(r"\([^)]*\)", english)]
        assert [piece for piece in pieces if len(piece) > 3], english
        assert all(piece.lower() in text for piece in pieces if len(piece) > 3), english


@given(st.lists(st.integers(0, 1 << 16), max_size=60))
def test_every_legal_move_can_be_said(choices: list[int]) -> None:
    board = chess.Board()
    for choice in choices:
        moves = list(board.legal_moves)
        if not moves:
            return
        move = moves[choice % len(moves)]
        for words in (ENGLISH, MOVES):
            said = words.spoken(board.san(move))
            assert chess.square_name(move.to_square) in said or board.is_castling(move)
        board.push(move)


def test_what_is_no_move_is_refused() -> None:
    with pytest.raises(ValueError, match="is not a move in SAN"):
        ENGLISH.spoken("e9")


def test_a_slow_voice_keeps_nobody_and_says_what_is_newest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.voice.speaker.LAST_WORDS", PATIENCE)
    heard, go = tmp_path / "heard", tmp_path / "go"
    voice = tmp_path / "voice"
    voice.write_text(f'#!/bin/sh\nwhile [ ! -e {go} ]; do sleep 0.01; done\necho "$4" >> {heard}\n')
    voice.chmod(0o755)
    with Speaker(program=str(voice)) as speaker:
        for number in range(100):
            speaker.say(f"sentence {number}")
        go.touch()
    lines = heard.read_text().splitlines()
    assert lines[-1] == "sentence 99"
    assert len(lines) <= 5


def test_a_voice_that_hangs_does_not_keep_the_program_from_ending(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.voice.speaker.LAST_WORDS", 0.1)
    voice = tmp_path / "voice"
    voice.write_text("#!/bin/sh\nexec sleep 600\n")
    voice.chmod(0o755)
    with Speaker(program=str(voice)) as speaker:
        speaker.say("one")
        speaker.say("two")
    assert not speaker._thread.is_alive()
    assert speaker._saying is not None
    assert speaker._saying.returncode is not None


def test_a_voice_that_is_not_there_is_one_sentence_with_the_remedy() -> None:
    with pytest.raises(SpeakerMissing, match="sudo apt-get install"):
        Speaker(program="a-voice-that-nobody-has")
