"""Players: a line is followed by ply, then the engine goes on."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Collection
from contextlib import ExitStack
from pathlib import Path

import chess
import chess.engine
import pytest

from app.play.player_selection import engine_players
from app.players.players import Decision, LinePlayer, Players
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from engine.errors import EngineFailed, EngineRefused
from hardware.interfaces import Pace
from tests.waiting import PATIENCE, until


class Always:
    name = "always"

    def __init__(self, move: str) -> None:
        self.move = chess.Move.from_uci(move)

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        return Decision(self.move)


def test_a_line_is_followed_from_the_position_it_starts_in():
    board = chess.Board("4k3/8/8/8/8/8/4P3/4K3 b - - 0 31")
    line = [chess.Move.from_uci(m) for m in ("e8e7", "e2e4", "e7e6")]
    player = LinePlayer(board, line)
    for expected in line:
        assert player.choose(board).move == expected
        board.push(expected)
    assert player.choose(board).move is None
    assert player.name == "line"


def test_after_the_line_another_player_goes_on():
    board = chess.Board()
    player = LinePlayer(board, [chess.Move.from_uci("e2e4")], Always("e7e5"))
    assert player.choose(board).move == chess.Move.from_uci("e2e4")
    board.push_uci("e2e4")
    assert player.choose(board).move == chess.Move.from_uci("e7e5")
    assert player.name == "always"


class Counting:
    def __init__(self, name: str) -> None:
        self.name = name
        self.positions = list[str]()

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        self.positions.append(board.fen())
        return Decision(next(iter(board.legal_moves)))


def test_what_was_thought_ahead_is_the_answer_and_another_position_is_thought_about_anew():
    white, black = Counting("w"), Counting("b")
    board, other = chess.Board(), chess.Board()
    other.push_san("Nf3")
    with Players(white, black) as players:
        assert (players.name(chess.WHITE), players.name(chess.BLACK)) == ("w", "b")
        players.begin(board)
        players.begin(board)
        first = players.choose(board).move
        assert len(white.positions) == 1
        assert first in board.legal_moves
        players.begin(board)
        assert players.choose(other).move in other.legal_moves
        assert black.positions == [other.fen()]
        board.push_san("Nf3")
        board.push_san("Nf6")
        board.push_san("Ng1")
        board.push_san("Ng8")  # the same position, but seen before: another question
        players.begin(chess.Board())
        players.choose(board)
        assert white.positions[-1] == board.fen()


def test_what_goes_wrong_in_thinking_ahead_shows_when_the_move_is_needed():
    class Broken:
        name = "broken"

        def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
            raise LookupError("no move")

    with Players(Broken(), Broken()) as players:
        players.begin(chess.Board())
        with pytest.raises(LookupError, match="no move"):
            players.choose(chess.Board())


class Thinking:
    """Notes what it is asked; thinks until it is hurried where it is told to."""

    name = "thinking"

    def __init__(self, slow: bool = False) -> None:
        self.asked = list[tuple[object, ...]]()
        self.hurried = threading.Event()
        self.slow = slow

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        self.asked.append(("choose", board.ply(), clock))
        if self.slow:
            assert self.hurried.wait(PATIENCE)
        return Decision(next(iter(board.legal_moves)))

    def ponder(self, board: chess.Board, clock: chess.engine.Limit | None, *, certain: bool) -> None:
        self.asked.append(("ponder", board.ply(), clock, certain))

    def move_now(self) -> None:
        self.hurried.set()

    def hint(self, board: chess.Board) -> Decision:
        self.asked.append(("hint", board.ply()))
        return Decision(next(iter(board.legal_moves)))

    def accepts_draw(self, board: chess.Board) -> bool:
        return board.ply() > 0


CLOCK = chess.engine.Limit(white_clock=60.0, black_clock=50.0)


def test_with_a_clock_nobody_thinks_for_a_move_before_its_time():
    white, black = Thinking(), Thinking()
    board = chess.Board()
    with Players(white, black) as players:
        players.begin(board, CLOCK)
        assert players.choose(board, CLOCK).move in board.legal_moves
        board.push_san("e4")
        players.ponder(board, CLOCK)  # White has moved, and expects a reply
        board.push_san("e5")
        players.choose(board)
    assert white.asked == [
        ("ponder", 0, CLOCK, True), ("choose", 0, CLOCK), ("ponder", 1, CLOCK, False), ("choose", 2, None),
    ]  # fmt: skip
    assert black.asked == []


def test_who_does_not_ponder_thinks_ahead_only_for_a_move_that_no_clock_counts():
    white = Thinking()
    with Players(white, white, ponders=False) as players:
        players.begin(chess.Board(), CLOCK)
        players.ponder(chess.Board(), CLOCK)
        players.ponder(chess.Board())
        assert white.asked == []
        players.begin(chess.Board())
        players.choose(chess.Board())
    assert white.asked == [("choose", 0, None)]


def test_a_thought_about_a_position_that_did_not_come_is_cut_short():
    white = Thinking(slow=True)
    other = chess.Board()
    other.push_san("Nf3")
    other.push_san("Nf6")
    with Players(white, Thinking()) as players:
        players.begin(chess.Board())
        until(lambda: white.asked, "its thought")  # who has not begun is not hurried
        assert players.choose(other).move in other.legal_moves
    assert white.hurried.is_set()


def test_whether_a_move_is_ready():
    white = Thinking(slow=True)
    board = chess.Board()
    with Players(white, Thinking()) as players:
        assert not players.ready(board)
        players.begin(board)
        assert not players.ready(board)
        players.move_now()
        while not players.ready(board):
            time.sleep(0.01)
        players.choose(board)
        assert not players.ready(board)


def test_a_person_is_not_asked_but_helped():
    robot = Thinking()
    board = chess.Board()
    with Players(None, robot) as players:
        assert players.name(chess.WHITE) == "Human"
        players.begin(board)
        with pytest.raises(ValueError, match="a person is to move"):
            players.choose(board)
        players.ponder(board, CLOCK)
        assert players.hint(board).move in board.legal_moves
        assert not players.accepts_draw(board, chess.BLACK)
        assert not players.accepts_draw(board, chess.WHITE)
        board.push_san("e4")
        assert players.accepts_draw(board, chess.BLACK)
        players.choose(board, CLOCK)
    # the hint ends what is pondered, which begins again after it
    assert robot.asked == [
        ("ponder", 0, CLOCK, False), ("hint", 0), ("ponder", 0, CLOCK, False), ("choose", 1, CLOCK),
    ]  # fmt: skip


def test_without_an_engine_there_is_no_hint():
    line = LinePlayer(chess.Board(), [chess.Move.from_uci("e2e4")])
    with (
        Players(line, line) as players,
        pytest.raises(EngineRefused, match=r"^no engine is playing that could give a hint: play against one$"),
    ):
        players.hint(chess.Board())


def test_a_line_lets_its_follower_think_once_it_ends():
    follower = Thinking()
    board = chess.Board()
    player = LinePlayer(board, [chess.Move.from_uci("e2e4"), chess.Move.from_uci("e7e5")], follower)
    player.ponder(board, None, certain=True)
    player.ponder(board, None, certain=False)
    board.push_san("e4")
    player.ponder(board, None, certain=True)
    player.ponder(board, None, certain=False)
    board.push_san("e5")
    player.ponder(board, None, certain=True)
    assert player.choose(board, CLOCK).move is not None
    assert player.hint(board).move is not None
    assert player.accepts_draw(board)
    player.move_now()
    assert follower.hurried.is_set()
    assert follower.asked == [
        ("ponder", 1, None, False), ("ponder", 2, None, True), ("choose", 2, CLOCK), ("hint", 2),
    ]  # fmt: skip


def test_after_a_failure_a_player_may_be_asked_again():
    class RecoveryResult(Thinking):
        def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
            if not self.asked:
                self.asked.append(("failed",))
                raise EngineFailed("engine", "choosing a move", ["it died"])
            return super().choose(board, clock)

    with Players(RecoveryResult(), Thinking()) as players:
        with pytest.raises(EngineFailed):
            players.choose(chess.Board(), CLOCK)
        assert players.choose(chess.Board(), CLOCK).move in chess.Board().legal_moves


PLAIN_ENGINE = f"""#!{sys.executable}
import sys
sys.path[:0] = {sys.path!r}
import chess
for line in sys.stdin:
    words = line.split()
    if words[0] == "uci": print("id name Plain", "uciok", sep="\\n", flush=True)
    if words[0] == "isready": print("readyok", flush=True)
    if words[0] == "position":
        board = chess.Board()
        for word in words[3:]: board.push_uci(word)
    if words[0] == "go": print("info score cp 0", f"bestmove {{next(iter(board.legal_moves))}}", sep="\\n", flush=True)
"""


class Hearing(UserInterface):
    def __init__(self) -> None:
        self.said = list[str]()

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.said.append(sentence)


def test_an_engine_without_any_option_plays_a_whole_game_with_its_opening(tmp_path: Path) -> None:
    path, ui, board = tmp_path / "plain", Hearing(), chess.Board()
    path.write_text(PLAIN_ENGINE)
    path.chmod(0o755)
    settings = settings_of({"engine.path": str(path), "engine.nodes": 10, "game.plies": 6})
    with ExitStack() as stack:
        players = stack.enter_context(engine_players(settings, board, 2, stack, ui, Pace.FAST))
        while board.ply() < 12:
            decision = players.choose(board)
            assert decision.troubles == ()
            assert decision.move is not None
            board.push(decision.move)
    assert ui.said == ["plain has no option MultiPV, so its opening is chosen by searching each move alone."]
