"""Options of the commands that play: each sets one field of the settings, and has one text wherever it stands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.ending import fail, say

if TYPE_CHECKING:
    from app.settings.tree import Settings

Rig = Annotated[str, typer.Option(help="sim, board, or the TOML file of a lab's rig.")]
Pace = Annotated[
    str | None, typer.Option(help="real: by the wall clock, the default; fast: as fast as the machine can.")
]
Processes = Annotated[
    str,
    typer.Option(
        help="Pace fast: together, world and controller in one process, the fastest; separate: each in its own. Both "
        "come to the same."
    ),
]
Drives = Annotated[
    str,
    typer.Option(
        help="What moves the simulated arm: sim, drives of its own; moteus or ethercat, emulated ones by their real "
        "driver, in pace real."
    ),
]
Profile = Annotated[
    str | None,
    typer.Option(
        help="How the arm moves: default, fast, gentle (children in reach), minimum-jerk, or separation: fast while "
        "the guard sees nobody near. Left out: separation where a simulation is guarded, else default."
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Chooses the opening of two engines and all randomness of the world.")]
Square = Annotated[
    float | None,
    typer.Option(help="Side of a square of the simulated board [mm]; a larger board stands nearer to the robot."),
]
Pads = Annotated[str, typer.Option(help="What the fingers end in: grooved or flat.")]
Captured = Annotated[
    str | None,
    typer.Option(help="Where captured pieces go: tray, the default, to places of their own; box: dropped."),
]
Randomise = Annotated[
    Path | None, typer.Option(help="TOML file: how the simulation differs from what the game believes of it.")
]
Ideal = Annotated[
    bool,
    typer.Option(
        "--ideal",
        help="The simulated robot, table and camera are just as the game believes, instead of mildly off as in a lab.",
    ),
]
Linger = Annotated[
    float, typer.Option(min=0.0, help="If this program is killed: how long the arm waits for another [s].")
]
Port = Annotated[int, typer.Option(min=0, max=65535, help="UDP port of the controller; 0: any free one.")]
Cameras = Annotated[
    bool, typer.Option(help="The simulation is drawn; without, no OpenGL is needed, and nothing is seen or filmed.")
]
Video = Annotated[bool, typer.Option(help="Film the first part of the game.")]
VideoLength = Annotated[float, typer.Option(min=1.0, help="Longest film, in plant time [s].")]

Fen = Annotated[str | None, typer.Option(help="Start from this position.")]
FromBoard = Annotated[
    bool,
    typer.Option(
        "--from-board",
        help="Start from what stands on the board: the camera tells the pieces, you whose move it is.",
    ),
]
Chess960 = Annotated[
    bool, typer.Option("--chess960", help="Castling by the rules of Chess960, from wherever king and rooks start.")
]
Moves = Annotated[str | None, typer.Option(help='Play this line (SAN or UCI), e.g. "e4 d5 exd5".')]
Plies = Annotated[int, typer.Option(min=1, help="End each game after so many plies.")]
Games = Annotated[int, typer.Option(min=1, help="So many games; the arm sets the pieces up in between.")]
ReplayGame = Annotated[int | None, typer.Option(min=1, help="Only this game of the file.")]
FromPly = Annotated[int, typer.Option(min=1, help="Begin with this ply.")]

EnginePath = Annotated[str | None, typer.Option(help="Path of a UCI engine; Stockfish by default.")]
WhiteEngine = Annotated[str | None, typer.Option(help="Path of White's own UCI engine.")]
BlackEngine = Annotated[str | None, typer.Option(help="Path of Black's own UCI engine.")]
WhiteElo = Annotated[int | None, typer.Option(help="Strength of White; full strength if not given.")]
BlackElo = Annotated[int | None, typer.Option(help="Strength of Black; full strength if not given.")]
MoveTime = Annotated[
    float | None,
    typer.Option(min=0.001, help="Thinking time per move [s]; 0.2 where there is no clock, else the longest."),
]
Nodes = Annotated[int | None, typer.Option(min=1, help="Think so many nodes instead: a run then repeats exactly.")]
Book = Annotated[Path | None, typer.Option(help="Opening book in Polyglot's format.")]
WhiteBook = Annotated[Path | None, typer.Option(help="White's own opening book.")]
BlackBook = Annotated[Path | None, typer.Option(help="Black's own opening book.")]
Clock = Annotated[str | None, typer.Option(help="Time control such as 5+3; no clock if not given.")]
WhiteClock = Annotated[str | None, typer.Option(help="White's own time control.")]
BlackClock = Annotated[str | None, typer.Option(help="Black's own time control.")]
Verify = Annotated[
    bool | None, typer.Option(help="The camera looks after every ply, and what is wrong is mended; in a lab it does.")
]
Guard = Annotated[
    bool | None,
    typer.Option(help="The camera watches for hands, and the arm stops while one is over the board; in a lab it does."),
]
Speak = Annotated[bool, typer.Option("--speak", help="Moves and requests are spoken aloud, by espeak-ng.")]
Page = Annotated[
    bool | None,
    typer.Option(
        help="Shown in a browser as well, at the address that is printed, which is so unless --no-page says no; with "
        "--page a game against a person waits for a browser where nobody types.",
    ),
]
PagePort = Annotated[
    int | None, typer.Option(min=0, max=65535, help="TCP port of the page, 8064 or any free one by default.")
]
Out = Annotated[Path | None, typer.Option(help="Folder of the record; games/<time> by default.")]
Config = Annotated[
    Path | None,
    typer.Option(help="TOML file with settings, as 'touchmove config' prints it; options count for more."),
]
Headless = Annotated[bool, typer.Option("--headless", help="Show nothing meanwhile.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the report as JSON.")]


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
