"""The page's own scripts and pages: whole, and without what the Content-Security-Policy forbids."""

from __future__ import annotations

import re
from pathlib import Path

STATIC = Path(__file__).resolve().parents[3] / "app" / "page" / "static"
SCRIPTS = [path for path in sorted(STATIC.rglob("*.js")) if "vendor" not in path.parts]
SOURCES = [path for path in sorted(STATIC.rglob("*.*")) if "vendor" not in path.parts]


def test_every_module_that_is_imported_is_there() -> None:
    for path in SCRIPTS:
        for name in re.findall(r"""(?:from|import\()\s*['"](\.[^'"]+)['"]""", path.read_text(encoding="utf-8")):
            assert (path.parent / name).resolve().is_file(), f"{path.relative_to(STATIC)} imports {name}"


def test_no_source_is_a_merge_that_was_not_finished() -> None:
    for path in SOURCES:
        assert not re.search(r"^(<<<<<<<|>>>>>>>) ", path.read_text(encoding="utf-8"), re.MULTILINE), path.name


def test_pages_hold_no_script_style_or_address_of_another_host() -> None:
    for page in STATIC.glob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"<style|\sstyle=|\son[a-z]+=", text), page.name
        assert not re.search(r"<script(?![^>]*\ssrc=)", text), page.name
        assert not re.search(r"""(?:src|href)=["'](?:https?:)?//""", text), page.name
    for path in SOURCES:
        addresses = set(re.findall(r"https?://[^\s'\"`)]+", path.read_text(encoding="utf-8")))
        assert addresses <= {"http://www.w3.org/2000/svg"}, path.name
