"""The page's libraries are what their list says, and nothing else is there."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
VENDOR = ROOT / "app" / "page" / "static" / "vendor"
LIST = VENDOR / "vendor.json"
PACKAGES: list[dict[str, Any]] = json.loads(LIST.read_text(encoding="utf-8"))["packages"]
LICENCES = {"GPL-3.0-or-later", "GPL-2.0-or-later", "MIT"}
"""With which the program may be given on under its own."""


def listed() -> Iterator[tuple[Path, dict[str, Any]]]:
    for one in PACKAGES:
        for path, entry in one["files"].items():
            yield VENDOR / one["folder"] / Path(path).name, entry


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_every_file_is_as_its_list_says_and_no_other_is_there() -> None:
    for path, entry in listed():
        assert hashlib.sha256(path.read_bytes()).hexdigest() == entry["sha256"], f"{path.name}: run make vendor"
    assert {path for path, _ in listed()} | {LIST} == {path for path in VENDOR.rglob("*") if path.is_file()}


def test_every_library_has_a_version_and_a_licence_that_lies_beside_it() -> None:
    for one in PACKAGES:
        assert re.fullmatch(r"\d+\.\d+\.\d+", one["version"]), one["package"]
        assert one["licence"] in LICENCES, one["package"]
        assert any(Path(path).stem == "LICENSE" for path in one["files"]), one["package"]
        assert all(entry.get("licence", one["licence"]) in LICENCES for entry in one["files"].values())


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A checkout of which the libraries can be fetched without harm."""
    shutil.copytree(VENDOR, tmp_path / "app" / "page" / "static" / "vendor")
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "vendor.py", tmp_path / ".ci")
    return tmp_path


def fetch(checkout: Path, npm: Path | None = None) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": "/usr/bin:/bin"} if npm is None else {"PATH": f"{npm}:/usr/bin:/bin"}
    command = [sys.executable, str(checkout / ".ci" / "vendor.py")]
    return subprocess.run(command, env=environment, check=False, capture_output=True, text=True, timeout=300)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("npm") is None, reason="npm is not here: what it would deliver cannot be compared")
def test_npm_delivers_the_same_files(copy: Path) -> None:
    folder = copy / "app" / "page" / "static" / "vendor"
    for path in folder.rglob("*.js"):
        path.unlink()
    (folder / "left-over.js").write_text("")
    npm = shutil.which("npm")
    assert npm is not None
    done = fetch(copy, Path(npm).parent)
    if done.returncode and "did not deliver" in done.stderr:
        pytest.skip(f"no package registry can be reached: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    assert contents(folder) == contents(VENDOR)


def archive_of(copy: Path, content: str) -> Path:
    """An npm that delivers every package with one file ``dist/chessground.min.js``; the folder of its command."""
    folder = copy / "npm"
    (folder / "package" / "dist").mkdir(parents=True)
    (folder / "package" / "dist" / "chessground.min.js").write_text(content)
    subprocess.run(["tar", "-czf", str(folder / "one.tgz"), "-C", str(folder), "package"], check=True)
    script = (
        f'#!/bin/sh\nwhile [ "$1" != --pack-destination ]; do shift; done\ncp {folder}/one.tgz "$2"\necho one.tgz\n'
    )
    (folder / "npm").write_text(script)
    (folder / "npm").chmod(0o755)
    return folder


def only(copy: Path, entry: dict[str, Any]) -> Path:
    """The list names one file alone."""
    path = copy / "app" / "page" / "static" / "vendor" / "vendor.json"
    package = {**PACKAGES[0], "files": {"dist/chessground.min.js": entry}}
    path.write_text(json.dumps({"packages": [package]}))
    return path


def test_a_file_that_came_otherwise_is_refused(copy: Path) -> None:
    only(copy, {"sha256": "0" * 64})
    done = fetch(copy, archive_of(copy, "something else"))
    assert done.returncode == 1
    found = hashlib.sha256(b"something else").hexdigest()
    assert done.stderr == (
        f"touchmove: dist/chessground.min.js is not what it was (SHA-256 {found}): empty its hash in vendor.json to "
        "take it\n"
    )


def test_a_new_file_is_taken_replaced_in_and_written_down(copy: Path) -> None:
    path = only(copy, {"sha256": "", "replace": [["from 'three'", "from './three.js'"]]})
    done = fetch(copy, archive_of(copy, "import {A} from 'three';"))
    assert done.returncode == 0, done.stderr
    wanted = b"import {A} from './three.js';"
    assert (path.parent / "chessground" / "chessground.min.js").read_bytes() == wanted
    (entry,) = json.loads(path.read_text())["packages"][0]["files"].values()
    assert entry["sha256"] == hashlib.sha256(wanted).hexdigest()
    assert not (path.parent / "chessground" / "LICENSE").exists(), "what no list names is removed"


def test_what_is_missing_is_named(copy: Path) -> None:
    only(copy, {"sha256": "", "replace": [["absent", ""]]})
    done = fetch(copy, archive_of(copy, "text"))
    assert "dist/chessground.min.js does not hold 'absent'" in done.stderr
    only(copy, {"sha256": ""}).write_text(
        json.dumps({"packages": [{**PACKAGES[0], "files": {"no.js": {"sha256": ""}}}]})
    )
    assert "the package has no file no.js: correct vendor.json" in fetch(copy, copy / "npm").stderr
    if shutil.which("npm", path="/usr/bin:/bin") is None:
        assert "npm was not found" in fetch(copy).stderr
