"""The camera's picture and the plots, in a real browser: what vision thinks in words and marks, figures in a table."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from app.motion.settings import MotionSettings
from app.page.robot_scene import robot_scene
from controller.protection.limits import default_limits
from hardware.parameters import load_parameters
from hardware.table import TableSettings
from tests.app.page.browsers import IN_3D, chromium
from tests.app.page.panels.site import PanelSite, panel, served, until

pytestmark = pytest.mark.slow
PARAMETERS, TABLE = load_parameters(), TableSettings()
UNSURE = ("e4", "a7")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium(IN_3D) as opened:
        yield opened


@pytest.fixture
def site() -> Iterator[PanelSite]:
    answers: dict[str, Any] = {
        "/robot.json": robot_scene(PARAMETERS, TABLE, MotionSettings().home, PARAMETERS.drive.tick),
        "/picture/camera.jpg": picture(),
    }
    with served(PanelSite(answers)) as found:
        yield found


def picture() -> bytes:
    """A JPEG of 64 × 48 pixels."""
    made, encoded = cv2.imencode(".jpg", np.full((48, 64, 3), 90, np.uint8))
    assert made
    return bytes(encoded)


def look() -> dict[str, Any]:
    """A look at the start position through a camera straight above it, unsure of two squares."""
    grid = [[100.0 + 40.0 * file, 440.0 - 40.0 * rank] for rank in range(9) for file in range(9)]
    squares = [
        {"seen": "white" if square < 16 else "black" if square >= 48 else "empty", "sure": 0.97} for square in range(64)
    ]
    squares[28]["sure"] = squares[48]["sure"] = 0.55
    return {
        "stamp": 2.0, "outcome": "unsure", "text": "I am not sure what stands there.", "unsure": UNSURE,
        "squares": squares, "grid": grid, "width": 640, "height": 480, "picture": 3,
    }  # fmt: skip


def test_the_camera_shows_the_newest_picture_and_says_what_vision_thinks(browser: Browser, site: PanelSite) -> None:
    with panel(browser, site, "camera") as page:
        until(lambda: page.evaluate("sent.at(-1)?.camera"), page)
        page.evaluate("(look) => store.change({look, pictures: {camera: {number: 4, stamp: 2.5}}})", look())
        until(lambda: page.evaluate("document.querySelector('img').naturalWidth") == 64, page)
        assert page.evaluate("document.querySelector('img').src").endswith("?n=4")
        words = [text.strip() for text in page.locator(".tm-sentence").all_text_contents()]
        assert words[0] == "I am not sure what stands there."
        assert words[1] == "Seen: 16 white and 16 black pieces. Not sure of e4 (empty, 55 %), a7 (black, 55 %)."
        assert "exposed at 2.5 s of plant time" in words[2]
        marked = page.locator(".tm-is-unsure")
        assert sorted(marked.evaluate_all("all => all.map((one) => one.dataset.square)")) == sorted(UNSURE)
        assert {text.strip() for text in marked.locator("text").all_text_contents()} == {"? 55"}
        # e4 is the fifth square along, the fourth up: where the grid has it
        assert page.locator("[data-square=e4] polygon").get_attribute("points") == "260,320 300,320 300,280 260,280"
        assert page.locator(".tm-square circle").count() == 32
        page.evaluate("element.hidden = true")
        until(lambda: page.evaluate("sent.at(-1).camera") is False, page)


def test_pictures_that_come_unseen_are_not_fetched(browser: Browser, site: PanelSite) -> None:
    with panel(browser, site, "camera") as page:
        page.evaluate("element.hidden = true")
        until(lambda: page.evaluate("sent.at(-1).camera") is False, page)
        page.evaluate("store.set('pictures', {camera: {number: 9, stamp: 1}})")
        page.wait_for_timeout(200)
        assert page.evaluate("document.querySelector('img').src") == ""
        page.evaluate("element.hidden = false")
        until(lambda: page.evaluate("document.querySelector('img').src").endswith("?n=9"), page)


def figures(page: Page) -> dict[str, dict[str, str]]:
    """Every chart's newest figures, by title and name."""
    found: dict[str, dict[str, str]] = page.evaluate(
        """() => Object.fromEntries([...document.querySelectorAll('.tm-legend')].map((table) => [
             table.caption.textContent,
             Object.fromEntries([...table.rows].map((row) => [...row.cells].map((one) => one.textContent)))]))"""
    )
    return found


def test_plots_say_their_newest_figures_and_limits_in_tables(browser: Browser, site: PanelSite) -> None:
    limits, stiffness = default_limits(PARAMETERS, TABLE), 4900.0
    path = {"motion": 3, "stride": 10, "points": [[0, 0, 0.4]] * 2, "stiffness": [[stiffness, stiffness, 400.0]] * 2}
    with panel(browser, site, "plots") as page:
        page.evaluate("(path) => store.set('path', path)", path)
        times = itertools.count(10.0, 0.1)

        def told() -> bool:
            """Limits come a moment after the panel: frames are told until they are known."""
            frame = {
                "t": next(times), "tool": [0.0, 0.0, 0.4], "reference": [0.0003, 0.0004, 0.402], "tactile": [4.8, 4.6],
                "force": [0.0, 3.0, -4.0], "motion": 3, "executed": 5, "late": 12e-6, "work": 310e-6, "word": "moves",
            }  # fmt: skip
            page.evaluate("(frame) => store.set('telemetry', frame)", frame)
            return figures(page)["Ticks [µs]"]["length of a tick"] == "880"

        until(told, page)
        found = figures(page)
        assert found["Tracking error [mm]"]["in the plane"] == "0.50"
        assert found["Tracking error [mm]"]["vertical"] == "2.00"
        admitted = limits.tracking_acceleration / stiffness
        assert found["Tracking error [mm]"]["limit in the plane"] == f"{1e3 * admitted:.2f}"
        assert found["Tracking error [mm]"]["limit vertical"] == f"{1e3 * limits.tracking_most:.2f}"
        assert found["Forces [N]"]["on the tool"] == "5.0"
        assert found["Stiffness [1/s²]"] == {"in the plane": "4900", "vertical": "400"}
        assert found["Ticks [µs]"] == {"lateness": "12", "work": "310", "length of a tick": "880"}


def test_paused_plots_stand_still(browser: Browser, site: PanelSite) -> None:
    with panel(browser, site, "plots") as page:
        tell = """(t) => store.set('telemetry', {t, tool: [0, 0, 0.4], reference: [0, 0, 0.4], tactile: [t, 0],
                   force: [0, 0, 0], motion: 0, executed: 0, late: 0, work: 0, word: 'moves'})"""
        page.evaluate(tell, 1)
        until(lambda: figures(page)["Forces [N]"]["right pad"] == "1.0", page)
        page.get_by_role("button", name="Pause").click()
        page.evaluate(tell, 2)
        page.wait_for_timeout(300)
        assert figures(page)["Forces [N]"]["right pad"] == "1.0"
        page.get_by_role("button", name="Pause").click()
        page.evaluate(tell, 3)
        until(lambda: figures(page)["Forces [N]"]["right pad"] == "3.0", page)


def test_plots_go_on_with_the_game_after_a_record_was_shown(browser: Browser, site: PanelSite) -> None:
    live = """(t) => store.receive({telemetry: {t, tool: [0, 0, 0.4], reference: [0, 0, 0.4], tactile: [t, 0],
              force: [0, 0, 0], motion: 0, executed: 0, late: 0, work: 0, word: 'moves'}})"""
    three = [[0.0], [0.0], [0.4]]
    columns = {
        "t": [50.0], "tool": three, "reference": three, "tactile": [[7.0], [0.0]], "force": three, "motion": [0],
        "executed": [0], "late": [0.0], "work": [0.0], "word": ["moves"],
    }  # fmt: skip
    with panel(browser, site, "plots") as page:
        page.evaluate(live, 1)
        until(lambda: figures(page)["Forces [N]"]["right pad"] == "1.0", page)
        page.evaluate(
            """async (columns) => {
              const {Trace} = await import('/static/record/trace.js');
              const trace = new Trace({columns});
              store.showRecord('a-game');
              store.change({trace, telemetry: trace.frame(50)});
            }""",
            columns,
        )
        until(lambda: figures(page)["Forces [N]"]["right pad"] == "7.0", page)
        page.evaluate("store.set('trace', null); store.showRecord(null)")
        page.evaluate(live, 2)
        until(lambda: figures(page)["Forces [N]"]["right pad"] == "2.0", page)
