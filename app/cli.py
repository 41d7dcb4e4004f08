"""The command line: ``touchmove COMMAND``. Heavy imports happen inside the commands, so that ``--help`` is quick."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    from app.calibrate_report import CalibrateReport
    from app.check import CheckReport
    from app.faces import Face
    from app.link_test import LinkReport
    from app.seeing import VisionReport
    from app.session import SessionResult
    from app.settings import Settings

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # [s] is a unit
    help="A delta robot plays chess, in simulation or in the lab.",
)


def _fail(sentence: str, status: int = 2) -> NoReturn:
    print(f"touchmove: {sentence}", file=sys.stderr)
    raise typer.Exit(status)


@app.callback()
def _root() -> None:
    """A delta robot plays chess, in simulation or in the lab."""


@app.command()
def demo(
    context: typer.Context,
    plies: Annotated[int, typer.Option(min=1, help="End after so many plies.")] = 300,
    games: Annotated[int, typer.Option(min=1, help="So many games; the arm sets the pieces up in between.")] = 1,
    rig: Annotated[str, typer.Option(help="sim, board, or the TOML file of a lab's rig.")] = "sim",
    pace: Annotated[
        str | None, typer.Option(help="real: by the wall clock, the default; fast: as fast as the machine can.")
    ] = None,
    profile: Annotated[
        str, typer.Option(help="How the arm moves: default, fast, gentle (children in reach) or minimum-jerk.")
    ] = "default",
    seed: Annotated[int, typer.Option(min=0, help="Chooses the opening and all randomness of the world.")] = 1,
    fen: Annotated[str | None, typer.Option(help="Start from this position.")] = None,
    moves: Annotated[str | None, typer.Option(help='Play this line (SAN or UCI), e.g. "e4 d5 exd5".')] = None,
    white_elo: Annotated[int | None, typer.Option(help="Strength of White; full strength if not given.")] = None,
    black_elo: Annotated[int | None, typer.Option(help="Strength of Black; full strength if not given.")] = None,
    movetime: Annotated[
        float | None, typer.Option(min=0.001, help="Thinking time per move [s]; 0.2 where there is no clock.")
    ] = None,
    clock: Annotated[str | None, typer.Option(help="Time control such as 5+3; no clock if not given.")] = None,
    book: Annotated[Path | None, typer.Option(help="Opening book in Polyglot's format.")] = None,
    nodes: Annotated[
        int | None, typer.Option(min=1, help="Think so many nodes instead: a run then repeats exactly.")
    ] = None,
    engine: Annotated[str | None, typer.Option(help="Path of a UCI engine; Stockfish by default.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the record; games/<time> by default.")] = None,
    verify: Annotated[
        bool | None,
        typer.Option(help="The camera looks after every ply, and what is wrong is mended; in a lab it does."),
    ] = None,
    video: Annotated[bool, typer.Option(help="Film the first part of the game.")] = True,
    video_length: Annotated[float, typer.Option(min=1.0, help="Longest film, in plant time [s].")] = 40.0,
    linger: Annotated[
        float, typer.Option(min=0.0, help="If this program is killed: how long the arm waits for another [s].")
    ] = 30.0,
    square: Annotated[
        float | None,
        typer.Option(help="Side of a square of the simulated board [mm]; a larger board stands nearer to the robot."),
    ] = None,
    pads: Annotated[str, typer.Option(help="What the fingers end in: grooved or flat.")] = "grooved",
    captured: Annotated[
        str | None,
        typer.Option(help="Where captured pieces go: tray, the default, to places of their own; box: dropped."),
    ] = None,
    randomise: Annotated[
        Path | None, typer.Option(help="TOML file: how the simulation differs from what the game believes of it.")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="UDP port of the controller; 0: any free one.")] = 0,
    headless: Annotated[bool, typer.Option("--headless", help="Show nothing while playing.")] = False,
    config: Annotated[
        Path | None,
        typer.Option(help="TOML file with settings, as 'touchmove config' prints it; options count for more."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Two engines play a game that the arm executes."""
    from app.games import run_games

    settings = _chosen(
        context,
        {
            "rig.name": rig, "rig.pace": pace, "rig.profile": profile, "rig.seed": seed, "rig.square": square,
            "rig.pads": pads, "rig.captured": captured, "rig.randomise": randomise, "rig.linger": linger,
            "rig.port": port, "rig.video": video, "rig.video_length": video_length,
            "game.plies": plies, "game.fen": fen, "game.moves": moves, "game.games": games,
            "engine.move_time": movetime, "engine.nodes": nodes, "engine.path": engine,
            "engine.book": book, "clock.time": clock,
            "white.elo": white_elo, "black.elo": black_elo, "vision.verify": verify, "out": out,
        },
        config,
    )  # fmt: skip
    _show_game(lambda face: run_games(settings, face), headless=headless, as_json=as_json)


@app.command()
def play(
    context: typer.Context,
    color: Annotated[str, typer.Option(help="Your pieces: white or black.")] = "white",
    elo: Annotated[int | None, typer.Option(help="Strength of the robot; full strength if not given.")] = None,
    rig: Annotated[str, typer.Option(help="sim, board, or the TOML file of a lab's rig.")] = "sim",
    pace: Annotated[
        str | None, typer.Option(help="real: by the wall clock, the default; fast: as fast as the machine can.")
    ] = None,
    fen: Annotated[str | None, typer.Option(help="Start from this position.")] = None,
    clock: Annotated[str | None, typer.Option(help="Time control such as 5+3; no clock if not given.")] = None,
    movetime: Annotated[
        float | None, typer.Option(min=0.001, help="The robot's thinking time per move [s]; with a clock the longest.")
    ] = None,
    book: Annotated[Path | None, typer.Option(help="Opening book in Polyglot's format.")] = None,
    nodes: Annotated[
        int | None, typer.Option(min=1, help="Think so many nodes instead: a run then repeats exactly.")
    ] = None,
    engine: Annotated[str | None, typer.Option(help="Path of a UCI engine; Stockfish by default.")] = None,
    profile: Annotated[
        str, typer.Option(help="How the arm moves: default, fast, gentle (children in reach) or minimum-jerk.")
    ] = "default",
    seed: Annotated[int, typer.Option(min=0, help="Chooses all randomness of a simulated world.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Folder of the record; games/<time> by default.")] = None,
    config: Annotated[
        Path | None,
        typer.Option(help="TOML file with settings, as 'touchmove config' prints it; options count for more."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Play against the robot: type a move, or just make it where there is a real board. 'help' says what else."""
    if color not in ("white", "black"):
        _fail(f"--color is '{color}', choose white or black")

    from app.games import run_games

    other = "black" if color == "white" else "white"
    settings = _chosen(
        context,
        {
            "rig.name": rig, "rig.pace": pace, "rig.profile": profile, "rig.seed": seed, "rig.video": False,
            "game.fen": fen, "engine.move_time": movetime, "engine.nodes": nodes, "engine.path": engine,
            "engine.book": book, "clock.time": clock, f"{color}.player": "human", f"{other}.elo": elo, "out": out,
        },
        config,
    )  # fmt: skip
    _show_game(lambda face: run_games(settings, face, sys.stdin), headless=False, as_json=as_json, talks=True)


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="PGN file, also with several games; or the folder of a game.")],
    game: Annotated[int | None, typer.Option(min=1, help="Only this game of the file.")] = None,
    from_ply: Annotated[int, typer.Option(min=1, help="Begin with this ply.")] = 1,
    plies: Annotated[int, typer.Option(min=1, help="End each game after so many plies.")] = 1000,
    rig: Annotated[str, typer.Option(help="sim, board, or the TOML file of a lab's rig.")] = "sim",
    pace: Annotated[
        str | None, typer.Option(help="real: by the wall clock, the default; fast: as fast as the machine can.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Chooses all randomness of a simulated world.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Folder of the record; games/<time> by default.")] = None,
    verify: Annotated[
        bool | None,
        typer.Option(help="The camera looks after every ply, and what is wrong is mended; in a lab it does."),
    ] = None,
    headless: Annotated[bool, typer.Option("--headless", help="Show nothing while playing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """The arm plays recorded games again, and says of every ply whether the board came out right."""
    from app.games import run_games

    settings = _settings(
        {
            "rig.name": rig, "rig.pace": pace, "rig.seed": seed, "rig.video": False, "game.replay": file,
            "game.replay_game": game, "game.from_ply": from_ply, "game.plies": plies, "vision.verify": verify,
            "out": out,
        }
    )  # fmt: skip
    _show_game(lambda face: run_games(settings, face), headless=headless, as_json=as_json)


@app.command()
def setup(
    fen: Annotated[str, typer.Option(help="The position to set up; 'start' is the usual one.")] = "start",
    standing: Annotated[str, typer.Option(help="What stands on the board now; 'start' is the usual one.")] = "start",
    rig: Annotated[str, typer.Option(help="sim, board, or the TOML file of a lab's rig.")] = "sim",
    pace: Annotated[
        str | None, typer.Option(help="real: by the wall clock, the default; fast: as fast as the machine can.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Chooses all randomness of a simulated world.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Folder of the record; games/<time> by default.")] = None,
    verify: Annotated[
        bool | None, typer.Option(help="The camera looks in the end, and what is wrong is mended; in a lab it does.")
    ] = None,
    headless: Annotated[bool, typer.Option("--headless", help="Show nothing meanwhile.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """The arm sets a position up, with the pieces on the board and beside it."""
    import chess

    from app.games import run_games

    settings = _settings(
        {
            "rig.name": rig, "rig.pace": pace, "rig.seed": seed, "rig.video": False, "game.plies": 0,
            "game.fen": chess.STARTING_FEN if fen == "start" else fen,
            "game.standing": chess.STARTING_FEN if standing == "start" else standing,
            "vision.verify": verify, "out": out,
        }
    )  # fmt: skip
    _show_game(lambda face: run_games(settings, face), headless=headless, as_json=as_json)


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="Folder of a game's record.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Compute the report of a recorded game again, from its events alone, also of one that broke off."""
    from rich.console import Console

    from app import UserError
    from app.records import EVENTS_FILE, read_events, summarise
    from app.report_table import report_table

    try:
        found = summarise(read_events(folder / EVENTS_FILE))
    except UserError as error:
        _fail(str(error))
    if as_json:
        print(found.model_dump_json(indent=2))
    else:
        Console().print(report_table(found))
    raise typer.Exit(0 if found.physical_ok is not False and not found.failures else 1)


@app.command("config")
def show_config(
    file: Annotated[Path | None, typer.Argument(help="TOML file with settings; the defaults if left out.")] = None,
) -> None:
    """Print the settings that are in force, as a TOML file that says what each of them means."""
    from app.settings_file import as_toml

    print(as_toml(_settings({}, file)), end="")


def _chosen(context: typer.Context, changes: dict[str, object], file: Path | None) -> Settings:
    """The settings of a file, if there is one, with the options that were given; without a file, with all of them.

    Args:
        context: of the command.
        changes: by dotted name; those that an option sets are left out where nobody gave it.
        file: TOML; None: none.
    """
    if file is not None:
        changes = {name: value for name, value in changes.items() if _given(context, name)}
    return _settings(changes, file)


_PARAMETERS = {
    "rig.name": "rig", "engine.move_time": "movetime", "engine.path": "engine", "white.elo": "white_elo",
    "black.elo": "black_elo", "clock.time": "clock",
}  # fmt: skip
"""Parameters of commands that are not named like the last part of the setting."""


def _given(context: typer.Context, name: str) -> bool:
    """Whether somebody has given the option of a setting; what no option sets counts as given."""
    source = context.get_parameter_source(_PARAMETERS.get(name, name.rsplit(".", 1)[-1]))
    return source is None or source.name != "DEFAULT"


def _settings(changes: dict[str, object], file: Path | None = None) -> Settings:
    from app import UserError
    from app.settings_file import settings_of

    try:
        return settings_of(changes, file)
    except UserError as error:
        _fail(str(error))


@app.command()
def resume(
    folder: Annotated[Path, typer.Argument(help="Folder of the game's record.")],
    headless: Annotated[bool, typer.Option("--headless", help="Show nothing while playing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Go on with a game that was interrupted, or whose program or controller died: first with the ply under way."""
    from app.games import resume_games

    _show_game(lambda face: resume_games(folder, face, sys.stdin), headless=headless, as_json=as_json, talks=True)


def _show_game(
    play: Callable[[Face], SessionResult], *, headless: bool, as_json: bool, talks: bool = False
) -> NoReturn:
    """Play a game before a face; ends the program."""
    from rich.console import Console

    from app import UserError
    from app.faces import Conversation, Quiet, Terminal
    from engine.errors import EngineProblem

    console = Console(stderr=True)
    for number in (signal.SIGINT, signal.SIGTERM):  # SIGINT too: a shell's background job starts with it ignored
        signal.signal(number, _interrupt)
    try:
        if headless:
            result = play(Quiet())
        else:
            with Conversation(console) if talks else Terminal(console) as terminal:
                result = play(terminal)
    except (UserError, EngineProblem) as error:
        _fail(str(error))
    except KeyboardInterrupt:
        _fail("interrupted; the arm rests and nothing that this program started is left running", 130)
    if as_json:
        print(result.report.model_dump_json(indent=2))
    if not headless:
        report = result.report
        console.print(f"{report.exit_reason}, result {report.result}, {report.plies} plies; record in {result.folder}")
    for failure in result.report.failures:
        console.print(f"[red]failed:[/] {failure.reason}", highlight=False, soft_wrap=True)
    if result.resumable:
        console.print(f"'touchmove resume {result.folder}' goes on with it", highlight=False, soft_wrap=True)
    raise typer.Exit(0 if result.holds else 1)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """Ctrl-C and SIGTERM end what runs within in good order, then the program with status 130."""
    before = {number: signal.signal(number, _interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    except KeyboardInterrupt:
        _fail("interrupted; nothing is left running", 130)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@app.command()
def controller(
    action: Annotated[
        str, typer.Argument(help="run, status, enable, hold, resume, stop, clear-fault or shutdown.")
    ] = "run",
    rig: Annotated[str, typer.Option(help="sim, or the TOML file of a lab's rig.")] = "sim",
    run_dir: Annotated[Path | None, typer.Option("--run-dir", hidden=True)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the telemetry as JSON.")] = False,
) -> None:
    """Run a rig's controller until Ctrl-C; or look at one that runs, or command it."""
    from app.processes import run_controller, run_controller_of_rig

    if run_dir is not None:
        _run(lambda: run_controller(run_dir))
    if action == "run":
        _run(lambda: run_controller_of_rig(rig, _say))
    _operate(action, rig, as_json)


def _operate(action: str, rig: str, as_json: bool) -> NoReturn:
    import json

    from rich.console import Console

    from app import UserError
    from app.operate import operate, status_json, status_table

    try:
        telemetry = operate(action, rig)
    except UserError as error:
        _fail(str(error))
    if as_json:
        print(json.dumps(status_json(telemetry), indent=2))
    else:
        Console().print(status_table(telemetry))
    raise typer.Exit(0)


def _say(step: str) -> None:
    print(f"touchmove: {step}", file=sys.stderr, flush=True)


@app.command()
def world(
    view: Annotated[
        bool, typer.Option("--view", help="Show the world of a game that runs in MuJoCo's viewer.")
    ] = False,
    game: Annotated[Path | None, typer.Argument(help="Folder of the game; the newest one if left out.")] = None,
    run_dir: Annotated[Path | None, typer.Option("--run-dir", hidden=True)] = None,
) -> None:
    """Look at a simulated world that runs; games start theirs by themselves."""
    from app.processes import run_world, view_world

    if view:
        _run(lambda: view_world(game, _say))
    if run_dir is None:
        _fail("games start their worlds by themselves: say 'touchmove world --view' to look at one that runs")
    _run(lambda: run_world(run_dir))


def _run(process: Callable[[], int]) -> NoReturn:
    from app import UserError
    from hardware.interfaces import HardwareError

    try:
        status = process()
    except (UserError, HardwareError, OSError) as error:
        _fail(str(error))
    raise typer.Exit(status)


@app.command()
def figures(
    name: Annotated[str, typer.Argument(help="5, 6, 7 or 9 of the paper, newton, encoder, workspace, touch or move.")],
    move: Annotated[str, typer.Argument(help="Drawn by figure move, SAN or UCI.")] = "e2e4",
    fen: Annotated[str | None, typer.Option(help="Figure move: in this position.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the pictures and their numbers.")] = Path("games/figures"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON.")] = False,
) -> None:
    """Compute a figure: pictures, and the numbers as JSON beside them."""
    import json

    from app import UserError
    from app.figures import make_figure
    from hardware.interfaces import HardwareError

    try:
        content = make_figure(name, out, _say, move, fen)
    except (UserError, HardwareError) as error:
        _fail(str(error))
    if as_json:
        print(json.dumps(content, indent=2))
    else:
        print(f"{content['title']}: {'holds' if content['holds'] else 'does not hold'}; pictures in {out}")
    raise typer.Exit(0 if content["holds"] else 1)


@app.command()
def bench(
    name: Annotated[
        str, typer.Argument(help="What to measure: law, loop, finger, kills, motion, sim, grip or vision.")
    ],
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions: ends within a minute.")] = False,
    photos: Annotated[
        Path | None, typer.Option(help="Labelled photographs for bench vision; else the folder in TOUCHMOVE_PHOTOS.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Measure, and say whether each bar is held."""
    from app import UserError
    from app.bench import run_bench

    try:
        with _interruptible():
            report = run_bench(name, quick, _say, photos)
    except UserError as error:
        _fail(str(error))
    if as_json:
        print(report.model_dump_json(indent=2))
    else:
        print(report.table())
    raise typer.Exit(0 if report.holds else 1)


@app.command()
def check(
    rig: Annotated[str, typer.Option(help="sim, which is started for it, or the TOML file of a lab's rig.")] = "sim",
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Try each device of a rig alone, and say what is wrong and what to do; the arm stays on its brakes."""
    from app.check import check_rig

    _show_report(lambda: check_rig(rig, _say), as_json)


@app.command()
def calibrate(
    rig: Annotated[str, typer.Option(help="sim, which is started for it, or the TOML file of a lab's rig.")] = "sim",
    out: Annotated[
        Path | None, typer.Option(help="File to write; the rig file's, or games/calibration.json, if left out.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the calibration as JSON.")] = False,
) -> None:
    """Find where the camera hangs: the arm moves over the board and shows its marker. Keep hands away."""
    from app.calibrate import run_calibrate

    _show_report(lambda: run_calibrate(rig, out, _say), as_json)


@app.command()
def vision(
    folder: Annotated[Path, typer.Argument(help="Pictures of a game in the order of their names, or a video.")],
    corners: Annotated[
        str, typer.Option(help="Where the board is: find, in the pictures; or labels, as labels.json says.")
    ] = "find",
    as_json: Annotated[bool, typer.Option("--json", help="Print events and score as JSON.")] = False,
) -> None:
    """Follow a game in photographs or a video: say what was played, and ask where that is not clear."""
    from app.seeing import CornersFrom, follow_folder

    if corners not in list(CornersFrom):
        _fail(f"'--corners {corners}' is unknown, choose from: {', '.join(CornersFrom)}")
    _show_report(lambda: follow_folder(folder, CornersFrom(corners), _say), as_json)


@app.command("link-test")
def link_test(
    rig: Annotated[
        str, typer.Option(help="sim, which is started for the test, or the TOML file of a lab's rig.")
    ] = "sim",
    duration: Annotated[float, typer.Option(min=2.0, help="How long to measure [s].")] = 10.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the checks as JSON.")] = False,
) -> None:
    """Say whether this PC and network are good enough for the controller, and what to change."""
    from app.link_test import link_test as run_link_test

    _show_report(lambda: run_link_test(rig, duration, _say), as_json)


def _show_report(
    find: Callable[[], CheckReport | LinkReport | CalibrateReport | VisionReport], as_json: bool
) -> NoReturn:
    """Find out, show it, and end the program with what it says."""
    from rich.console import Console

    from app import UserError

    try:
        with _interruptible():
            report = find()
    except UserError as error:
        _fail(str(error))
    if as_json:
        print(report.model_dump_json(indent=2))
    else:
        Console().print(report.table())
    raise typer.Exit(0 if report.holds else 1)


def main() -> None:
    """Entry point of the command."""
    app()


if __name__ == "__main__":
    main()
