"""Reads a campaign's rows: from its ledger, shards put together; from Parquet where that is all there is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from numpy.typing import NDArray
from pyarrow import parquet
from pydantic import ValidationError

from app import UserError
from app.campaign.report.analysis.rows import CampaignRows, RowTable
from app.campaign.schema import GAMES_FILE, LEDGERS, PLIES_FILE, GameRow, PlyRow, TaskResult


class CampaignRowsError(UserError):
    """The rows of a campaign cannot be read."""


def read_rows(folder: Path) -> CampaignRows:
    """Read what a campaign has found so far.

    Raises:
        CampaignRowsError: there is no campaign in the folder, or its rows cannot be read.
    """
    ledgers = sorted(folder.glob(LEDGERS))
    if ledgers:
        return _in_order(str(folder), *_from_ledgers(ledgers))
    if (folder / GAMES_FILE).is_file():
        return _in_order(str(folder), _from_parquet(folder / GAMES_FILE), _from_parquet(folder / PLIES_FILE))
    raise CampaignRowsError(
        f"there is no campaign in '{folder}': name the folder that 'touchmove campaign' was told by --out"
    )


def _in_order(name: str, games: RowTable, plies: RowTable) -> CampaignRows:
    games = games.where(np.argsort(games.numbers("seed"), kind="stable"))
    return CampaignRows(name, games, plies.where(np.lexsort((plies.numbers("ply"), plies.numbers("seed")))))


def _from_ledgers(ledgers: Iterable[Path]) -> tuple[RowTable, RowTable]:
    """All results of all shards; what two of them hold counts once."""
    results: dict[int, TaskResult] = {}
    for ledger in ledgers:
        for result in _results(ledger):
            results.setdefault(result.game.seed, result)
    games = [result.game.columns() for result in results.values()]
    plies = [ply.columns() for result in results.values() for ply in result.plies]
    return RowTable.of(games, _fields(GameRow)), RowTable.of(plies, _fields(PlyRow))


def _fields(row: type[GameRow | PlyRow]) -> list[str]:
    return [name for name in row.model_fields if name != "drawn"]


def _results(ledger: Path) -> Iterator[TaskResult]:
    """Line by line; a last one without an end is being written, or was cut off."""
    try:
        lines = ledger.read_bytes().split(b"\n")[:-1]
    except OSError as error:
        raise CampaignRowsError(f"'{ledger}' cannot be read: {error.strerror}: see that it is there") from error
    for number, line in enumerate(lines, start=1):
        try:
            yield TaskResult.model_validate_json(line)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(map(str, first["loc"])) or "the line"
            raise CampaignRowsError(
                f"'{ledger}' line {number} is no result of this version ({where}: {first['msg']}): read it with the "
                "version that wrote it, or take the line out"
            ) from error


def _from_parquet(file: Path) -> RowTable:
    try:
        table = parquet.read_table(file)
    except (OSError, ValueError) as error:
        said = " ".join(str(error).split())
        raise CampaignRowsError(f"'{file}' cannot be read as Parquet: {said}: make it again from the ledger") from error
    return RowTable({name: _column(table.column(name)) for name in table.column_names})


def _column(column: Any) -> NDArray[Any]:
    """Numbers and truths as numbers, NaN for null; everything else as words."""
    if not (pyarrow.types.is_string(column.type) or pyarrow.types.is_large_string(column.type)):
        return np.asarray(column.cast(pyarrow.float64()).to_numpy(), dtype=np.float64)
    found = np.empty(len(column), dtype=np.object_)
    found[:] = column.to_pylist()
    return found
