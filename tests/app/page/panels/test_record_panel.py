"""A recorded game under the slider, in a real browser: the page's whole state comes to the slider's moment."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import chess
import pytest
from playwright.sync_api import Browser, Page

from app.motion.settings import MotionSettings
from app.page.recorded.catalogue import RecordPlace
from app.page.recorded.record import record_shown
from app.page.robot_scene import robot_scene
from app.records.files import EVENTS_FILE
from app.records.history import read_events
from hardware.parameters import load_parameters
from hardware.table import square_place
from tests.app.page.browsers import IN_3D, chromium
from tests.app.page.panels.recorded_game import HOME, ID, STAGE, TABLE, RecordedGame, recorded_game
from tests.app.page.panels.site import PanelSite, panel, served, until
from tests.app.page.recorded.recorded_games import RecordedGame as TakenBack

pytestmark = pytest.mark.slow
GAME = f"/games/{ID}"
SEEK = """(t) => {
  const slider = document.querySelector('input[type=range]');
  slider.value = t;
  slider.dispatchEvent(new Event('input'));
}"""

WITH_MOVES = """async () => {
  document.body.append(Object.assign(document.createElement('div'), {id: 'moves'}));
  (await import('/static/game/moves.js')).mountMoves(store);
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium(IN_3D) as opened:
        yield opened


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RecordedGame:
    return recorded_game(tmp_path_factory.mktemp("record"), "e4", "d5", "exd5", "Qxd5")


@pytest.fixture(scope="module")
def site(recorded: RecordedGame) -> Iterator[PanelSite]:
    robot = robot_scene(load_parameters(), TABLE, MotionSettings().home, 0.00088)
    listed = {
        "id": ID, "number": 1, "sets_up": False, "white": "Anna", "black": "Bert", "began": recorded.record["began"],
        "plies": 4, "result": "*", "reason": None, "film": False, "telemetry": True,
    }  # fmt: skip
    answers = {
        "/robot.json": robot, "/games": [listed], f"{GAME}/record.json": recorded.record, f"{GAME}/robot.json": robot,
        f"{GAME}/telemetry.json": recorded.telemetry,
    }  # fmt: skip
    with served(PanelSite(answers)) as found:
        yield found


@pytest.fixture(scope="module")
def page(browser: Browser, site: PanelSite) -> Iterator[Page]:
    with panel(browser, site, "record") as opened:
        until(lambda: opened.locator(".tm-table button").count() == 1, opened)
        opened.locator(".tm-table button").click()
        until(lambda: get(opened, "telemetry"), opened)
        yield opened


def get(page: Page, section: str) -> Any:
    """A section of the page's state."""
    return page.evaluate("(section) => store.get(section)", section)


def test_the_slider_brings_every_section_to_its_ply(page: Page, recorded: RecordedGame) -> None:
    for ply in (3, 1, 4, 2):
        page.evaluate(SEEK, recorded.done[ply - 1])
        shown, board = get(page, "game"), recorded.boards[ply]
        assert shown["fen"] == board.fen()
        assert shown["turn"] == ("white" if board.turn else "black")
        assert shown["last"] == [board.move_stack[-1].uci()[:2], board.move_stack[-1].uci()[2:4]]
        assert get(page, "viewing") == (None if ply == 4 else ply)
        assert [move["san"] for move in shown["moves"]] == ["e4", "d5", "exd5", "Qxd5"]
        assert get(page, "telemetry")["t"] == pytest.approx(recorded.done[ply - 1], abs=1e-6)
        squares = {tuple(piece["at"]) for piece in shown["pieces"]}
        for square in board.piece_map():
            x, y = TABLE.xy(square_place(square))
            assert any(abs(x - u) < 1e-4 and abs(y - v) < 1e-4 for u, v in squares)


def test_within_a_ply_the_piece_is_held_and_the_tool_is_under_way(page: Page) -> None:
    carry = 2.5 * STAGE
    page.evaluate(SEEK, carry)
    assert get(page, "game")["held"] == "white-pawn-e"
    assert get(page, "game")["fen"] == chess.STARTING_FEN
    source, target = (TABLE.base_from_board([*TABLE.xy(square_place(square)), 0.05]) for square in (chess.E2, chess.E4))
    assert get(page, "telemetry")["tool"] == pytest.approx((source + target) / 2.0, abs=1e-3)
    path = get(page, "path")
    assert path["points"][0] == pytest.approx(source, abs=1e-3)
    assert path["motion"] == get(page, "telemetry")["motion"]
    page.evaluate(SEEK, 0.0)
    assert get(page, "game")["held"] is None
    assert get(page, "telemetry")["tool"] == pytest.approx(HOME, abs=1e-6)


def test_keys_go_from_ply_to_ply(page: Page, recorded: RecordedGame) -> None:
    slider = page.locator("input[type=range]")
    slider.focus()
    for key, expected in (
        ("PageDown", recorded.done[0]), ("PageDown", recorded.done[1]), ("ArrowRight", recorded.done[1] + 0.1),
        ("PageUp", recorded.done[1]), ("PageUp", recorded.done[0]), ("End", recorded.record["span"][1]), ("Home", 0.0),
    ):  # fmt: skip
        slider.press(key)
        until(lambda to=expected: float(slider.input_value()) == pytest.approx(to, abs=0.011), page)


def test_the_analysis_says_what_was_wrong_and_leads_there(page: Page, recorded: RecordedGame) -> None:
    blunder = page.locator(".tm-chances .tm-blunder").first
    assert blunder.inner_text() == "1… d5 ??"
    blunder.click()
    until(lambda: get(page, "viewing") == 2, page)
    assert "Blunder. d5 lets the winning chances fall" in page.locator(".tm-chances .tm-sentence").last.inner_text()
    chart = page.locator(".tm-chances-chart").bounding_box()
    assert chart is not None
    page.mouse.click(chart["x"] + 0.25 * chart["width"], chart["y"] + 0.5 * chart["height"])
    until(lambda: get(page, "game")["fen"] == recorded.boards[1].fen(), page)


def test_a_move_chosen_in_the_list_of_moves_takes_the_slider_there(page: Page, recorded: RecordedGame) -> None:
    page.evaluate("store.set('viewing', 2)")
    assert get(page, "game")["fen"] == recorded.boards[2].fen()
    assert float(page.locator("input[type=range]").input_value()) == pytest.approx(recorded.done[1], abs=0.011)
    page.evaluate("store.set('viewing', 0)")
    assert get(page, "game")["fen"] == chess.STARTING_FEN


def test_the_list_of_moves_leads_through_a_record_and_nowhere_where_moves_were_taken_back(
    browser: Browser, site: PanelSite, tmp_path: Path
) -> None:
    game = TakenBack(tmp_path)
    for san in ("e4", "e5", "Nf3", "f6"):
        game.ply(san)
    taken_back = game.time
    game.take_back(2)
    game.ply("Nc3")
    game.record.end("*", "it was long enough", game.later())
    address = "/games/back"
    site.answers[f"{address}/record.json"] = record_shown(
        RecordPlace("back", tmp_path, 1, False), read_events(tmp_path / EVENTS_FILE)
    )
    site.answers[f"{address}/robot.json"] = site.answers["/robot.json"]
    with panel(browser, site, "record", "#game=back") as page:
        until(lambda: get(page, "game"), page)
        page.evaluate(WITH_MOVES)
        slider, heading = page.locator("input[type=range]"), page.locator("h1")
        heading.press("ArrowRight")
        heading.press("ArrowRight")
        assert get(page, "viewing") == 2
        assert page.get_by_role("button", name="Back to the game").is_hidden(), "it leads to the record's end"
        page.evaluate(SEEK, taken_back)
        assert get(page, "game")["fen"].startswith("rnbqkbnr/pppp2pp/5p2/4p3/4P3/5N2/"), "as it stood then"
        moment = slider.input_value()
        for key in ("ArrowLeft", "ArrowRight", "Home", "End"):
            heading.press(key)
            assert slider.input_value() == moment


def test_it_plays_as_fast_as_asked_and_stops(page: Page) -> None:
    page.locator("select").select_option("2")  # slow enough that a busy browser finds it still playing
    page.get_by_role("button", name="Play", exact=True).click()
    until(lambda: get(page, "telemetry")["t"] > 1.0, page)
    page.get_by_role("button", name="Pause", exact=True).click()
    stopped = get(page, "telemetry")["t"]
    page.wait_for_timeout(300)
    assert get(page, "telemetry")["t"] == stopped


def test_a_link_leads_to_the_moment(browser: Browser, site: PanelSite, recorded: RecordedGame) -> None:
    with panel(browser, site, "record", f"#game={ID}&t={recorded.done[2]:.2f}") as page:
        until(lambda: (get(page, "game") or {}).get("fen") == recorded.boards[3].fen(), page)
        page.evaluate(SEEK, recorded.done[0])
        until(lambda: page.evaluate("location.hash") == f"#game={ID}&t={recorded.done[0]:.2f}", page)


def test_what_is_played_waits_behind_a_record_and_comes_back(page: Page) -> None:
    page.evaluate("store.receive({game: {fen: 'live', pieces: [], moves: []}, telemetry: {t: 99}})")
    assert get(page, "game")["fen"] != "live"
    page.get_by_role("button", name="Close").click()
    assert get(page, "game")["fen"] == "live"
    assert get(page, "telemetry")["t"] == 99
    assert get(page, "record") is None
    assert page.evaluate("location.hash") == ""
