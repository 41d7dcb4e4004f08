"""Commands that compute and measure: figures, benches, games seen in photographs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.ending import fail, say, show_report


def figures(
    name: Annotated[
        str, typer.Argument(help="Paper's figure 5, 6, 7 or 9; newton, encoder, workspace, touch, separation or move.")
    ],
    move: Annotated[str, typer.Argument(help="For figure move: the move to draw, SAN or UCI.")] = "e2e4",
    fen: Annotated[str | None, typer.Option(help="For figure move: the position.")] = None,
    out: Annotated[Path, options.output("Folder for the pictures and their numbers.")] = Path("games/figures"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON.")] = False,
) -> None:
    """Compute a figure: pictures, and their numbers as JSON."""
    import json

    from app import UserError
    from app.measure.names import FIGURES, require_name

    try:
        require_name("figure", name, FIGURES)
    except UserError as error:
        fail(str(error))
    from app.measure.figures import make_figure
    from hardware.interfaces import HardwareError

    try:
        content = make_figure(name, out, say, move, fen)
    except (UserError, HardwareError) as error:
        fail(str(error))
    if as_json:
        print(json.dumps(content, indent=2))
    else:
        print(f"{content['title']}: {'holds' if content['holds'] else 'does not hold'}; pictures in {out}")
    raise typer.Exit(0 if content["holds"] else 1)


def bench(
    name: Annotated[
        str,
        typer.Argument(
            help="What to measure: law, loop, finger, kills, motion, sim, grip, fallen, recovery, people, knocks, "
            "vision, clock, drives, pictures, identify, commission or campaign."
        ),
    ],
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions; takes less than a minute.")] = False,
    photos: Annotated[
        Path | None,
        typer.Option(help="For bench vision: labelled photographs; if left out, the folder in TOUCHMOVE_PHOTOS."),
    ] = None,
    watchers: Annotated[
        int,
        typer.Option(
            min=0,
            max=32,
            help="For bench loop: measure again with a page and this many browsers that watch arm and camera.",
        ),
    ] = 0,
    standard_cycle: Annotated[
        bool, typer.Option("--standard-cycle", help="For bench motion: industry's pick cycle, 25/305/25 mm and back.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Measure, and say whether each requirement is met."""
    from app import UserError
    from app.measure.names import BENCHES, require_name

    try:
        require_name("bench", name, BENCHES)
    except UserError as error:
        fail(str(error))
    from app.measure.bench import run_bench

    show_report(lambda: run_bench(name, quick, say, photos, watchers, standard_cycle=standard_cycle), as_json)


def vision(
    folder: Annotated[
        Path, typer.Argument(help="Folder with pictures of a game in order of their names, or with a video.")
    ],
    corners: Annotated[
        str, typer.Option(help="The board's corners: find: in the pictures; labels: from labels.json.")
    ] = "find",
    as_json: Annotated[bool, typer.Option("--json", help="Print events and score as JSON.")] = False,
) -> None:
    """Follow a game in photographs or a video: say what was played, and ask if it is unclear."""
    from app.measure.photographs import CornersFrom, follow_folder

    if corners not in list(CornersFrom):
        fail(f"'--corners {corners}' is unknown, choose from: {', '.join(CornersFrom)}")
    show_report(lambda: follow_folder(folder, CornersFrom(corners), say), as_json)
