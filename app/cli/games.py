"""Commands that play: by engines, against a person, puzzles, from records; and what they are played with.

Most parameters of these commands are read through their context: each sets the field of the settings that
``options`` names for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.audience import page_of_command, show_game
from app.cli.ending import fail
from app.cli.online import require_extra

if TYPE_CHECKING:
    from app.play.session import SessionResult
    from app.players.person import Lines
    from app.settings.defaults import Settings
    from app.terminal.game_display import UserInterface

    Resuming = Callable[[Path, UserInterface, Lines, Mapping[str, str]], SessionResult]


@options.shared(
    options.RIG, options.PROCESSES, options.ENGINE, options.SIGHT, options.VOICE, options.RECORD, options.UNSEEN
)
def demo(
    context: typer.Context,
    plies: options.Plies = 300,
    games: options.Games = 1,
    fen: options.Fen = None,
    chess960: options.Chess960 = False,
    odds: options.Odds = None,
    moves: options.Moves = None,
    white_elo: options.WhiteElo = None,
    black_elo: options.BlackElo = None,
    clock: options.Clock = None,
    white_clock: options.WhiteClock = None,
    black_clock: options.BlackClock = None,
    white_book: options.WhiteBook = None,
    black_book: options.BlackBook = None,
    syzygy: options.Syzygy = None,
    white_engine: options.WhiteEngine = None,
    black_engine: options.BlackEngine = None,
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
    page_ahead = page_of_command(context)
    settings = options.settings_of_command(context, config)
    show_game("demo", games_of(context, settings), settings, page_ahead, headless=headless, as_json=as_json)


@options.shared(options.RIG, options.PROCESSES, options.ENGINE, options.TALK, options.RECORD)
def play(
    context: typer.Context,
    color: Annotated[str | None, typer.Option(help="Your pieces: white (the default) or black.")] = None,
    elo: Annotated[
        int | None, typer.Option(help="Strength of the robot in Elo, from 400; full strength if not given.")
    ] = None,
    fen: options.Fen = None,
    from_board: options.FromBoard = False,
    standing: Annotated[
        str | None, typer.Option(help="With --from-board in a simulation: the position on the board.")
    ] = None,
    chess960: options.Chess960 = False,
    odds: options.Odds = None,
    coach: options.Coach = False,
    repertoire: options.Repertoire = None,
    two_people: Annotated[
        bool,
        typer.Option("--two-people", help="Both sides are played by hand: the robot is arbiter and keeps the clocks."),
    ] = False,
    clock: options.Clock = None,
    syzygy: options.Syzygy = None,
    guard: options.Guard = None,
    page: options.Page = None,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """Play against the robot: type your moves, or simply make them on a real board. Type 'help' for other commands."""
    if color not in (None, "white", "black"):
        fail(f"--color is '{color}', choose white or black")

    page_ahead = page_of_command(context)
    from app.settings.defaults import PlayerKind

    also: dict[str, object] = {"rig.video": False}
    believed = options.settings_of_command(context, config, also)
    if color is None:
        color = "black" if believed.black.player is PlayerKind.HUMAN else "white"
    other = "black" if color == "white" else "white"
    if two_people and elo is not None:
        fail("--elo is the robot's strength, and with --two-people it does not play: leave one of them out")
    robot = "human" if two_people else "engine"
    also |= {f"{color}.player": "human", f"{other}.player": robot, f"{other}.elo": elo}
    settings = options.settings_of_command(context, config, also)
    show_game("play", games_of(context, settings), settings, page_ahead, as_json=as_json, awaited=page is True)


@options.shared(options.RIG, options.PROCESSES, options.TALK, options.RECORD)
def puzzle(
    context: typer.Context,
    puzzles: Annotated[
        Path,
        typer.Argument(help="CSV file with the columns FEN and Moves, as Lichess publishes it, or a PGN file."),
    ],
    number: Annotated[int, typer.Option(min=1, help="Begin with this puzzle of the file.")] = 1,
    games: Annotated[int, typer.Option(min=1, help="Number of puzzles; the arm sets up each of them.")] = 1,
    guard: options.Guard = None,
    page: options.Page = None,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """Solve puzzles: the arm sets them up and plays the opponent; it says whether a move is right."""
    page_ahead = page_of_command(context)
    sides = {"white.player": "human", "black.player": "engine", "rig.video": False}
    settings = options.settings_of_command(context, config, sides)
    show_game("play", games_of(context, settings), settings, page_ahead, as_json=as_json, awaited=page is True)


@options.shared(options.RIG, options.PROCESSES, options.VOICE, options.RECORD, options.UNSEEN)
def replay(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="PGN file with one or more games, or the folder of a game.")],
    game: options.ReplayGame = None,
    from_ply: options.FromPly = 1,
    plies: options.Plies = 1000,
    verify: options.Verify = None,
    cameras: options.Cameras = True,
    headless: options.Headless = False,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """The arm plays recorded games again and checks the board after every ply."""
    page_ahead = page_of_command(context)
    settings = options.settings_of_command(context, config, {"rig.video": False})
    show_game("replay", games_of(context, settings), settings, page_ahead, headless=headless, as_json=as_json)


@options.shared(options.RIG, options.PROCESSES, options.RECORD, options.UNSEEN)
def setup(
    context: typer.Context,
    fen: Annotated[str, typer.Option(help="The position to set up; 'start' is the usual one.")] = "start",
    standing: Annotated[str, typer.Option(help="The position on the board now; 'start' is the usual one.")] = "start",
    verify: options.Verify = None,
    cameras: options.Cameras = True,
    headless: options.Headless = False,
    config: options.Config = None,
    as_json: options.AsJson = False,
) -> None:
    """The arm sets up a position, with the pieces on the board and beside it."""
    page_ahead = page_of_command(context)
    import chess

    position = {
        f"game.{name}": chess.STARTING_FEN if value == "start" else value
        for name, value in (("fen", fen), ("standing", standing))
        if config is None or options.given(context, name)
    }
    settings = options.settings_of_command(context, config, {**position, "game.plies": 0, "rig.video": False})
    show_game("setup", games_of(context, settings), settings, page_ahead, headless=headless, as_json=as_json)


def resume(
    context: typer.Context,
    folder: Annotated[Path, typer.Argument(help="Folder of the match, or of one of its games.")],
    from_board: Annotated[
        bool,
        typer.Option(
            "--from-board", help="Ignore the recorded position and continue from what stands on the board now."
        ),
    ] = False,
    engine: options.EnginePath = None,
    white_engine: options.WhiteEngine = None,
    black_engine: options.BlackEngine = None,
    page: options.Page = None,
    headless: options.Headless = False,
    as_json: options.AsJson = False,
) -> None:
    """Continue a game that was interrupted, or whose program or controller died, from the ply under way."""
    page_ahead = page_of_command(context)
    from app import UserError
    from app.play.launch import resume_from_board, resume_games
    from app.play.match import match_of
    from app.settings.files import kept_settings

    options.refuse_unseen_page(context)
    go_on: Resuming = resume_from_board if from_board else resume_games
    try:
        settings = kept_settings(match_of(folder)).with_changes({"page.on": page})
    except UserError as error:
        fail(str(error))
    engines = _other_engines(context, settings, engine, white_engine, black_engine)
    if settings.online.use is not None:
        if from_board:
            fail("a game on Lichess goes on from its own position alone: leave --from-board out")
        require_extra()
        from app.online.launch import resume_online as go_on
    if settings.link.role is not None:
        from app.cli.linked import secret_or_end
        from app.linked.games import resume_linked_games

        if from_board:
            fail("a game of two robots goes on from what both have recorded: leave --from-board out")
        secret = secret_or_end(settings.link)

        def go_on(folder: Path, ui: UserInterface, lines: Lines, engines: Mapping[str, str]) -> SessionResult:
            return resume_linked_games(folder, ui, lines, secret, engines)

    show_game(
        "resume", lambda ui, lines: go_on(folder, ui, lines, engines), settings, page_ahead, headless=headless,
        as_json=as_json, awaited=page is True,
    )  # fmt: skip


def _other_engines(
    context: typer.Context, settings: Settings, both: str | None, white: str | None, black: str | None
) -> dict[str, str]:
    """The engines that a match goes on with, by the setting that names them; one for both replaces each side's own.

    Ends the program with a sentence where no engine plays that they could replace.
    """
    from app.play.launch import engine_from_anywhere
    from app.settings.defaults import OnlineUse
    from app.settings.options import without_effect

    named = {"engine.path": both, "white.path": white or both, "black.path": black or both}
    engines = {field: engine_from_anywhere(path) for field, path in named.items() if path is not None}
    given = {"engine": "engine.path", "white_engine": "white.path", "black_engine": "black.path"}
    for sentence in without_effect(settings, [field for name, field in given.items() if options.given(context, name)]):
        fail(sentence)
    person_online = settings.online.use is OnlineUse.PERSON or (settings.link.role is not None and settings.link.person)
    if engines and (person_online or settings.two_people):
        fail("no engine plays in this game: leave --engine, --white-engine and --black-engine out")
    if (white or black) and (settings.online.use is not None or settings.link.role is not None):
        fail("only one engine plays in this game: name it with --engine")
    return engines


def show_config(
    file: Annotated[Path | None, typer.Argument(help="TOML file with settings; if left out, the defaults.")] = None,
) -> None:
    """Print the settings in force, as a TOML file with an explanation of each."""
    from app.settings.files import as_toml

    print(as_toml(options.settings_or_end({}, file)), end="")


def games_of(context: typer.Context, settings: Settings) -> Callable[[UserInterface, Lines], SessionResult]:
    """Plays as the settings say; what plays is loaded only then, since the page and the rig's processes load, too."""
    from app.rig.simulation.ahead import RigAhead

    ahead = RigAhead(settings)
    context.call_on_close(ahead.cancel)

    def play(ui: UserInterface, lines: Lines) -> SessionResult:
        from app.play.launch import run_games

        return run_games(settings, ui, lines, ahead)

    return play
