"""One browser for a module of tests, stages and visitors for a test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import chess
import pytest
from playwright.sync_api import Browser

from app.page.live import controls
from tests.app.page.browsers import Visit, Visitor, chromium
from tests.app.page.stage import Stage
from tests.waiting import PATIENCE

SetStage = Callable[..., Stage]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture
def set_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SetStage]:
    """Begins games, each with a page of its own; whoever loads it anew keeps the controls, however long that takes."""
    monkeypatch.setattr(controls, "GRACE", PATIENCE)
    with ExitStack() as stages:

        def begin(fen: str = chess.STARTING_FEN, *, stoppable: bool = True) -> Stage:
            folder = tmp_path / f"stage-{len(list(tmp_path.iterdir()))}"
            folder.mkdir()
            return stages.enter_context(Stage(folder, fen, stoppable=stoppable))

        yield begin


@pytest.fixture
def visit(browser: Browser) -> Iterator[Visit]:
    """Lets somebody visit a page; at the end nothing may have gone wrong in anybody's browser."""
    visitors = list[Visitor]()

    def come(stage: Stage, size: str = "desk", *, scripts: tuple[str, ...] = ()) -> Visitor:
        visitors.append(Visitor(browser, stage.address, size, scripts=scripts))
        return visitors[-1]

    yield come
    for visitor in visitors:
        visitor.close()
    assert [visitor.wrong for visitor in visitors] == [[] for _ in visitors]
