"""Whole games with whatever can go wrong on the way: the record here is the game there."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.online.online_games import play, require_same


@pytest.mark.parametrize(("use", "seed"), [("person", 8), ("person", 12), ("bot", 103), ("bot", 106)])
def test_the_record_is_the_game_there_whatever_goes_wrong(tmp_path: Path, use: str, seed: int) -> None:
    played = play(use, seed, tmp_path / "session", rematches=1 if seed == 12 else 0)
    require_same(played)
    assert len(played.games) == (2 if seed == 12 else 1)
