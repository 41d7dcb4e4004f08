"""Pictures of a recorded game, by a process that draws."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from app.rig.simulation.film import FilmFailed
from app.rig.simulation.pictures import PicturesWish, draw_pictures


@pytest.mark.parametrize("frames", [1, 50_000])
def test_a_process_that_cannot_draw_says_why_however_much_is_wanted(
    frames: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho 'ImportError: no EGL here' >&2\nexit 1\n", encoding="utf-8")
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr("sys.executable", str(python))
    wish = PicturesWish(
        positions=tmp_path / "positions.bin", ticks=tuple(range(frames)), views=("camera",), width=64, height=64
    )
    with pytest.raises(FilmFailed, match=r"^ImportError: no EGL here$"):
        next(draw_pictures(wish))
