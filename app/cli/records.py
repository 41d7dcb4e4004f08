"""What is made of a record, whenever it is wanted: the report, the analysis, the film."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Annotated

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.ending import fail, interruptible, say


def report(
    folder: Annotated[Path, typer.Argument(help="Folder of a game's record.")],
    as_json: options.AsJson = False,
    as_html: Annotated[
        bool,
        typer.Option("--html", help="Write it as a page, report.html in the folder; for a match, one per round."),
    ] = False,
) -> None:
    """Compute the report of a recorded game again from its events, even if the game broke off."""
    from rich.console import Console

    from app import UserError
    from app.records import EVENTS_FILE, read_events, summarise
    from app.terminal.report_table import report_table

    try:
        found = summarise(read_events(folder / EVENTS_FILE, say))
        pages = _report_pages(folder) if as_html else ()
    except UserError as error:
        fail(str(error))
    for page in pages:
        print(page, file=sys.stderr if as_json else sys.stdout)
    if as_json:
        print(found.model_dump_json(indent=2))
    elif not as_html:
        Console(markup=False).print(report_table(found))
    raise typer.Exit(0 if found.physical_ok is not False and not found.failures else 1)


def _report_pages(folder: Path) -> tuple[Path, ...]:
    from app.report import write_report_pages  # loads OpenCV: not where only numbers are asked for

    return write_report_pages(folder)


def analyse(
    file: Annotated[Path, typer.Argument(help="PGN file with one or more games, or the folder of a recorded game.")],
    nodes: Annotated[
        int | None,
        typer.Option(
            min=1, max=(1 << 63) - 1, help="Positions searched for each position of the game; 100000 by default."
        ),
    ] = None,
    movetime: Annotated[
        float | None, typer.Option(min=0.001, max=3600.0, help="Time for each position instead [s].")
    ] = None,
    lines: Annotated[
        int, typer.Option(min=1, max=10, help="Best lines of each position; more than one share its nodes or time.")
    ] = 1,
    engine: options.EnginePath = None,
    out: Annotated[
        Path | None,
        options.output("Folder for the files; by default where the game lies."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the analysis as JSON.")] = False,
) -> None:
    """An engine evaluates every move of a game, names mistakes and says why, as JSON and PGN."""
    from app import UserError
    from app.analysis.analyses import analyse_games
    from app.analysis.evaluating import NODES, AnalysisSettings
    from app.terminal.analysis_table import analysis_text
    from engine.errors import EngineProblem

    if nodes is not None and movetime is not None:
        fail("--nodes and --movetime both limit the search: leave one of them out")
    settings = AnalysisSettings(engine=engine, nodes=nodes or NODES, move_time=movetime, lines=lines)
    try:
        with interruptible():
            found = analyse_games(file, settings, out, say)
    except (UserError, EngineProblem) as error:
        fail(str(error))
    if as_json:
        print(found.analyses.model_dump_json(indent=2))
    else:
        for game in found.analyses.games:
            print(analysis_text(game))
    for path in found.files:
        print(path, file=sys.stderr if as_json else sys.stdout)


def film(
    folder: Annotated[
        Path, typer.Argument(help="Folder of the game, which may still be running or have broken off.", exists=True)
    ],
    camera: Annotated[
        str, typer.Option(help="film, camera, or viewpoint and target [m], such as 0.5,-0.6,0.4:0,0,0.1.")
    ] = "film",
    size: Annotated[str, typer.Option(help="Width and height [px].")] = "640x480",
    begin: Annotated[float, typer.Option("--from", min=0.0, help="Start this long after the first picture [s].")] = 0.0,
    length: Annotated[float | None, typer.Option(min=0.1, help="Maximum length [s].")] = None,
    fine: Annotated[bool, typer.Option("--fine", help="Smooth edges and shadows; takes three times as long.")] = False,
    output: Annotated[
        Path | None,
        options.output("WebM file to write; if left out, in the folder."),
    ] = None,
) -> None:
    """Draw a film of a simulated game from the positions in its record. Ctrl-C cancels it."""
    from pydantic import ValidationError

    from app import UserError
    from app.play.match import match_of
    from app.rig.simulation.film import FilmWish, default_output, draw_film, positions_of, standpoint
    from app.terminal.progress_bar import progress_bar

    sides = re.fullmatch(r"(\d{1,5})x(\d{1,5})", size)
    if sides is None:
        fail(f"'--size {size}' is not a size: write it as 640x480")
    try:
        folder = match_of(folder)
        view = standpoint(camera)
        wish = FilmWish(
            positions=positions_of(folder), output=output or default_output(folder, view), camera=view,
            width=int(sides[1]), height=int(sides[2]), begin=begin, length=length, fine=fine,
        )  # fmt: skip
        with interruptible(), progress_bar("film", "{task.completed:.0f} of {task.total:.0f} s") as tell:
            draw_film(wish, tell)
    except ValidationError as error:
        fail(f"'--size {size}': {error.errors()[0]['msg']}; both sides must be even, from 16 to 4096")
    except UserError as error:
        fail(str(error))
    print(wish.output)
