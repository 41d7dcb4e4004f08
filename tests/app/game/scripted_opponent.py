"""An opponent who sits nowhere: what it does follows from what it is told, as a script says."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import chess

from app.game import GameEnd
from app.players.remote import (
    GameOver,
    Offer,
    OfferAnswered,
    OpponentClock,
    RemoteEvent,
    RemoteListing,
    RemoteMove,
)

Script = Callable[["ScriptedOpponent", str], Sequence[RemoteEvent]]
"""What it does when something was told to it: ``play e2e4 0``, ``stands 3``, ``offer draw``, ``resign`` …"""


def line_of(*sans: str) -> Script:
    """Plays a line of both sides' moves from the usual position, as soon as the table shows what is before each."""
    board, moves = chess.Board(), list[chess.Move]()
    for san in sans:
        moves.append(board.push_san(san))

    def answer(opponent: ScriptedOpponent, told: str) -> Sequence[RemoteEvent]:
        what, *rest = told.split()
        ply = int(rest[0]) if what == "stands" else -1
        if 0 <= ply < len(moves) and (ply % 2 == 0) is opponent.colour:
            return [RemoteMove(ply, moves[ply])]
        return []

    return answer


def ends_when_asked(opponent: ScriptedOpponent, told: str) -> Sequence[RemoteEvent]:
    """Confirms a resignation or an abort, accepts a draw, and declines to take back."""
    result = "1-0" if opponent.colour else "0-1"
    match told:
        case "resign":
            return [GameOver(GameEnd(result, "they resign", complete=True))]
        case "abort":
            return [GameOver(GameEnd("*", "aborted", complete=True))]
        case "offer draw":
            return [
                OfferAnswered(Offer.DRAW, accepted=True),
                GameOver(GameEnd("1/2-1/2", "draw agreed", complete=True)),
            ]
        case "offer take back":
            return [OfferAnswered(Offer.TAKE_BACK, accepted=False)]
        case _:
            return []


@dataclass
class ScriptedOpponent:
    """``RemoteOpponent`` by scripts, all of which hear all that it is told."""

    colour: chess.Color
    scripts: Sequence[Script]
    name: str = "Ada"
    time: OpponentClock | None = None
    claimable: bool = False
    unsaid: bool = False
    told: list[str] = field(default_factory=list)
    events: deque[RemoteEvent] = field(default_factory=deque)

    @property
    def listing(self) -> RemoteListing:
        return RemoteListing("Bob", "https://chess.example/abc", "600+5")

    def next(self, timeout: float) -> RemoteEvent | None:
        if not self.events:
            time.sleep(min(timeout, 0.01))
            return None
        return self.events.popleft()

    def play(self, ply: int, move: chess.Move, *, offers_draw: bool = False) -> None:
        self._hear(f"play {move.uci()} {ply}" + (" offering a draw" if offers_draw else ""))

    def stands(self, board: chess.Board) -> None:
        self._hear(f"stands {len(board.move_stack)}")

    def offer(self, what: Offer) -> None:
        self._hear(f"offer {what}")

    def decline(self, what: Offer) -> None:
        self._hear(f"decline {what}")

    def resign(self) -> None:
        self._hear("resign")

    def abort(self) -> None:
        self._hear("abort")

    def claim(self) -> None:
        self._hear("claim")

    def mending(self, busy: bool) -> None:
        self._hear(f"mending {busy}")

    def clock(self) -> OpponentClock | None:
        return self.time

    def _hear(self, told: str) -> None:
        self.told.append(told)
        for script in self.scripts:
            self.events.extend(script(self, told))


class Source:
    """``OpponentSource`` of given opponents."""

    def __init__(self, *opponents: ScriptedOpponent) -> None:
        self._opponents = list(opponents)

    def find(self) -> ScriptedOpponent | None:
        return self._opponents.pop(0) if self._opponents else None

    def again(self, end: GameEnd) -> bool:
        return bool(self._opponents)
