"""A campaign's results as Parquet, made from its ledgers line by line, so that memory does not grow with them."""

from __future__ import annotations

import os
import time
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any, Final, Self

import pyarrow
from pyarrow import parquet
from pydantic import BaseModel

from app.campaign.folder import one_at_a_time
from app.campaign.ledger import ledgers_in, results_in
from app.campaign.schema import DRAWN, GAMES_FILE, PLIES_FILE, SCHEMA_VERSION, GameRow, PlyRow, TaskResult
from app.campaign.spec import CampaignSpec, ChoiceRange
from app.records.files import recording

BATCH: Final = 256
"""Games at a time."""
EVERY: Final = 180.0
"""The tables are made anew so often [s, wall] …"""
SHARE: Final = 0.01
"""… and at most for this share of the time."""
_ARROW: Final = {int: pyarrow.int64(), float: pyarrow.float64(), str: pyarrow.string(), bool: pyarrow.bool_()}


def write_tables(folder: Path, spec: CampaignSpec) -> None:
    """Make ``games.parquet`` and ``plies.parquet`` anew from all ledgers of a campaign; old ones stay until then.

    Raises:
        UserError: there is no room, or a ledger is damaged.
    """
    with one_at_a_time(folder):
        games, plies = (
            _Table(folder / GAMES_FILE, games_schema(spec)),
            _Table(folder / PLIES_FILE, arrow_schema(PlyRow)),
        )
        with recording(folder), games, plies:
            for batch in _batches(_unique(folder)):
                games.add([result.game.columns() for result in batch])
                plies.add([ply.columns() for result in batch for ply in result.plies])


class GrowingTables:
    """Parquet as it grows."""

    def __init__(self, folder: Path, spec: CampaignSpec) -> None:
        self._folder, self._spec = folder, spec
        self._next = time.monotonic() + EVERY

    def write_if_due(self) -> None:
        """Not more often than it is worth."""
        since = time.monotonic()
        if since >= self._next:
            self.write()
            took = time.monotonic() - since
            self._next = time.monotonic() + max(EVERY, took / SHARE)

    def write(self) -> None:
        """From all ledgers."""
        write_tables(self._folder, self._spec)


def games_schema(spec: CampaignSpec) -> pyarrow.Schema:
    """Of a campaign's games: those of every one, and a column a range."""
    drawn = [pyarrow.field(DRAWN + name, _drawn_type(one)) for name, one in spec.ranges.items()]
    whole = arrow_schema(GameRow)
    return pyarrow.schema([*whole, *drawn], metadata=whole.metadata)


def arrow_schema(row: type[BaseModel]) -> pyarrow.Schema:
    """Of a model whose fields are numbers, words and truths."""
    columns = [
        pyarrow.field(name, _arrow(field.annotation), nullable=type(None) in typing.get_args(field.annotation))
        for name, field in row.model_fields.items()
        if typing.get_origin(field.annotation) is not dict
    ]
    return pyarrow.schema(columns, metadata={"touchmove_campaign": str(SCHEMA_VERSION)})


def _arrow(kind: Any) -> pyarrow.DataType:
    if typing.get_origin(kind) in (typing.Union, types.UnionType, typing.Annotated, typing.Literal):
        first = typing.get_args(kind)[0]
        return _arrow(first if isinstance(first, type) else type(first))
    return pyarrow.string() if issubclass(kind, StrEnum) else _ARROW[kind]


def _drawn_type(one: Any) -> pyarrow.DataType:
    words = isinstance(one, ChoiceRange) and any(isinstance(value, str) for value in one.one_of)
    return pyarrow.string() if words else pyarrow.float64()


def _unique(folder: Path) -> Iterator[TaskResult]:
    seen: set[int] = set()
    for ledger in ledgers_in(folder):
        for result in results_in(ledger):
            if result.game.index not in seen:
                seen.add(result.game.index)
                yield result


def _batches(results: Iterator[TaskResult]) -> Iterator[list[TaskResult]]:
    batch: list[TaskResult] = []
    for result in results:
        batch.append(result)
        if len(batch) == BATCH:
            yield batch
            batch = []
    if batch:
        yield batch


class _Table:
    """A Parquet file that replaces the one before as a whole, once it is whole itself."""

    def __init__(self, path: Path, schema: pyarrow.Schema) -> None:
        self._path, self._schema = path, schema
        self._part = path.with_name(path.name + ".part")

    def __enter__(self) -> Self:
        self._writer = parquet.ParquetWriter(self._part, self._schema, compression="zstd")
        return self

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write some rows."""
        if rows:
            columns = {name: [row.get(name) for row in rows] for name in self._schema.names}
            words = {name for name in columns if pyarrow.types.is_string(self._schema.field(name).type)}
            columns = {n: [v if v is None else str(v) for v in c] if n in words else c for n, c in columns.items()}
            self._writer.write_table(pyarrow.table(columns, schema=self._schema))

    def __exit__(self, failed: object, *_: object) -> None:
        try:
            self._writer.close()
            if failed is None:
                with self._part.open("rb") as file:
                    os.fsync(file.fileno())
                self._part.replace(self._path)
        finally:
            self._part.unlink(missing_ok=True)
