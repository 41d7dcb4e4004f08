"""Prints a command's report, as a table for people or as JSON for programs, and ends it with what the report says."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, NoReturn, Protocol

import typer

from app.cli.ending import fail, interruptible

if TYPE_CHECKING:
    from rich.console import RenderableType

PIPED_WIDTH = 160
"""Of tables that go into a file or to another program: nothing of them is folded [characters]."""


class Shown(Protocol):
    """A report of a command."""

    @property
    def holds(self) -> bool:
        """Whether all is as it should be."""

    def table(self) -> RenderableType:
        """One screen for people."""

    def model_dump_json(self, *, indent: int) -> str:
        """For programs."""


def show_report(find: Callable[[], Shown], as_json: bool) -> NoReturn:
    """Find out, show it, and end the program with what it says."""
    from rich.console import Console

    from app import UserError

    try:
        with interruptible():
            report = find()
    except UserError as error:
        fail(str(error))
    if as_json:
        print(report.model_dump_json(indent=2))
    else:
        Console(width=None if sys.stdout.isatty() else PIPED_WIDTH).print(report.table())
    raise typer.Exit(0 if report.holds else 1)
