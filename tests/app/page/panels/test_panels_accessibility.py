"""axe finds nothing in the robot's panels, light and dark, narrow and wide, and nothing sticks out of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser

from app.motion.settings import MotionSettings
from app.page.robot_scene import robot_scene
from hardware.parameters import load_parameters
from tests.app.page.browsers import IN_3D, chromium
from tests.app.page.panels.recorded_game import ID, TABLE, recorded_game
from tests.app.page.panels.site import PanelSite, panel, served, until
from tests.app.page.panels.test_looking_panels import look, picture
from tests.app.page.test_accessibility import OF_ALL, OF_COLOURS, axe

pytestmark = pytest.mark.slow
READY = {
    "robot": "module.inspect(element)?.renders > 0",
    "plots": "document.querySelectorAll('.tm-legend').length === 4",
    "camera": "document.querySelectorAll('.tm-square').length === 64",
    "record": "document.querySelector('.tm-record canvas') !== null && store.get('telemetry') !== null",
}
"""When each panel shows what it can."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium(IN_3D) as opened:
        yield opened


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    game, robot = recorded_game(tmp_path_factory.mktemp("record"), "e4", "d5"), robot_scene(
        load_parameters(), TABLE, MotionSettings().home, load_parameters().drive.tick
    )  # fmt: skip
    shown = {**game.record, "troubles": [
        {"t": 1.0, "kind": "stray", "text": "The pawn stood off its square.", "squares": ["e4"], "mended_by": "arm"}
    ]}  # fmt: skip
    return {
        "/robot.json": robot, f"/games/{ID}/robot.json": robot, f"/games/{ID}/record.json": shown,
        f"/games/{ID}/telemetry.json": game.telemetry, "/games": [], "/picture/camera.jpg": picture(),
    }  # fmt: skip


@pytest.mark.parametrize("name", READY)
def test_axe_finds_nothing(browser: Browser, answers: dict[str, Any], name: str) -> None:
    fragment = f"#game={ID}&t=1.5" if name == "record" else ""
    with served(PanelSite(answers)) as site, panel(browser, site, name, fragment) as page:
        page.evaluate("(look) => store.change({look, pictures: {camera: {number: 1, stamp: 2}}})", look())
        until(lambda: page.evaluate(READY[name]), page)
        page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
        page.evaluate(f"{axe()}; 0")
        for width in (360, 1440):
            page.set_viewport_size({"width": width, "height": 900})
            until(lambda: page.evaluate("document.documentElement.scrollWidth <= innerWidth"), page)
            for theme in ("light", "dark"):
                page.evaluate("(theme) => (document.documentElement.dataset.theme = theme)", theme)
                settled = "document.getAnimations().every((one) => one.playState !== 'running')"
                until(lambda: page.evaluate(settled), page)  # noqa: B023  # it is called at once
                found = page.evaluate(f"axe.run({OF_ALL if theme == 'light' else OF_COLOURS})")
                assert [
                    f"{width} px, {theme}: {rule['id']}: {node['html'][:200]}: {node['failureSummary']}"
                    for rule in found["violations"] for node in rule["nodes"]
                ] == []  # fmt: skip
                looked = [rule["id"] for kind in ("passes", "incomplete", "inapplicable") for rule in found[kind]]
                assert "color-contrast" in looked
                assert len(looked) > (50 if theme == "light" else 1)
