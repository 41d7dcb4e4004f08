"""The results of a campaign as they come in: one line of JSON each, written by one program alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final, Self

from pydantic import ValidationError

from app import UserError
from app.campaign.schema import LEDGERS, SCHEMA_VERSION, TaskResult
from app.records.files import LineLog, recording, whole_lines

_NAME: Final = LEDGERS.replace("*", "{}")


class LedgerError(UserError):
    """A ledger is no such, or of another version."""


class Shard(tuple[int, int]):
    """One of several equal parts of a campaign: its number from 1, and of how many."""

    __slots__ = ()

    @classmethod
    def parse(cls, text: str) -> Shard:
        """``2/8``.

        Raises:
            LedgerError: it is no such.
        """
        number, _, parts = text.partition("/")
        if number.isdecimal() and parts.isdecimal() and 1 <= int(number) <= int(parts):
            return cls((int(number), int(parts)))
        most = int(parts) if parts.isdecimal() and int(parts) else 8
        raise LedgerError(f"--shard is '{text}': say which part of how many, from 1/{most} to {most}/{most}")

    def indices(self, games: int) -> range:
        """Its tasks; those of all shards together are all of the campaign's, none of them twice."""
        number, parts = self
        return range(number - 1, games, parts)

    @property
    def ledger(self) -> str:
        """Name of its file."""
        return _NAME.format("" if self == WHOLE else f"-{self[0]}-of-{self[1]}")


WHOLE: Final = Shard((1, 1))


class Ledger:
    """Grows by a line a result; a context manager. What a crash cut short is taken back at the next start.

    Attributes:
        done: indices of tasks that have a result.
        before: rows of the games that had one at the beginning.
    """

    def __init__(self, path: Path) -> None:
        """Open it, or begin it.

        Raises:
            LedgerError: something in it is no result.
            RecordError: it cannot be written, or another program writes it.
        """
        self._log = LineLog(path, go_on=True)
        try:
            self.before = tuple(result.game for result in results_in(path))
        except BaseException:
            self._log.close()
            raise
        self.done = {game.index for game in self.before}

    def add(self, result: TaskResult) -> bool:
        """Write a result down; whether it is the first of its task: another one changes nothing.

        Raises:
            RecordError: there is no room; the lines before it stay whole.
        """
        if result.game.index in self.done:
            return False
        # a power cut may lose the last ones, which are then played again, to the same end: nobody waits for the disk
        self._log.append(result.model_dump_json(), durable=False)
        self.done.add(result.game.index)
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._log.close()


def results_in(path: Path) -> Iterator[TaskResult]:
    """The results of a ledger, in the order in which they came in; a last line that was cut short is left out.

    Raises:
        LedgerError: a line is damaged, or of another version.
        RecordError: it cannot be read.
    """
    with recording(path):
        lines, _ = whole_lines(path.read_bytes())
    for number, line in enumerate(lines, start=1):
        try:
            yield TaskResult.model_validate_json(line)
        except ValidationError as error:
            raise LedgerError(f"{path}: line {number} {_explained(error)}") from error


def _explained(problem: ValidationError) -> str:
    errors = problem.errors(include_url=False)
    other = next((error["input"] for error in errors if error["loc"][-1:] == ("schema_version",)), None)
    if other is not None:
        return f"is of version {other} and not {SCHEMA_VERSION}: read it with a program of the version that wrote it"
    first = errors[0]
    what = "" if first["type"] == "json_invalid" else f" ({'.'.join(map(str, first['loc']))}: {first['msg']})"
    return f"is damaged{what}: remove that line, and its game is played again"


def ledgers_in(folder: Path) -> tuple[Path, ...]:
    """Of all shards."""
    return tuple(sorted(folder.glob(LEDGERS)))
