"""A whole game through the page, in Debian's Chromium, against the simulated robot: all that a person may do."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import urlsplit

import chess.pgn
import pytest
from playwright.sync_api import Browser, expect

from tests.app.page.browsers import Visitor, chromium
from tests.app.page.serving import TOKEN
from tests.app.page.serving import Browser as PageBrowser
from tests.controllers import free_port
from tests.test_play import ENGINE, TOUCHMOVE
from tests.waiting import PATIENCE, until

pytestmark = pytest.mark.slow
PICTURES = os.environ.get("TOUCHMOVE_PICTURES")
"""Where pictures of the states go that the test comes through; nowhere if it is not set."""
RICH = "3qk3/p1Pp3p/8/1p2P3/8/8/3P1PPP/1N2K2R w K - 0 1"
"""From here four moves are of every kind that a person may make on a page."""


@contextmanager
def playing(folder: Path, *options: str) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """A game that waits for a browser, and the page's address."""
    said = folder / "said"
    with said.open("wb") as out:
        process = subprocess.Popen(
            [*TOUCHMOVE, "play", "--page", "--page-port", str(free_port()), "--out", str(folder / "game"), *options],
            stdin=subprocess.DEVNULL, stdout=out, stderr=out, start_new_session=True,
        )  # fmt: skip
    try:
        found = until(lambda: re.search(rb"in a browser: (http://\S+)", said.read_bytes()), "the page")
        yield process, found[1].decode()
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            process.wait(PATIENCE)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as found:
        yield found


class Player(Visitor):
    """Somebody who plays at the page."""

    def turn(self, moves: int) -> None:
        """Wait until so many moves were made, and it is their turn."""
        wait = 1000.0 * PATIENCE
        expect(self.page.locator("#moves button.move")).to_have_count(moves, timeout=wait)
        expect(self.page.locator("#ask")).to_have_attribute("data-mood", "turn", timeout=wait)

    def asked_anew(self, act: Callable[[], None]) -> None:
        """Do something that is no move, and wait until they are asked again: till then the old question stands."""
        before = self.page.evaluate("asked")
        act()
        self.until(f"asked > {before}")

    def says(self, line: str) -> None:
        self.page.locator("#line").fill(line)
        self.page.keyboard.press("Enter")

    def reads(self, text: str) -> None:
        """Wait until the page has said something."""
        expect(self.page.locator("#log")).to_contain_text(text, timeout=1000.0 * PATIENCE)

    def keys(self, source: str, target: str) -> None:
        """Move by keyboard alone."""
        for square in (source, target):
            self.page.locator(f'[role="gridcell"][data-square="{square}"]').focus()
            self.page.keyboard.press("Enter")

    def picture(self, name: str) -> None:
        if PICTURES is not None:
            self.page.wait_for_timeout(400.0)
            self.page.screenshot(path=Path(PICTURES) / f"{name}.png")


def moves_of(folder: Path) -> str:
    with (folder / "game" / "game.pgn").open(encoding="utf-8") as stream:
        game = chess.pgn.read_game(stream)
    assert game is not None
    return " ".join(node.san() for node in game.mainline())


def test_a_whole_game_on_the_page(tmp_path: Path, browser: Browser) -> None:
    engine = tmp_path / "engine"
    engine.write_text(f"#!{sys.executable}\n" + ENGINE.format(replies="d5 h6 Kxd8 h5"))
    engine.chmod(0o755)
    options = ("--pace", "fast", "--no-guard", "--fen", RICH, "--engine", str(engine))
    with playing(tmp_path, *options) as (process, address):
        player = Player(browser, address)
        player.turn(0)
        player.picture("page-start")
        player.says("hand move b1 d2")  # where a pawn stands
        player.reads("Another piece stands at d2: take it away first")
        player.says("hand knock e4")  # where nothing stands; nor does the hand stay there
        player.reads("No piece stands within 20 mm of e4")
        player.drag("h2", "h3")
        player.turn(2)
        player.keys("e5", "d6")  # en passant
        player.turn(4)
        player.asked_anew(lambda: player.says("hand move b1 b3"))  # a knight does not move like that
        player.reads("or say 'fix' and the arm does it")
        player.picture("page-illegal")
        player.asked_anew(player.page.locator('#ask [data-answer="fix"]').click)
        player.turn(4)
        player.click("c7", "d8")
        player.picture("page-promotion")
        player.page.get_by_role("button", name="queen", exact=True).click()
        player.turn(6)
        # in the middle of the game the page is left and visited again: the controls are still ours
        player.page.reload()
        player.turn(6)
        player.click("e1", "g1")
        player.turn(8)
        player.page.locator("#tab-camera").click()
        player.picture("page-camera")
        player.says("hand knock b5")  # it stands alone: how it falls does not matter
        player.page.locator('#ask [data-answer="fix"]').click(timeout=1000.0 * PATIENCE)
        player.turn(8)
        player.page.get_by_role("button", name="Take back", exact=True).click()
        player.turn(6)
        player.says("resign")
        leave = player.page.locator('#ask [data-answer="quit"]')
        expect(leave).to_be_visible(timeout=1000.0 * PATIENCE)
        player.picture("page-over")
        assert player.wrong == []  # what cannot be had once the program has ended is nobody's fault
        leave.click()
        assert process.wait(PATIENCE) == 0, (tmp_path / "said").read_text()[-2000:]
        player.close()
    expected = "h3 d5 exd6 h6 cxd8=Q+ Kxd8"
    assert moves_of(tmp_path) == expected
    report = json.loads((tmp_path / "game" / "report.json").read_text())
    assert report["physical_ok"] is True
    assert {"illegal", "fallen"} <= {trouble["kind"] for trouble in report["troubles"]}
    assert all(trouble["mended_by"] in ("arm", None) for trouble in report["troubles"])
    assert (report["result"], report["exit_reason"]) == ("0-1", "White resigns")


def test_nobody_loses_a_game_by_a_browser_or_a_page_that_goes(tmp_path: Path, browser: Browser) -> None:
    """Two browsers; the page's process is killed; the one that has the controls closes while it is asked something."""
    with playing(tmp_path, "--rig", "board", "--nodes", "200") as (process, address):
        player, watcher = Player(browser, address), Player(browser, address)
        player.turn(0)
        player.click("e2", "e4")
        player.turn(2)
        expect(watcher.page.locator("#moves button.move")).to_have_count(2)
        (page,) = [pid for pid in children(process.pid) if "app.page.process" in command_of(pid)]
        os.kill(page, signal.SIGKILL)
        for one in (player, watcher):
            one.until("sockets.length > 1")  # till then it shows what it was shown before
        player.turn(2)  # both come back by themselves
        assert [pid for pid in children(process.pid) if pid != page and "app.page.process" in command_of(pid)]
        expect(watcher.page.locator("#ask .ask-title")).to_have_text("White to move")
        player.says("pause")
        expect(player.page.locator('#ask [data-answer="go"]')).to_be_visible()
        player.close()
        button = watcher.page.locator('#ask [data-answer="go"]')
        take = watcher.page.locator("#banners").get_by_role("button", name="Take the controls")
        take.click(timeout=1000.0 * PATIENCE)  # they were kept for a while for the one who has gone
        button.click()
        watcher.turn(2)
        watcher.drag("d2", "d4")
        watcher.turn(4)
        watcher.says("quit")
        assert process.wait(PATIENCE) == 0
        watcher.close()
    assert moves_of(tmp_path).split()[::2] == ["e4", "d4"]


def test_what_was_decided_is_kept_before_anything_else_is_asked(tmp_path: Path) -> None:
    """Whoever plays resigns, and the program is killed while it asks whether there is to be another game."""
    with (
        playing(tmp_path, "--rig", "board", "--nodes", "200") as (process, address),
        PageBrowser(urlsplit(address).port or 0, TOKEN) as player,
    ):
        player.until(lambda: (player.state["prompt"] or {}).get("turn"))
        player.send({"type": "line", "text": "resign"})
        player.until(lambda: "another game?" in (player.state["prompt"] or {}).get("text", ""))
        process.kill()
        process.wait(PATIENCE)
    last = json.loads((tmp_path / "game" / "events.jsonl").read_text().splitlines()[-1])
    assert (last["event"], last["result"], last["reason"]) == ("end", "0-1", "White resigns")
    assert '[Result "0-1"]' in (tmp_path / "game" / "game.pgn").read_text()


def children(pid: int) -> list[int]:
    found = list[int]()
    for task in Path(f"/proc/{pid}/task").iterdir():
        with suppress(OSError):  # a thread that has just ended
            found += map(int, (task / "children").read_text().split())
    return found


def command_of(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""
