"""Commands for learning at the board."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import app.cli.options as options  # noqa: PLR0402 - the package itself imports this module
from app.cli.audience import page_of_command, show_game
from app.cli.games import games_of


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
