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
from app.campaign.workers.threads import SUMS
from engine.process import UciProcess
from engine.stockfish import find_engine
from hardware.frozen import Frozen

ROOMS: Final = ("app", "controller", "engine", "hardware", "vision")
DISTRIBUTION: Final = "touchmove"
ENGINE_DEADLINE: Final = 20.0
"""For an engine to say its name [s, wall]."""
SHOWN: Final = 12
"""Digits of digests in sentences."""


class CampaignEnvironment(Frozen):
    """What has to be the same for a seed to come to the same."""

    sources: str
    """SHA-256 of all modules and data of the product."""
    python: str
    packages: dict[str, str]
    """Versions of what the product is built on."""
    engine: str
    """As it calls itself; empty where none plays."""
    files: dict[str, str]
    """SHA-256 of files that the campaign names, by path."""
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
        if isinstance(value, dict):
            yield from ((f"{name}.{inner}", str(text)[:SHOWN]) for inner, text in value.items())
        else:
            yield name, str(value) if name == "engine" else str(value)[:SHOWN]


@cache
def environment_here(engine: str | None, files: tuple[str, ...]) -> CampaignEnvironment:
    """That of this process.

    Args:
        engine: path of the one that plays, empty for the usual one; None: none plays.
        files: that the campaign names.

    Raises:
        EngineProblem: there is no such engine, or it does not answer.
        OSError: one of the files cannot be read.
    """
    return CampaignEnvironment(
        sources=_sources(), python=platform.python_version(), packages=_packages(),
        engine="" if engine is None else _engine_name(engine or None),
        files={name: hashlib.sha256(Path(name).read_bytes()).hexdigest() for name in files},
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


def _sources() -> str:
    """What is read when the program runs; not what Python makes of it."""
    root, digest = Path(app.__file__).parents[1], hashlib.sha256()
    for room in ROOMS:
        for path in sorted((root / room).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(f"{path.relative_to(root)}\0{path.stat().st_size}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def _packages() -> dict[str, str]:
    try:
        wanted = [text for text in requires(DISTRIBUTION) or () if "extra ==" not in text]
    except PackageNotFoundError:
        return {}
    names = [found[0] for text in wanted if (found := re.match(r"[A-Za-z0-9._-]+", text))]
    return {name: version(name) for name in sorted(names)}


def _engine_name(path: str | None) -> str:
    process = UciProcess(find_engine(path), ENGINE_DEADLINE)
    try:
        return str(process.uci.id.get("name", "unnamed"))
    finally:
        process.kill()
