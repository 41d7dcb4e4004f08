"""Games that are killed at random moments and resumed, by the same bench that counts a hundred such kills."""

from __future__ import annotations

import json
import signal

import pytest

from app.measure.bench.kills import measure_kills
from app.settings.files import keep_settings, kept_settings
from tests.conftest import Run


@pytest.mark.slow
def test_program_controller_and_all_at_once_are_killed_in_mid_move_and_the_game_goes_on() -> None:
    said: list[str] = []
    report = measure_kills(1, "fast", said.append)
    assert {name for name, row in report.rows.items() if not row.holds} == set()
    assert report.rows["app_rest"].n == report.rows["controller_rest"].n == report.rows["jump"].n == 1
    assert len(said) == 3, "and all at once"


@pytest.mark.slow
def test_an_interrupted_game_is_resumed_from_the_worlds_last_state(demo) -> None:
    line = "e4 d5 exd5 Qxd5 Nc3 Qa5"
    run = demo("--no-cameras", "--moves", line)  # in pace fast it may be over before anybody interrupts it
    events = run.folder / "events.jsonl"
    run.until(lambda: events.exists() and '"carry"' in events.read_text(), "a carry")
    run.signal(signal.SIGINT)
    assert run.wait()[0] == 130
    assert not run.helpers()
    assert run.world_end()["at_rest"]
    keep_settings(run.folder, kept_settings(run.folder).with_changes({"rig.pace": "fast"}))
    again = Run(["resume", str(run.folder), "--headless", "--json"], run.folder)
    status, out, err = again.wait()
    assert status == 0, err
    report = json.loads(out)
    assert report["plies"] == len(line.split())
    assert report["physical_ok"] is True
    assert not again.helpers()
    # a game that is over stays over
    status, _, err = Run(["resume", str(run.folder), "--headless"], run.folder).wait()
    assert status == 2
    assert err.strip().endswith("is over after 6 plies: start a new one")
