"""axe finds nothing in any state of the page, light and dark, on a phone and on a desk; and all of it fits."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from tests.app.page.browsers import SIZES, Visit
from tests.app.page.conftest import SetStage
from tests.app.page.scenes import SCENES

OF_ALL = "{resultTypes: ['violations']}"
OF_COLOURS = "{resultTypes: ['violations'], preload: false, runOnly: ['color-contrast', 'link-in-text-block']}"
"""Of all that axe looks for, what another colour scheme can change: the document is the same one."""

pytestmark = pytest.mark.slow


def axe() -> str:
    """axe-core, as its Python package carries it."""
    found = importlib.util.find_spec("axe_playwright_python")
    assert found is not None
    assert found.submodule_search_locations
    (file,) = Path(found.submodule_search_locations[0]).rglob("axe.min.js")
    return file.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", SCENES)
def test_axe_finds_nothing(set_stage: SetStage, visit: Visit, name: str) -> None:
    scene, fen = SCENES[name]
    stage = set_stage(fen)
    visitor = visit(stage)
    scene(stage, visitor)
    page = visitor.page
    page.evaluate(f"{axe()}; 0")
    for size in ("desk", "phone"):
        width, height = SIZES[size]
        page.set_viewport_size({"width": width, "height": height})
        visitor.until("document.documentElement.scrollWidth <= innerWidth")  # the board follows a frame later
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            visitor.until("document.getAnimations().every((one) => one.playState !== 'running')")
            found = page.evaluate(f"axe.run({OF_ALL if scheme == 'light' else OF_COLOURS})")
            wrong = [
                f"{size}, {scheme}: {rule['id']}: {node['html'][:200]}: {node['failureSummary']}"
                for rule in found["violations"] for node in rule["nodes"]
            ]  # fmt: skip
            assert wrong == []
            looked = [rule["id"] for kind in ("passes", "incomplete", "inapplicable") for rule in found[kind]]
            assert "color-contrast" in looked
            assert len(looked) > (50 if scheme == "light" else 1)
