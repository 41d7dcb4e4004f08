"""Records of games for the tests of the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.played_game import EVERY_KIND, LINE_OF_EVERY_KIND, PlayedGame


@pytest.fixture
def game(tmp_path: Path) -> PlayedGame:
    """Of every kind of move."""
    return PlayedGame(tmp_path / "game", EVERY_KIND).play(LINE_OF_EVERY_KIND)
