"""Files, folders and engines that a campaign's file names: they lie beside it, and are there before anything is played.

Paths are made whole once, when the file is read: workers play in folders of their own.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from app.campaign.schema import TaskKind
from app.campaign.spec import CampaignSpec, ChoiceRange, fields, parts_of
from app.settings.toml import ConfigError

_ENGINE: Final = "engine.path"
_ENGINES: Final = (_ENGINE, "white.path", "black.path")
"""A text among the settings, since a bare name may also be on PATH."""
_FOLDERS: Final = ("engine.syzygy",)
_OPENINGS: Final = ("game.fen", "engine.book", "white.book", "black.book")
"""With any of these no engine is asked for an opening."""


def beside(folder: Path, draw: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Values that name files, as paths that hold anywhere; they lie beside a campaign's file."""
    for name, value in draw.items():
        if not _names_file(name):
            yield name, value
        elif isinstance(value, ChoiceRange):
            yield name, ChoiceRange(one_of=tuple(_whole(folder, name, str(one)) for one in value.one_of))
        else:
            yield name, _whole(folder, name, str(value))


def require_named(draw: Mapping[str, Any]) -> None:
    """Make sure that everything that is named is there.

    Raises:
        ConfigError: something is not; the sentence says by which name it is asked for.
    """
    for name in filter(_names_file, draw):
        for path in _values(draw[name]):
            if name in _ENGINES:
                there, what = shutil.which(path) is not None, "program that can be started"
            elif name in _FOLDERS:
                there, what = Path(path).is_dir(), "folder"
            else:
                there, what = Path(path).is_file() and os.access(path, os.R_OK), "file that can be read"
            if not there:
                raise ConfigError(f"{name} names {path}, which is no {what}: correct the path, or leave {name} out")


def engines_of(spec: CampaignSpec) -> tuple[str, ...]:
    """Paths of all engines that games of a campaign may ask, each once; an empty one is the usual engine's."""
    draw = spec.draw
    if spec.kind is TaskKind.SETUP or spec.fixed.get("start.line") is True or "game.moves" in draw:
        return ()
    of_both = _values(draw.get(_ENGINE, ""))
    sides = [_values(draw[name]) if name in draw else of_both for name in _ENGINES if name != _ENGINE]
    opens = spec.kind is TaskKind.GAME and not any(name in draw for name in _OPENINGS)
    return tuple(sorted({*sides[0], *sides[1], *(of_both if opens else ())}))


def files_of(spec: CampaignSpec) -> tuple[str, ...]:
    """Files and folders, other than engines, that games depend on."""
    named = (name for name in spec.draw if _names_file(name) and name not in _ENGINES)
    return tuple(sorted({path for name in named for path in _values(spec.draw[name])}))


def _names_file(name: str) -> bool:
    return name in _ENGINES or any(part is Path for part in parts_of(fields()[name]))


def _values(value: Any) -> tuple[str, ...]:
    return tuple(map(str, value.one_of)) if isinstance(value, ChoiceRange) else (str(value),)


def _whole(folder: Path, name: str, value: str) -> str:
    near = folder / value
    on_path = name in _ENGINES and os.sep not in value and not near.exists() and shutil.which(value)
    return value if on_path else str(near)
