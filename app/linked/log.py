"""The record that both robots agree on: entries, each checked against those before it, on the disk before they count.

Digests are chained, so that two robots that have the same digest after an entry have the same record up to there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import chess
from pydantic import ValidationError

from app import UserError
from app.game.clock import ChessClock
from app.linked.errors import LinkBroken, LinkError
from app.linked.messages import ENTRY, BeginEntry, EndEntry, Entry, MoveEntry, TakeBackEntry
from app.records.files import LineLog, whole_lines
from app.settings.defaults import LinkRole
from app.settings.time_control import TimeControl

LOG_FILE: Final = "link.jsonl"
"""In the folder of a match."""
FIRST_DIGEST: Final = hashlib.sha256(b"touchmove game").hexdigest()
"""Of a record without entries."""


@dataclass(frozen=True, slots=True)
class LinkedState:
    """Where the games stand after an entry.

    Attributes:
        begin: of the game under way or last played; None: none was begun.
        board: with its moves; not to be changed.
        ended: how it was ended, where that does not follow from the board.
        clock: between two moves; None: the game is played without.
    """

    begin: BeginEntry | None = None
    board: chess.Board = field(default_factory=chess.Board)
    ended: EndEntry | None = None
    clock: ChessClock | None = None

    @property
    def over(self) -> bool:
        """Whether no move can follow."""
        begin = self.begin
        if begin is None or self.ended is not None or len(self.board.move_stack) >= begin.plies:
            return True
        return self.board.outcome() is not None

    @property
    def ended_by_players(self) -> bool:
        """Whether the game has its result, and is not only broken off after so many plies."""
        return self.ended is not None or self.board.outcome() is not None

    @property
    def writer(self) -> LinkRole:
        """Who writes the next entry."""
        return LinkRole.HOST if self.begin is None or self.over else self.plays(self.board.turn)

    def plays(self, colour: chess.Color) -> LinkRole:
        """Who plays a colour in the game that was begun."""
        assert self.begin is not None, "no game was begun"
        return LinkRole.HOST if self.begin.host_is_white is colour else LinkRole.GUEST

    def colour(self, role: LinkRole) -> chess.Color:
        """Of a robot in the game that was begun."""
        return self.plays(chess.WHITE) is role

    def after(self, entry: Entry) -> LinkedState:
        """With an entry more.

        Raises:
            LinkBroken: it cannot follow.
        """
        match entry:
            case BeginEntry():
                return self._begun(entry)
            case MoveEntry():
                return self._moved(entry)
            case TakeBackEntry():
                return self._taken_back(entry)
            case EndEntry():
                if self.over:
                    raise LinkBroken("the other robot ends a game that is over: the link is taken up anew")
                return replace(self, ended=entry)

    def _begun(self, entry: BeginEntry) -> LinkedState:
        if not self.over:
            raise LinkBroken("the other robot begins a game while one is under way: the link is taken up anew")
        try:
            board = chess.Board(entry.fen, chess960=entry.chess960)
            control = None if entry.clock is None else TimeControl.parse(entry.clock)
        except (ValueError, UserError) as error:
            raise LinkBroken(f"the game of the other robot cannot be begun here: {error}") from error
        if not board.is_valid():
            raise LinkBroken("the game of the other robot begins with no legal position: it has to choose another")
        return LinkedState(entry, board, None, None if control is None else ChessClock.new(control))

    def _moved(self, entry: MoveEntry) -> LinkedState:
        move = chess.Move.from_uci(entry.uci)
        if self.over or entry.ply != len(self.board.move_stack) or not self.board.is_legal(move):
            raise LinkBroken(f"{entry.uci} cannot be ply {entry.ply + 1} of this game: the link is taken up anew")
        clock = self.clock
        if clock is not None:
            clock = clock.start(self.board.turn, 0.0).press(entry.thought)
        board = self.board.copy()
        board.push(move)
        return replace(self, board=board, clock=clock)

    def _taken_back(self, entry: TakeBackEntry) -> LinkedState:
        back = len(self.board.move_stack) - entry.plies
        if self.over or back <= 0:
            raise LinkBroken(f"the game cannot be taken back to ply {entry.plies}: the link is taken up anew")
        board = self.board.copy()
        for _ in range(back):
            board.pop()
        return replace(self, board=board, clock=None if self.clock is None else self.clock.take_back(back))


class LinkedLog:
    """The entries of a match on the disk. A context manager; one program at a time has it open."""

    def __init__(self, folder: Path, *, go_on: bool = False) -> None:
        """Open the record of a match.

        Args:
            folder: of the match; it exists.
            go_on: there is a record already.

        Raises:
            LinkError: it cannot be read, or contradicts itself.
            RecordError: it cannot be written.
        """
        path = folder / LOG_FILE
        self._file = LineLog(path, go_on=go_on)
        self.entries: list[Entry] = []
        self.state = LinkedState()
        """After all entries."""
        self.digests, self.fens, self.plies = [FIRST_DIGEST], [self.state.board.fen()], [0]
        """After so many entries each: digest of the record, position, and plies of the game under way."""
        try:
            for line in whole_lines(path.read_bytes())[0]:
                entry = ENTRY.validate_json(line)
                self._take(entry, self.state.after(entry))
        except (ValidationError, LinkBroken) as error:
            self._file.close()
            raise LinkError(
                f"line {len(self.entries) + 1} of {path} does not belong to this game: nothing can go on with it; "
                "begin a new one"
            ) from error

    def __enter__(self) -> LinkedLog:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __len__(self) -> int:
        return len(self.entries)

    def require_next(self, entries: Sequence[Entry], digest: str | None = None) -> None:
        """Make sure that these can follow, and lead to that digest; nothing changes.

        Raises:
            LinkBroken: they cannot.
        """
        state, head = self.state, self.digests[-1]
        for entry in entries:
            state, head = state.after(entry), digest_after(head, entry)
        if digest is not None and digest != head:
            raise LinkBroken("the records of the two robots differ: look at both, and begin a new game")

    def append(self, entry: Entry) -> None:
        """Write an entry; it is on the disk when this returns.

        Raises:
            LinkBroken: it cannot follow; nothing changes.
            RecordError: it cannot be written.
        """
        state = self.state.after(entry)
        self._file.append(entry.model_dump_json())
        self._take(entry, state)

    def _take(self, entry: Entry, state: LinkedState) -> None:
        self.digests.append(digest_after(self.digests[-1], entry))
        self.fens.append(state.board.fen())
        self.plies.append(len(state.board.move_stack))
        self.entries.append(entry)
        self.state = state


def digest_after(digest: str, entry: Entry) -> str:
    """Of a record with an entry more."""
    return hashlib.sha256(f"{digest} {entry.model_dump_json()}".encode()).hexdigest()
