"""The arm in three dimensions, in a real browser: what stands where, what follows what; and nothing is drawn unseen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import chess
import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from app.motion.settings import MotionSettings
from app.page.robot_scene import robot_scene
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.scene.arm import arm_joints
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES
from hardware.table import Place, TableSettings
from tests.app.page.browsers import IN_3D, chromium
from tests.app.page.panels.site import PanelSite, panel, served, until

pytestmark = pytest.mark.slow
TABLE = TableSettings(yaw_in_base=0.02)
PARAMETERS = load_parameters()
MODEL = DeltaModel(PARAMETERS)
TICK = PARAMETERS.drive.tick
INSPECT = "module.inspect(element)"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium(IN_3D) as opened:
        yield opened


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    """One page for all: each test sets what it looks at."""
    with opened_panel(browser) as opened:
        yield opened


@contextmanager
def opened_panel(browser: Browser) -> Iterator[Page]:
    site = PanelSite({"/robot.json": robot_scene(PARAMETERS, TABLE, MotionSettings().home, TICK)})
    with served(site), panel(browser, site, "robot") as opened:
        until(lambda: (opened.evaluate(INSPECT) or {}).get("renders"), opened)
        yield opened


def game(held: str | None = None) -> dict[str, Any]:
    """The section ``game`` at the start."""
    pieces = [
        {"name": one.name, "kind": one.kind, "colour": one.colour, "place": str(one.place), "at": TABLE.xy(one.place)}
        for one in Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
    ]
    return {"pieces": pieces, "held": held}


def telemetry(tool: tuple[float, float, float], **changed: Any) -> dict[str, Any]:
    """A frame with the tool at a point, base frame [m]."""
    return {
        "t": 1.0, "tool": tool, "reference": tool, "angles": posture_at(MODEL, np.array(tool)).y.tolist(),
        "finger": 0.01, "tactile": [0.0, 0.0], "force": [0.0, 0.0, 0.0], "motion": 0, "executed": 0, "word": "moves",
        "exact": True, **changed,
    }  # fmt: skip


def drawn(page: Page, tool: Sequence[float], **parts: float) -> dict[str, Any]:
    """What is drawn, once the tool is there, and other figures are what they should be."""

    def there() -> dict[str, Any] | None:
        found: dict[str, Any] = page.evaluate(INSPECT)
        right = found["tool"] == pytest.approx(tool, abs=1e-6)
        return found if right and all(found[name] == pytest.approx(parts[name], abs=0.02) for name in parts) else None

    found: dict[str, Any] = until(there, page)
    return found


def still(page: Page) -> int:
    """How often it has been drawn, once nothing is drawn any more."""

    def rests() -> int:
        before: int = page.evaluate(INSPECT)["renders"]
        page.wait_for_timeout(700)
        return before if page.evaluate(INSPECT)["renders"] == before else 0

    renders: int = until(rests, page)
    return renders


def test_pieces_stand_where_the_game_says(page: Page) -> None:
    page.evaluate("(game) => store.set('game', game)", game())
    shown = page.evaluate(INSPECT)["pieces"]
    for piece in game()["pieces"]:
        expected = TABLE.base_from_board(np.array([*piece["at"], 0.0]))
        assert shown[piece["name"]] == pytest.approx(expected, abs=1e-5)
    assert len(shown) == len(game()["pieces"])


def test_what_is_not_on_the_table_is_not_shown_and_what_is_gone_is_gone(page: Page) -> None:
    shown = game()
    shown["pieces"][0]["at"] = None
    page.evaluate("(game) => store.set('game', game)", shown)
    assert len(page.evaluate(INSPECT)["pieces"]) == len(shown["pieces"])
    page.evaluate("(game) => store.set('game', {...game, pieces: game.pieces.slice(0, 2)})", shown)
    assert len(page.evaluate(INSPECT)["pieces"]) == 2


def test_the_tool_follows_telemetry(page: Page) -> None:
    for tool in ((0.05, 0.08, 0.41), (-0.1, -0.05, 0.38)):
        page.evaluate("(frame) => store.set('telemetry', frame)", telemetry(tool, finger=0.015))
        assert drawn(page, tool)["fingers"] == pytest.approx(0.015)


def test_between_two_frames_the_tool_is_on_its_way_and_then_there(page: Page) -> None:
    start, end = (0.0, 0.0, 0.40), (0.05, 0.0, 0.40)
    page.evaluate("(frame) => store.set('telemetry', frame)", telemetry(start))
    drawn(page, start)
    page.evaluate("(frame) => store.set('telemetry', frame)", telemetry(end, exact=False))
    x, *_ = page.evaluate(INSPECT)["tool"]
    assert 0.0 <= x <= end[0]
    drawn(page, end)
    still(page)


def test_the_held_piece_moves_with_the_tool(page: Page) -> None:
    held = next(one for one in game()["pieces"] if one["kind"] == "knight")
    page.evaluate("(game) => store.set('game', game)", game(held["name"]))
    for tool in ((0.02, 0.03, 0.40), (0.08, -0.02, 0.37)):
        page.evaluate("(frame) => store.set('telemetry', frame)", telemetry(tool))
        found = drawn(page, tool)
        assert found["held"] == held["name"]
        below = np.array([0.0, 0.0, PIECE_SHAPES[held["kind"]].grip_height])
        assert found["pieces"][held["name"]] == pytest.approx(np.array(tool) + below, abs=1e-5)


def test_the_path_fades_with_what_has_been_executed(page: Page) -> None:
    points = [[0.002 * i, 0.0, 0.40] for i in range(50)]
    page.evaluate("(path) => store.set('path', path)", {"motion": 7, "points": points, "stiffness": [], "stride": 10})
    for executed, share in ((0, 0.0), (245, 0.5), (490, 1.0)):
        frame = telemetry((0.0, 0.0, 0.40), motion=7, executed=executed)
        page.evaluate("(frame) => store.set('telemetry', frame)", frame)
        drawn(page, (0.0, 0.0, 0.40), executed=share)


def test_joints_are_where_the_kinematics_have_them(page: Page) -> None:
    angles, geometry = (0.1, -0.2, 0.3), PARAMETERS.geometry.model_dump()
    expected = arm_joints(MODEL, angles)
    found = page.evaluate(
        """async ([geometry, angles, tool]) =>
           (await import('/static/robot/kinematics.js')).joints(geometry, angles, tool)""",
        [geometry, angles, expected.tool],
    )
    for arm in range(3):
        assert found[arm]["shoulder"] == pytest.approx(expected.shoulders[arm])
        assert found[arm]["elbow"] == pytest.approx(expected.elbows[arm])
        assert found[arm]["wrist"] == pytest.approx(expected.wrists[arm])
        assert found[arm]["axis"] == pytest.approx(expected.axes[arm])


def test_nothing_is_drawn_unseen_or_unchanged_and_nothing_is_asked_for(page: Page) -> None:
    assert page.evaluate("sent.at(-1).telemetry") is True
    rested = still(page)
    page.evaluate("element.hidden = true")
    until(lambda: page.evaluate("sent.at(-1).telemetry") is False, page)
    for i in range(5):
        page.evaluate("(frame) => store.set('telemetry', frame)", telemetry((0.01 * i, 0.0, 0.40)))
    page.evaluate("(game) => store.set('game', game)", game())
    page.wait_for_timeout(300)
    assert page.evaluate(INSPECT)["renders"] == rested
    page.evaluate("element.hidden = false")
    drawn(page, (0.04, 0.0, 0.40))


def test_a_text_says_what_is_seen(page: Page) -> None:
    held = next(one for one in game()["pieces"] if one["name"] == "white-queen")
    page.evaluate("(game) => store.set('game', game)", game(held["name"]))
    x, y, z = TABLE.base_from_board(np.array([*TABLE.xy(Place.parse("d4")), 0.05])).tolist()
    page.evaluate("(frame) => store.set('telemetry', frame)", telemetry((x, y, z), force=[0.0, 0.0, -2.0]))
    said = page.locator(".tm-sentence").text_content()
    assert (
        said
        == "The tool is over d4, 50 mm above the board, and holds the white queen, 2.0 N on the tool; the arm moves."
    )


def test_unmounted_it_leaves_nothing(browser: Browser) -> None:
    with opened_panel(browser) as page:
        page.evaluate("unmount()")
        assert page.evaluate("element.childElementCount") == 0
        assert page.evaluate("sent.at(-1).telemetry") is False
        page.evaluate("(game) => store.set('game', game)", game())


def test_without_webgl_a_sentence_says_so(browser: Browser) -> None:
    site = PanelSite({"/robot.json": robot_scene(PARAMETERS, TABLE, MotionSettings().home, TICK)})
    context = browser.new_context()
    context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = context.new_page()
    with served(site):
        page.goto(f"{site.address}/?panel=robot")
        until(lambda: "WebGL" in (page.locator(".tm-sentence").text_content() or ""), page)
        assert page.locator("canvas").count() == 0
    context.close()


def test_a_record_shows_its_arm_also_where_the_game_that_is_played_has_none(browser: Browser) -> None:
    with opened_panel(browser) as page:
        page.evaluate("store.set('session', {rig: 'board'})")
        assert page.evaluate(INSPECT)["arm"] is False
        page.evaluate("store.showRecord('a-game')")
        assert page.evaluate(INSPECT)["arm"] is True
        page.evaluate("store.showRecord(null)")
        assert page.evaluate(INSPECT)["arm"] is False
