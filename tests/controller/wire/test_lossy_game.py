"""A game over a link that loses, repeats and reorders ends in the same world, to the last bit, as over a good one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.play.launch import run_games
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from controller.wire.client import ControllerClient
from hardware.interfaces import Pace

LINE = "e4 d5"


def play(folder: Path) -> dict[str, Any]:
    """The line, as ``touchmove demo`` plays it; its report."""
    settings = settings_of(
        {
            "rig.pace": Pace.FAST, "rig.seed": 3, "rig.video": False, "rig.cameras": False, "rig.linger": 5.0,
            "game.plies": 2, "game.moves": LINE, "out": folder,
        }
    )  # fmt: skip
    done = run_games(settings, UserInterface())
    assert done.holds, done.report.failures
    return done.report.model_dump()


@pytest.mark.slow
def test_a_line_over_a_bad_link_moves_every_piece_in_the_same_way(
    tmp_path: Path, lossy_link: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    good = play(tmp_path / "good")
    links = []

    def through_a_bad_link(host: str, port: int, key: bytes, **options: Any) -> ControllerClient:
        links.append(lossy_link(port, loss=0.3, repeats=0.1, delay=0.02))
        return ControllerClient(host, links[-1].port, key, **options)

    monkeypatch.setattr("app.rig.remote.ControllerClient", through_a_bad_link)
    bad = play(tmp_path / "bad")
    assert len(links) == 1
    assert len(links[0].seen) > 300
    assert bad["world_state"] == good["world_state"]
    assert bad["sim_s"] == good["sim_s"]
    assert bad["kinds"] == good["kinds"]
