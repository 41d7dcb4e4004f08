"""Engines that hang, die, lie or are not there."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import chess
import chess.engine
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from engine.errors import EngineFailed, EngineMissing, EngineRefused
from engine.process import exit_phrase
from engine.stockfish import Engine, EngineSettings, find_engine

REMEDY = ": try it by hand in a terminal, or name another one with --engine PATH"
E2E4 = chess.Move.from_uci("e2e4")


def settings_for(path: str, **changes: object) -> EngineSettings:
    return EngineSettings.model_validate({"path": path, "nodes": 100, "deadline": 60.0} | changes)


@pytest.mark.parametrize(
    "trouble",
    [
        "time.sleep(60)",
        "os._exit(3)",
        'say("bestmove e2e5")',
        'say("bestmove 0000")',
        'say("bestmove (none)")',
        'say("bestmove")',
    ],
    ids=["hangs", "dies", "illegal", "null move", "none", "nothing"],
)
def test_a_failure_is_answered_by_a_restart_and_the_question_again(
    fake: Callable[..., Any], give_up_soon: Callable[[Engine], None], trouble: str
) -> None:
    engine_file = fake(on_go=f'if start == 1: {trouble}\nelse: say("bestmove e2e4 ponder e7e5")')
    board = chess.Board()
    with Engine(settings_for(engine_file.path)) as engine:
        first = engine.pid
        if "sleep" in trouble:
            give_up_soon(engine)
        chosen = engine.choose(board)
        assert engine.pid != first
    assert chosen.move == E2E4
    assert chosen.ponder == chess.Move.from_uci("e7e5")
    assert (chosen.score, chosen.depth, chosen.nodes) == (None, None, None)
    assert engine_file.starts == 2
    assert board == chess.Board()


@pytest.mark.parametrize(
    ("trouble", "reason", "attempts"),
    [
        ("time.sleep(60)", "it gave no answer within 2 s", 2),
        ("os._exit(3)", "it died with exit code 3", 4),
        ("os.kill(os.getpid(), signal.SIGSEGV)", "it died with exit code -11", 4),
        (
            'print("no network file", file=sys.stderr); sys.exit(1)',
            "it died with exit code 1 (last words: 'no network file')",
            4,
        ),
        ('say("bestmove e2e5")', f"it broke the protocol: illegal uci: 'e2e5' in {chess.STARTING_FEN}", 4),
        ('say("bestmove (none)")', f"it named no move in {chess.STARTING_FEN}", 4),
    ],
)
def test_a_failure_each_time_is_the_end(fake: Callable[..., Any], trouble: str, reason: str, attempts: int) -> None:
    engine_file = fake(on_go=trouble)
    deadline = 2.0 if "sleep" in trouble else 60.0
    with Engine(settings_for(engine_file.path, deadline=deadline)) as engine:
        with pytest.raises(EngineFailed) as caught:
            engine.choose(chess.Board())
        assert engine.pid is None
    assert str(caught.value) == (
        f"engine {engine_file.path} failed {attempts} times in a row in choosing a move ({reason}){REMEDY}"
    )
    assert caught.value.reasons == (reason,) * attempts
    assert engine_file.starts == attempts


def test_two_different_failures_are_both_told(fake: Callable[..., Any]) -> None:
    engine_file = fake(on_go='if start == 1: os._exit(3)\nelse: say("bestmove e2e5")')
    with (
        Engine(settings_for(engine_file.path)) as engine,
        pytest.raises(EngineFailed, match="exit code 3, then it broke"),
    ):
        engine.choose(chess.Board())


def test_an_engine_that_recovers_may_be_asked_again_after_its_failure(fake: Callable[..., Any]) -> None:
    engine_file = fake(on_go='if start < 5: os._exit(3)\nelse: say("bestmove e2e4")')
    with Engine(settings_for(engine_file.path)) as engine:
        with pytest.raises(EngineFailed):
            engine.choose(chess.Board())
        assert engine.choose(chess.Board()).move == E2E4


def test_an_engine_that_died_between_moves_is_started_again(fake: Callable[..., Any]) -> None:
    engine_file = fake(on_go='say("bestmove e2e4")\nif start == 1: os._exit(0)')
    with Engine(settings_for(engine_file.path)) as engine:
        assert engine.choose(chess.Board()).move == E2E4
        time.sleep(0.1)
        assert engine.choose(chess.Board()).move == E2E4
    assert engine_file.starts == 2


@pytest.mark.parametrize(
    ("snippets", "reason", "starts"),
    [
        ({"on_uci": ""}, "it gave no answer within 1.5 s", 2),
        ({"at_start": "sys.exit(7)"}, "it died with exit code 7", 4),
        ({"on_uci": 'say("option name Hash type spin default many min 1 max 2")'}, "expected integer for spin", 4),
    ],
    ids=["never uciok", "exits at once", "broken option"],
)
def test_an_engine_that_does_not_start(
    fake: Callable[..., Any], snippets: dict[str, str], reason: str, starts: int
) -> None:
    engine_file, hangs = fake(**snippets), "no answer" in reason
    with pytest.raises(EngineFailed) as caught:
        Engine(settings_for(engine_file.path, start_deadline=1.5 if hangs else 60.0)).open()
    assert str(caught.value).startswith(f"engine {engine_file.path} failed {starts} times in a row in starting (")
    assert all(reason in told for told in caught.value.reasons)
    assert engine_file.starts == starts or hangs  # a slow one is given up before it counts itself


def test_a_start_that_fails_once_is_forgiven(fake: Callable[..., Any]) -> None:
    engine_file = fake(at_start="if start == 1: sys.exit(7)")
    with Engine(settings_for(engine_file.path)) as engine:
        assert engine.choose(chess.Board()).move == E2E4


def test_a_file_that_is_no_program(tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_bytes(b"\x00\x01 no program")
    path.chmod(0o755)
    with pytest.raises(EngineFailed, match=re.escape("(it could not be started: Exec format error): try")):
        Engine(settings_for(str(path))).open()


def test_a_missing_binary_says_how_to_get_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("engine.stockfish.DEBIAN_PATH", str(tmp_path / "stockfish"))
    with pytest.raises(EngineMissing) as caught:
        Engine(EngineSettings()).open()
    assert str(caught.value) == (
        f"Stockfish was found neither on PATH nor at {tmp_path}/stockfish: "
        "install it with 'sudo apt-get install stockfish' or name it with --engine PATH"
    )


def test_debians_place_is_tried_after_the_path(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, fake: Callable[..., Any]
) -> None:
    engine_file = fake()
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("engine.stockfish.DEBIAN_PATH", engine_file.path)
    assert find_engine() == engine_file.path
    first = tmp_path / "stockfish"
    first.symlink_to(engine_file.path)
    assert find_engine() == str(first)


def test_a_named_binary_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(EngineMissing) as caught:
        Engine(settings_for(str(tmp_path))).open()
    assert str(caught.value) == (
        f"engine '{tmp_path}' is not an executable file: name another one with --engine PATH, "
        "or install Stockfish with 'sudo apt-get install stockfish' and leave --engine out"
    )


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"elo": 399},
            "Elo 399 is outside what Fake 1.0 can play: choose 400 to 2000, or leave it out",
        ),
        ({"elo": 2001}, "Elo 2001 is outside what Fake 1.0 can play: choose 400 to 2000, or leave it out"),
        ({"threads": 5}, "Threads = 5 is outside what Fake 1.0 offers: choose 1 to 4, or leave it out"),
        ({"hash_mb": 2048}, "Hash = 2048 is outside what Fake 1.0 offers: choose 1 to 1024, or leave it out"),
    ],
)
def test_what_the_engine_does_not_offer_is_refused_once(
    fake: Callable[..., Any], changes: dict[str, int], sentence: str
) -> None:
    engine_file = fake()
    engine = Engine(settings_for(engine_file.path, **changes))
    with pytest.raises(EngineRefused) as caught:
        engine.open()
    assert str(caught.value) == sentence
    assert engine_file.starts == 1
    assert engine.pid is None


def test_a_bare_engine_plays_but_not_at_an_elo_nor_on_two_threads(fake: Callable[..., Any]) -> None:
    engine_file = fake(on_uci='say("uciok")')
    with Engine(settings_for(engine_file.path)) as engine:
        assert engine.choose(chess.Board()).move == E2E4
    for changes, sentence in (
        ({"elo": 1501}, "Elo 1501 is outside what this engine can play: choose 400 to 1500, or leave it out"),
        ({"threads": 2}, "this engine does not offer Threads, so that 2 cannot be set: leave it out"),
    ):
        with pytest.raises(EngineRefused, match=f"^{sentence}"):
            Engine(settings_for(engine_file.path, **changes)).open()


def test_questions_without_an_answer_are_refused(fake: Callable[..., Any]) -> None:
    engine_file = fake()
    mated = chess.Board("rnb1kbnr/pppp1ppp/8/4p3/6Pq/5P2/PPPPP2P/RNBQKBNR w KQkq - 1 3")
    with Engine(settings_for(engine_file.path, nodes=None)) as engine:
        with pytest.raises(EngineRefused, match=f"^the game is over at {re.escape(mated.fen())}: there is no move"):
            engine.choose(mated)
        with pytest.raises(EngineRefused, match=r"^nothing limits the engine's search: set a move time, a number"):
            engine.choose(chess.Board())
        with pytest.raises(EngineRefused, match=r"^nothing limits"):
            engine.choose(chess.Board(), chess.engine.Limit(black_clock=10.0))
    with pytest.raises(EngineRefused, match=r"^the engine is not open: open it before asking$"):
        engine.choose(chess.Board(), chess.engine.Limit(nodes=1))
    assert not [line for line in engine_file.heard if line.startswith("go")]


def test_settings_reach_the_engine_and_each_game_is_announced_once(fake: Callable[..., Any]) -> None:
    engine_file = fake()
    with Engine(settings_for(engine_file.path, elo=1600, threads=2, hash_mb=32, move_time=0.25)) as engine:
        for _ in range(2):
            engine.choose(chess.Board())
            engine.choose(chess.Board(), chess.engine.Limit(white_clock=60.0, black_clock=50.0, white_inc=1.0))
            engine.new_game()
    heard = engine_file.heard
    for option in ("UCI_Elo value 1600", "UCI_LimitStrength value true", "Threads value 2", "Hash value 32"):
        assert heard.count(f"setoption name {option}") == 1
    assert heard.count("go nodes 100 movetime 250") == 2
    by_clock = [line.split() for line in heard if line.startswith("go wtime")]  # it runs while this process is held up
    assert [line[3:] for line in by_clock] == [["btime", "50000", "winc", "1000"]] * 2
    assert all(50_000 < int(line[2]) <= 60_000 for line in by_clock)
    assert heard.count("ucinewgame") == 2


def test_a_death_before_an_analysis_has_begun_is_seen_at_once(fake: Callable[..., Any]) -> None:
    engine_file = fake(on_new_game="os._exit(5)")
    with (  # its deadline is longer than a test may take
        Engine(settings_for(engine_file.path, deadline=3600.0)) as engine,
        pytest.raises(EngineFailed, match=r"4 times in a row .* \(it died with exit code 5\)"),
    ):
        engine.candidates(chess.Board(), lines=2, nodes=10)


@pytest.mark.parametrize("reply", ["bestmove e2e4", "info depth 1 multipv 1 pv e2e4\\nbestmove e2e4"])
def test_an_analysis_without_moves_or_scores_is_a_failure(fake: Callable[..., Any], reply: str) -> None:
    engine_file = fake(on_go=f'say("{reply}")')
    with (
        Engine(settings_for(engine_file.path)) as engine,
        pytest.raises(EngineFailed, match=r"in analysing a position.*it named no move and score for rnbq"),
    ):
        engine.candidates(chess.Board(), lines=2, nodes=10)


def test_candidates_are_told_once_each_in_the_engines_order(fake: Callable[..., Any]) -> None:
    said = [
        "info depth 2 multipv 1 score cp 30 pv d2d4 d7d5",
        "info depth 2 multipv 2 score cp 20 pv e2e4",
        "info depth 1 multipv 3 score cp 10 pv d2d4",
        "info depth 1 multipv 4 score cp 5 pv e2e5",
        "bestmove d2d4",
    ]
    engine_file = fake(on_go="\n".join(f'say("{line}")' for line in said))
    with Engine(settings_for(engine_file.path)) as engine:
        found = engine.candidates(chess.Board(), lines=4, nodes=10)
    assert [(c.move.uci(), c.score.relative.score()) for c in found] == [("d2d4", 30), ("e2e4", 20)]


def test_nonsense_between_the_lines_does_no_harm(fake: Callable[..., Any]) -> None:
    noise = [
        'say("info depth deep score cp much nodes -")',
        'say("info string \\u2654 hello")',
        'sys.stdout.buffer.write(b"\\xff\\xfe\\n")',
        'say("readyok")',
        'say("uciok")',
        'say("info depth 4 nodes 77 score mate 3 pv e2e4")',
        'say("bestmove e2e4 ponder e2e4")',
    ]
    with Engine(settings_for(fake(on_go="\n".join(noise)).path)) as engine:
        chosen = engine.choose(chess.Board())
    assert (chosen.move, chosen.ponder, chosen.depth, chosen.nodes) == (E2E4, None, 4, 77)
    assert chosen.score == chess.engine.PovScore(chess.engine.Mate(3), chess.WHITE)


UCI_WORDS = st.from_regex(r"[a-h][1-8][a-h][1-8][qrbnk]?", fullmatch=True)
PAWNS = "4k3/P6P/8/2pP4/8/8/8/R3K2R w KQ c6 0 1"


@given(
    answer=st.one_of(UCI_WORDS, st.sampled_from([m.uci() for m in chess.Board(PAWNS).legal_moves]), st.text("a1 0-@N"))
)
@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_answered_only_legal_moves_come_out(answering: tuple[Engine, Path], answer: str) -> None:
    engine, answer_file = answering
    answer_file.write_text(answer)
    board = chess.Board(PAWNS)
    legal = {move.uci() for move in board.legal_moves}
    try:
        chosen = engine.choose(board)
    except EngineFailed:
        assert answer not in legal
    else:
        assert chosen.move in board.legal_moves
        if answer in legal:
            assert chosen.move.uci() == answer


@pytest.fixture
def answering(
    fake: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[Engine, Path]]:
    monkeypatch.setattr("engine.stockfish.PAUSES", ())  # one attempt each
    engine_file = fake(on_go=f'say("bestmove", open({str(tmp_path / "answer")!r}).read())')
    with Engine(settings_for(engine_file.path)) as engine:
        yield engine, tmp_path / "answer"


def test_the_deadline_lies_on_top_of_the_time_of_the_limit(fake: Callable[..., Any]) -> None:
    engine_file = fake(on_go='time.sleep(0.8)\nsay("bestmove e2e4")')
    with Engine(settings_for(engine_file.path, move_time=30.0, deadline=0.7)) as engine:
        assert engine.choose(chess.Board()).wall >= 0.8
    assert engine_file.starts == 1


def test_how_an_end_is_told() -> None:
    assert exit_phrase(0, "") == "it died with exit code 0"
    assert exit_phrase(-4, "") == "it died with exit code -4 (the binary was built for another CPU)"
    assert exit_phrase(-9, "oh") == (
        "it died with exit code -9 (killed from outside, perhaps because memory ran out; last words: 'oh')"
    )


@pytest.mark.parametrize(
    "wrong",
    [{"nodes": 0}, {"move_time": -1.0}, {"move_time": float("inf")}, {"deadline": 0.0}, {"skil": 3}, {"skill": -1}],
)
def test_impossible_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        EngineSettings.model_validate(wrong)
