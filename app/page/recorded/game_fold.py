"""A game as the page shows it, from its recorded events alone: the same while it is played and whenever it is shown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import chess

from app.analysis.openings import Opening, opening_of_game
from app.pieces.inventory import Inventory, InventoryError, Stage, Transfer
from app.pieces.manipulation import IllegalPly, NoSpare, transfers
from app.records.events import AnyEvent, EndEvent, PlyEvent, SideEvent, StartEvent
from app.records.history import RecordState, transfer_of
from hardware.piece_set import Colour
from hardware.table import PieceSpec, Place, TableSettings

UNDECIDED: Final = "*"
"""The result of a game that is not over, as in PGN."""
_DIGITS: Final = 5
"""Of places on the board: hundredths of a millimetre."""


class RecordContradicts(ValueError):
    """Events that cannot follow each other; the message says which."""


@dataclass(frozen=True, slots=True)
class RoundShown:
    """What is known of a game beside its events."""

    id: str
    """Of its record, in the page's addresses."""
    number: int = 1
    """Of the game in its match, from 1."""
    sets_up: bool = False
    """No game, but pieces that are set up for one."""
    person: Colour | None = None
    """Side of the person at the board as the game began; None: nobody plays by hand."""


class GameFold:
    """Takes the events of one game one after the other, and says how it stands.

    Args:
        start: the first event.
        table: that it is played on.
    """

    def __init__(self, start: StartEvent, table: TableSettings) -> None:
        self._start, self.table = start, table
        self._state = RecordState.after((start,), chess.Board(start.fen, chess960=start.chess960))
        self._names = {Colour.WHITE: start.white, Colour.BLACK: start.black}
        self._person: Colour | None = None
        self._end: EndEvent | None = None
        self._carried: tuple[object, tuple[Transfer, ...]] = (None, ())
        """The transfers of what is under way, and what that is."""

    @property
    def plies(self) -> tuple[PlyEvent, ...]:
        """Those that count."""
        return tuple(self._state.plies)

    @property
    def board(self) -> chess.Board:
        """The position, with the moves that led to it."""
        assert self._state.board is not None
        return self._state.board

    def take(self, event: AnyEvent) -> None:
        """One event more.

        Raises:
            RecordContradicts: it cannot follow those before.
        """
        try:
            self._state.take(event)
        except (ValueError, IndexError) as error:
            raise RecordContradicts(f"after ply {len(self._state.plies)}: {error}") from error
        self._end = event if isinstance(event, EndEvent) else None
        if isinstance(event, SideEvent):
            self._person = event.person
            self._names = {Colour.WHITE: self._names[Colour.BLACK], Colour.BLACK: self._names[Colour.WHITE]}

    def section(self, shown: RoundShown, decided: tuple[str, str] | None = None) -> dict[str, Any]:
        """The section ``game`` of the page's state (docs/page.md).

        Args:
            shown: what else is known of it.
            decided: result and reason, of a game that is over and whose record does not say so yet.
        """
        board, person = self.board, self._person or shown.person
        result, reason = decided or (UNDECIDED, None)
        if self._end is not None:
            result, reason = self._end.result, self._end.reason
        check = board.king(board.turn) if board.is_check() else None
        last = board.peek() if board.move_stack else None
        legal = dict[str, list[str]]()
        promoting = dict[tuple[str, str], None]()
        for move in board.legal_moves if reason is None else ():
            # castling is written as the king's own way, but from where another way is meant as well
            way = board.uci(move)
            source, target = way[:2], way[2:4]
            if target not in legal.setdefault(source, []):
                legal[source].append(target)
            if move.promotion is not None:
                promoting[source, target] = None
        opening = self._opening()
        return {
            "id": shown.id, "number": shown.number, "sets_up": shown.sets_up,
            "white": self._names[Colour.WHITE], "black": self._names[Colour.BLACK],
            "person": person, "start": self._start.fen, "chess960": self._start.chess960,
            "time_control": self._start.time_control, "fen": board.fen(),
            "turn": "white" if board.turn else "black", "check": None if check is None else chess.square_name(check),
            "legal": legal, "promoting": [list(way) for way in promoting],
            "last": None if last is None else _way(board, last), "moves": [_move(ply) for ply in self._state.plies],
            "result": result, "reason": reason,
            "opening": None if opening is None else opening._asdict(),
            **self.pieces(), "assists": not self._between_people(),
        }  # fmt: skip

    def pieces(self) -> dict[str, Any]:
        """Where every piece is believed to be, and which is in the fingers: the fields ``pieces`` and ``held``."""
        places, held = self._now()
        shown = [
            {"name": one.name, "kind": one.kind, "colour": one.colour, "place": places[one.name],
             "at": self._at(places[one.name])}
            for one in self._start.inventory
        ]  # fmt: skip
        return {"pieces": shown, "held": held}

    def _at(self, place: str) -> list[float] | None:
        """Where a place is on the table; None: the table has no such place, as far as the record says."""
        try:
            x, y = self.table.xy(Place.parse(place))
        except ValueError:
            return None
        return [round(x, _DIGITS), round(y, _DIGITS)]

    def _now(self) -> tuple[Mapping[str, str], str | None]:
        """Where each piece stands, by name, with what has been done of a ply or task under way; which one is held."""
        places, unfinished = dict(self._state.places), self._state.unfinished
        if unfinished is None or unfinished.transfer is None:
            return places, None
        carried = self._under_way()
        for done in carried[: unfinished.transfer]:
            places[done.name] = str(done.target)
        if unfinished.transfer >= len(carried):  # the way home after the last one
            return places, None
        now = carried[unfinished.transfer]
        if unfinished.stage in (Stage.RELEASE, Stage.RETURN):
            places[now.name] = str(now.target)
        return places, now.name if unfinished.stage is Stage.CARRY else None

    def _under_way(self) -> tuple[Transfer, ...]:
        """The transfers of the ply, task or repair that was begun last."""
        unfinished = self._state.unfinished
        assert unfinished is not None
        if unfinished.repair is not None:
            return unfinished.repair
        if unfinished.task is not None:
            return tuple(transfer_of(one) for one in unfinished.task.transfers)
        if unfinished.uci is None:
            return ()
        key = (len(self._state.plies), unfinished.uci)
        if self._carried[0] != key:
            self._carried = key, self._planned(unfinished.uci)
        return self._carried[1]

    def _planned(self, uci: str) -> tuple[Transfer, ...]:
        """What the arm carries for a move, as it planned it from the same inventory; nothing where that does not go."""
        places = self._state.places
        try:
            inventory = Inventory.of(
                (PieceSpec(p.name, p.kind, p.colour, Place.parse(places[p.name])) for p in self._start.inventory),
                self.table,
            )
            return transfers(self.board, self.board.parse_uci(uci), inventory).transfers
        except (ValueError, IllegalPly, InventoryError, NoSpare):
            return ()  # a record that contradicts itself still shows its positions

    def _opening(self) -> Opening | None:
        """Of the last position of the game that has a name."""
        found = opening_of_game(self.board)
        return None if found is None else found[0]

    def _between_people(self) -> bool:
        """Nor is anybody helped in a game that is played at a server, which has a site."""
        elsewhere = self._start.site != NOWHERE
        return elsewhere or self._names[Colour.WHITE] == self._names[Colour.BLACK] == PERSON


NOWHERE: Final = "?"
"""The site of a game that is played at this table alone."""
PERSON: Final = "Human"
"""A person's name in a record, where they gave none."""


def fold(events: Iterable[AnyEvent], table: TableSettings) -> GameFold:
    """A game after all of its events.

    Raises:
        RecordContradicts: there are none, or they do not begin with a start, or contradict each other.
    """
    events = iter(events)
    start = next(events, None)
    if not isinstance(start, StartEvent):
        raise RecordContradicts("the record does not begin with the start of a game")
    game = GameFold(start, table)
    for event in events:
        game.take(event)
    return game


def _way(board: chess.Board, last: chess.Move) -> list[str]:
    """From where to where a move went that was made: castling as the king goes."""
    before = board.copy()
    before.pop()
    way = before.uci(last)
    return [way[:2], way[2:4]]


def _move(ply: PlyEvent) -> dict[str, Any]:
    """A ply that counts, for the list of moves."""
    return {
        "ply": ply.ply, "san": ply.san, "uci": ply.uci, "fen": ply.fen, "by": ply.by, "kind": ply.kind,
        "seconds": ply.real_s, "clock": ply.clock_s, "score": ply.score,
        "frame": None if ply.frame is None else ply.frame.rpartition("/")[2],
    }  # fmt: skip
