"""Two robots in one process, without sockets: what they say goes through sealed lines, and can be cut at any time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path

import chess

from app.linked.errors import LinkBroken
from app.linked.log import LinkedLog
from app.linked.messages import Message, message_of
from app.linked.opponent import LinkedOpponent, new_game
from app.linked.peer import LinkedPeer
from app.linked.sealing import Handshake, Opener, Sealer
from app.linked.secret import LinkSecret
from app.players.remote import GameOver, Notice, RemoteEvent, RemoteMove, TakenBack
from app.settings.defaults import LinkRole

SECRET = LinkSecret(b"k" * 32)
HOST, GUEST = LinkRole.HOST, LinkRole.GUEST


class Clockwork:
    """Monotonic time that a test moves on."""

    def __init__(self) -> None:
        self.time = 0.0

    def __call__(self) -> float:
        return self.time


class Robot:
    """One end: a table that does what the loop would do, at once."""

    def __init__(self, folder: Path, role: LinkRole, now: Callable[[], float], start: str = chess.STARTING_FEN) -> None:
        self.folder, self.role, self.now = folder, role, now
        self.table = chess.Board(start)
        self.events: list[RemoteEvent] = []
        self.over: GameOver | None
        folder.mkdir(exist_ok=True)
        self.open()

    def open(self) -> None:
        self.log = LinkedLog(self.folder, go_on=True)
        self.peer = LinkedPeer(self.log, self.role, f"engine of the {self.role}", self.now)
        self.opponent = LinkedOpponent(self.peer, self.now)
        self.stood, self.over = False, None

    def kill(self, *, table: int = 0) -> None:
        """End the program as ``kill -9`` does, and start it again; the table had not yet carried out the last plies."""
        self.log.__exit__()
        for _ in range(min(table, len(self.table.move_stack))):
            self.table.pop()
        self.open()

    def heed(self) -> None:
        """What the loop does between two plies."""
        if self.peer.log.state.begin is None or self.over is not None:
            return
        if not self.stood:
            self.opponent.stands(self.table)
            self.stood = True
        while self.over is None and (event := self.opponent.next(0.0)) is not None:
            self.take(event)

    def take(self, event: RemoteEvent) -> None:
        self.events.append(event)
        match event:
            case RemoteMove(ply, move):
                if ply < len(self.table.move_stack) and self.table.move_stack[ply] == move:
                    return
                assert ply == len(self.table.move_stack), "no ply is lost or doubled"
                assert self.table.is_legal(move)
                self.table.push(move)
                self.opponent.stands(self.table)
            case TakenBack(plies):
                while len(self.table.move_stack) > plies:
                    self.table.pop()
                self.opponent.stands(self.table)
            case GameOver():
                while event.plies is not None and len(self.table.move_stack) > event.plies:
                    self.table.pop()
                self.over = event

    def move(self, move: chess.Move | str, *, offers_draw: bool = False) -> None:
        """Decide on a move, tell it, and carry it out."""
        move = chess.Move.from_uci(move) if isinstance(move, str) else move
        self.opponent.play(len(self.table.move_stack), move, offers_draw=offers_draw)
        self.table.push(move)
        self.opponent.stands(self.table)

    def said(self) -> list[str]:
        return [event.sentence for event in self.events if isinstance(event, Notice)]


class Wire:
    """Between two robots."""

    def __init__(self, host: Robot, guest: Robot) -> None:
        self.robots = {HOST: host, GUEST: guest}
        self.lines: dict[LinkRole, deque[bytes]] = {HOST: deque(), GUEST: deque()}
        """By who shall hear them."""
        self.up = False
        self._nonce = 0
        self._openers = dict[LinkRole, Opener]()

    def connect(self) -> None:
        self.up, self._nonce = True, self._nonce + 1
        shake = Handshake.of(SECRET, b"guest %d" % self._nonce, b"host", "g", "h")
        self._openers = {role: shake.opener(role.other) for role in LinkRole}
        for role, robot in self.robots.items():
            robot.peer.connected(self._sender(role.other, shake.sealer(role)))

    def cut(self) -> None:
        """What is under way is lost."""
        self.up = False
        for role, robot in self.robots.items():
            self.lines[role].clear()
            robot.peer.disconnected()

    def deliver(self, role: LinkRole) -> None:
        """One line to a robot, if one is under way."""
        if self.lines[role]:
            line = self.lines[role].popleft()
            self.robots[role].peer.received(message_of(self._openers[role].open(line)))

    def settle(self) -> None:
        """Until nobody has anything to say any more."""
        while True:
            for robot in self.robots.values():
                robot.heed()
            if not any(self.lines.values()):
                return
            for role in LinkRole:
                self.deliver(role)

    def _sender(self, to: LinkRole, sealer: Sealer) -> Callable[[Message], None]:
        return lambda message: self.lines[to].append(sealer.seal(message.model_dump_json().encode()))


def pair(
    folder: Path, *, fen: str = chess.STARTING_FEN, clock: str | None = None, plies: int = 300,
    now: Callable[[], float] | None = None,
) -> tuple[Robot, Robot, Wire]:  # fmt: skip
    """A host that plays White, a guest, and the wire between them, connected."""
    now = now or Clockwork()
    host, guest = (Robot(folder / role, role, now, fen) for role in LinkRole)
    host.peer.begin(new_game(fen, chess960=False, host_is_white=True, clock=clock, plies=plies))
    wire = Wire(host, guest)
    wire.connect()
    wire.settle()
    return host, guest, wire


def refused(act: Callable[[], object]) -> bool:
    """Whether that breaks the link."""
    try:
        act()
    except LinkBroken:
        return True
    return False
