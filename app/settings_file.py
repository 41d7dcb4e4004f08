"""Settings in files: a person's TOML, and what a game was played with, beside its record."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from app import UserError
from app.config import ConfigError
from app.records.files import write_atomically
from app.settings import Settings

SETTINGS_FILE: Final = "settings.json"
"""In the folder of a match: what it was started with."""


def settings_of(changes: Mapping[str, Any]) -> Settings:
    """The settings with what the command line says.

    Args:
        changes: by dotted name such as ``rig.pace``; None changes nothing.

    Raises:
        ConfigError: a value is impossible.
    """
    try:
        return Settings().with_changes(changes)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        choices = str(first.get("ctx", {}).get("expected", "")).replace("'", "")
        wrong = f"choose {choices}" if choices else first["msg"].removeprefix("Value error, ")
        raise ConfigError(f"{_option(first['loc'])} is '{first['input']}': {wrong}") from error


def _option(where: tuple[int | str, ...]) -> str:
    """The option of the command line that sets a field; those of a side begin with its colour."""
    section, name = str(where[0]), str(where[-1]).replace("_", "-")
    return f"--{section}-{name}" if section in ("white", "black") else f"--{name}"


def keep_settings(folder: Path, settings: Settings) -> None:
    """Write what a match is played with into its folder.

    Raises:
        RecordError: it cannot be written.
    """
    write_atomically(folder / SETTINGS_FILE, settings.model_dump_json(indent=2) + "\n")


def kept_settings(folder: Path) -> Settings:
    """What a match was started with.

    Raises:
        UserError: there is no such folder, or another version wrote it.
    """
    path = folder / SETTINGS_FILE
    try:
        return Settings.model_validate_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}): name the folder of a game") from error
    except ValidationError as error:
        raise UserError(f"{path} is of another version: go on with the version that wrote it") from error
