"""What is spoken at the board arrives as if it had been typed, once confirmed; talk beside the board does not."""

from __future__ import annotations

import queue
import random
from collections.abc import Iterator
from pathlib import Path

import chess
import chess.pgn
import pytest

from app.voice.listener import Listener
from app.voice.microphone import Microphone, MicrophoneMissing
from app.voice.phrases import ADDRESS, grammar_of, lines_of, sayable
from app.voice.recogniser import Recogniser, RecogniserMissing
from tests.app.voice.spoken import VOICES, microphone, speech

GAMES = Path(__file__).parents[2] / "data" / "master_games.pgn"
PATIENCE = 120.0
"""Never reached: what is said is understood in less than a second."""


class Table:
    """Keeps what the listener offers and tells."""

    def __init__(self) -> None:
        self.lines: queue.Queue[str] = queue.Queue()
        self.told: queue.Queue[str] = queue.Queue()

    def listener(self, program: str, *, deaf: bool = False) -> Listener:
        return Listener(self.lines.put, self.told.put, lambda: deaf, program)


def positions(rng: random.Random, number: int) -> Iterator[tuple[chess.Board, chess.Move]]:
    games = []
    with GAMES.open() as file:
        while (game := chess.pgn.read_game(file)) is not None:
            games.append(list(game.mainline_moves()))
    for _ in range(number):
        moves = rng.choice(games)
        board = chess.Board()
        for move in moves[: rng.randrange(len(moves))]:
            board.push(move)
        yield board, rng.choice(list(board.legal_moves))


def test_a_move_is_played_once_it_was_confirmed(tmp_path: Path) -> None:
    table = Table()
    with table.listener(microphone(tmp_path / "it", speech(f"{ADDRESS} echo two to echo four"), speech("yes"))):
        assert table.told.get(timeout=PATIENCE) == "I heard 'e4': yes or no?"
        assert table.lines.get(timeout=PATIENCE) == "e4"
    assert table.lines.empty()
    assert table.told.empty()


def test_the_robot_is_called_first_and_then_told(tmp_path: Path) -> None:
    table = Table()
    program = microphone(
        tmp_path / "it", speech(ADDRESS), speech("knight foxtrot three"), speech("no"), speech(f"{ADDRESS} hint")
    )
    with table.listener(program):
        assert table.lines.get(timeout=PATIENCE) == "hint"
    assert [table.told.get_nowait() for _ in range(table.told.qsize())] == [
        "I heard 'knight f3': yes or no?", "then say it again, or type it",
    ]  # fmt: skip


def test_what_a_game_has_come_to_is_what_can_be_said(tmp_path: Path) -> None:
    table = Table()
    with table.listener(microphone(tmp_path / "it")) as listener:
        board = chess.Board("4k3/P7/8/8/8/8/8/4K3 w - - 0 1")
        listener.position(board)
        listener._heed(speech(f"{ADDRESS} alpha eight becomes a queen").tobytes())
        listener._heed(speech("yes").tobytes())
        assert table.lines.get_nowait() == "a8=Q"
        listener.prompt("was that your move?", ("yes", "no", "takeback", "e2e4"))
        listener._heed(speech(f"{ADDRESS} no").tobytes())
        assert table.lines.get_nowait() == "no"
        listener.answered()
        listener._heed(speech(f"{ADDRESS} yes").tobytes())
        assert table.lines.empty()


def test_a_yes_to_the_games_question_is_not_for_what_was_heard_before(tmp_path: Path) -> None:
    table = Table()
    with table.listener(microphone(tmp_path / "it")) as listener:
        listener._heed(speech(f"{ADDRESS} echo two to echo four").tobytes())
        assert table.told.get_nowait() == "I heard 'e4': yes or no?"
        listener.prompt("this looks like d4, but not clearly: was that it? (yes or no)", ("yes", "no", "y", "n"))
        listener._heed(speech("yes").tobytes())
        assert table.lines.empty()
        listener._heed(speech(f"{ADDRESS} yes").tobytes())
        assert table.lines.get_nowait() == "yes"


def test_while_the_robot_speaks_nothing_is_heard(tmp_path: Path) -> None:
    table = Table()
    sounds = speech(f"{ADDRESS} hint"), speech(f"{ADDRESS} pause")
    with Microphone(microphone(tmp_path / "it", *sounds)) as recording:
        heard = iter([True] * (len(sounds[0]) // 480))
        utterances = recording.utterances(lambda: next(heard, False))
        assert Recogniser().understood(next(utterances), f"{ADDRESS} ( hint | pause )") == f"{ADDRESS} pause"
    assert table.lines.empty()


def test_moves_of_real_games_in_many_voices() -> None:
    """By the letters' code at least nine of ten are understood; never is anything understood that cannot be played."""
    rng = random.Random(20261126)
    recogniser, right, rounds = Recogniser(), 0, 12
    for board, move in positions(rng, rounds):
        said = sayable(board)
        lines, san = lines_of(said), board.san(move).rstrip("+#")
        words = rng.choice([
            phrase for phrase, line in lines.items() if line == san and not {*phrase.split()} & {*"bcdefgh"}
        ])  # fmt: skip
        sound = speech(f"{ADDRESS} {words}", rng.choice(VOICES), speed=rng.randrange(120, 180)).tobytes()
        understood = recogniser.understood(sound, f"{ADDRESS} ( {grammar_of(said)} )")
        right += understood is not None and lines[understood.removeprefix(f"{ADDRESS} ")] == san
    assert right >= 0.9 * rounds


def test_talk_at_the_board_is_not_for_the_robot() -> None:
    said = (
        "what a nice day it is today", "I think he is going to win", "could you pass me the water please",
        "queen takes d four was a mistake", "that was a strong move", "it is your turn now", "take the knight",
        "did you see the match last night", "eight o'clock tomorrow", "the bishop on b two is bad",
    )  # fmt: skip
    recogniser = Recogniser()
    assert sum(recogniser.addressed(speech(words).tobytes()) for words in said) <= 1
    assert all(recogniser.addressed(speech(f"{ADDRESS} knight b five", voice).tobytes()) for voice in VOICES)


def test_a_microphone_that_ends_says_why_and_the_game_goes_on(tmp_path: Path) -> None:
    program = tmp_path / "arecord"
    program.write_text("#!/bin/sh\necho 'arecord: main:831: audio open error: No such file or directory' >&2\nexit 1\n")
    program.chmod(0o755)
    table = Table()
    with table.listener(str(program)):
        assert table.told.get(timeout=PATIENCE) == (
            "nothing can be heard any more: arecord: main:831: audio open error: No such file or directory; moves can "
            "be typed"
        )


def test_what_is_missing_is_one_sentence_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MicrophoneMissing, match="sudo apt-get install alsa-utils"):
        Microphone("a-recorder-that-nobody-has")
    monkeypatch.setattr("app.voice.recogniser.find_spec", lambda _: None)
    with pytest.raises(RecogniserMissing, match="install it with pip install 'touchmove\\[voice\\]'"):
        Recogniser()
