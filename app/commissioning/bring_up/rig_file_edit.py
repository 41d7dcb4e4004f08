"""Naming another parameters file in a person's rig file: one line, and everything else as they wrote it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from app.records.files import write_atomically
from app.rig.rig_file import load_rig
from app.settings.toml import toml_value

_LINE: Final = re.compile(r"""^[ \t]*(?:parameters|"parameters"|'parameters')[ \t]*=.*$""", re.MULTILINE)
_SECTION: Final = re.compile(r"^\s*\[", re.MULTILINE)


def with_parameters(text: str, name: str) -> str:
    """A rig file's text with this ``parameters``: in the place of the line that was there, or first of all."""
    line = f"parameters = {toml_value(name)}"
    section = _SECTION.search(text)
    before = len(text) if section is None else section.start()
    if _LINE.search(text, 0, before):
        head = _LINE.sub(lambda _: line, text[:before], count=1)
        return head + text[before:]
    return f"{line}\n{text}"


def name_parameters(rig: Path, name: str) -> None:
    """Write it, and read it again.

    Raises:
        UserError: the file cannot be written, or would not be read.
    """
    write_atomically(rig, with_parameters(rig.read_text(encoding="utf-8"), name))
    load_rig(rig)
