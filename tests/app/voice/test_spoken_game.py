"""A game in which nothing is typed."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

from app.voice.phrases import ADDRESS
from tests.app.voice.spoken import microphone, speech
from tests.controllers import TOUCHMOVE
from tests.waiting import PATIENCE


def test_a_game_is_played_and_ended_by_voice(tmp_path: Path) -> None:
    said = [f"{ADDRESS} echo two to echo four", "yes", f"{ADDRESS} I resign", "no", f"{ADDRESS} I resign", "yes"]
    program = microphone(tmp_path / "bin", *map(speech, said))
    game = tmp_path / "game"
    with subprocess.Popen(
        [*TOUCHMOVE, "play", "--rig", "board", "--nodes", "500", "--no-page", "--microphone", "--out", str(game)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env={**os.environ, "PATH": f"{Path(program).parent}:{os.environ['PATH']}"},
    ) as process:  # fmt: skip
        assert process.wait(PATIENCE) == 0
        assert process.stdout is not None
        shown = process.stdout.read()
    report = json.loads((game / "report.json").read_text())
    assert (report["result"], report["plies"], report["exit_reason"]) == ("0-1", 2, "White resigns")
    for sentence in ("I heard 'e4': yes or no?", "I heard 'resign': yes or no?", "then say it again, or type it"):
        assert sentence in shown
    assert "1. e4  (you played)" in shown
