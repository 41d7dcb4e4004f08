"""Who watches two engines may pause them, end the game, or have another one; everything else is answered."""

from __future__ import annotations

import io
import json
from collections.abc import Collection
from pathlib import Path

from app.play.launch import run_games
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines


class Told(UserInterface):
    def __init__(self) -> None:
        self.said: list[str] = []
        self.asked: list[str] = []

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.said.append(sentence)

    def prompt(
        self, sentence: str, answers: Collection[str] = (), squares: Collection[str] = (), *, turn: bool = False
    ) -> None:
        self.asked.append(sentence)


def demo(folder: Path, *lines: str) -> tuple[Told, list[str]]:
    """What was said and asked while a line of four plies was to be played, and how each game ended."""
    typed = TypedLines(None)
    for line in lines:
        typed.offer(line)
    ui = Told()
    run_games(settings_of({"rig.name": "board", "game.moves": "e4 e5 d4 d5", "out": folder}), ui, typed)
    ends = [json.loads(path.read_text()) for path in sorted(folder.rglob("report.json"))]
    return ui, [f"{end['plies']} {end['exit_reason']}" for end in ends]


def test_a_pause_lasts_until_somebody_says_go(tmp_path: Path) -> None:
    ui, ends = demo(tmp_path / "game", "pause", "nonsense", "go")
    assert ends == ["4 4 plies played"]
    assert ui.said[0] == "the game is paused"
    assert len(ui.asked) == 2  # nonsense is no answer


def test_words_that_make_no_sense_are_answered_and_change_nothing(tmp_path: Path) -> None:
    ui, ends = demo(tmp_path / "game", "hint", "e4", "hand knock e4")
    assert ends == ["4 4 plies played"]
    assert len([said for said in ui.said if said.startswith("two engines play")]) == 3


def test_a_game_is_left_or_given_up_for_another_one(tmp_path: Path) -> None:
    assert demo(tmp_path / "left", "quit")[1] == ["0 left by the person at the board"]
    assert demo(tmp_path / "paused", "pause", "quit")[1] == ["0 left by the person at the board"]
    both = ["0 given up for a new game", "4 4 plies played"]
    assert sorted(demo(tmp_path / "another", "new")[1]) == both
    assert sorted(demo(tmp_path / "another paused", "pause", "new")[1]) == both


def test_who_watches_and_says_nothing_changes_nothing(tmp_path: Path) -> None:
    quiet, ends = demo(tmp_path / "game")
    assert (quiet.said, ends) == ([], ["4 4 plies played"])


def test_lines_may_end(tmp_path: Path) -> None:
    settings = settings_of({"rig.name": "board", "game.moves": "e4 e5", "out": tmp_path / "game"})
    assert run_games(settings, UserInterface(), TypedLines(io.StringIO(""))).holds
