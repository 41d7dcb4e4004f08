"""Another game, as a person wants it to be: said in one line, checked before the present one is given up, and kept."""

from __future__ import annotations

import errno
import io
import json
import os
import re
from collections.abc import Collection
from pathlib import Path

import chess
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.play.games import wished
from app.play.launch import resume_games, run_games
from app.players.typed_commands import CommandError, NewGame, parse_command, parse_new
from app.records.files import LineLog, RecordError
from app.settings.defaults import PlayerKind
from app.settings.files import kept_settings, settings_of
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines

MIDDLE = "r1bqkbnr/pppp1ppp/2n5/4p3/4P3/5N2/PPPP1PPP/RNBQKB1R w KQkq - 2 3"

wishes = st.builds(
    NewGame,
    st.sampled_from([None, True, False]), st.none() | st.integers(0, 4000), st.sampled_from([None, "", "10+5", "3:00"]),
    st.sampled_from([None, "", MIDDLE, chess.STARTING_FEN]),
)  # fmt: skip


def said(wish: NewGame) -> str:
    words = ["new"]
    if wish.person is not None:
        words.append("white" if wish.person else "black")
    if wish.elo is not None:
        words.append(f"elo {wish.elo}" if wish.elo else "full")
    if wish.clock is not None:
        words.append(f"clock {wish.clock or 'none'}")
    if wish.fen is not None:
        words.append(f"fen {wish.fen or 'start'}")
    return " ".join(words)


@given(wishes.filter(lambda wish: wish != NewGame()))
def test_what_is_said_of_a_new_game_is_understood(wish: NewGame) -> None:
    assert parse_command(said(wish), chess.Board()) == wish


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("elo", "'elo' needs a value: say for instance"),
        ("elo strong", "'strong' is not an Elo: say for instance 'new elo 1500', or 'new full'"),
        ("elo -5", "'-5' is not an Elo: "),
        ("elo 0", "'0' is not an Elo: "),
        ("clock", "'clock' needs a value: say for instance"),
        ("fen", "'fen' needs a value: say for instance"),
        ("fen 8/8", r"'8/8' is not a position \(.*\): give a FEN, or say 'new fen start'"),
        ("fen no such one", r"'no such one' is not a position \("),
        ("purple", "'purple' is not part of a new game: say for instance"),
        ("white elo", "'elo' needs a value: say for instance"),
    ],
)
def test_what_says_nothing_about_a_new_game_is_refused_in_a_sentence(words: str, said: str) -> None:
    with pytest.raises(CommandError, match=said):
        parse_new(words.split())


@given(wishes, wishes, st.booleans())
def test_the_last_wish_holds_and_the_rest_stays(first: NewGame, second: NewGame, white: bool) -> None:
    sides = ("white", "black") if white else ("black", "white")
    before = settings_of({f"{sides[0]}.player": "human", f"{sides[1]}.elo": 1700, "clock.time": "5+3"})
    once = wished(before, first)
    twice = wished(once, second)
    for wish, old, new in ((first, before, once), (second, once, twice)):
        humans = [colour for colour in (True, False) if new.side(colour).player is PlayerKind.HUMAN]
        was = next(colour for colour in (True, False) if old.side(colour).player is PlayerKind.HUMAN)
        assert humans == [was if wish.person is None else wish.person]
        elo = new.side(not humans[0]).elo
        assert elo == (old.side(not was).elo if wish.elo is None else wish.elo or None)
        assert new.clock.time == (old.clock.time if wish.clock is None else wish.clock or None)
        assert new.game.fen == (old.game.fen if wish.fen is None else wish.fen or None)
        assert (new.rig, new.engine, new.vision) == (old.rig, old.engine, old.vision)


@pytest.mark.parametrize(("elo", "strength"), [(1500, (1500, None)), (0, (None, None)), (None, (None, 5))])
def test_the_strength_that_is_wished_takes_the_place_of_a_skill(
    elo: int | None, strength: tuple[int | None, int | None]
) -> None:
    before = settings_of({"white.player": "human", "black.skill": 5})
    robot = wished(before, NewGame(elo=elo)).black
    assert (robot.elo, robot.skill) == strength


class Told(UserInterface):
    def __init__(self) -> None:
        self.said: list[str] = []
        self.results: list[tuple[str, str]] = []

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.said.append(sentence)

    def result(self, result: str, reason: str) -> None:
        self.results.append((result, reason))


def play(folder: Path, *lines: str, accompanied: bool = False, **more: object) -> Told:
    named = {
        "rig.name": "board", "white.player": "human", "engine.nodes": 200, "out": folder, **more,
    }  # fmt: skip
    typed = TypedLines(io.StringIO("\n".join(lines) + "\n"), company=lambda: accompanied)
    ui = Told()
    run_games(settings_of(named), ui, typed)
    return ui


def test_a_disk_that_fills_up_says_that_the_game_is_safe_and_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = settings_of({"rig.name": "board", "game.moves": "e4 e5 Nf3", "out": tmp_path / "game"})
    write, begun = LineLog._write, list[bytes]()

    def fills_up(log: LineLog, data: bytes, durable: bool) -> None:
        if b'"uci":"e7e5"' in data:
            begun.append(data)
        if len(begun) > 1:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        write(log, data, durable)

    monkeypatch.setattr(LineLog, "_write", fills_up)
    safe = f"what was played is safe: once there is room, 'touchmove resume {tmp_path / 'game'}' continues it"
    with pytest.raises(RecordError, match=rf"events\.jsonl: File too large: {re.escape(safe)}$"):
        run_games(line, UserInterface())
    monkeypatch.undo()
    done = resume_games(tmp_path / "game", UserInterface())
    assert done.holds
    assert done.report.plies == 3


def start_of(folder: Path) -> dict[str, object]:
    return json.loads((folder / "events.jsonl").read_text().splitlines()[0])


def test_another_game_is_as_wished_and_goes_on_so_after_an_interruption(tmp_path: Path) -> None:
    folder = tmp_path / "match"
    ui = play(
        folder, "e4", "new black elo 99", f"new black full clock 1:00 fen {MIDDLE}", "quit", **{"engine.nodes": None}
    )
    assert any("99" in sentence for sentence in ui.said), ui.said  # no engine plays so weakly: that game went on
    second = start_of(folder / "game-2")
    assert (second["black"], second["fen"], second["time_control"]) == ("Human", MIDDLE, "60")
    kept = kept_settings(folder)
    assert (kept.black.player, kept.game.fen) == (PlayerKind.HUMAN, MIDDLE)
    done = resume_games(folder, UserInterface(), TypedLines(io.StringIO("resign\n")))
    assert done.folder == folder / "game-2"
    assert done.report.result == "1-0"


def test_who_goes_on_watching_is_asked_for_another_game_and_who_does_not_is_not(tmp_path: Path) -> None:
    asked = play(tmp_path / "one", "resign", "new", "resign", "quit", accompanied=True)
    assert [result for result, _ in asked.results if result != "*"] == ["0-1", "0-1"]
    assert (tmp_path / "one" / "game-2").exists()
    assert not (tmp_path / "one" / "game-3").exists()
    alone = play(tmp_path / "two", "resign", "new", "resign")
    assert [result for result, _ in alone.results] == ["0-1"]
    assert not (tmp_path / "two" / "game-2").exists()


@pytest.mark.parametrize("word", ["new", "new full"])
def test_a_game_against_the_engine_after_a_puzzle_goes_on_after_it_was_left(word: str, tmp_path: Path) -> None:
    puzzles = tmp_path / "puzzles.csv"
    puzzles.write_text("PuzzleId,FEN,Moves\nA1,6k1/5ppp/8/8/8/8/5PPP/3R2K1 b - - 0 1,g8f8 d1d8\n", encoding="utf-8")
    folder = tmp_path / "game"
    play(folder, word, "e4", "quit", **{"practice.puzzles": puzzles, "black.player": "engine"})
    assert start_of(folder / "game-2")["fen"] == chess.STARTING_FEN
    done = resume_games(folder, UserInterface(), TypedLines(io.StringIO("d4\nresign\n")))
    assert (done.folder, done.report.result) == (folder / "game-2", "0-1")
    assert done.report.plies >= 3
