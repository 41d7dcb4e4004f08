"""The bench of vision: a rendered game is read, and what people do wrong is not taken for a move."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import chess
import numpy as np
import pytest

from app import UserError
from app.measure.bench import run_bench
from app.measure.bench.vision.actions import SORTS, action_rows
from app.measure.bench.vision.games import (
    TROUBLES,
    Scene,
    follow_games,
    game_rows,
    open_studio,
    random_game,
    trouble_rows,
)
from app.measure.bench.vision.photos import photo_folder
from hardware.piece_set import Colour
from hardware.table import TableSettings

pytestmark = pytest.mark.slow


def quiet(_step: str) -> None:
    """Nobody looks."""


@pytest.fixture(scope="module")
def studio():
    with open_studio(TableSettings(), hand=Colour.WHITE) as opened:
        yield opened


@pytest.fixture
def one_studio(studio, monkeypatch):
    """What follows games and actions uses the tests' own studio: each of its own would take seconds to open."""
    for module in ("games", "actions"):
        monkeypatch.setattr(f"app.measure.bench.vision.{module}.open_studio", lambda *_, **__: nullcontext(studio))


def test_a_rendered_game_is_read(monkeypatch):
    monkeypatch.setattr("app.measure.bench.vision.games.PLIES", {True: 8})
    rows = game_rows(True, quiet)
    assert rows["game wrong"].max == 0.0
    assert rows["game asked"].mean <= 0.25
    assert rows["game squares"].mean <= 0.002
    assert rows["game wrong"].n == 8


@pytest.mark.usefixtures("one_studio")
def test_trouble_with_light_camera_and_a_hand_is_read_or_asked_about(monkeypatch):
    monkeypatch.setattr("app.measure.bench.vision.games.TROUBLED", {True: 5})
    said: list[str] = []
    rows = trouble_rows(True, said.append)
    assert rows["trouble wrong"].max == 0.0, said
    assert rows["trouble asked"].mean < 1.0


def test_each_trouble_changes_the_picture_and_the_next_game_begins_without_it(studio):
    board = chess.Board()
    quiet_picture = Scene(studio, TableSettings(), 3).picture(board)
    for name, trouble in TROUBLES.items():
        scene = Scene(studio, TableSettings(), 3)
        trouble(scene)
        change = np.abs(scene.picture(board).colour.astype(float) - quiet_picture.colour)
        assert np.count_nonzero(change.max(axis=2) > 30.0) > 300, name
    again = Scene(studio, TableSettings(), 3).picture(board).colour.astype(float)
    assert np.count_nonzero(np.abs(again - quiet_picture.colour).max(axis=2) > 30.0) < 30


def test_a_studio_without_a_hand_shows_none(monkeypatch):
    monkeypatch.setattr("hardware.sim.process.table_studio.StillRenderer", lambda model: SimpleNamespace(close=bool))
    table = TableSettings()
    with open_studio(table) as studio:
        scene = Scene(studio, table, 3)
        TROUBLES["resting hand"](scene)
        with pytest.raises(ValueError, match="no hand"):
            scene.picture(chess.Board())


@pytest.mark.usefixtures("one_studio")
def test_a_long_run_is_the_sum_of_its_parts():
    def nothing(_scene: Scene) -> None:
        """Good light."""

    said: list[str] = []
    assert len(follow_games(2, 41, nothing, said.append)["wrong"]) == 2
    assert said[0].startswith("game 41, ply 1: " + next(random_game(41, 1)).uci())


@pytest.mark.usefixtures("one_studio")
def test_what_people_do_wrong_is_never_accepted(monkeypatch):
    monkeypatch.setattr("app.measure.bench.vision.actions.ACTIONS", {True: len(SORTS) // 2})
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
    with pytest.raises(UserError, match="uses no photographs"):
        run_bench("law", quick=True, progress=quiet, photos=tmp_path)
    with pytest.raises(UserError, match="is not a folder"):
        run_bench("vision", quick=True, progress=quiet, photos=tmp_path / "nowhere")
    assert photo_folder(tmp_path) == tmp_path
