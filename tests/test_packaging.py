"""Set-up, pins, the wheel and the pages: what somebody meets who has only just cloned the repository."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import pytest
import typer.main
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from app.cli.commands import app as command_line

ROOT = Path(__file__).resolve().parents[1]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
ROOMS = {"app", "controller", "engine", "hardware", "vision"}
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]


# -------------------------------------------------------------------------------------------------------------- pins


def pins() -> dict[str, Version]:
    """Pinned versions by canonical name."""
    first, *lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert first.startswith("# Made by ")
    found = {}
    for line in lines:
        match = re.fullmatch(r"([\w.-]+)==([\w.]+)", line)
        assert match, f"{line!r} pins nothing exactly"
        name = canonicalize_name(match.group(1))
        assert name not in found, f"{name} is pinned twice"
        found[name] = Version(match.group(2))
    return found


def declared() -> list[Requirement]:
    extras = PROJECT["project"]["optional-dependencies"]
    lines = PROJECT["project"]["dependencies"] + extras["dev"] + PROJECT["build-system"]["requires"]
    return [Requirement(line) for line in lines]


def needed() -> Iterator[Requirement]:
    """What we declare, and what that needs in its turn, as installed here."""
    todo, seen = declared(), set()
    while todo:
        requirement = todo.pop()
        name = canonicalize_name(requirement.name)
        yield requirement
        for extra in ("", *sorted(requirement.extras)):
            if (name, extra) not in seen:
                seen.add((name, extra))
                lines = [Requirement(line) for line in importlib.metadata.requires(name) or ()]
                todo += [one for one in lines if one.marker is None or one.marker.evaluate({"extra": extra})]


def test_every_package_is_pinned_within_its_range() -> None:
    pinned = pins()
    for requirement in needed():
        name = canonicalize_name(requirement.name)
        assert name in pinned, f"{name} is not pinned: run make constraints"
        assert requirement.specifier.contains(pinned[name]), f"{name}=={pinned[name]} is not {requirement}"


def test_only_what_is_needed_is_pinned() -> None:
    assert set(pins()) == {canonicalize_name(requirement.name) for requirement in needed()}


def test_these_tests_run_with_the_pinned_versions() -> None:
    for name, version in pins().items():
        assert Version(importlib.metadata.version(name)) == version, f"{name}: run make test, which installs the pins"


# -------------------------------------------------------------------------------------------------------------- wheel


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    folder = tmp_path_factory.mktemp("wheel")
    skip = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in (*ROOMS, "tests"):
        shutil.copytree(ROOT / name, folder / name, ignore=skip)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    build += ["--wheel-dir", "out", "."]
    subprocess.run(build, cwd=folder, check=True, capture_output=True, text=True)
    (made,) = (folder / "out").glob("*.whl")
    return zipfile.ZipFile(made)


def test_the_wheel_holds_the_rooms_and_all_their_files_and_no_tests(wheel: zipfile.ZipFile) -> None:
    files = {name for name in wheel.namelist() if not name.split("/")[0].endswith(".dist-info")}
    assert {name.split("/")[0] for name in files} == ROOMS
    ours = {
        str(path.relative_to(ROOT))
        for room in ROOMS
        for path in (ROOT / room).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert files == ours


def test_the_wheel_says_what_it_is(wheel: zipfile.ZipFile) -> None:
    def read(name: str) -> str:
        (full,) = [path for path in wheel.namelist() if path.endswith(f".dist-info/{name}")]
        return wheel.read(full).decode()

    assert re.search(r"^touchmove *= *app\.cli:main$", read("entry_points.txt"), re.MULTILINE)
    metadata = read("METADATA")
    assert "\nName: touchmove\n" in metadata
    assert "\nLicense-Expression: GPL-3.0-or-later\n" in metadata
    assert "GNU GENERAL PUBLIC LICENSE" in read("licenses/LICENSE")


# ------------------------------------------------------------------------------------------------------------- set-up


class FakeDebian:
    """A checkout with ``.ci/setup`` on a machine of which every command is a script that notes how it was called."""

    def __init__(self, folder: Path) -> None:
        self.checkout = folder / "checkout"
        (self.checkout / ".ci").mkdir(parents=True)
        for name in ("pyproject.toml", "constraints.txt", ".ci/setup", ".ci/run"):
            shutil.copy(ROOT / name, self.checkout / name)
        self.bin = folder / "bin"
        self.bin.mkdir()
        self.log = folder / "log"
        for name in ("bash", "cat", "cut", "dirname", "env", "grep", "rm", "sha256sum", "mkdir", "cp", "nice", "awk"):
            (self.bin / name).symlink_to(str(shutil.which(name)))
        self.command("dpkg-query", "echo installed")
        self.command("stockfish", "true")
        self.command("id", "echo 0")
        self.command("apt-get", "true")
        self.command("python3.11", 'if [ "$2" = venv ]; then mkdir -p .venv/bin; cp "$0" .venv/bin/python; '
                     'echo "command = $PWD/.venv" > .venv/pyvenv.cfg; fi')  # fmt: skip

    def command(self, name: str, body: str) -> None:
        """(Re)define a command; it notes its call first."""
        path = self.bin / name
        path.write_text(f'#!/bin/sh\necho "{name} $*" >> {self.log}\n{body}\n')
        path.chmod(0o755)

    def run(self, *arguments: str, script: str = ".ci/setup") -> tuple[int, str]:
        """Status and what was said; the log starts afresh."""
        self.log.write_text("")
        environment = {"PATH": str(self.bin), "HOME": str(self.checkout)}
        done = subprocess.run(
            ["bash", str(self.checkout / script), *arguments],
            env=environment, cwd="/", stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.stdout == ""
        return done.returncode, done.stderr

    def calls(self, start: str) -> list[str]:
        """Calls of a command in the last run."""
        return [line for line in self.log.read_text().splitlines() if line.startswith(start)]

    def installed(self) -> list[str]:
        """What pip was asked to install, the last word of each call; without the pins that come in halves before."""
        calls = self.calls("python3.11 -m pip --disable-pip-version-check install")
        return [line.split()[-1] for line in calls if "--no-deps" not in line]


@pytest.fixture
def debian(tmp_path: Path) -> FakeDebian:
    return FakeDebian(tmp_path)


def lacking(debian: FakeDebian, *packages: str) -> None:
    cases = "|".join(packages)
    debian.command("dpkg-query", f'case "$3" in {cases}) exit 1;; *) echo installed;; esac')


def test_setting_up_installs_the_pins_without_the_tools_and_only_once(debian: FakeDebian) -> None:
    status, said = debian.run("demo")
    assert status == 0
    assert said == "touchmove: installing Python packages into .venv (the first time this downloads a few hundred MB)\n"
    assert debian.installed() == ["setuptools", "."]
    assert all("--constraint constraints.txt" in call for call in debian.calls("python3.11 -m pip --dis"))
    assert not debian.calls("apt-get")
    assert debian.run("demo") == (0, "")
    assert debian.log.read_text() == "", "a second run asks nobody anything"


def test_the_tools_come_on_top_and_are_enough_for_the_demo(debian: FakeDebian) -> None:
    debian.run("demo")
    assert debian.run("dev")[0] == 0
    assert debian.installed() == ["setuptools", ".[dev]"]
    assert len(debian.calls("python3.11 -m pip --disable-pip-version-check install")) == 2 + 2, "pins come in halves"
    assert not debian.calls("python3.11 -m venv"), "the environment is kept"
    assert debian.run("demo") == (0, "")


@pytest.mark.parametrize("name", ["constraints.txt", "pyproject.toml", ".ci/setup"])
def test_a_change_of_what_is_to_be_installed_installs_again(debian: FakeDebian, name: str) -> None:
    debian.run("demo")
    with (debian.checkout / name).open("a") as file:
        file.write("# changed\n")
    assert debian.run("demo")[0] == 0
    assert debian.installed() == ["setuptools", "."]


def test_a_moved_checkout_gets_a_new_environment(debian: FakeDebian) -> None:
    debian.run("demo")
    debian.checkout = debian.checkout.rename(debian.checkout.with_name("elsewhere"))
    assert debian.run("demo")[0] == 0
    assert len(debian.calls("python3.11 -m venv")) == 1


def test_a_broken_environment_is_made_anew(debian: FakeDebian) -> None:
    debian.run("demo")
    (debian.checkout / ".venv/bin/python").unlink()
    assert debian.run("demo")[0] == 0
    assert len(debian.calls("python3.11 -m venv")) == 1


def test_root_installs_what_debian_lacks(debian: FakeDebian) -> None:
    lacking(debian, "libegl1", "libusb-1.0-0")
    status, said = debian.run("demo")
    assert status == 0
    assert "touchmove: installing from Debian: libegl1 libusb-1.0-0\n" in said
    update, install = debian.calls("apt-get")
    assert update.startswith("apt-get update")
    assert install == "apt-get install -y -qq --no-install-recommends libegl1 libusb-1.0-0"
    assert not debian.calls("sudo")


def test_only_tests_need_a_browser(debian: FakeDebian) -> None:
    lacking(debian, "chromium-headless-shell")
    assert debian.run("demo")[0] == 0
    assert not debian.calls("apt-get")
    assert debian.run("dev")[0] == 0
    assert debian.calls("apt-get")[-1] == "apt-get install -y -qq --no-install-recommends chromium-headless-shell"


def test_a_user_with_sudo_installs_by_it(debian: FakeDebian) -> None:
    lacking(debian, "libgl1-mesa-dri")
    debian.command("id", "echo 1000")
    debian.command("sudo", 'shift; exec "$@"')
    (debian.bin / "true").symlink_to("/bin/true")
    assert debian.run("demo")[0] == 0
    assert debian.calls("apt-get")[-1].endswith("--no-install-recommends libgl1-mesa-dri")
    assert all(call.startswith("sudo -n ") for call in debian.calls("sudo"))


def test_others_are_told_the_exact_command(debian: FakeDebian) -> None:
    lacking(debian, "libegl1", "libgl1-mesa-dri", "libusb-1.0-0")
    debian.command("id", "echo 1000")
    debian.command("sudo", "exit 1")
    status, said = debian.run("demo")
    assert status == 2
    assert said == (
        "touchmove: Debian packages are missing, and only root may install them. Run this, then start again:\n"
        "    sudo apt-get update && sudo apt-get install -y --no-install-recommends "
        "libegl1 libgl1-mesa-dri libusb-1.0-0\n"
    )
    assert not debian.calls("apt-get")
    assert not (debian.checkout / ".venv").exists()


def test_a_python_without_venv_and_a_missing_stockfish_are_noticed(debian: FakeDebian) -> None:
    debian.command("python3.11", 'case "$2" in *ensurepip*) exit 1;; esac')
    (debian.bin / "stockfish").unlink()
    debian.command("id", "echo 1000")
    debian.command("sudo", "exit 1")
    status, said = debian.run("demo")
    assert status == 2
    wanted = "python3-venv" if Path("/usr/games/stockfish").exists() else "stockfish python3-venv"
    assert said.endswith(f"--no-install-recommends {wanted}\n")


def test_a_failing_apt_is_named(debian: FakeDebian) -> None:
    lacking(debian, "libegl1")
    debian.command("apt-get", 'echo "E: no network" >&2; exit 100')
    status, said = debian.run("demo")
    assert status == 2
    assert "E: no network" in said
    assert said.endswith("touchmove: apt-get could not install libegl1: fix the error above, then start again\n")


def test_a_failing_pip_is_named_and_leaves_no_stamp(debian: FakeDebian) -> None:
    debian.run("demo")
    python = debian.checkout / ".venv/bin/python"
    python.write_text('#!/bin/sh\ncase "$*" in *install*) exit 1;; esac\n')
    (debian.checkout / "constraints.txt").write_text("")
    for _ in range(2):
        status, said = debian.run("demo")
        assert status == 2
        assert said.splitlines()[-1] == (
            "touchmove: pip could not install the Python packages: fix the error above, then start again"
        )


def test_an_old_python_is_refused(debian: FakeDebian) -> None:
    for name in ("python3.11", "python3"):
        debian.command(name, "exit 1")
    status, said = debian.run("demo")
    assert status == 2
    assert said.startswith(
        "touchmove: Python 3.11 or newer was not found: install it with 'sudo apt-get install python3'"
    )


def test_elsewhere_than_on_debian_the_user_is_told_what_must_be_there(debian: FakeDebian) -> None:
    (debian.bin / "dpkg-query").unlink()
    status, said = debian.run("demo")
    assert status == 0
    assert (
        "this is not Debian: Stockfish, EGL with a software driver (Mesa) and libusb 1.0 must already be installed"
        in said
    )


def test_a_wrong_word_is_usage(debian: FakeDebian) -> None:
    assert debian.run("all") == (2, "touchmove: usage: .ci/setup demo|dev\n")


@pytest.mark.parametrize(("fails", "status"), [("nothing", 0), ("ready", 2), ("check", 3), ("test", 2)])
def test_continuous_integration_checks_beside_the_tests(debian: FakeDebian, fails: str, status: int) -> None:
    """``make`` itself ends with 2 whatever failed; 3 shows whose status it is."""
    debian.command("make", f'case "$*" in *{fails}) exit {status};; esac')
    assert debian.run(script=".ci/run")[0] == status
    called = [call.split()[-1] for call in debian.calls("make")]
    assert called[0] == "ready"
    assert set(called[1:]) == (set() if fails == "ready" else {"check", "test"})


# -------------------------------------------------------------------------------------------------------------- pages


def links(page: Path) -> list[str]:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.findall(r"\]\(([^)\s#]+)[^)]*\)", text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for link in links(page):
        assert link.startswith("https://") or (page.parent / link).exists(), link


def test_the_first_page_is_short_and_has_a_picture() -> None:
    page = ROOT / "README.md"
    assert len(page.read_text(encoding="utf-8").splitlines()) < 150
    (picture,) = [ROOT / link for link in links(page) if link.endswith((".jpg", ".png"))]
    assert picture.stat().st_size < 200_000
    image = cv2.imread(str(picture))
    assert image is not None
    assert image.shape[1] >= 640


def demo_options() -> Mapping[str, Any]:
    """Options of ``touchmove demo`` as the command line has them: every name with its parameter."""
    command: Any = typer.main.get_command(command_line)
    demo = command.commands["demo"]
    return {name: parameter for parameter in demo.params for name in (*parameter.opts, *parameter.secondary_opts)}


def test_the_page_about_playing_lists_exactly_the_options_that_exist_with_their_defaults() -> None:
    page = (ROOT / "docs" / "playing.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`--.*?) \|(.*?)(?<!\\)\|", page, re.MULTILINE)
    listed = {name: default.strip() for names, default in rows for name in re.findall(r"--[\w-]+", names)}
    options = demo_options()
    assert set(listed) == set(options)
    defaults = {name: option.default for name, option in options.items() if not isinstance(option.default, bool)}
    for name, default in defaults.items():
        if default is not None:
            assert listed[name] == (default if isinstance(default, str) else f"{default:g}"), name
    assert len([default for default in defaults.values() if default is not None]) >= 6


def test_the_changelog_begins_with_this_version() -> None:
    """After what no version has yet."""
    headings = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    newest = next(heading for heading in headings if heading != "Unreleased")
    assert headings.index(newest) <= 1
    assert newest == PROJECT["project"]["version"] == importlib.metadata.version("touchmove")


def test_the_licence_is_the_gpl() -> None:
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert text.lstrip().startswith("GNU GENERAL PUBLIC LICENSE")
    assert "Version 3, 29 June 2007" in text


def test_scripts_can_be_run() -> None:
    assert all(os.access(ROOT / name, os.X_OK) for name in (".ci/run", ".ci/setup"))
