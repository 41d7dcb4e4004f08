"""The page's process: how it begins, what it leaves alone, how it ends; and the controller behind it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.page.live.telemetry import WORDS, in_words, telemetry_shown
from app.page.news import EndNews, RoundNews, SessionNews
from app.page.process import NICE
from controller.protocol.causes import Cause
from controller.protocol.states import State
from tests.app.page.fake_controller import NOTHING, PERIOD, TICK, FakeController
from tests.app.page.recorded.recorded_games import RecordedGame
from tests.app.page.serving import TOKEN, Browser, PageProcess
from tests.controllers import free_port
from tests.waiting import PATIENCE, until


@pytest.fixture
def games(tmp_path: Path) -> Path:
    game = RecordedGame(tmp_path / "games" / "match")
    game.ply("e4")
    return tmp_path / "games"


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[FakeController]:
    with FakeController(tmp_path) as running:
        yield running


def session(games: Path, robot: FakeController | None = None) -> SessionNews:
    place = None if robot is None else (*robot.address[:2], str(robot.address[2]))
    return SessionNews(
        program="play", folder=str(games / "match"), rig="sim", pace="real", tick=TICK, controller=place
    )  # fmt: skip


def test_it_is_a_process_of_its_own_and_steps_back(games: Path) -> None:
    with PageProcess(games) as page:
        assert os.getsid(page.process.pid) == page.process.pid
        usual = os.getpriority(os.PRIO_PROCESS, 0)
        assert os.getpriority(os.PRIO_PROCESS, page.process.pid) == usual, "somebody waits for it"
        with Browser(page.port, "0" * 16):
            until(lambda: os.getpriority(os.PRIO_PROCESS, page.process.pid) == min(usual + NICE, 19))


def test_it_loads_nothing_heavy() -> None:
    code = "import sys, app.page.process; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True).stdout
    found = {"numba", "scipy", "cv2", "mujoco", "matplotlib", "ruckig", "av"} & set(loaded.split())
    assert not found


def test_it_ends_with_the_game_and_tells_the_browsers_first(games: Path) -> None:
    with PageProcess(games) as page:
        page.tell(session(games))
        with Browser(page.port, TOKEN) as browser:
            page.tell(EndNews(text="the game is over"))
            page.game.close()
            browser.until(lambda: browser.state["session"]["ended"] == "the game is over")
    assert page.process.returncode == 0
    assert page.said == ""


def test_it_ends_with_a_game_that_died_once_nothing_can_be_stopped(games: Path, robot: FakeController) -> None:
    with PageProcess(games, forbearing=True) as page:
        page.tell(session(games, robot))
        with Browser(page.port, TOKEN) as browser:
            browser.until(lambda: browser.controls["stoppable"])
            page.game.close()
            browser.until(lambda: browser.state["session"]["live"] is False)
            assert "touchmove resume" in browser.state["session"]["ended"]
            browser.send({"type": "stop"})
            until(lambda: robot.presses, "the arm is stopped without a game")
            assert page.process.poll() is None
            robot.state = State.OFF
            until(lambda: page.process.poll() == 0, "the page ends with the arm on its brakes")
    assert page.said == ""


def test_sigterm_ends_it_though_somebody_looks(games: Path) -> None:
    with PageProcess(games) as page, Browser(page.port, TOKEN):
        page.process.send_signal(signal.SIGTERM)
        assert page.process.wait(PATIENCE) in (0, -signal.SIGTERM)


def test_a_page_that_was_killed_comes_back_where_it_was_with_all_there_is(games: Path) -> None:
    with PageProcess(games, port=free_port()) as page:  # one that nobody gets while no page has it
        page.process.kill()
        page.process.wait()
        with PageProcess(games, port=page.port) as again:
            assert again.port == page.port
            again.tell(session(games))
            again.tell(RoundNews(folder=str(games / "match"), number=1, sets_up=False))
            with Browser(again.port, TOKEN) as browser:
                browser.until(lambda: browser.state["game"])
                assert [one["san"] for one in browser.state["game"]["moves"]] == ["e4"]


def test_a_game_of_another_version_ends_it_with_its_reason(games: Path) -> None:
    with PageProcess(games) as page:
        page.game.sendall(b'{"news":"never heard of"}\n')
        page.process.wait(PATIENCE)
    assert page.process.returncode == 1
    assert "never heard of" in page.said


def test_what_keeps_it_from_opening_is_one_sentence(games: Path) -> None:
    with PageProcess(games, host="0.0.0.0") as page:
        assert page.address == ""
    assert page.process.returncode == 2
    assert page.said.count("\n") == 1
    assert page.said.startswith("touchmove: a page that others reach at 0.0.0.0 needs a password")


# ----------------------------------------------------------------------------------------------------------- telemetry


def test_telemetry_comes_twenty_times_a_second_to_who_watches(games: Path, robot: FakeController) -> None:
    with PageProcess(games, forbearing=True) as page:
        page.tell(session(games, robot))
        with Browser(page.port, TOKEN) as browser:
            browser.until(lambda: browser.controls["stoppable"])
            assert not browser.read(0.3), "nobody watches"
            browser.send({"type": "watch", "telemetry": True})
            browser.until(lambda: len(browser.telemetry) >= 40)
            span = browser.telemetry[-1]["t"] - browser.telemetry[0]["t"]
            assert span > 39 * 0.9 * 0.05, "no more often than twenty times a second"
            newest = browser.telemetry[-1]
            assert newest["state"] == "track"
            assert newest["word"] == "moves"
            assert len({frame["t"] for frame in browser.telemetry}) == len(browser.telemetry)
            assert PERIOD < 0.05
            browser.send({"type": "watch", "telemetry": False})
            until(lambda: not browser.read(0.3), "it ends")


def test_stop_goes_straight_to_the_controller(games: Path, robot: FakeController) -> None:
    with PageProcess(games, forbearing=True) as page:
        page.tell(session(games, robot))
        with Browser(page.port, TOKEN) as holder, Browser(page.port, TOKEN[::-1]) as watcher:
            watcher.until(lambda: watcher.controls["stoppable"])
            robot.deaf = True  # before anybody is heard: a press that is late to arrive counts, too
            holder.send({"type": "stop"})
            holder.until(lambda: holder.refusals)
            assert holder.refusals[0].startswith("the arm may still move: ")
            robot.deaf = False
            watcher.send({"type": "watch", "telemetry": True})
            watcher.send({"type": "stop"})
            watcher.until(lambda: watcher.telemetry and watcher.telemetry[-1]["stopped"])
            assert watcher.telemetry[-1]["word"] == "stopped until somebody says 'go'"
            assert robot.presses >= 1, "it is pressed until the controller says so"
            assert not watcher.refusals


def test_a_controller_that_falls_silent_cannot_be_stopped_any_more(games: Path, tmp_path: Path) -> None:
    with PageProcess(games) as page:
        with FakeController(tmp_path) as robot:
            page.tell(session(games, robot))
            with Browser(page.port, TOKEN) as browser:
                browser.until(lambda: browser.controls["stoppable"])
        with Browser(page.port, TOKEN) as browser:
            browser.until(lambda: not browser.controls["stoppable"])


@pytest.mark.parametrize("state", State)
def test_every_state_has_words(state: State) -> None:
    assert WORDS[state]
    stopped = NOTHING._replace(state=state, cause=Cause.TOOL_SPEED, cause_value=2.0, cause_limit=1.0)
    assert in_words(stopped).startswith(f"{WORDS[state]}: the tool moved at 2.000 m/s")


def test_what_is_not_finite_is_null() -> None:
    shown = telemetry_shown(NOTHING._replace(force=(float("nan"), 1.0, float("inf")), lateness=float("nan")), TICK)
    assert (shown["force"], shown["late"]) == ([None, 1.0, None], None)
