"""Stockfish, or any UCI engine, as a player: limits, pondering, and a deadline of our own on every call.

An engine that hangs, dies, answers illegally or breaks the protocol is killed, restarted and asked again; only after
that failed several times, ``EngineFailed`` says so. Even then it may be asked anew, and is started anew: the game can
go on.
"""

import shutil
import threading
import time
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, Self, TypeVar

import chess
import chess.engine

from engine import budget, levels
from engine.answers import Candidate, EngineMove, engine_move, searched_alone
from engine.errors import EngineFailed, EngineMissing, EngineRefused, Hung, Misbehaved
from engine.options import at_full_strength, configuration, plays_below
from engine.process import UciProcess
from engine.protocol import PULSE_DEADLINE, TOLD, Uci
from engine.settings import EngineSettings

__all__ = ["Candidate", "Engine", "EngineMove", "EngineSettings", "find_engine"]

T = TypeVar("T")

DEBIAN_PATH = "/usr/games/stockfish"
"""Where Debian installs Stockfish; not on the PATH of every account."""
PAUSES: Final = (0.0, 0.2, 1.0)
"""Before each further attempt at one question [s]: what is wrong with the machine may pass."""
MOST_HANGS: Final = 2
"""Attempts at one question that may end by a deadline: each costs its whole time."""
ALONE = 0.25
"""A move that is searched alone is given this at most [s]: an engine that heeds no number of nodes is stopped then …"""
ALONE_SLOWEST: Final = 20_000.0
"""… or, of many nodes, after as long as they take at this rate, at which an engine searches in any case [1/s]."""


class _Ahead(NamedTuple):
    """What is pondered."""

    board: chess.Board
    limit: chess.engine.Limit


def find_engine(path: str | None = None) -> str:
    """Path of the binary to start; ``EngineMissing`` says how to get one if it is not there or not executable."""
    found = shutil.which(path) if path else shutil.which("stockfish") or shutil.which(DEBIAN_PATH)
    if found:
        return found
    if path:
        raise EngineMissing(
            f"engine {path!r} is not an executable file: name another one with --engine PATH, "
            "or install Stockfish with 'sudo apt-get install stockfish' and leave --engine out"
        )
    raise EngineMissing(
        f"Stockfish was found neither on PATH nor at {DEBIAN_PATH}: "
        "install it with 'sudo apt-get install stockfish' or name it with --engine PATH"
    )


class Engine:
    """An engine that plays; a context manager. One thread at a time may ask, any thread, and any may close it."""

    def __init__(self, settings: EngineSettings) -> None:
        self.settings = settings
        self._supervised = EngineSupervisor(settings)
        self._game = object()
        self._ahead: _Ahead | None = None
        self._searching = False

    def open(self) -> Self:
        """Find, start and configure the engine, so that what is wrong shows here.

        Raises ``EngineMissing``; ``EngineRefused`` if it does not offer a setting, or not that value; and
        ``EngineFailed`` if it could not be started, several times.
        """
        self._supervised.open(find_engine(self.settings.path))
        return self

    def close(self) -> None:
        """End the process at once, also while another thread asks. Harmless when already done."""
        self._supervised.close()

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """Process id of the running engine; None while there is none."""
        process = self._supervised.process
        return process.pid if process else None

    @property
    def name(self) -> str:
        """As the engine calls itself, such as Stockfish 15.1; known once it is open."""
        process = self._supervised.process
        return "" if process is None else process.uci.id.get("name", "")

    @property
    def ranks(self) -> bool:
        """Whether it names several moves of one search (MultiPV); known once it is open."""
        process = self._supervised.process
        return process is not None and "MultiPV" in process.uci.options

    def new_game(self) -> None:
        """Forget the game so far: the next question clears hash and histories first."""
        self._game = object()

    def choose(self, board: chess.Board, limit: chess.engine.Limit | None = None) -> EngineMove:
        """The engine's move, always a legal one; what was pondered on this position counts, and the board is left as it
        is.

        ``limit`` is for this move, such as the chess clock's; None takes the settings'. With a clock its ``time`` is
        the longest that the move may take. It returns at the latest after ``MOST_HANGS`` deadlines (see ``budget``) and
        a start for each attempt. Raises ``EngineRefused`` if the game is over, nothing limits the search, or the engine
        is not open, and ``EngineFailed`` if it hung, died, answered illegally or broke the protocol, again after
        restarts. Asked anew, it is started anew.
        """
        limit = limit or self.settings.limit
        self._check_question(board, limit)
        began = time.monotonic()

        def ask(process: UciProcess) -> tuple[chess.engine.PlayResult, float]:
            lost = time.monotonic() - began
            if plays_below(self.settings, process.uci):
                return self._play_below(process, board), lost
            return self._play(process, board, budget.less(limit, board.turn, lost)), lost

        (played, lost), troubles = self._supervised.ask("choosing a move", ask)
        return engine_move(played, time.monotonic() - began, lost if troubles else 0.0, troubles)

    def ponder(self, board: chess.Board, limit: chess.engine.Limit | None = None) -> bool:
        """Begin to think about a position that is expected, with the engine's side to move; returns at once.

        The next question ends it. ``limit`` is what ``choose`` is expected to be asked with; None takes the settings'.
        False when it does not: by the settings, as the engine offers no option Ponder, at the end of a game, or as it
        just failed. ``choose`` then starts anew and tells of trouble that lasts.
        """
        limit = limit or self.settings.limit
        if not self.settings.ponders or not any(board.legal_moves):
            return False
        if self._ahead is not None and same_position(self._ahead.board, board):
            return True
        said, ahead = budget.told(limit, board.turn), board.copy()
        try:
            process = self._supervised.running()
            if "Ponder" not in process.uci.options or plays_below(self.settings, process.uci):
                return False
            self._settle(process)
            process.call(lambda uci: uci.begin_ponder(ahead, said, self._game), self._patience)
        except Misbehaved:
            self._supervised.drop()
            return False
        self._ahead = _Ahead(ahead, limit)
        return True

    def hint(self, board: chess.Board, seconds: float = 1.0) -> EngineMove:
        """What the engine would play at its full strength, whatever its settings; for the person on the other side.

        It thinks so many ``seconds`` where the settings name no number of nodes; the board is left as it is. Raises
        ``EngineProblem`` as for ``choose``.
        """
        nodes = self.settings.nodes
        limit = chess.engine.Limit(time=seconds) if nodes is None else chess.engine.Limit(nodes=nodes)
        self._check_question(board, limit)
        began = time.monotonic()
        played, troubles = self._supervised.ask(
            "looking for a hint", lambda process: self._play(process, board, limit, at_full_strength(process.uci))
        )
        return engine_move(played, time.monotonic() - began, 0.0, troubles)

    def move_now(self) -> None:
        """End the search for a move, so that ``choose`` answers with what is known; from any thread."""
        process = self._supervised.process
        if self._searching and process is not None:
            process.tell("stop")

    def candidates(self, board: chess.Board, lines: int, nodes: int) -> tuple[Candidate, ...]:
        """The best moves of a position, at most ``lines``, best first, from a cleared engine: on one thread they depend
        on it alone.

        ``nodes`` positions are searched for all of them together. Raises as ``analyse``.
        """
        limit = chess.engine.Limit(nodes=nodes)
        self._check_question(board, limit)
        return self._supervised.ask(
            "analysing a position", lambda process: self._ranked(process, board, lines, limit, exact=False)
        )[0]

    def analyse(self, board: chess.Board, lines: int, limit: chess.engine.Limit) -> tuple[Candidate, ...]:
        """The best moves of a position, at most ``lines``, best first, with exact scores and lines; cleared before.

        ``limit`` is for all of them together, by nodes or by time; an engine without MultiPV searches each move alone.
        Raises ``EngineRefused`` if the game is over, nothing limits the search, or the engine is not open, and
        ``EngineFailed`` as for ``choose``.
        """
        self._check_question(board, limit)
        return self._supervised.ask(
            "analysing a position", lambda process: self._ranked(process, board, lines, limit, exact=True)
        )[0]

    def _ranked(
        self, process: UciProcess, board: chess.Board, lines: int, limit: chess.engine.Limit, *, exact: bool
    ) -> tuple[Candidate, ...]:
        """One attempt at the best moves: at least one."""
        self._settle(process)
        moves = board.legal_moves.count()
        lines = min(lines, moves)
        offered = process.uci.options.get("MultiPV")
        most = lines if offered is None or offered.max is None else min(lines, offered.max)
        every = not exact and most < lines == moves  # all moves are wanted, and the engine names fewer
        if lines > 1 and (offered is None or every):
            found = self._ranked_alone(process, board, lines, limit)
        else:
            stop = budget.stop_after(limit, board.turn)

            async def search(uci: Uci) -> Sequence[chess.engine.InfoDict]:
                if exact:
                    return await uci.watched(uci.exact_lines(board, limit, most), stop)
                return await uci.watched(uci.analyse(board, limit, multipv=most, game=object()), stop)

            infos = process.call(search, budget.give_up_after(limit, board.turn, self.settings.deadline))
            ranked = dict[chess.Move, Candidate]()
            for info in infos:
                if (pv := info.get("pv")) and "score" in info:
                    ranked.setdefault(pv[0], Candidate(pv[0], info["score"], tuple(pv)))
            found = tuple(ranked.values())
        if not found:
            raise Misbehaved(f"it named no move and score for {board.fen()}")
        return found

    def _play_below(self, process: UciProcess, board: chess.Board) -> chess.engine.PlayResult:
        """One attempt at a move below the engine's own lowest Elo."""
        assert self.settings.elo is not None, "it plays below a level"
        found = self._ranked(process, board, levels.LINES, chess.engine.Limit(nodes=levels.NODES), exact=False)
        drawn = levels.drawn_move(
            found, levels.temperature_of(self.settings.elo), levels.draw_of(self.settings.seed, board)
        )
        if drawn.move not in board.legal_moves:
            raise Misbehaved(f"it named {drawn.move}, which is not legal in {board.fen()}")
        return chess.engine.PlayResult(drawn.move, None, {"score": drawn.score, "pv": list(drawn.pv)})

    def _ranked_alone(
        self, process: UciProcess, board: chess.Board, lines: int, limit: chess.engine.Limit
    ) -> tuple[Candidate, ...]:
        game = object()

        def search(position: chess.Board, part: chess.engine.Limit) -> chess.engine.PlayResult:
            stop = max(ALONE, (part.nodes or 0) / ALONE_SLOWEST) if part.time is None else part.time
            return process.call(
                lambda uci: uci.watched(uci.play(position, part, game=game, info=TOLD), stop),
                stop + self.settings.deadline,
            )

        return searched_alone(search, board, lines, limit)

    def _check_question(self, board: chess.Board, limit: chess.engine.Limit) -> None:
        if not any(board.legal_moves):
            raise EngineRefused(f"the game is over at {board.fen()}: there is no move to ask for")
        if budget.thinking_time(limit, board.turn) is None and limit.nodes is None and limit.depth is None:
            raise EngineRefused("nothing limits the engine's search: set a move time, a number of nodes or a clock")

    def _play(
        self,
        process: UciProcess,
        board: chess.Board,
        limit: chess.engine.Limit,
        options: chess.engine.ConfigMapping | None = None,
    ) -> chess.engine.PlayResult:
        """One attempt at a move: by what is pondered, if that is it."""
        ahead, self._ahead = self._ahead, None
        hit = options is None and ahead is not None and same_position(ahead.board, board)
        if ahead is None or not hit or not budget.still_holds(ahead.limit, limit, board.turn):
            hit = False
            self._settle(process)
        stop, said = budget.stop_after(limit, board.turn), budget.told(limit, board.turn)

        async def search(uci: Uci) -> chess.engine.PlayResult:
            answer = uci.hit() if hit else uci.play(
                board, said, game=self._game, info=TOLD, options=options or {}
            )  # fmt: skip
            return await uci.watched(answer, stop)

        self._searching = True
        try:
            played = process.call(search, budget.give_up_after(limit, board.turn, self.settings.deadline))
        finally:
            self._searching = False
        if played.move is None:
            raise Misbehaved(f"it named no move in {board.fen()}")
        if played.move not in board.legal_moves:
            raise Misbehaved(f"it answered {played.move}, which is not legal in {board.fen()}")
        return played

    @property
    def _patience(self) -> float:
        """Wall time for an answer that needs no search [s]."""
        return min(PULSE_DEADLINE, self.settings.deadline)

    def _settle(self, process: UciProcess) -> None:
        """End what it ponders, let pass what it may still say of earlier questions, and see that it lives."""
        self._ahead = None
        process.call(lambda uci: uci.ping(), self._patience)


def same_position(one: chess.Board, other: chess.Board) -> bool:
    """The same position with the same history."""
    return one == other and one.move_stack == other.move_stack


class EngineSupervisor:
    """One engine, closed at first. One thread at a time may ask, any thread, and any may close it."""

    def __init__(self, settings: EngineSettings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._path: str | None = None
        self.process: UciProcess | None = None
        """None while there is none."""

    def open(self, path: str) -> None:
        """Start the engine, so that what is wrong shows here; raises ``EngineRefused`` if it does not offer a setting,
        or not that value and ``EngineFailed`` if it could not be started, several times.
        """
        self._path = path
        self.ask("starting", lambda process: None)

    def close(self) -> None:
        """End the process at once, also while another thread asks. Harmless when already done."""
        with self._lock:
            self._path = None
        self.drop()

    def ask(self, doing: str, ask: Callable[[UciProcess], T]) -> tuple[T, tuple[str, ...]]:
        """Ask, and after a failure ask a fresh process once more, several times; the answer, and a phrase for each
        failure.

        ``doing`` is for the sentence, such as "choosing a move"; ``ask`` is one attempt, which raises ``Misbehaved``.
        Raises ``EngineRefused`` if it is closed, or as ``ask``, and ``EngineFailed`` if every attempt failed.
        """
        reasons, hangs = list[str](), 0
        while True:
            try:
                return ask(self.running()), tuple(reasons)
            except Misbehaved as error:
                self.drop()
                reasons.append(str(error))
                hangs += isinstance(error, Hung)
            if hangs >= MOST_HANGS or len(reasons) > len(PAUSES):
                path = self._path
                if path is None:
                    raise EngineRefused("the engine was closed while it was asked")
                raise EngineFailed(path, doing, reasons)
            time.sleep(PAUSES[len(reasons) - 1])

    def running(self) -> UciProcess:
        """The process, started if there is none; raises ``EngineRefused`` if it is closed, or does not offer what is to
        be set and ``Misbehaved`` if it could not be started.
        """
        path, process = self._path, self.process
        if path is None:
            raise EngineRefused("the engine is not open: open it before asking")
        if process is not None:
            return process
        process = self._start(path)
        with self._lock:
            if self._path is not None:
                self.process = process
                return process
        process.kill()  # closed meanwhile
        raise EngineRefused("the engine was closed while it was started")

    def _start(self, path: str) -> UciProcess:
        process = UciProcess(path, self._settings.start_deadline)
        try:
            options = configuration(self._settings, process.uci)
            process.call(lambda uci: uci.configure(options), self._settings.start_deadline)
            process.call(lambda uci: uci.ping(), self._settings.start_deadline)
        except BaseException:
            process.kill()
            raise
        return process

    def drop(self) -> None:
        """End the process; the next question starts another one."""
        with self._lock:
            process, self.process = self.process, None
        if process:
            process.kill()
