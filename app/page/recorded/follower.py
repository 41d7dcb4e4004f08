"""Follows the record of a game while it is written."""

from __future__ import annotations

from pathlib import Path

from app.page.recorded.game_fold import GameFold, RecordContradicts
from app.records.events import AnyEvent, StartEvent, read_event
from app.records.files import EVENTS_FILE, RecordError
from app.records.robot import kept_robot
from hardware.table import TableSettings


def table_of(folder: Path) -> TableSettings:
    """The table that the game of a record is played on; the usual one as long as the record does not say it."""
    try:
        robot = kept_robot(folder)
    except RecordError:  # of another version: its positions can be shown all the same
        robot = None
    return TableSettings() if robot is None else robot.table


class RecordFollower:
    """The game of a record that grows.

    Args:
        folder: of the record; it may be made later.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._path, self._table = folder / EVENTS_FILE, TableSettings()
        self.game: GameFold | None = None
        """As it stands; None: it has not begun."""
        self._offset = self._lines = 0

    def follow(self) -> tuple[AnyEvent, ...]:
        """Read what has come since; the events. A last line that is not whole yet comes later.

        Raises:
            RecordError: it cannot be read, is of another version, or contradicts itself.
        """
        try:
            size = self._path.stat().st_size
        except FileNotFoundError:
            return ()
        except OSError as error:
            raise RecordError(f"{self._path} cannot be read: {error.strerror}") from error
        if size < self._offset:  # a last line that was garbled has been taken back
            self.game, self._offset, self._lines = None, 0, 0
        if size == self._offset:
            return ()
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                whole, end, _ = file.read().rpartition(b"\n")
        except OSError as error:
            raise RecordError(f"{self._path} cannot be read: {error.strerror}") from error
        if not end:
            return ()
        self._offset += len(whole) + 1
        events = []
        for line in whole.split(b"\n"):
            self._lines += 1
            event = read_event(self._path, self._lines, line)
            self._take(event)
            events.append(event)
        if self.game is not None and (table := table_of(self.folder)) != self._table:
            self._table = self.game.table = table
        return tuple(events)

    def _take(self, event: AnyEvent) -> None:
        if self.game is None:
            if not isinstance(event, StartEvent):
                raise RecordError(f"{self._path} does not begin with the start of a game: name the folder of a record")
            try:
                self.game = GameFold(event, self._table)
            except ValueError as error:
                raise RecordError(f"{self._path} starts from no position: {error}") from error
            return
        try:
            self.game.take(event)
        except RecordContradicts as error:
            raise RecordError(f"{self._path}, line {self._lines}: {error}") from error
