"""Options of the commands that play: each sets one field of the settings, and has one text wherever it stands."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from app.cli.ending import fail, say


def _written(text: str | Path) -> Path:
    """What an option names that is to be written; an empty name, as of a shell's unset variable, means nothing."""
    if not str(text).strip():
        raise ValueError("name a file or folder, or leave the option out")
    return Path(text)


def output(explained: str, *names: str) -> Any:
    """An option that names a file or folder to be written."""
    return typer.Option(*names, parser=_written, metavar="PATH", help=explained)


if TYPE_CHECKING:
    from app.settings.defaults import Settings

Rig = Annotated[str, typer.Option(help="sim, board, or the TOML file of a lab's rig.")]
Pace = Annotated[
    str | None, typer.Option(help="real, the default: by the wall clock; fast: as fast as the machine can.")
]
Processes = Annotated[
    str,
    typer.Option(
        help="In pace fast: together: world and controller in one process, fastest; separate: each in its own process. "
        "The results are identical."
    ),
]
Drives = Annotated[
    str,
    typer.Option(
        help="Drives of the simulated arm: sim: the simulation's own; moteus or ethercat: emulated drives behind their "
        "real driver, in pace real."
    ),
]
Profile = Annotated[
    str | None,
    typer.Option(
        help="How the arm moves: default, fast, gentle (children in reach), minimum-jerk, or separation (fast while "
        "the guard sees nobody near). If left out: separation in a guarded simulation, otherwise default."
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed for the opening of two engines and all randomness of the world.")]
Square = Annotated[
    float | None,
    typer.Option(help="Side of a square of the simulated board [mm]; larger boards stand nearer to the robot."),
]
Pads = Annotated[str, typer.Option(help="Finger pads: grooved or flat.")]
Captured = Annotated[
    str | None,
    typer.Option(
        help="Where captured pieces go: tray, the default: onto places of their own; box: dropped into a box."
    ),
]
Randomise = Annotated[
    Path | None, typer.Option(help="TOML file that says how the simulation differs from what the game believes.")
]
Ideal = Annotated[
    bool,
    typer.Option(
        "--ideal",
        help="Robot, table and camera of the simulation match exactly what the game believes, without a lab's errors.",
    ),
]
Linger = Annotated[
    float, typer.Option(min=0.0, help="How long the arm waits for another program if this one is killed [s].")
]
Port = Annotated[int, typer.Option(min=0, max=65535, help="UDP port of the controller; 0: any free one.")]
Cameras = Annotated[
    bool, typer.Option(help="Draw the simulation. --no-cameras needs no OpenGL, but then nothing is seen or filmed.")
]
Video = Annotated[bool, typer.Option(help="Film the first part of the game.")]
VideoLength = Annotated[float, typer.Option(min=1.0, help="Maximum length of the film, in plant time [s].")]

Fen = Annotated[str | None, typer.Option(help="Start from this position.")]
FromBoard = Annotated[
    bool,
    typer.Option(
        "--from-board",
        help="Start from what stands on the board: the camera identifies the pieces, you say whose move it is.",
    ),
]
Chess960 = Annotated[
    bool, typer.Option("--chess960", help="Castle by the rules of Chess960, from wherever king and rooks start.")
]
Moves = Annotated[str | None, typer.Option(help='Play this line (SAN or UCI), e.g. "e4 d5 exd5".')]
Plies = Annotated[int, typer.Option(min=1, help="End each game after this many plies.")]
Games = Annotated[int, typer.Option(min=1, help="Number of games; the arm sets up the pieces in between.")]
ReplayGame = Annotated[int | None, typer.Option(min=1, help="Play only this game of the file.")]
FromPly = Annotated[int, typer.Option(min=1, help="Begin with this ply.")]

Odds = Annotated[
    str | None,
    typer.Option(
        help="The robot, or White where two engines play, begins without a piece: pawn, knight, bishop, rook or queen."
    ),
]
Coach = Annotated[
    bool, typer.Option("--coach", help="At a blunder of yours, offer to take it back, and say why in one sentence.")
]
Repertoire = Annotated[
    Path | None,
    typer.Option(help="PGN file with variations: the robot plays by it, and says where you have left it."),
]

EnginePath = Annotated[str | None, typer.Option(help="Path of a UCI engine; Stockfish by default.")]
WhiteEngine = Annotated[str | None, typer.Option(help="Path of White's own UCI engine.")]
BlackEngine = Annotated[str | None, typer.Option(help="Path of Black's own UCI engine.")]
WhiteElo = Annotated[int | None, typer.Option(help="Strength of White in Elo, from 400; full strength if not given.")]
BlackElo = Annotated[int | None, typer.Option(help="Strength of Black in Elo, from 400; full strength if not given.")]
MoveTime = Annotated[
    float | None,
    typer.Option(min=0.001, help="Thinking time per move [s], 0.2 without a clock; with a clock, the maximum."),
]
Nodes = Annotated[
    int | None,
    typer.Option(min=1, help="Search this many nodes instead of thinking for a time; a run then repeats exactly."),
]
Book = Annotated[Path | None, typer.Option(help="Opening book in Polyglot's format.")]
WhiteBook = Annotated[Path | None, typer.Option(help="White's own opening book.")]
BlackBook = Annotated[Path | None, typer.Option(help="Black's own opening book.")]
Syzygy = Annotated[
    Path | None,
    typer.Option(help="Folder with Syzygy endgame tables: they end games of two engines, and give hints to people."),
]
Clock = Annotated[str | None, typer.Option(help="Time control such as 5+3; no clock if not given.")]
WhiteClock = Annotated[str | None, typer.Option(help="White's own time control.")]
BlackClock = Annotated[str | None, typer.Option(help="Black's own time control.")]
Verify = Annotated[
    bool | None,
    typer.Option(help="Check the board with the camera after every ply and repair errors; on by default in a lab."),
]
Guard = Annotated[
    bool | None,
    typer.Option(
        help="Watch for hands with the camera and stop the arm while one is over the board; on by default in a lab."
    ),
]
Speak = Annotated[bool, typer.Option("--speak", help="Speak moves and requests aloud, with espeak-ng.")]
SpeakingVoice = Annotated[str, typer.Option("--voice", help="The language it speaks: english or german.")]
Microphone = Annotated[
    bool,
    typer.Option("--microphone", help="Take moves and requests that are spoken in English, such as 'computer, e4'."),
]
Page = Annotated[
    bool | None,
    typer.Option(
        help="Show the game in a browser as well, at the address that is printed; on by default. With an explicit "
        "--page, a game against a person waits for a browser if there is no terminal.",
    ),
]
PagePort = Annotated[
    int | None, typer.Option(min=0, max=65535, help="TCP port of the page; by default 8064, or any free one.")
]
Out = Annotated[Path | None, output("Folder of the record; games/<time> by default.")]
Config = Annotated[
    Path | None,
    typer.Option(help="TOML file with settings, as 'touchmove config' prints it; options override it."),
]
Headless = Annotated[bool, typer.Option("--headless", help="Show nothing while playing.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the report as JSON.")]

Group = Mapping[str, tuple[Any, Any]]
"""Options that commands have in common: by parameter, what they are and their default."""
RIG: Final[Group] = MappingProxyType({
    "rig": (Rig, "sim"), "pace": (Pace, None), "drives": (Drives, "sim"), "profile": (Profile, None),
    "seed": (Seed, 1), "ideal": (Ideal, False),
})  # fmt: skip
PROCESSES: Final[Group] = MappingProxyType({"processes": (Processes, "together")})
SIGHT: Final[Group] = MappingProxyType({
    "verify": (Verify, None), "guard": (Guard, None), "cameras": (Cameras, True),
})  # fmt: skip
ENGINE: Final[Group] = MappingProxyType({
    "movetime": (MoveTime, None), "nodes": (Nodes, None), "book": (Book, None), "engine": (EnginePath, None),
})  # fmt: skip
VOICE: Final[Group] = MappingProxyType({"speak": (Speak, False), "voice": (SpeakingVoice, "english")})
TALK: Final[Group] = MappingProxyType({**VOICE, "microphone": (Microphone, False)})
RECORD: Final[Group] = MappingProxyType({
    "page": (Page, None), "page_port": (PagePort, None), "out": (Out, None), "config": (Config, None),
    "as_json": (AsJson, False),
})  # fmt: skip
UNSEEN: Final[Group] = MappingProxyType({"headless": (Headless, False)})


def shared(*groups: Group, **more: tuple[Any, Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of some groups besides those of its own signature.

    What it does not name itself it finds in its context, as ``settings_of_command`` does.
    """
    wanted = {name: option for group in (*groups, more) for name, option in group.items()}

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True).parameters
        others = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=what)
            for name, (what, default) in wanted.items()
            if name not in own
        ]

        @functools.wraps(command)
        def called(**values: Any) -> None:
            command(**{name: value for name, value in values.items() if name in own})

        parameters = [*own.values(), *others]
        called.__annotations__ = {one.name: one.annotation for one in parameters}
        vars(called)["__signature__"] = inspect.Signature(parameters)
        return called

    return with_options


def settings_of_command(context: typer.Context, file: Path | None, also: Mapping[str, Any] | None = None) -> Settings:
    """The settings of a command: a file's, if there is one, changed by the options that somebody gave; else by all.

    An option that would change nothing ends the program with a sentence; of a file, which may serve several commands,
    the same is only said.

    Args:
        context: of the command; its parameters are looked up among the options of the settings.
        file: TOML; None: none.
        also: further changes by dotted name, or other values for those that an option has set.
    """
    from app.settings.options import OPTIONS, changed_fields, without_effect

    refuse_unseen_page(context)
    parameters = {option.parameter: option.field for option in OPTIONS.values()}
    changes = {
        parameters[name]: value
        for name, value in context.params.items()
        if name in parameters and (file is None or given(context, name))
    }
    settings = settings_or_end({**changes, **(also or {})}, file)
    named = [field for name, field in parameters.items() if name in context.params and given(context, name)]
    for sentence in without_effect(settings, named):
        fail(sentence)
    if file is not None:
        for sentence in without_effect(settings, changed_fields(settings)):
            say(sentence)
    return settings


def refuse_unseen_page(context: typer.Context) -> None:
    """End the program with a sentence where the page is asked for and nothing is to be shown."""
    if context.params.get("headless") and context.params.get("page"):
        fail("--headless shows nothing, so --page would have no effect: leave one of them out")


def given(context: typer.Context, name: str) -> bool:
    """Whether somebody has given the option of a parameter."""
    source = context.get_parameter_source(name)
    return source is not None and source.name != "DEFAULT"


def settings_or_end(changes: Mapping[str, Any], file: Path | None = None) -> Settings:
    """The settings of a file with changes by dotted name; ends the program with a sentence if one is impossible."""
    from app import UserError
    from app.settings.files import settings_of

    try:
        return settings_of(changes, file)
    except UserError as error:
        fail(str(error))
