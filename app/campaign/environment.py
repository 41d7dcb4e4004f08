"""What a game's result depends on besides its task: sources, packages, engine, files; computed where it is played."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import socket
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Final

import app
from app import UserError
from app.campaign.workers.threads import SUMS
from engine.errors import EngineMissing, Misbehaved
from engine.process import UciProcess
from engine.stockfish import find_engine
from hardware.frozen import Frozen

ROOMS: Final = ("app", "controller", "engine", "hardware", "vision")
DISTRIBUTION: Final = "touchmove"
ENGINE_DEADLINE: Final = 20.0
"""For an engine to say its name [s, wall]."""
SHOWN: Final = 12
"""Digits of digests in sentences."""
_DIGESTS: Final = ("sources", "files")
"""All else is said whole: versions may differ in their last digit."""


class CampaignEnvironment(Frozen):
    """What has to be the same for a seed to come to the same."""

    sources: str
    """SHA-256 of all modules and data of the product."""
    python: str
    packages: dict[str, str]
    """Versions of what the product is built on."""
    engine: str
    """As it calls itself, of several each; empty where none plays."""
    files: dict[str, str]
    """SHA-256 of files that the campaign names, by path; of a folder that of its files' names and sizes."""
    threads: dict[str, str]
    """Of ``SUMS``."""

    @property
    def digest(self) -> str:
        """Of all of it."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:SHOWN]

    def differences(self, other: CampaignEnvironment) -> tuple[str, ...]:
        """What another one has otherwise; a phrase each."""
        mine, theirs = dict(_items(self)), dict(_items(other))
        return tuple(
            f"{name} is {theirs.get(name, 'missing')} instead of {mine.get(name, 'missing')}"
            for name in sorted({*mine, *theirs})
            if mine.get(name) != theirs.get(name)
        )


def _items(environment: CampaignEnvironment) -> Iterator[tuple[str, str]]:
    for name, value in environment:
        length = SHOWN if name in _DIGESTS else None
        if isinstance(value, dict):
            yield from ((f"{name}.{inner}", str(text)[:length]) for inner, text in value.items())
        else:
            yield name, str(value)[:length]


def environment_here(engines: tuple[str, ...], files: tuple[str, ...]) -> CampaignEnvironment:
    """That of this process: sources and packages as it has begun with them, engines and files as they are now.

    Args:
        engines: paths of those that play, an empty one for the usual one.
        files: that the campaign names, and folders.

    Raises:
        UserError: there is no such engine here, it does not answer, or one of the files cannot be read.
    """
    return CampaignEnvironment(
        sources=_sources(), python=platform.python_version(), packages=_packages(),
        engine=", ".join(map(_engine_name, engines)),
        files={name: _digest(Path(name)) for name in files},
        threads={name: os.environ.get(name, "not set") for name in SUMS},
    )  # fmt: skip


@cache
def host_and_cpu() -> tuple[str, str]:
    """Name of this machine, and what its processor is called."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        found = re.search(r"^model name\s*:\s*(.+)$", info.read_text(encoding="utf-8"), re.MULTILINE)
        cpu = found[1].strip() if found else cpu
    return socket.gethostname(), cpu


@cache
def _sources() -> str:
    """What is read when the program runs; not what Python makes of it."""
    root, digest = Path(app.__file__).parents[1], hashlib.sha256()
    for room in ROOMS:
        for path in sorted((root / room).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(f"{path.relative_to(root)}\0{path.stat().st_size}\0".encode() + path.read_bytes())
    return digest.hexdigest()


@cache
def _packages() -> dict[str, str]:
    try:
        wanted = [text for text in requires(DISTRIBUTION) or () if "extra ==" not in text]
    except PackageNotFoundError:
        return {}
    names = [found[0] for text in wanted if (found := re.match(r"[A-Za-z0-9._-]+", text))]
    return {name: version(name) for name in sorted(names)}


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    try:
        if not path.is_dir():
            return hashlib.sha256(path.read_bytes()).hexdigest()
        for inner in sorted(path.rglob("*")):  # endgame tables take many GB: who has them all has the same
            if inner.is_file():
                digest.update(f"{inner.relative_to(path)}\0{inner.stat().st_size}\0".encode())
    except OSError as error:
        raise UserError(
            f"{path}, which the campaign names, cannot be read on {socket.gethostname()} ({error.strerror}): "
            "put it there, and the same command goes on"
        ) from error
    return digest.hexdigest()


def _engine_name(path: str) -> str:
    try:
        process = UciProcess(find_engine(path or None), ENGINE_DEADLINE)
        try:
            return str(process.uci.id.get("name", "unnamed"))
        finally:
            process.kill()
    except (EngineMissing, Misbehaved, OSError) as error:
        why = "it is not there" if isinstance(error, EngineMissing) else str(error)
        raise UserError(
            f"engine {path or 'Stockfish'} cannot play on {socket.gethostname()} ({why}): install it there, or name "
            "another one by engine.path"
        ) from error
