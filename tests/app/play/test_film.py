"""The film of a game says when it begins."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.play.film import Film
from app.records.film import film_begins

TICK = 0.00088


class FewPictures:
    """A source of five pictures, 40 ms apart."""

    def __init__(self, first: int) -> None:
        self._ticks = [first + 45 * i for i in range(5)]
        self.over = threading.Event()

    def next(self) -> tuple[NDArray[np.uint8], int] | None:
        if not self._ticks:
            self.over.set()
            return None
        return np.full((48, 64, 3), 120, np.uint8), self._ticks.pop(0)

    def cancel(self) -> None:
        pass

    def close(self) -> None:
        pass


def test_a_film_says_at_which_plant_time_it_begins(tmp_path: Path) -> None:
    source = FewPictures(first=12345)
    film = Film(source, tmp_path / "game.webm", 40.0, TICK)
    assert source.over.wait(30.0)
    path = film.finish()
    assert path is not None
    assert film_begins(path) == pytest.approx(12345 * TICK, abs=1e-5)


def test_what_is_no_film_says_nothing(tmp_path: Path) -> None:
    (tmp_path / "game.webm").write_bytes(b"no film")
    assert film_begins(tmp_path / "game.webm") is None
    assert film_begins(tmp_path / "missing.webm") is None
