"""The command line: ``touchmove COMMAND``. Heavy imports happen inside the commands, so that ``--help`` is quick."""

from __future__ import annotations

from collections.abc import Callable

import typer

from app.cli.devices import calibrate, check, controller, link_test, world
from app.cli.games import demo, play, replay, report, resume, setup, show_config
from app.cli.measuring import bench, figures, vision

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # [s] is a unit
    help="A delta robot plays chess, in simulation or in the lab.",
)
_COMMANDS: dict[str, Callable[..., None]] = {
    "play": play, "demo": demo, "replay": replay, "setup": setup, "resume": resume, "report": report,
    "config": show_config, "controller": controller, "world": world, "check": check, "calibrate": calibrate,
    "link-test": link_test, "vision": vision, "figures": figures, "bench": bench,
}  # fmt: skip
for _name, _command in _COMMANDS.items():
    app.command(_name)(_command)


def main() -> None:
    """Entry point of the command."""
    app()
