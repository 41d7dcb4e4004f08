"""Which games lie in a folder, and which of their plies can be demonstrations."""

from __future__ import annotations

from pathlib import Path

import pytest

from app import UserError
from app.dataset.games import match_folders, plies_of_match
from app.pieces.inventory import Stage
from tests.app.played_game import EVERY_KIND, LINE_OF_EVERY_KIND, PlayedGame


def test_a_game_a_match_a_campaign_and_a_folder_of_games(tmp_path: Path) -> None:
    for name in ("games/10", "games/9", "games/10/game-2"):
        PlayedGame(tmp_path / name).play("e4")
    (tmp_path / "games/empty").mkdir()
    ten, second, nine = (tmp_path / "games" / name for name in ("10", "10/game-2", "9"))
    campaign = ((nine, (nine,)), (ten, (ten, second)))
    assert match_folders(tmp_path) == campaign
    assert match_folders(tmp_path / "games") == campaign
    assert match_folders(ten) == ((ten, (ten, second)),)
    assert match_folders(second) == ((ten, (second,)),)
    plies = plies_of_match(ten, (ten, second), tmp_path, print).plies
    assert [ply.game for ply in plies] == ["games/10", "games/10/game-2"]


def test_a_campaign_keeps_a_record_beside_its_world_and_one_played_again_is_the_same_game(tmp_path: Path) -> None:
    for name in ("games/9/game", "games/10/game", "games/9-again/game", "games/8-again/game"):
        PlayedGame(tmp_path / name).play("e4")
    nine, ten, alone = (tmp_path / "games" / name / "game" for name in ("9", "10", "8-again"))
    assert match_folders(tmp_path) == ((alone, (alone,)), (nine, (nine,)), (ten, (ten,)))
    assert match_folders(tmp_path / "games" / "9") == ((nine, (nine,)),)


def test_a_folder_without_games_is_refused(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(UserError, match="holds no recorded game: name a record, a match, or a campaign that kept"):
            match_folders(folder)


def test_plies_of_the_arm_with_their_times_and_outcomes(tmp_path: Path) -> None:
    outcomes = {
        2: {"physical_ok": False},
        3: {"failures": ("the piece slipped",)},
        4: {"by": "hand", "real": None, "planned": None, "peak_torque": None, "peak_force": None},
        5: {"resumed": True},
        6: {"mended": True, "real": None, "planned": None},
    }
    PlayedGame(tmp_path, EVERY_KIND).play(f"{LINE_OF_EVERY_KIND} Kg7", lambda number: outcomes.get(number, {}))
    plies = plies_of_match(tmp_path, (tmp_path,), tmp_path, print).plies
    assert [ply.number for ply in plies] == [1, 2, 3, 5, 6]
    assert [ply.success for ply in plies] == [True, False, False, True, True]
    assert [ply.resumed for ply in plies] == [False, False, False, True, False]
    assert [ply.mended for ply in plies] == [False, False, False, False, True]
    first, second = plies[:2]
    assert (first.begun, first.ended) == (1.0, pytest.approx(4.01))
    assert first.task == "capture the black pawn on d5 with the white pawn from e5 to d6 en passant"
    assert first.fen == EVERY_KIND
    assert second.begun == 4.0
    assert first.seed == 7


@pytest.mark.parametrize("tried", ["e2e4", "d2d4"])
def test_a_ply_that_was_given_up_and_begun_anew_is_only_what_was_done_at_last(tried: str, tmp_path: Path) -> None:
    game = PlayedGame(tmp_path)
    game.record.step(tried, 0, Stage.APPROACH, game.time)
    game.time += 5.0
    if tried == "e2e4":
        game.record.task_dropped("the camera failed", game.time)
    game.time += 20.0
    game.play("e4")
    (ply,) = plies_of_match(tmp_path, (tmp_path,), tmp_path, print).plies
    assert (ply.begun, ply.ended) == (26.0, pytest.approx(28.01))
