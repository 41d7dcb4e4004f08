"""The bench of vision: a rendered game is read, and what people do wrong is not taken for a move."""

from __future__ import annotations

import chess
import pytest

from app.bench import registry
from app.bench.vision_actions import SORTS, action_rows
from app.bench.vision_games import game_rows, random_game
from app.bench.vision_photos import photo_folder

pytestmark = pytest.mark.slow


def quiet(_step: str) -> None:
    """Nobody looks."""


def test_a_rendered_game_is_read(monkeypatch):
    monkeypatch.setattr("app.bench.vision_games.PLIES", {True: 8})
    rows = game_rows(True, quiet)
    assert rows["game wrong"].max == 0.0
    assert rows["game asked"].mean <= 0.25
    assert rows["game squares"].mean <= 0.002
    assert rows["game wrong"].n == 8


def test_what_people_do_wrong_is_never_accepted(monkeypatch):
    monkeypatch.setattr("app.bench.vision_actions.ACTIONS", {True: len(SORTS)})
    said: list[str] = []
    rows = action_rows(True, said.append)
    assert rows["action accepted"].max == 0.0, said
    assert rows["action unnamed"].mean <= 0.2, said


def test_a_random_game_is_a_game_and_repeats():
    moves = list(random_game(3, 60))
    board = chess.Board()
    for move in moves:
        assert move in board.legal_moves
        board.push(move)
    assert list(random_game(3, 60)) == moves


def test_photographs_are_looked_at_by_one_bench_only(tmp_path):
    with pytest.raises(registry.UserError, match="looks at no photographs"):
        registry.run_bench("law", quick=True, progress=quiet, photos=tmp_path)
    with pytest.raises(registry.UserError, match="is no folder"):
        registry.run_bench("vision", quick=True, progress=quiet, photos=tmp_path / "nowhere")
    assert photo_folder(tmp_path) == tmp_path
