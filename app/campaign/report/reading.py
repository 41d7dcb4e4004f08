"""Reads a campaign's rows: from its ledgers, shards put together; from Parquet where that is all there is."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from numpy.typing import NDArray
from pyarrow import parquet

from app import UserError
from app.campaign.folder import CAMPAIGN_FILE, KeptCampaign, kept_campaign
from app.campaign.ledger import ledgers_in, results_in
from app.campaign.report.analysis.rows import CampaignRows, RowTable
from app.campaign.report.wording import counted
from app.campaign.schema import GAMES_FILE, PLIES_FILE, SCHEMA_VERSION, GameRow, PlyRow, TaskOutcome, TaskResult
from app.settings.toml import ConfigError


class CampaignRowsError(UserError):
    """The rows of a campaign cannot be read."""


def read_rows(folder: Path) -> CampaignRows:
    """Read what a campaign has found so far, also while it goes on, and though its file cannot be read any more.

    Raises:
        UserError: there is no campaign in the folder, or its rows cannot be read.
    """
    if ledgers_in(folder):
        games, plies = _from_ledgers(folder)
    elif (folder / GAMES_FILE).is_file():
        games, plies = _from_parquet(folder / GAMES_FILE, GameRow), _from_parquet(folder / PLIES_FILE, PlyRow)
        _require_games(folder / GAMES_FILE, games)
        _require_plies(folder / PLIES_FILE, plies, games)
    else:
        raise CampaignRowsError(
            f"there is no result of a campaign in '{folder}': name a folder that 'touchmove campaign' was told by --out"
        )
    games = games.where(np.argsort(games.numbers("seed"), kind="stable"))
    plies = plies.where(np.lexsort((plies.numbers("ply"), plies.numbers("seed"))))
    kept, unread = _kept(folder)
    wanted = None if kept is None else kept.games
    return _by_the_arm(CampaignRows(str(folder), games, plies, wanted, kept, unread))


def _kept(folder: Path) -> tuple[KeptCampaign | None, str]:
    """What the folder is the campaign of, or why its file cannot be read: a release may draw by other names."""
    if not (folder / CAMPAIGN_FILE).is_file():
        return None, ""
    try:
        return kept_campaign(folder), ""
    except ConfigError as error:
        return None, str(error)


def _by_the_arm(rows: CampaignRows) -> CampaignRows:
    """With the worst placement of each game among the plies that the arm made: the column has also people's."""
    placed, game = np.where(rows.by_arm, rows.plies.numbers("error_mm"), np.nan), rows.game_of_plies()
    worst = np.full(len(rows.games), np.nan)
    np.fmax.at(worst, game[game >= 0], placed[game >= 0])
    return replace(rows, games=RowTable({**rows.games.columns, "placement_max_mm": worst}))


def _from_ledgers(folder: Path) -> tuple[RowTable, RowTable]:
    """All results of all shards; what two of them hold counts once."""
    results: dict[int, TaskResult] = {}
    for ledger in ledgers_in(folder):
        for result in results_in(ledger):
            results.setdefault(result.game.index, result)
    games = [result.game.columns() for result in results.values()]
    plies = [ply.columns() for result in results.values() for ply in result.plies]
    return RowTable.of(games, _fields(GameRow)), RowTable.of(plies, _fields(PlyRow))


def _fields(row: type[GameRow | PlyRow]) -> list[str]:
    return [name for name in row.model_fields if name != "drawn"]


def _from_parquet(file: Path, row: type[GameRow | PlyRow]) -> RowTable:
    if not file.is_file():
        raise CampaignRowsError(f"'{file}' is missing: copy it from where the campaign was played, beside {GAMES_FILE}")
    try:
        table = parquet.read_table(file)
    except (OSError, ValueError) as error:
        said = " ".join(str(error).split())
        raise CampaignRowsError(f"'{file}' cannot be read as Parquet: {said}: make it again from the ledger") from error
    rows = RowTable({name: _column(file, name, table.column(name)) for name in table.column_names})
    newer = rows.numbers("schema_version") > SCHEMA_VERSION
    if newer.any():
        raise CampaignRowsError(
            f"'{file}' is of a newer version than {SCHEMA_VERSION}: read it with the one that wrote it"
        )
    missing = [name for name in _fields(row) if name not in rows.columns]
    if missing:
        raise CampaignRowsError(
            f"'{file}' has no column {missing[0]}, so it does not hold what it is named after: make it again from the "
            "ledger"
        )
    return rows


def _require_games(file: Path, games: RowTable) -> None:
    """Each game has a seed of its own and an outcome that there is: with another it would count as one that held."""
    _require_seeds(file, games)
    seeds, counts = np.unique(games.numbers("seed"), return_counts=True)
    if np.any(counts > 1):
        seed = int(seeds[counts > 1][0])
        raise CampaignRowsError(f"'{file}' has more than one game of seed {seed}: make it again from the ledger")
    outcomes = set(TaskOutcome)
    for outcome in games.words("outcome"):
        if outcome not in outcomes:
            has = "without an outcome" if outcome is None else f"of outcome '{outcome}'"
            raise CampaignRowsError(
                f"'{file}' has a game {has}, and there are {', '.join(TaskOutcome)}: make it again from the ledger"
            )


def _require_plies(file: Path, plies: RowTable, games: RowTable) -> None:
    """The plies are those of the games, none of them twice."""
    _require_seeds(file, plies)
    found = Counter(plies.numbers("seed").tolist())
    told = dict(zip(games.numbers("seed").tolist(), games.numbers("plies").tolist(), strict=True))
    for seed in (*told, *found):
        if found[seed] != told.get(seed, 0.0):
            raise CampaignRowsError(
                f"'{file}' has {found[seed]} plies of seed {seed:.0f}, and {GAMES_FILE} says {told.get(seed, 0.0):g}: "
                "make both again from the ledger"
            )


def _require_seeds(file: Path, rows: RowTable) -> None:
    seeds = rows.numbers("seed")
    wrong = ~np.isfinite(seeds) | (seeds != np.floor(seeds)) | (seeds < 0.0)
    if wrong.any():
        raise CampaignRowsError(
            f"'{file}' has {counted(int(wrong.sum()), 'row')} whose seed is no whole number from 0: make it again from "
            "the ledger"
        )


def _column(file: Path, name: str, column: Any) -> NDArray[Any]:
    """Numbers and truths as numbers, NaN for null; everything else as words."""
    if not (pyarrow.types.is_string(column.type) or pyarrow.types.is_large_string(column.type)):
        try:
            return np.asarray(column.cast(pyarrow.float64()).to_numpy(), dtype=np.float64)
        except pyarrow.ArrowException as error:
            raise CampaignRowsError(
                f"'{file}' has a column {name} of {column.type}, which is neither numbers nor words: make it again "
                "from the ledger"
            ) from error
    found = np.empty(len(column), dtype=np.object_)
    found[:] = column.to_pylist()
    return found
