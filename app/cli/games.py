"""Commands that play: by engines, against a person, from records; and what they are played with.

Most parameters of these commands are read through their context: each sets the field of the settings that
``options`` names for it.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from app.cli import options
from app.cli.ending import fail, interrupt, say

if TYPE_CHECKING:
    from app.play.session import SessionResult
    from app.terminal.interface import UserInterface


def demo(
    context: typer.Context,
    plies: options.Plies = 300,
    games: options.Games = 1,
    rig: options.Rig = "sim",
    pace: options.Pace = None,
    profile: options.Profile = None,
    seed: options.Seed = 1,
    fen: options.Fen = None,
    chess960: options.Chess960 = False,
    moves: options.Moves = None,
    white_elo: options.WhiteElo = None,
    black_elo: options.BlackElo = None,
    movetime: options.MoveTime = None,
    nodes: options.Nodes = None,
    clock: options.Clock = None,
    white_clock: options.WhiteClock = None,
    black_clock: options.BlackClock = None,
    book: options.Book = None,
    white_book: options.WhiteBook = None,
    black_book: options.BlackBook = None,
    engine: options.EnginePath = None,
    white_engine: options.WhiteEngine = None,
    black_engine: options.BlackEngine = None,
    out: options.Out = None,
    verify: options.Verify = None,
    guard: options.Guard = None,
    cameras: options.Cameras = True,
    video: options.Video = True,
    video_length: options.VideoLength = 40.0,
    linger: options.Linger = 30.0,
    square: options.Square = None,
    pads: options.Pads = "grooved",
    captured: options.Captured = None,
    randomise: options.Randomise = None,
    port: options.Port = 0,
    headless: options.Headless = False,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """Two engines play a game that the arm executes."""
    from app.play.launch import run_games

    settings = options.settings_of_command(context, config)
    _show_game(lambda ui: run_games(settings, ui), headless=headless, as_json=as_json)


def play(
    context: typer.Context,
    color: Annotated[str | None, typer.Option(help="Your pieces: white, the default, or black.")] = None,
    elo: Annotated[int | None, typer.Option(help="Strength of the robot; full strength if not given.")] = None,
    rig: options.Rig = "sim",
    pace: options.Pace = None,
    fen: options.Fen = None,
    from_board: options.FromBoard = False,
    standing: Annotated[
        str | None, typer.Option(help="With --from-board in a simulation: the position that stands there.")
    ] = None,
    chess960: options.Chess960 = False,
    clock: options.Clock = None,
    movetime: options.MoveTime = None,
    nodes: options.Nodes = None,
    book: options.Book = None,
    engine: options.EnginePath = None,
    profile: options.Profile = None,
    seed: options.Seed = 1,
    guard: options.Guard = None,
    out: options.Out = None,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """Play against the robot: type a move, or just make it where there is a real board. 'help' says what else."""
    if color not in (None, "white", "black"):
        fail(f"--color is '{color}', choose white or black")

    from app.play.launch import run_games
    from app.settings.tree import PlayerKind

    also: dict[str, object] = {"rig.video": False}
    believed = options.settings_of_command(context, config, also)
    if color is None:
        color = "black" if believed.black.player is PlayerKind.HUMAN else "white"
    other = "black" if color == "white" else "white"
    also |= {f"{color}.player": "human", f"{other}.player": "engine", f"{other}.elo": elo}
    settings = options.settings_of_command(context, config, also)
    _show_game(lambda ui: run_games(settings, ui, sys.stdin), headless=False, as_json=as_json, talks=True)


def replay(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="PGN file, also with several games; or the folder of a game.")],
    game: options.ReplayGame = None,
    from_ply: options.FromPly = 1,
    plies: options.Plies = 1000,
    rig: options.Rig = "sim",
    pace: options.Pace = None,
    profile: options.Profile = None,
    seed: options.Seed = 1,
    verify: options.Verify = None,
    cameras: options.Cameras = True,
    out: options.Out = None,
    headless: options.Headless = False,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """The arm plays recorded games again, and says of every ply whether the board came out right."""
    from app.play.launch import run_games

    settings = options.settings_of_command(context, config, {"rig.video": False})
    _show_game(lambda ui: run_games(settings, ui), headless=headless, as_json=as_json)


def setup(
    context: typer.Context,
    fen: Annotated[str, typer.Option(help="The position to set up; 'start' is the usual one.")] = "start",
    standing: Annotated[str, typer.Option(help="What stands on the board now; 'start' is the usual one.")] = "start",
    rig: options.Rig = "sim",
    pace: options.Pace = None,
    profile: options.Profile = None,
    seed: options.Seed = 1,
    verify: options.Verify = None,
    cameras: options.Cameras = True,
    out: options.Out = None,
    headless: options.Headless = False,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """The arm sets a position up, with the pieces on the board and beside it."""
    import chess

    from app.play.launch import run_games

    position = {
        f"game.{name}": chess.STARTING_FEN if value == "start" else value
        for name, value in (("fen", fen), ("standing", standing))
        if config is None or options.given(context, name)
    }
    settings = options.settings_of_command(context, config, {**position, "game.plies": 0, "rig.video": False})
    _show_game(lambda ui: run_games(settings, ui), headless=headless, as_json=as_json)


def resume(
    folder: Annotated[Path, typer.Argument(help="Folder of the match, or of one of its games.")],
    from_board: Annotated[
        bool, typer.Option("--from-board", help="Whatever its record says: go on from what stands on the board now.")
    ] = False,
    headless: options.Headless = False,
    as_json: options.AsJson = False,
) -> None:
    """Go on with a game that was interrupted, or whose program or controller died: first with the ply under way."""
    from app.play.launch import resume_from_board, resume_games

    go_on = resume_from_board if from_board else resume_games
    _show_game(lambda ui: go_on(folder, ui, sys.stdin), headless=headless, as_json=as_json, talks=True)


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of a game's record.")],
    as_json: options.AsJson = False,
) -> None:
    """Compute the report of a recorded game again, from its events alone, also of one that broke off."""
    from rich.console import Console

    from app import UserError
    from app.records import EVENTS_FILE, read_events, summarise
    from app.terminal.report_table import report_table

    try:
        found = summarise(read_events(folder / EVENTS_FILE, say))
    except UserError as error:
        fail(str(error))
    if as_json:
        print(found.model_dump_json(indent=2))
    else:
        Console(markup=False).print(report_table(found))
    raise typer.Exit(0 if found.physical_ok is not False and not found.failures else 1)


def show_config(
    file: Annotated[Path | None, typer.Argument(help="TOML file with settings; the defaults if left out.")] = None,
) -> None:
    """Print the settings that are in force, as a TOML file that says what each of them means."""
    from app.settings.files import as_toml

    print(as_toml(options.settings_or_end({}, file)), end="")


def _show_game(
    play: Callable[[UserInterface], SessionResult], *, headless: bool, as_json: bool, talks: bool = False
) -> NoReturn:
    """Play a game before a face; ends the program."""
    from rich.console import Console
    from rich.text import Text

    from app import UserError
    from app.terminal.interface import Conversation, Terminal, UserInterface
    from engine.errors import EngineProblem

    console = Console(stderr=True)
    for number in (signal.SIGINT, signal.SIGTERM):  # SIGINT too: a shell's background job starts with it ignored
        signal.signal(number, interrupt)
    try:
        if headless:
            result = play(UserInterface())
        else:
            with Conversation(console, echoes=sys.stdin.isatty()) if talks else Terminal(console) as terminal:
                result = play(terminal)
    except (UserError, EngineProblem) as error:
        fail(str(error))
    except KeyboardInterrupt as stop:
        from app.play.session import Interrupted

        more = f"; 'touchmove resume {stop.folder}' goes on with it" if isinstance(stop, Interrupted) else ""
        fail(f"interrupted; the arm rests and nothing that this program started is left running{more}", 130)
    if as_json:
        print(result.report.model_dump_json(indent=2))
    if not headless:
        report = result.report
        ended = f"{report.exit_reason}, result {report.result}, {report.plies} plies; record in {result.folder}"
        console.print(ended, highlight=False, markup=False, soft_wrap=True)
    for failure in result.report.failures:
        console.print(Text.assemble(("failed:", "red"), f" {failure.reason}"), soft_wrap=True)
    if result.resumable:
        from app.play.match import match_of

        sentence = f"'touchmove resume {match_of(result.folder)}' goes on with it"
        console.print(sentence, highlight=False, markup=False, soft_wrap=True)
    raise typer.Exit(0 if result.holds else 1)
