"""What was played, as demonstrations for robot learning."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.ending import fail, interruptible, say
from app.dataset.wish import RATES, DatasetFormat, DatasetWish

if TYPE_CHECKING:
    from app.dataset.making import DatasetReport

_SIZE = f"{DatasetWish.width}x{DatasetWish.height}"
_NONE = "none"


def dataset(
    folder: Annotated[
        Path, typer.Argument(help="Folder of a game, a match, a campaign, or of several games.", exists=True)
    ],
    output: Annotated[
        Path,
        options.output("Folder of the dataset, which must not be there yet.", "--out"),
    ],
    form: Annotated[
        DatasetFormat, typer.Option("--format", help="lerobot: LeRobot's v3.0; mcap: one file an episode.")
    ] = DatasetWish.format,
    fps: Annotated[
        int, typer.Option(min=RATES[0], max=RATES[1], help="Frames a second of plant time.")
    ] = DatasetWish.fps,
    view: Annotated[
        list[str] | None,
        typer.Option(
            help="What is drawn, again for each view: camera, film, or from where at what [m], as "
            "0.5,-0.6,0.4:0,0,0.1; none: no pictures. camera, if left out."
        ),
    ] = None,
    size: Annotated[str, typer.Option(help="Width and height of pictures [px].")] = _SIZE,
    fine: Annotated[bool, typer.Option("--fine", help="Smooth edges and shadows; takes three times as long.")] = False,
    failures: Annotated[bool, typer.Option("--failures", help="Also plies that went wrong.")] = False,
    as_json: options.AsJson = False,
) -> None:
    """Make a dataset for robot learning of recorded games: an episode a ply. Ctrl-C leaves nothing of it."""
    from app import UserError

    sides = re.fullmatch(r"(\d{1,5})x(\d{1,5})", size)
    if sides is None:
        fail(f"'--size {size}' is no size, say it as {_SIZE}")
    if view is not None and _NONE in view and len(view) > 1:
        fail(f"--view {_NONE} is said beside other views: leave it out, or them")
    views: dict[str, Any] = {} if view is None else {"views": tuple(one for one in view if one != _NONE)}
    try:
        wish = DatasetWish(
            source=folder, output=output, format=form, fps=fps, width=int(sides[1]), height=int(sides[2]), fine=fine,
            failures=failures, **views,
        )  # fmt: skip
    except ValueError as error:
        fail(f"'--size {size}': {error}")
    try:
        report = _made(wish)
    except UserError as error:
        fail(str(error))
    _tell(report, as_json)


def _made(wish: DatasetWish) -> DatasetReport:
    from app.dataset.making import make_dataset  # loads what reads telemetry and draws
    from app.terminal.progress_bar import progress_bar

    with interruptible(), progress_bar("dataset", "{task.completed:.0f}/{task.total:.0f} plies") as tell:
        return make_dataset(wish, tell, say)


def _tell(report: DatasetReport, as_json: bool) -> None:
    from app.campaign.report.wording import counted

    for sentence in report.skipped:
        say(f"left out: {sentence}")
    if report.left_out:
        say("left out: " + ", ".join(f"plies that {why}: {number}" for why, number in report.left_out.items()))
    say(
        f"{counted(report.episodes, 'episode')} of {counted(report.games, 'game')}, {report.frames} frames, "
        f"{report.size_bytes / 1e6:.1f} MB, in {report.wall_s:.0f} s"
    )
    print(report.model_dump_json(indent=2) if as_json else report.output)
