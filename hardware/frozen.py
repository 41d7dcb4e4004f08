"""Base classes of settings and reports that do not change: strict about names, so that a misspelt one is refused."""

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict


class Frozen(BaseModel):
    """Data that does not change; a name that it does not have is refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class FrozenFinite(Frozen):
    """Of finite numbers alone: what devices are set to."""

    model_config = ConfigDict(allow_inf_nan=False)


def _named(path: object) -> object:
    if isinstance(path, str) and not path.strip():
        raise ValueError("it should be the name of a file or folder, or be left out")
    return path


NamedPath = Annotated[Path, BeforeValidator(_named)]
"""A file or folder that a person names; an empty name would be the current folder."""
