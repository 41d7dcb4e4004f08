"""Commands of two robots that play one game: ``host`` and ``join``, and going on with it."""

from __future__ import annotations

import getpass
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.audience import page_of_command, show_game
from app.cli.ending import fail, say

if TYPE_CHECKING:
    from app.linked.secret import LinkSecret
    from app.play.session import SessionResult
    from app.players.person import Lines
    from app.settings.defaults import LinkSection, Settings
    from app.terminal.game_display import UserInterface

Person = Annotated[
    bool, typer.Option("--person", help="A person plays at this table; otherwise an engine or --moves does.")
]
Name = Annotated[str | None, typer.Option(help="Who plays at this table, for the records of both robots.")]
Elo = Annotated[int | None, typer.Option(help="Strength of the engine here; full strength if not given.")]
Secret = Annotated[
    Path | None,
    typer.Option(
        help="File with the secret that both robots share, readable only by you; asked for at the terminal if left out."
    ),
]
Identity = Annotated[
    Path | None,
    typer.Option(
        help="Folder of this robot's key and certificate; by default in your configuration, made at first use."
    ),
]


@options.shared(options.RIG, options.ENGINE, options.SIGHT, options.TALK, options.RECORD, options.UNSEEN)
def host(
    context: typer.Context,
    color: Annotated[str, typer.Option(help="The pieces of this table's player: white or black.")] = "white",
    person: Person = False,
    name: Name = None,
    elo: Elo = None,
    moves: options.Moves = None,
    plies: options.Plies = 300,
    fen: options.Fen = None,
    chess960: options.Chess960 = False,
    clock: options.Clock = None,
    listen: Annotated[
        str | None,
        typer.Option(
            help="IPv4 address to wait at; by default only this computer can join: 0.0.0.0 lets any that reaches it."
        ),
    ] = None,
    link_port: Annotated[
        int | None, typer.Option("--port", min=1, max=65535, help="TCP port to wait at; 8065 by default.")
    ] = None,
    secret: Secret = None,
    identity: Identity = None,
    config: options.Config = None,
) -> None:
    """Play one game on two tables: say what is played, and wait for the other robot to join."""
    if color not in ("white", "black"):
        fail(f"--color is '{color}', choose white or black")
    if secret is not None and not secret.exists():
        _make_secret(secret)
    also: dict[str, object] = {"link.role": "host", "link.listen": listen, "link.port": link_port}
    if config is None or options.given(context, "color"):
        also["link.color"] = color
    _play(context, config, {**also, **_of_both(person, name, elo, secret, identity)})


@options.shared(options.RIG, options.ENGINE, options.SIGHT, options.TALK, options.RECORD, options.UNSEEN)
def join(
    context: typer.Context,
    address: Annotated[str, typer.Argument(metavar="HOST[:PORT]", help="Where the other robot waits.")],
    person: Person = False,
    name: Name = None,
    elo: Elo = None,
    moves: options.Moves = None,
    secret: Secret = None,
    identity: Identity = None,
    config: options.Config = None,
) -> None:
    """Join the game of another robot; each of the two tables shows all of it."""
    from app import UserError
    from app.linked.link import parse_address
    from app.settings.defaults import LinkSection

    try:
        where, port = parse_address(address, LinkSection().port)
    except UserError as error:
        fail(str(error))
    also: dict[str, object] = {"link.role": "guest", "link.host": where, "link.port": port}
    _play(context, config, {**also, **_of_both(person, name, elo, secret, identity)})


def secret_or_end(section: LinkSection) -> LinkSecret:
    """The secret of both robots, from its file or typed; ends the program with a sentence where there is none."""
    from app import UserError
    from app.linked.link import link_secret

    try:
        return link_secret(section, _typed)
    except UserError as error:
        fail(str(error))


def _of_both(
    person: bool, name: str | None, elo: int | None, secret: Path | None, identity: Path | None
) -> dict[str, object]:
    return {
        "link.person": person or None, "link.name": name, "white.elo": elo, "link.secret": secret,
        "link.identity": identity,
    }  # fmt: skip


def _play(context: typer.Context, config: Path | None, also: dict[str, object]) -> None:
    page_ahead = page_of_command(context)
    settings = options.settings_of_command(context, config, {"rig.video": False, **also})
    secret = secret_or_end(settings.link)
    show_game(
        "play" if settings.link.person else "demo", _games_of(context, settings, secret), settings, page_ahead,
        headless=bool(context.params["headless"]), as_json=bool(context.params["as_json"]),
        awaited=settings.link.person and context.params["page"] is True,
    )  # fmt: skip


def _games_of(
    context: typer.Context, settings: Settings, secret: LinkSecret
) -> Callable[[UserInterface, Lines], SessionResult]:
    from app.rig.simulation.ahead import RigAhead

    ahead = RigAhead(settings)
    context.call_on_close(ahead.cancel)

    def play(ui: UserInterface, lines: Lines) -> SessionResult:
        from app.linked.games import run_linked_games

        return run_linked_games(settings, ui, lines, secret, ahead)

    return play


def _make_secret(path: Path) -> None:
    from app import UserError
    from app.linked.secret import make_secret

    try:
        make_secret(path)
    except UserError as error:
        fail(str(error))
    say(f"made a new secret in {path}: copy this file to the other robot, and let nobody else read it")


def _typed() -> str:
    if sys.stdin is None or not sys.stdin.isatty():
        fail("two robots need a secret that both know, and nobody can type it here: name its file with --secret")
    try:
        return getpass.getpass("touchmove: secret of both robots: ")
    except EOFError:
        fail("no secret was typed: type it, or name its file with --secret")
