"""Campaigns: many games drawn by seed, what they prove, and any of them once more."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.ending import fail, say

if TYPE_CHECKING:
    from app.campaign.running import CampaignSummary, CampaignWish
    from app.campaign.spec import CampaignSpec

_RUN = "run"


class _FileFirst(TyperGroup):
    """``touchmove campaign FILE …`` runs it; what is no command of the group is a file."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in self.commands and args[0] != "--help":
            args = [_RUN, *args]
        return super().parse_args(ctx, args)


campaign = typer.Typer(
    cls=_FileFirst, no_args_is_help=True, pretty_exceptions_enable=False, rich_markup_mode=None,
    help="Play many games drawn by seed over ranges: touchmove campaign FILE.toml --games N. Report, repeat any.",
)  # fmt: skip


@campaign.command(_RUN)
def run(
    file: Annotated[Path, typer.Argument(help="TOML file of the campaign; docs/campaign.md says what is in it.")],
    games: Annotated[int, typer.Option(min=1, max=2**53, help="Games in all; a larger number later goes on.")],
    output: Annotated[
        Path | None,
        options.output("Folder of the campaign; campaigns/<name of the file> by default.", "--out"),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Games at a time on this machine; its cores by default.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, such as tcp://host:8786: its workers play.")
    ] = None,
    shard: Annotated[str, typer.Option(help="Only one of several equal parts, for job arrays: 2/8.")] = "1/1",
    keep: Annotated[str, typer.Option(help="Folders of which games are kept: all, failed or none.")] = "failed",
    as_json: options.AsJson = False,
) -> None:
    """Run a campaign, or go on with it. Ctrl-C loses no finished game."""
    from app import UserError
    from app.campaign.folder import load_spec
    from app.campaign.ledger import Shard
    from app.campaign.running import CampaignWish
    from app.campaign.workers.order import Kept

    if keep not in list(Kept):
        fail(f"'--keep {keep}' is unknown, choose from: {', '.join(Kept)}")
    if workers is not None and scheduler is not None:
        fail("--workers is for this machine, and --scheduler has workers of its own: leave one of them out")
    folder = Path("campaigns") / file.stem if output is None else output
    try:
        wish = CampaignWish(games, folder, workers, scheduler, Shard.parse(shard), Kept(keep))
        summary = _run(load_spec(file), wish)
    except UserError as error:
        fail(str(error))
    _tell(summary, wish, as_json)
    raise typer.Exit(0 if summary.holds else 1)


def _run(spec: CampaignSpec, wish: CampaignWish) -> CampaignSummary:
    from rich.console import Console

    from app.campaign.progress import CampaignProgress
    from app.campaign.running import run_campaign

    try:
        with CampaignProgress(Console(stderr=True)) as shown:
            return run_campaign(spec, wish, shown)
    except KeyboardInterrupt:
        if not (wish.folder / wish.shard.ledger).exists():
            fail("interrupted before anything was played; nothing is still running", 130)
        fail(f"interrupted; what was played is in {wish.folder}, and the same command goes on", 130)


def _tell(summary: CampaignSummary, wish: CampaignWish, as_json: bool) -> None:
    for game in summary.failed:
        say(f"seed {game.seed} {game.outcome}: {game.reason}")
        say(f"  again: touchmove campaign repeat {summary.folder} {game.seed} --film")
    counts = ", ".join(f"{number} {outcome}" for outcome, number in sorted(summary.outcomes.items()))
    if summary.games:
        say(f"{summary.done} of {summary.games} games: {counts or 'none'}")
    else:
        number, parts = wish.shard
        say(f"part {number} of {parts} is empty: there are fewer games than parts; choose more --games, or fewer parts")
    print(summary.model_dump_json(indent=2) if as_json else summary.folder)


@campaign.command()
def repeat(
    folder: Annotated[Path, typer.Argument(help="Folder of the campaign.")],
    seed: Annotated[int, typer.Argument(min=0, help="Of the game.")],
    film: Annotated[bool, typer.Option("--film", help="Film it from its beginning to its end.")] = False,
    output: Annotated[
        Path | None,
        options.output("Folder of the repeated game; games/<seed>-again of the campaign by default.", "--out"),
    ] = None,
    as_json: options.AsJson = False,
) -> None:
    """Play one game of a campaign again, alone, and say whether it came to the same to the last bit."""
    from app import UserError
    from app.campaign.repeating import repeat_seed, usual_output

    try:
        found = repeat_seed(folder, seed, output or usual_output(folder, seed), film, lambda _drawn, _whole: None)
    except UserError as error:
        fail(str(error))
    except KeyboardInterrupt:
        fail("interrupted; nothing is left running", 130)
    for sentence in found.sentences():
        say(sentence)
    print(found.model_dump_json(indent=2) if as_json else found.folder)
    raise typer.Exit(0 if found.holds else 1)


@campaign.command("report")
def campaign_report(
    folder: Annotated[Path, typer.Argument(help="Folder of a campaign, also of one that goes on.")],
    compare: Annotated[
        Path | None,
        typer.Option(help="Folder of an older campaign: what became better or worse, and how sure that is."),
    ] = None,
    gate: Annotated[Path | None, typer.Option(help="TOML file of bars; status 1 when one of them is missed.")] = None,
    as_json: options.AsJson = False,
    out: Annotated[
        Path | None,
        options.output("File of the page; report.html in the folder, if left out."),
    ] = None,
) -> None:
    """What a campaign proves, as a page: rates with bounds, figures against their bars, what explains failures."""
    from app import UserError
    from app.campaign.report.findings import findings
    from app.campaign.report.gate import load_bars
    from app.campaign.report.page import KIND, MARK, campaign_page
    from app.campaign.report.reading import read_rows
    from app.campaign.report.sentences import all_sentences
    from app.campaign.report.summary import summary_json
    from app.records.files import check_output, write_atomically
    from app.report import REPORT_PAGE

    page = folder / REPORT_PAGE if out is None else out
    try:
        bars = None if gate is None else load_bars(gate)
        older = None if compare is None else read_rows(compare)
        rows = read_rows(folder)
        check_output(page, KIND, MARK)
        found = findings(rows, older, bars)
        write_atomically(page, campaign_page(found))
    except UserError as error:
        fail(str(error))
    print(page, file=sys.stderr if as_json else sys.stdout)
    print(summary_json(found) if as_json else "\n".join(all_sentences(found)))
    raise typer.Exit(0 if found.holds else 1)
