"""The page of a game that was analysed."""

from __future__ import annotations

from app.report.page import report_page
from app.report.source import read_source
from tests.app.analysis.analysed import analysed
from tests.app.played_game import EVERY_KIND, LINE_OF_EVERY_KIND, PlayedGame

SCORES = [0, 0, 400, 400, 300, -900]


def test_the_page_of_an_analysed_game_shows_chances_and_mistakes(game: PlayedGame) -> None:
    folder = game.record.folder
    assert "What the engine thinks of it" not in report_page(read_source(folder))
    made = analysed(LINE_OF_EVERY_KIND, SCORES, folder, EVERY_KIND)
    page = report_page(read_source(folder))
    assert "What the engine thinks of it" in page
    assert page.count('class="m j-blunder"') == 1 + sum(
        move.judgement == "blunder" for move in made.moves
    )  # and its key
    for move in made.moves:
        assert move.note.replace("’", "’") in page
    assert "Fake 1.0, 7 nodes a position" in page


def test_the_analysis_of_another_game_is_not_shown(game: PlayedGame) -> None:
    analysed("e4 e5", [0, 0, 0], game.record.folder)
    assert "What the engine thinks of it" not in report_page(read_source(game.record.folder))
