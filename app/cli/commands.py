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
        sentence = error.format_message()
        if "\n" in sentence:  # no mistake, but the help that is shown where nothing was said
            raise
        fail(f"{(_refused(error) or sentence).rstrip('.')}: {_lists(getattr(error, 'ctx', None))}")
    except Exception as error:
        # pydantic's errors name what went wrong in what they had called
        if KeyboardInterrupt.__name__ not in str(error):
            raise
        fail(INTERRUPTED, 130)


def _refused(error: TyperException) -> str | None:
    """What is wrong with the value of an option or an argument, where Pydantic has refused it."""
    from pydantic import ValidationError

    from hardware.demands import demand

    cause, parameter = error.__cause__, getattr(error, "param", None)
    if not isinstance(cause, ValidationError) or parameter is None:
        return None
    first = cause.errors(include_url=False)[0]
    name = parameter.opts[0] if parameter.param_type_name == "option" else parameter.display_name_raw
    return f"{name} is '{first['input']}': {demand(first)}"


def _lists(context: Any) -> str:
    """Where to look up what a command takes."""
    names, of_group = list[str](), context is None or isinstance(context.command, TyperGroup)
    while context is not None and context.parent is not None:
        names.insert(0, str(context.info_name))
        context = context.parent
    return f"'{' '.join(('touchmove', *names))} --help' lists the {'commands' if of_group else 'options'}"


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
