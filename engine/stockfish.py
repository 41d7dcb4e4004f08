"""Stockfish, or any UCI engine, as a player: strength, limits, and a deadline of our own on every call.

An engine that hangs, dies, answers illegally or breaks the protocol is killed, restarted once and asked again.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import NamedTuple, Self, TypeVar

import chess
import chess.engine
from pydantic import BaseModel, ConfigDict, PositiveFloat, PositiveInt

from engine.errors import EngineFailed, EngineMissing, EngineRefused
from engine.process import Misbehaved, UciProcess

T = TypeVar("T")

DEBIAN_PATH = "/usr/games/stockfish"
"""Where Debian installs Stockfish; not on the PATH of every account."""

ATTEMPTS = 2

_TOLD = chess.engine.INFO_BASIC | chess.engine.INFO_SCORE


class EngineSettings(BaseModel):
    """How one engine plays."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    path: str | None = None
    """The binary; None looks for ``stockfish`` on PATH, then where Debian puts it."""
    elo: PositiveInt | None = None
    """Playing strength by UCI_LimitStrength, within the engine's own limits; None is full strength."""
    threads: PositiveInt = 1
    hash_mb: PositiveInt = 64
    """Size of the hash table [MiB]."""
    move_time: PositiveFloat | None = None
    """Thinking time of a move [s]."""
    nodes: PositiveInt | None = None
    """Positions searched for a move."""
    deadline: PositiveFloat = 30.0
    """Wall time [s] granted beyond the time that a limit names, or in all where it names none."""
    start_deadline: PositiveFloat = 10.0
    """Wall time [s] for each step of starting: process and handshake, options."""

    @property
    def limit(self) -> chess.engine.Limit:
        """Limit of a move by these settings; empty when neither time nor nodes are set."""
        return chess.engine.Limit(time=self.move_time, nodes=self.nodes)

    @property
    def repeatable(self) -> bool:
        """Whether the same line comes out each time after ``new_game``.

        Time depends on the load of the machine, Elo draws from a generator seeded by the clock, and several threads
        race each other: what is left is a node limit at full strength on one thread.
        """
        return self.nodes is not None and self.move_time is None and self.elo is None and self.threads == 1


@dataclass(frozen=True, slots=True)
class EngineMove:
    """A legal move and what the engine said of it; None where it said nothing."""

    move: chess.Move
    ponder: chess.Move | None
    """Reply that the engine expects."""
    score: chess.engine.PovScore | None
    depth: int | None
    """Search depth [plies]."""
    nodes: int | None
    """Positions searched."""
    wall: float
    """Wall time from question to answer, a restart included [s]."""


class Candidate(NamedTuple):
    """One of the best moves of a position and its score."""

    move: chess.Move
    score: chess.engine.PovScore


def find_engine(path: str | None = None) -> str:
    """Path of the binary to start.

    Raises:
        EngineMissing: it is not there or not executable; says how to get one.
    """
    found = shutil.which(path) if path else shutil.which("stockfish") or shutil.which(DEBIAN_PATH)
    if found:
        return found
    if path:
        raise EngineMissing(
            f"engine {path!r} is no executable file: name another one with --engine PATH, "
            "or install Stockfish with 'sudo apt-get install stockfish' and leave --engine out"
        )
    raise EngineMissing(
        f"Stockfish was found neither on PATH nor at {DEBIAN_PATH}: "
        "install it with 'sudo apt-get install stockfish' or name it with --engine PATH"
    )


def thinking_time(limit: chess.engine.Limit, turn: chess.Color) -> float | None:
    """Longest time [s] that a limit leaves to the side to move; None where it names no time."""
    clock = limit.white_clock if turn == chess.WHITE else limit.black_clock
    named = [max(0.0, seconds) for seconds in (limit.time, clock) if seconds is not None]
    return min(named, default=None)


class Engine:
    """An engine that plays; a context manager. One thread at a time may ask, any thread, and any may close it."""

    def __init__(self, settings: EngineSettings) -> None:
        self.settings = settings
        self._lock = threading.Lock()
        self._path: str | None = None
        self._process: UciProcess | None = None
        self._game = object()

    def open(self) -> Self:
        """Find, start and configure the engine, so that what is wrong shows here.

        Raises:
            EngineMissing: no binary.
            EngineRefused: the engine does not offer a setting, or not that value.
            EngineFailed: it could not be started, twice.
        """
        self._path = find_engine(self.settings.path)
        self._ask("starting", lambda process: None)
        return self

    def close(self) -> None:
        """End the process at once, also while another thread asks. Harmless when already done."""
        with self._lock:
            self._path = None
        self._drop()

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """Process id of the running engine; None while there is none."""
        return self._process.pid if self._process else None

    def new_game(self) -> None:
        """Forget the game so far: the next question clears hash and histories first."""
        self._game = object()

    def choose(self, board: chess.Board, limit: chess.engine.Limit | None = None) -> EngineMove:
        """The engine's move, always a legal one.

        Args:
            board: the position with its history; left as it is.
            limit: for this move, such as the chess clock's; None takes the settings'.

        Returns:
            At the latest after twice the time of the limit and the deadline, and one more start.

        Raises:
            EngineRefused: the game is over, nothing limits the search, or the engine is not open.
            EngineFailed: hung, died, answered illegally or broke the protocol, again after a restart.
        """
        limit = limit or self.settings.limit
        self._check_question(board, limit)
        deadline = (thinking_time(limit, board.turn) or 0.0) + self.settings.deadline
        began = time.monotonic()

        def ask(process: UciProcess) -> chess.engine.PlayResult:
            played = process.call(lambda uci: uci.play(board, limit, game=self._game, info=_TOLD), deadline)
            if played.move is None or played.move not in board.legal_moves:
                raise Misbehaved(f"it answered {played.move}, which is not legal in {board.fen()}")
            return played

        played = self._ask("choosing a move", ask)
        assert played.move is not None, "checked to be legal"
        return EngineMove(
            move=played.move,
            ponder=played.ponder,
            score=played.info.get("score"),
            depth=played.info.get("depth"),
            nodes=played.info.get("nodes"),
            wall=time.monotonic() - began,
        )

    def candidates(self, board: chess.Board, lines: int, nodes: int) -> tuple[Candidate, ...]:
        """The best moves of a position, best first, from a cleared engine: on one thread they depend on it alone.

        Args:
            board: the position with its history; left as it is.
            lines: how many moves at most.
            nodes: positions searched for all of them together.

        Raises:
            EngineRefused: the game is over, or the engine is not open.
            EngineFailed: as for ``choose``.
        """
        limit = chess.engine.Limit(nodes=nodes)
        self._check_question(board, limit)

        def ask(process: UciProcess) -> tuple[Candidate, ...]:
            infos = process.call(
                lambda uci: uci.analyse(board, limit, multipv=lines, game=object()), self.settings.deadline
            )
            found: dict[chess.Move, chess.engine.PovScore] = {}
            for info in infos:
                if info.get("pv") and "score" in info:
                    found.setdefault(info["pv"][0], info["score"])
            if not found:
                raise Misbehaved(f"it named no move and score for {board.fen()}")
            return tuple(Candidate(move, score) for move, score in found.items())

        return self._ask("analysing a position", ask)

    def _check_question(self, board: chess.Board, limit: chess.engine.Limit) -> None:
        if not any(board.legal_moves):
            raise EngineRefused(f"the game is over at {board.fen()}: there is no move to ask for")
        if thinking_time(limit, board.turn) is None and limit.nodes is None and limit.depth is None:
            raise EngineRefused("nothing limits the engine's search: set a move time, a number of nodes or a clock")

    def _ask(self, doing: str, ask: Callable[[UciProcess], T]) -> T:
        """Ask, and after a failure ask a fresh process once more."""
        reasons, path = [], self._path
        for _ in range(ATTEMPTS):
            try:
                return ask(self._running())
            except Misbehaved as error:
                self._drop()
                reasons.append(str(error))
        assert path is not None, "else _running refuses"
        raise EngineFailed(path, doing, reasons)

    def _running(self) -> UciProcess:
        """The process, started if there is none."""
        path, process = self._path, self._process
        if path is None:
            raise EngineRefused("the engine is not open: open it before asking")
        if process is not None:
            return process
        process = self._start(path)
        with self._lock:
            if self._path is not None:
                self._process = process
                return process
        process.kill()  # closed meanwhile
        raise EngineRefused("the engine was closed while it was started")

    def _start(self, path: str) -> UciProcess:
        process = UciProcess(path, self.settings.start_deadline)
        try:
            options = _configuration(self.settings, process.uci)
            process.call(lambda uci: uci.configure(options), self.settings.start_deadline)
            process.call(lambda uci: uci.ping(), self.settings.start_deadline)
        except BaseException:
            process.kill()
            raise
        return process

    def _drop(self) -> None:
        with self._lock:
            process, self._process = self._process, None
        if process:
            process.kill()


def _configuration(settings: EngineSettings, uci: chess.engine.UciProtocol) -> dict[str, int | bool]:
    """Options to set, each checked against what the engine says of itself.

    Raises:
        EngineRefused: an option is not offered, or not with that value.
    """
    wanted: dict[str, int | bool] = {}
    if settings.threads > 1 or "Threads" in uci.options:
        wanted["Threads"] = _within(uci, "Threads", settings.threads)
    if "Hash" in uci.options:  # an engine without the option has a fixed table, or none
        wanted["Hash"] = _within(uci, "Hash", settings.hash_mb)
    if settings.elo is not None:
        wanted["UCI_Elo"] = _within(uci, "UCI_Elo", settings.elo)
        wanted["UCI_LimitStrength"] = True
    return wanted


def _within(uci: chess.engine.UciProtocol, name: str, value: int) -> int:
    """The value, if the engine offers the option with it."""
    engine = uci.id.get("name", "this engine")
    option = uci.options.get(name)
    if option is None:
        raise EngineRefused(f"{engine} does not offer {name}, so that {value} cannot be set: leave it out")
    low, high = option.min, option.max
    if (low is not None and value < low) or (high is not None and value > high):
        raise EngineRefused(
            f"{name} = {value} is outside what {engine} offers: choose {low} to {high}, or leave it out"
        )
    return value
