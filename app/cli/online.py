"""The command that plays on Lichess."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Final

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.audience import page_of_command, show_game
from app.cli.ending import ask, fail, say

if TYPE_CHECKING:
    from app.play.session import SessionResult
    from app.players.person import Lines
    from app.settings.defaults import Settings
    from app.terminal.game_display import UserInterface


_BOT: Final[options.Group] = MappingProxyType({
    "upgrade": (
        Annotated[
            bool, typer.Option("--upgrade", help="With --bot: turn the account into a bot's. This cannot be undone.")
        ],
        False,
    ),
    "take_backs": (
        Annotated[bool, typer.Option(help="With --bot: agree when the opponent wants to take a move back.")], True
    ),
    "elo": (Annotated[int | None, typer.Option(help="With --bot: strength; full strength if not given.")], None),
    "movetime": (
        Annotated[
            float | None, typer.Option(min=0.001, help="With --bot: longest thought about a move [s], 3 if not given.")
        ],
        None,
    ),
    "nodes": (
        Annotated[
            int | None, typer.Option(min=1, help="With --bot: search this many nodes instead of thinking for a time.")
        ],
        None,
    ),
    "book": (Annotated[Path | None, typer.Option(help="With --bot: opening book in Polyglot's format.")], None),
    "engine": (
        Annotated[str | None, typer.Option(help="With --bot: path of a UCI engine; Stockfish by default.")], None
    ),
})  # fmt: skip
"""Options of an account that the engine plays with."""
_OF_THE_ENGINE: Final = ("elo", "movetime", "nodes", "book", "engine")


@options.shared(_BOT, options.RIG, options.PROCESSES, options.TALK, options.RECORD)
def online(
    context: typer.Context,
    person: Annotated[
        bool, typer.Option("--person", help="You play people: no engine runs, and nobody gives hints.")
    ] = False,
    bot: Annotated[bool, typer.Option("--bot", help="The engine plays, with a bot's account.")] = False,
    opponent: Annotated[str | None, typer.Option(help="Challenge this player.")] = None,
    accept: Annotated[
        bool, typer.Option("--accept", help="Wait for a challenge instead of looking for an opponent.")
    ] = False,
    clock: Annotated[str | None, typer.Option(help="Time control, 15+10 if not given.")] = None,
    days: Annotated[
        int | None, typer.Option(help="Days per move of a correspondence game: 1, 2, 3, 5, 7, 10 or 14.")
    ] = None,
    color: Annotated[str | None, typer.Option(help="Colour to ask for: white or black; either if not given.")] = None,
    rated: Annotated[bool, typer.Option("--rated", help="Play for rating points.")] = False,
    games: options.Games = 1,
    game_id: Annotated[
        str | None, typer.Option(help="Go on with this game of the account, by its id, from the usual position.")
    ] = None,
    token_file: Annotated[
        Path | None,
        typer.Option(help="File with the account's token, mode 0600; if not given, the keyring is asked."),
    ] = None,
    server: Annotated[str, typer.Option(help="Address of the server.")] = "https://lichess.org",
    arm_seconds: Annotated[
        float | None,
        typer.Option(min=0.0, help="Mean time of the arm for a ply [s], to tell which time controls it can keep."),
    ] = None,
    rig: options.Rig = "sim",
    pace: options.Pace = None,
    verify: options.Verify = None,
    guard: options.Guard = None,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """Play on Lichess: you at the board against people, or the engine with a bot's account."""
    _refuse_contradictions(context)
    require_extra()
    page_ahead = page_of_command(context)
    also = {
        "online.use": "person" if person else "bot", "online.color": color, "white.elo": context.params["elo"],
        "rig.video": False, "white.player": "human" if person else None,
    }  # fmt: skip
    settings = options.settings_of_command(context, config, also)
    if context.params["upgrade"]:
        _upgrade(settings)
    show_game("play" if person else "demo", _games_of(context, settings), settings, page_ahead, as_json=as_json)


def _refuse_contradictions(context: typer.Context) -> None:
    """End the program with a sentence where options contradict each other."""
    person, color, upgrade = (context.params[name] for name in ("person", "color", "upgrade"))
    if person is context.params["bot"]:
        fail("choose who plays: --person for you at the board, or --bot for the engine")
    if color not in (None, "white", "black"):
        fail(f"--color is '{color}', choose white or black")
    engines = [name for name in _OF_THE_ENGINE if options.given(context, name)]
    if person and (engines or upgrade):
        wrong = "--upgrade" if upgrade else f"--{engines[0]}"
        fail(f"{wrong} is for --bot: in a person's game no engine runs, as the server's rules say")
    if person and context.params["rig"] == "sim" and context.params["pace"] == "fast":
        fail("people play by the wall clock: leave --pace fast out")


def require_extra() -> None:
    """End the program with a sentence where what talks to Lichess is not installed."""
    if find_spec("berserk") is None:
        fail("games on Lichess need the package berserk: install it with pip install 'touchmove[online]'")


def _upgrade(settings: Settings) -> None:
    from app import UserError
    from app.online.launch import client_of
    from app.online.launch import upgrade as upgrade_account

    try:
        upgrade_account(client_of(settings), ask)
    except UserError as error:
        fail(str(error))
    say("the account is a bot's now")


def _games_of(context: typer.Context, settings: Settings) -> Callable[[UserInterface, Lines], SessionResult]:
    from app.rig.simulation.ahead import RigAhead

    ahead = RigAhead(settings)
    context.call_on_close(ahead.cancel)

    def play(ui: UserInterface, lines: Lines) -> SessionResult:
        from app.online.launch import online_settings, run_online

        return run_online(online_settings(settings), ui, lines, ahead)

    return play
