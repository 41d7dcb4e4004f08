"""Commands that compute and measure: figures, benches, games seen in photographs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.ending import fail, say, show_report


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
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions: ends within a minute.")] = False,
    photos: Annotated[
        Path | None, typer.Option(help="Labelled photographs for bench vision; else the folder in TOUCHMOVE_PHOTOS.")
    ] = None,
    watchers: Annotated[
        int,
        typer.Option(
            min=0, max=32, help="Bench loop: once more with a page, and so many browsers that watch arm and camera."
        ),
    ] = 0,
    standard_cycle: Annotated[
        bool, typer.Option("--standard-cycle", help="Bench motion: industry's pick cycle, 25/305/25 mm and back.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Measure, and say whether each bar is held."""
    from app.measure.bench import run_bench

    show_report(lambda: run_bench(name, quick, say, photos, watchers, standard_cycle=standard_cycle), as_json)


def vision(
    folder: Annotated[Path, typer.Argument(help="Pictures of a game in the order of their names, or a video.")],
    corners: Annotated[
        str, typer.Option(help="Where the board is: find, in the pictures; or labels, as labels.json says.")
    ] = "find",
    as_json: Annotated[bool, typer.Option("--json", help="Print events and score as JSON.")] = False,
) -> None:
    """Follow a game in photographs or a video: say what was played, and ask where that is not clear."""
    from app.measure.photographs import CornersFrom, follow_folder

    if corners not in list(CornersFrom):
        fail(f"'--corners {corners}' is unknown, choose from: {', '.join(CornersFrom)}")
    show_report(lambda: follow_folder(folder, CornersFrom(corners), say), as_json)
