"""A game in which nothing is typed."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

from app.voice.phrases import ADDRESS
from tests.app.voice.spoken import open_microphone, speech
from tests.controllers import TOUCHMOVE
from tests.waiting import PATIENCE, until


def test_a_game_is_played_and_ended_by_voice(tmp_path: Path) -> None:
    pipe, game, shown = open_microphone(tmp_path / "bin"), tmp_path / "game", tmp_path / "shown"
    with (
        shown.open("wb") as out,
        subprocess.Popen(
            [*TOUCHMOVE, "play", "--rig", "board", "--nodes", "500", "--no-page", "--microphone", "--out", str(game)],
            stdin=subprocess.PIPE, stdout=out, stderr=out,
            env={**os.environ, "PATH": f"{pipe.parent}:{os.environ['PATH']}"},
        ) as process,
    ):  # fmt: skip

        def asked(before: str) -> bool:
            assert process.poll() is None, shown.read_text()
            return re.search(f"{before}.*your move", shown.read_text(), re.DOTALL) is not None

        # each move makes what was asked before it void, so nothing is said until it is their turn
        until(lambda: asked(""), "the first turn")
        with pipe.open("wb") as microphone:
            for words in (f"{ADDRESS} echo two to echo four", "yes"):
                microphone.write(speech(words).tobytes())
            microphone.flush()
            until(lambda: asked("I played"), "the second turn")
            for words in (f"{ADDRESS} I resign", "no", f"{ADDRESS} I resign", "yes"):
                microphone.write(speech(words).tobytes())
            microphone.flush()
            assert process.wait(PATIENCE) == 0
    report = json.loads((game / "report.json").read_text())
    assert (report["result"], report["plies"], report["exit_reason"]) == ("0-1", 2, "White resigns")
    for sentence in ("I heard 'e4': yes or no?", "I heard 'resign': yes or no?", "then say it again, or type it"):
        assert sentence in shown.read_text()
    assert "1. e4  (you played)" in shown.read_text()
