"""An engine as a player: book first, what it expects, its manners, and a game by the clock."""

from __future__ import annotations

import random
import shutil

import chess
import chess.engine
import pytest

from app.game.clock import ArmTime, ChessClock
from app.measure.bench.clock import play
from app.players.engine_player import EnginePlayer
from app.settings.time_control import TimeControl
from engine.answers import EngineMove
from engine.draws_and_resigning import DrawResignPolicy
from engine.stockfish import DEBIAN_PATH, Engine, EngineSettings

Limit = chess.engine.Limit
CLOCK = Limit(white_clock=60.0, black_clock=50.0)


class Scripted:
    """Stands for ``Engine``: plays any move with the next score, and notes what it is asked."""

    def __init__(self, *scores: int, settings: EngineSettings | None = None) -> None:
        self.settings = settings or EngineSettings(ponder=True)
        self.scores = list(scores)
        self.limits = list[Limit | None]()
        self.pondered = list[str]()

    def choose(self, board: chess.Board, limit: Limit | None = None) -> EngineMove:
        self.limits.append(limit)
        moves = list(board.legal_moves)
        after = board.copy()
        after.push(moves[0])
        score = self.scores.pop(0) if self.scores else None
        told = None if score is None else chess.engine.PovScore(chess.engine.Cp(score), board.turn)
        reply = next(iter(after.legal_moves), None)
        return EngineMove(moves[0], reply, told, 9, 5, 0.5, (moves[0],), 0.1, ("it died",))

    def ponder(self, board: chess.Board, limit: Limit | None = None) -> bool:
        self.pondered.append(board.fen())
        self.limits.append(limit)
        return True


class Book:
    """Stands for ``engine.book.Book``: knows moves by position."""

    def __init__(self, *line: str) -> None:
        self.moves, board = dict[str, chess.Move](), chess.Board()
        for uci in line:
            self.moves[board.fen()] = chess.Move.from_uci(uci)
            board.push_uci(uci)

    def move(self, board: chess.Board) -> chess.Move | None:
        return self.moves.get(board.fen())


def test_what_the_engine_says_reaches_the_game() -> None:
    engine = Scripted(25)
    decision = EnginePlayer(engine, "robot").choose(chess.Board(), CLOCK)
    assert decision.move in chess.Board().legal_moves
    assert decision.score == chess.engine.PovScore(chess.engine.Cp(25), chess.WHITE)
    assert (decision.pv, decision.depth, decision.thought) == ((decision.move,), 9, 0.5)
    assert (decision.lost, decision.troubles, decision.from_book) == (0.1, ("it died",), False)
    assert engine.limits == [CLOCK]


def test_a_player_by_nodes_does_not_look_at_the_clock() -> None:
    engine = Scripted(settings=EngineSettings(nodes=7))
    EnginePlayer(engine, "robot").choose(chess.Board(), CLOCK)
    assert engine.limits == [Limit(nodes=7)]


def test_the_book_comes_first_and_nothing_is_thought_in_it() -> None:
    engine, board = Scripted(), chess.Board()
    player = EnginePlayer(engine, "robot", book=Book("e2e4", "e7e5", "g1f3"))
    decision = player.choose(board, CLOCK)
    assert (decision.move, decision.from_book) == (chess.Move.from_uci("e2e4"), True)
    board.push(decision.move)
    player.ponder(board, CLOCK, certain=False)  # the reply to expect is the book's, and the answer to it too
    board.push_uci("e7e5")
    assert player.choose(board, CLOCK).from_book
    assert engine.limits == []
    assert engine.pondered == []


def test_after_the_book_it_finds_out_what_to_expect() -> None:
    engine, board = Scripted(), chess.Board()
    player = EnginePlayer(engine, "robot", book=Book("e2e4"))
    board.push(player.choose(board, CLOCK).move)
    player.ponder(board, CLOCK, certain=False)
    expected = board.copy()
    expected.push(next(iter(board.legal_moves)))
    assert engine.pondered == [expected.fen()]
    assert engine.limits == [Limit(time=0.1), CLOCK]
    known = Scripted()
    player = EnginePlayer(known, "robot", book=Book("e2e4", "e7e5"))
    player.ponder(board, CLOCK, certain=False)
    board.push_uci("e7e5")
    assert known.pondered == [board.fen()]
    assert known.limits == [CLOCK]


def test_it_ponders_on_the_reply_it_expects_or_on_what_is_certain() -> None:
    engine, board = Scripted(), chess.Board()
    player = EnginePlayer(engine, "robot")
    decision = player.choose(board, CLOCK)
    board.push(decision.move)
    player.ponder(board, CLOCK, certain=False)
    board.push(decision.ponder)
    assert engine.pondered == [board.fen()]
    player.ponder(board, CLOCK, certain=True)
    assert engine.pondered == [board.fen()] * 2
    assert engine.limits == [CLOCK] * 3


def test_who_may_not_ponder_is_not_asked_to() -> None:
    engine = Scripted(settings=EngineSettings())
    EnginePlayer(engine, "robot").ponder(chess.Board(), CLOCK, certain=False)
    assert engine.pondered == []


def test_it_resigns_by_scores_in_a_row_that_a_taken_back_move_forgets() -> None:
    engine, board = Scripted(-2000, -2000, -2000, -2000, -2000, -2000), chess.Board()
    player = EnginePlayer(engine, "robot", policy=DrawResignPolicy(resign_below=1000, resign_for=3))
    resigned = []
    for _ in range(3):
        decision = player.choose(board)
        resigned.append(decision.resigns)
        board.push(decision.move)
        board.push(next(iter(board.legal_moves)))
    assert resigned == [False, False, True]
    for _ in range(4):
        board.pop()  # taken back to its second move
    assert not player.choose(board).resigns
    board.push(next(iter(board.legal_moves)))
    board.push(next(iter(board.legal_moves)))
    assert player.choose(board).resigns


def test_scores_with_a_gap_between_are_not_in_a_row() -> None:
    engine, board = Scripted(-2000, -2000), chess.Board()
    player = EnginePlayer(engine, "robot", policy=DrawResignPolicy(resign_below=1000, resign_for=2))
    assert not player.choose(board).resigns
    for _ in range(4):  # a move by somebody else between
        board.push(next(iter(board.legal_moves)))
    assert not player.choose(board).resigns


def test_it_accepts_a_draw_in_a_level_game() -> None:
    engine, board = Scripted(*[5] * 4), chess.Board()
    player = EnginePlayer(engine, "robot", policy=DrawResignPolicy(draw_for=3, draw_from=4))
    accepted = []
    rng = random.Random(1)
    for _ in range(4):
        board.push(player.choose(board).move)
        accepted.append(player.accepts_draw(board))
        board.push(rng.choice(list(board.legal_moves)))
    assert accepted == [False, False, True, True]


@pytest.fixture(scope="module")
def stockfish() -> str:
    found = shutil.which("stockfish") or shutil.which(DEBIAN_PATH)
    if found is None:
        pytest.skip("Stockfish is not installed (sudo apt-get install stockfish)")
    return found


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.parametrize("paid", list(ArmTime))
def test_a_game_by_the_clock_with_an_arm_that_takes_time(stockfish: str, paid: ArmTime) -> None:
    game = play(TimeControl.parse("0:04"), 0.05, paid, 16)
    assert len(game.clock.moves) == 16
    assert game.flag is None
    # how exact it is, the bench tells; here only that nothing is charged twice or to nobody
    assert abs(game.total_error) < 0.1
    assert max(abs(error) for error in game.errors) < 0.5
    assert all((move.arm > 0.0) == (paid is ArmTime.OWN) for move in game.clock.moves)


@pytest.mark.real_time
def test_a_stockfish_with_two_seconds_left_does_not_lose_by_time(stockfish: str) -> None:
    clock = ChessClock.new(TimeControl.parse("0:02"))
    with Engine(EngineSettings(path=stockfish, hash_mb=1)) as engine:
        player = EnginePlayer(engine, "robot")
        player.choose(chess.Board(), Limit(white_clock=1.0))
        board = chess.Board()
        for ply in range(8):
            clock = clock.start(board.turn, 0.0)
            decision = player.choose(board, clock.limit(board.turn, 0.0))
            assert clock.flag(decision.thought) is None, f"at ply {ply}"
            clock = clock.decided(decision.thought).arm_clear(100.0)
            board.push(decision.move)
