"""Settings in files: a person's TOML, and what a game was played with, beside its record."""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
import textwrap
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from pydantic import BaseModel, ValidationError

from app import UserError
from app.records.files import is_object, write_atomically
from app.settings.defaults import Settings
from app.settings.options import option_of
from app.settings.toml import ConfigError, load_toml, toml_value
from hardware.demands import demand

SETTINGS_FILE: Final = "settings.json"
"""In the folder of a match: what it was started with."""


def settings_of(changes: Mapping[str, Any], file: Path | None = None) -> Settings:
    """The settings with what a file and the command line say; the latter counts for more.

    Args:
        changes: by dotted name such as ``rig.pace``; None changes nothing.
        file: TOML; None: none.

    Raises:
        ConfigError: the file cannot be read, a field does not exist, or a value is impossible.
    """
    base = Settings() if file is None else load_settings(file)
    for side in ("white", "black"):
        if changes.get(f"{side}.elo") is not None:  # in place of the other way to say how strong it is
            base = base.model_copy(update={side: getattr(base, side).model_copy(update={"skill": None})})
    try:
        return base.with_changes(changes)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        named = option_of(".".join(str(part) for part in first["loc"]))
        value = "" if isinstance(first["input"], Mapping) else f" is '{first['input']}'"
        raise ConfigError(f"{named}{value}: {demand(first)}") from error


def load_settings(path: Path) -> Settings:
    """Read a person's TOML.

    Raises:
        ConfigError: it cannot be read, or something in it is wrong.
    """
    return load_toml(path, Settings, "settings", "'touchmove config' prints one to begin with")


def as_toml(settings: Settings) -> str:
    """The tree as a TOML file: every field with what it means; one without a value is a comment."""
    lines = ["# Settings of Touchmove, as 'touchmove config' prints them.", *_fields(settings)]
    for name, section in settings:
        if isinstance(section, BaseModel):
            doc = inspect.cleandoc(type(section).__doc__ or "").split(":", 1)[-1].strip().rstrip(".")
            lines += ["", f"[{name}]  # {doc}", *_fields(section)]
    return "\n".join(lines) + "\n"


@functools.cache
def meanings_of(section: type[BaseModel]) -> Mapping[str, str]:
    """What each field means, by name: what stands below it in the source. Read for those alone who ask for it."""
    meanings: dict[str, str] = {}
    for one in reversed([base for base in section.__mro__ if base is not BaseModel and issubclass(base, BaseModel)]):
        body = ast.parse(textwrap.dedent(inspect.getsource(one))).body[0]
        assert isinstance(body, ast.ClassDef)
        for field, after in itertools.pairwise(body.body):
            if (
                isinstance(field, ast.AnnAssign)
                and isinstance(after, ast.Expr)
                and isinstance(after.value, ast.Constant)
            ):
                meanings[ast.unparse(field.target)] = " ".join(str(after.value.value).split())
    return MappingProxyType(meanings)


def _fields(section: BaseModel) -> list[str]:
    lines, meanings = [], meanings_of(type(section))
    for name in type(section).model_fields:
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            continue
        lines += [f"# {line}" for line in textwrap.wrap(meanings.get(name, ""), 110)]
        lines.append(f"# {name} =" if value is None else f"{name} = {toml_value(value)}")
    return lines


def keep_settings(folder: Path, settings: Settings) -> None:
    """Write what a match is played with into its folder.

    Raises:
        RecordError: it cannot be written.
    """
    write_atomically(folder / SETTINGS_FILE, settings.model_dump_json(indent=2) + "\n")


def kept_settings(folder: Path) -> Settings:
    """What a match was started with.

    Raises:
        UserError: there is no such folder, the file is damaged, or another version wrote it.
    """
    path = folder / SETTINGS_FILE
    try:
        content = path.read_bytes()
        return Settings.model_validate_json(content)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}): name the folder of a game") from error
    except ValidationError as error:
        if not is_object(content):
            raise UserError(
                f"{path} is damaged: bring it back from a copy, or take that of another game which was started with "
                "the same options"
            ) from error
        raise UserError(f"{path} is of another version: continue with the version that wrote it") from error
