"""What a campaign proves: its page, its comparison with an older one, and a gate for releases."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.ending import fail


def campaign_report(
    folder: Annotated[Path, typer.Argument(help="Folder of a campaign, also of one that goes on.")],
    compare: Annotated[
        Path | None,
        typer.Option(help="Folder of an older campaign: what became better or worse, and how sure that is."),
    ] = None,
    gate: Annotated[Path | None, typer.Option(help="TOML file of bars; status 1 when one of them is missed.")] = None,
    as_json: options.AsJson = False,
    out: Annotated[Path | None, typer.Option(help="File of the page; report.html in the folder, if left out.")] = None,
) -> None:
    """What a campaign proves, as a page: rates with bounds, figures against their bars, what explains failures."""
    from app import UserError
    from app.campaign.report.findings import findings
    from app.campaign.report.gate import load_bars
    from app.campaign.report.page import campaign_page
    from app.campaign.report.reading import read_rows
    from app.campaign.report.sentences import all_sentences
    from app.campaign.report.summary import summary_json
    from app.records.files import write_atomically
    from app.report import REPORT_PAGE

    page = folder / REPORT_PAGE if out is None else out
    try:
        bars = None if gate is None else load_bars(gate)
        older = None if compare is None else read_rows(compare)
        found = findings(read_rows(folder), older, bars)
        write_atomically(page, campaign_page(found))
    except UserError as error:
        fail(str(error))
    print(page, file=sys.stderr if as_json else sys.stdout)
    print(summary_json(found) if as_json else "\n".join(all_sentences(found)))
    raise typer.Exit(0 if found.holds else 1)
