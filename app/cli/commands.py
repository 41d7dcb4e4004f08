"""All commands by name. Heavy imports happen inside the commands, so that ``--help`` is quick."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import typer
from typer.core import TyperGroup
from typer.exceptions import TyperException

from app.cli.campaign import campaign
from app.cli.dataset import dataset
from app.cli.devices import calibrate, check, commission, controller, identify, link_test, world
from app.cli.ending import INTERRUPTED, fail
from app.cli.games import demo, play, puzzle, replay, resume, setup, show_config
from app.cli.linked import host, join
from app.cli.measuring import bench, figures, vision
from app.cli.online import online
from app.cli.page import page
from app.cli.records import analyse, film, report


@contextmanager
def _one_sentence() -> Iterator[None]:
    """A mistake on the command line is answered like any other: in one sentence, with status 2; so is Ctrl-C, with 130.

    What plays or measures says by itself what is left then.
    """
    try:
        yield
    except KeyboardInterrupt:
        fail(INTERRUPTED, 130)
    except TyperException as error:
        sentence = error.format_message().replace("Value error, ", "")
        if "\n" in sentence:  # no mistake, but the help that is shown where nothing was said
            raise
        fail(f"{sentence.rstrip('.')}: 'touchmove COMMAND --help' lists the options")
    except Exception as error:
        if KeyboardInterrupt.__name__ not in str(
            error
        ):  # pydantic's errors name what went wrong in what they had called
            raise
        fail(INTERRUPTED, 130)


class _Commands(TyperGroup):
    """All commands; mistakes are found while the program's own arguments are read, or those of a command."""

    def make_context(self, *args: Any, **extra: Any) -> Any:
        with _one_sentence():
            return super().make_context(*args, **extra)

    def invoke(self, ctx: Any) -> Any:
        with _one_sentence():
            return super().invoke(ctx)


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # [s] is a unit
    help="A delta robot plays chess, in simulation or in the lab.",
)
_COMMANDS: dict[str, Callable[..., None]] = {
    "play": play, "online": online, "host": host, "join": join, "demo": demo, "replay": replay, "setup": setup,
    "resume": resume, "report": report, "film": film, "analyse": analyse, "puzzle": puzzle, "dataset": dataset,
    "page": page, "config": show_config, "controller": controller, "world": world, "check": check,
    "commission": commission, "calibrate": calibrate, "identify": identify, "link-test": link_test, "vision": vision,
    "figures": figures, "bench": bench,
}  # fmt: skip
for _name, _command in _COMMANDS.items():
    app.command(_name)(_command)
app.add_typer(campaign, name="campaign")
