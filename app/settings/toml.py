"""TOML files that a person writes: read strictly, every mistake named in one sentence."""

from __future__ import annotations

import difflib
import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from app import UserError
from hardware.camera.settings import LabCamera
from hardware.demands import demand

_M = TypeVar("_M", bound=BaseModel)


class ConfigError(UserError):
    """A file that a person wrote cannot be used; the sentence names file, field and remedy."""


def load_toml(path: Path, model: type[_M], what: str, instead: str) -> _M:
    """Read a TOML file strictly.

    Args:
        path: of the file.
        model: what it holds.
        what: the same for people.
        instead: what to do where it cannot be read.

    Raises:
        ConfigError: it cannot be read, or something in it is wrong.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{what} '{path}' cannot be read: {error.strerror}: {instead}") from error
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{what} file {path} is not valid TOML: {error}: correct that line") from error
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigError(f"{what} file {path}: {_explain(error, model)}") from error


def toml_value(value: object) -> str:
    """A value as TOML has it; tables stand in one line, without what is None."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_value(k)} = {toml_value(v)}" for k, v in value.items() if v is not None) + " }"
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, float):
        return repr(value)
    # JSON's strings are TOML's, but for this one character
    return json.dumps(str(value) if isinstance(value, Path) else value, ensure_ascii=False).replace("\x7f", "\\u007f")


def sentence_of(error: ErrorDetails) -> str:
    """What is wrong with a value, and the value, where it is short enough to be read."""
    said, given = demand(error), error["input"]
    return f"{said}, not {given!r}" if isinstance(given, (str, int, float, bool)) else said


def _explain(problem: ValidationError, model: type[BaseModel]) -> str:
    """The first mistake; an unknown name first, since it is often the misspelt form of a missing one."""
    errors = problem.errors(include_url=False)
    error = next((one for one in errors if one["type"] == "extra_forbidden"), errors[0])
    where = ".".join(_as_written(error["loc"]))
    if error["type"] == "extra_forbidden":
        valid = _names(error["loc"][:-1], model)
        near = difflib.get_close_matches(str(error["loc"][-1]), valid, n=1)
        return f"there is no setting {where}: " + (f"did you mean {near[0]}?" if near else f"choose {', '.join(valid)}")
    if error["type"] == "missing":
        return f"{where} is missing: give it a value"
    if error["type"] == "union_tag_not_found":
        return f"{where}.kind is missing: give it one of {', '.join(_kinds())}"
    if error["type"] == "union_tag_invalid":
        given = str(error["ctx"]["tag"])
        near = difflib.get_close_matches(given, _kinds(), n=1)
        said = f"did you mean {near[0]}?" if near else f"choose {', '.join(_kinds())}"
        return f"there is no {where} of kind '{given}': {said}"
    return ": ".join(filter(None, (where, sentence_of(error))))


def _kinds() -> list[str]:
    """Kinds of cameras."""
    return [str(kind.model_fields["kind"].default) for kind in get_args(LabCamera)]


def _as_written(where: tuple[int | str, ...]) -> list[str]:
    """The place of a mistake without what Pydantic adds: as which kind of camera, or alternative, it was tried."""
    names = [str(part) for part in where]
    if names[:1] == ["camera"]:
        return names[:1] + names[2:3]
    return names


def _names(section: tuple[int | str, ...], whole: type[BaseModel]) -> list[str]:
    """Settings that a section of a rig file may hold."""
    if section[:1] == ("camera",):
        kind = next(kind for kind in get_args(LabCamera) if kind.model_fields["kind"].default == section[1])
        return sorted(kind.model_fields)
    model = whole
    for name in section:
        if isinstance(name, str):  # a number is a place in a list of the same
            model = _model_in(model.model_fields[name].annotation)
    return sorted(model.model_fields)


def _model_in(annotation: object) -> type[BaseModel]:
    """The model that a field holds, perhaps several of it, perhaps none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(_model_in(part) for part in get_args(annotation) if part is not type(None))
