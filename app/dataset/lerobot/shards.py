"""Files that are filled up to a size, one after the other, in folders of so many: tables.

LeRobot's rule: an episode that would make a file too large, by what its frames took so far, begins the next one.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from app.records.files import RecordError, recording

MIB: Final = 1024.0 * 1024.0


@dataclass(frozen=True, slots=True)
class FilePlace:
    """Which file: its folder's number, and its own in that."""

    chunk: int = 0
    file: int = 0

    def after(self, chunk_size: int) -> FilePlace:
        """The next one."""
        return FilePlace(self.chunk + 1, 0) if self.file == chunk_size - 1 else FilePlace(self.chunk, self.file + 1)

    def path(self, root: Path, template: str, **names: str) -> Path:
        """In a dataset."""
        return root / template.format(chunk_index=self.chunk, file_index=self.file, **names)


class ParquetShards:
    """Tables of one schema; each that is written is a row group of its own.

    Args:
        root: of the dataset.
        template: of the files' names.
        schema: of the tables.
        largest: of a file [MiB].
        chunk_size: files in a folder.
    """

    def __init__(self, root: Path, template: str, schema: pa.Schema, largest: float, chunk_size: int) -> None:
        self._root, self._template, self.schema = root, template, schema
        self._largest, self._chunk_size = largest * MIB, chunk_size
        self._shard: FilePlace | None = None
        self._file: IO[bytes] | None = None
        self._writer: Any = None
        self._rows = 0
        self.paths = list[Path]()
        """Of all files so far."""

    def place(self, rows: int) -> FilePlace:
        """Where the next table of so many rows goes."""
        if self._shard is None:
            self._begin(FilePlace())
        elif self._rows and self._written() * (1.0 + rows / self._rows) >= self._largest:
            self.close()
            self._begin(self._shard.after(self._chunk_size))
        assert self._shard is not None
        return self._shard

    def write(self, columns: dict[str, Any], rows: int) -> None:
        """A table into the file of the last ``place``; raises ``RecordError`` where it cannot be written."""
        with recording(self.paths[-1]):
            self._writer.write_table(pa.table(columns, schema=self.schema))
        self._rows += rows

    def close(self) -> None:
        """End the file; a second call does nothing."""
        writer, file = self._writer, self._file
        self._writer = self._file = None
        if writer is not None and file is not None:
            with recording(self.paths[-1]), file:
                writer.close()

    def drop(self) -> None:
        """Leave the file as it is, also where there is no room for its end."""
        with suppress(RecordError):
            self.close()

    def _begin(self, shard: FilePlace) -> None:
        path = shard.path(self._root, self._template)
        with recording(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("wb")
            self._writer = pq.ParquetWriter(self._file, self.schema, compression="snappy", use_dictionary=True)
        self.paths.append(path)
        self._shard, self._rows = shard, 0

    def _written(self) -> int:
        assert self._file is not None
        return self._file.tell()
