"""The chess clock: what each instant does to both sides' time, and laws that hold for any game."""

from __future__ import annotations

import random

import chess
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.game.clock import ARM_LEAVES, LEAST_SHARE, OVERHEAD, ChessClock, ClockError
from app.settings.time_control import ArmTime, TimeControl

WHITE, BLACK = chess.WHITE, chess.BLACK


def clock(text: str = "5+3", arm_time: ArmTime = ArmTime.NOBODY, black: str | None = None) -> ChessClock:
    return ChessClock.new(TimeControl.parse(text), None if black is None else TimeControl.parse(black), arm_time)


def test_a_move_by_hand_costs_what_it_took_and_adds_the_increment() -> None:
    before = clock()
    running = before.start(WHITE, 100.0)
    assert running.left(WHITE, 110.0) == 290.0
    assert running.left(BLACK, 110.0) == 300.0
    after = running.press(110.0)
    assert (after.left(WHITE), after.left(BLACK)) == (293.0, 300.0)
    assert after.left(WHITE, 500.0) == 293.0  # nobody's clock runs until the next start
    assert (after.moves[0].after, after.moves[0].thought, after.made(WHITE), after.made(BLACK)) == (293.0, 10.0, 1, 0)
    assert before == clock()


def test_the_arms_motion_is_charged_to_nobody() -> None:
    game = clock("5").start(WHITE, 0.0).decided(2.0)
    assert game.left(WHITE, 1000.0) == 298.0
    assert game.flag(1000.0) is None
    game = game.arm_clear(8.0).start(BLACK, 8.0).press(9.5)
    assert (game.left(WHITE), game.left(BLACK)) == (298.0, 298.5)
    assert (game.moves[0].thought, game.moves[0].arm) == (2.0, 0.0)


def test_the_arms_motion_is_charged_to_the_side_for_which_it_moves() -> None:
    game = clock("5+1", ArmTime.OWN).start(WHITE, 0.0).decided(2.0)
    assert game.left(WHITE, 5.0) == 295.0
    game = game.arm_clear(8.0)
    assert (game.left(WHITE), game.left(BLACK)) == (293.0, 300.0)
    assert (game.moves[0].thought, game.moves[0].arm) == (2.0, 6.0)


def test_no_flag_falls_by_the_arm() -> None:
    game = clock("0:10", ArmTime.OWN).start(WHITE, 0.0).decided(2.0)
    assert [game.left(WHITE, at) for at in (4.0, 5.0, 6.0, 1e6)] == [6.0, 5.0, ARM_LEAVES, ARM_LEAVES]
    assert game.flag(1e6) is None
    late = clock("0:10", ArmTime.OWN).start(WHITE, 0.0).decided(9.0)
    assert late.left(WHITE, 60.0) == 1.0
    assert late.arm_clear(60.0).left(WHITE) == 1.0


def test_a_pause_costs_nothing_wherever_it_falls() -> None:
    game = clock("5").start(BLACK, 0.0).pause(4.0).pause(7.0)
    assert game.left(BLACK, 50.0) == 296.0
    game = game.start(BLACK, 100.0).decided(101.0).pause(102.0).start(BLACK, 200.0).arm_clear(203.0)
    assert game.left(BLACK) == 295.0
    assert game.moves[0].thought == 5.0


def test_simple_delay_and_bronsteins() -> None:
    for sign in "db":
        game = clock(f"5{sign}3").start(WHITE, 0.0).press(2.0)
        assert game.left(WHITE) == 300.0
        game = game.start(BLACK, 2.0).press(12.0)
        assert game.left(BLACK) == 293.0
    assert clock("5d3").start(WHITE, 0.0).left(WHITE, 2.0) == 300.0
    assert clock("5b3").start(WHITE, 0.0).left(WHITE, 2.0) == 298.0
    paused = clock("5d3").start(WHITE, 0.0).pause(2.0).start(WHITE, 50.0)
    assert paused.left(WHITE, 52.0) == 299.0  # the delay is the move's, not the start's


def test_a_period_ends_with_its_last_move() -> None:
    game = clock("2/1+5,3+5")
    for n in range(3):
        game = game.start(WHITE, 0.0).press(10.0)
        assert game.limit(BLACK, 0.0).remaining_moves == (2, 1, None)[n]
        game = game.start(BLACK, 10.0).press(11.0)
    assert game.left(WHITE) == 60.0 + 180.0 - 3 * 5.0
    assert game.limit(WHITE, 0.0).remaining_moves is None


def test_time_odds() -> None:
    game = clock("10+5", black="1")
    assert (game.left(WHITE), game.left(BLACK)) == (600.0, 60.0)
    assert game.start(BLACK, 0.0).press(1.0).left(BLACK) == 59.0


def test_a_flag_falls_at_its_instant_and_not_before() -> None:
    game = clock("0:30").start(WHITE, 5.0)
    assert game.flag(34.999) is None
    assert game.flag(35.0) == WHITE
    assert game.fallen(chess.Board(), 34.0) is None
    fall = game.fallen(chess.Board(), 36.0)
    assert fall == (WHITE, "0-1", "White's time has run out")
    black = clock("0:30").start(BLACK, 5.0).fallen(chess.Board(), 36.0)
    assert black == (BLACK, "1-0", "Black's time has run out")


@pytest.mark.parametrize(
    ("fen", "result"),
    [
        ("4k3/8/8/8/8/8/8/Q3K3 b - - 0 1", "1-0"),
        ("4k3/q7/8/8/8/8/8/4K3 b - - 0 1", "1/2-1/2"),  # a bare king cannot mate
        ("4k3/q7/8/8/8/8/8/4KB2 b - - 0 1", "1/2-1/2"),
        ("4k3/p7/8/8/8/8/8/4KN2 b - - 0 1", "1-0"),  # with the other side's help, a knight can
    ],
)
def test_who_could_not_mate_does_not_win_by_time(fen: str, result: str) -> None:
    fall = clock("0:30").start(BLACK, 0.0).fallen(chess.Board(fen), 31.0)
    assert fall is not None
    assert fall.result == result
    assert ("White has too little material to mate" in fall.reason) == (result == "1/2-1/2")


def test_a_taken_back_move_gives_both_sides_their_time_back() -> None:
    first = clock().start(WHITE, 0.0).press(10.0).start(BLACK, 10.0).press(12.0)
    later = first.start(WHITE, 12.0).press(60.0).start(BLACK, 60.0).press(61.0).start(WHITE, 61.0).at(70.0)
    assert later.take_back(2) == first
    assert later.take_back(0).left(WHITE) == later.left(WHITE) + 9.0 == 248.0  # of the move under way alone
    assert later.take_back(4) == clock()
    with pytest.raises(ClockError, match=r"^5 plies cannot be taken back: this clock has only 4$"):
        later.take_back(5)


def test_what_a_fault_took_is_given_back() -> None:
    game = clock("5").start(BLACK, 0.0).decided(30.0).give_back(25.0, 30.0).arm_clear(40.0)
    assert (game.left(BLACK), game.left(WHITE)) == (295.0, 300.0)
    assert game.take_back(1) == clock("5")
    more = clock("5").start(WHITE, 10.0).give_back(25.0, 12.0)  # it began before the clock did
    assert (more.left(WHITE), more.left(WHITE, 13.0)) == (300.0, 299.0)
    with pytest.raises(ClockError, match=r"^nobody can be given time back: no move is under way"):
        game.give_back(1.0, 50.0)


@given(
    text=st.sampled_from(["1", "1+3", "1d10", "1b10", "2/1+5,1+5"]), own=st.booleans(), paused=st.booleans(),
    spans=st.lists(st.tuples(st.floats(0.0, 30.0), st.floats(0.0, 90.0), st.floats(0.0, 9.0)), min_size=1, max_size=5),
)  # fmt: skip
def test_a_fault_leaves_no_trace_on_any_clock(
    text: str, own: bool, paused: bool, spans: list[tuple[float, float, float]]
) -> None:
    """Moves of which a part was lost and given back leave what the same moves leave without it."""
    faulty = sound = clock(text, ArmTime.OWN if own else ArmTime.NOBODY)
    for thought, lost, arm in spans:
        faulty, sound = faulty.start(WHITE, 0.0), sound.start(WHITE, 0.0)
        if paused:
            faulty = faulty.pause(lost).start(WHITE, 0.0)
            faulty = faulty.give_back(lost, thought)
        else:
            faulty = faulty.give_back(lost, lost + thought)
        assert faulty.left(WHITE) == pytest.approx(sound.left(WHITE, thought))
        faulty = ChessClock.model_validate_json(faulty.model_dump_json()).loaded().start(WHITE, 0.0)
        faulty, sound = faulty.decided(0.0).arm_clear(arm), sound.decided(thought).arm_clear(thought + arm)
        for one, other in zip(faulty.moves, sound.moves, strict=True):
            assert one.model_dump() == pytest.approx(other.model_dump())
        assert faulty.left(WHITE) == pytest.approx(sound.left(WHITE))
    assert faulty.take_back(len(spans)) == clock(text, faulty.arm_time)


def test_a_clock_goes_on_after_its_program() -> None:
    saved = clock("5+3").start(WHITE, 0.0).press(10.0).start(BLACK, 10.0).at(14.0).model_dump_json()
    read = ChessClock.model_validate_json(saved)
    assert read == clock("5+3").start(WHITE, 0.0).press(10.0).start(BLACK, 10.0).at(14.0)
    again = read.loaded().start(BLACK, 2.0).press(3.0)  # the game's time began anew
    assert (again.left(WHITE), again.left(BLACK)) == (293.0, 300.0 - 4.0 - 1.0 + 3.0)


def test_transitions_that_make_no_sense_are_refused() -> None:
    idle, running = clock(), clock().start(WHITE, 0.0)
    with pytest.raises(ClockError, match=r"^Black cannot start: White's move is under way; press"):
        running.start(BLACK, 1.0)
    with pytest.raises(ClockError, match=r"^White cannot start: White's move is under way"):
        running.start(WHITE, 1.0)
    with pytest.raises(ClockError, match=r"^Black cannot start: White's move is paused"):
        running.pause(1.0).start(BLACK, 1.0)
    with pytest.raises(ClockError, match=r"^nobody can press: no move is under way; start a side first$"):
        idle.press(1.0)
    with pytest.raises(ClockError, match=r"^nobody can decide: no move is under way"):
        idle.decided(1.0)
    with pytest.raises(ClockError, match=r"^the arm cannot have moved: White's move is under way; decide first$"):
        running.arm_clear(1.0)


def test_time_never_goes_back() -> None:
    game = clock("5").start(WHITE, 10.0)
    assert game.left(WHITE, 3.0) == 300.0
    assert game.at(3.0) == game
    assert game.press(3.0).left(WHITE) == 300.0


# ------------------------------------------------------------------------------------------------ what engines are told


def test_an_engine_is_told_both_clocks() -> None:
    limit = clock("5+3", black="10+5").start(WHITE, 0.0).limit(WHITE, 10.0, arm=6.0)
    assert limit.white_clock == pytest.approx(290.0 - OVERHEAD)
    assert limit.white_inc == pytest.approx(3.0 - OVERHEAD)
    assert (limit.black_clock, limit.black_inc) == (600.0, 5.0)


def test_an_engine_whose_side_pays_for_the_arm_is_told_less() -> None:
    limit = clock("15+10", ArmTime.OWN).start(BLACK, 0.0).limit(BLACK, 0.0, arm=6.0)
    assert limit.black_clock == pytest.approx(900.0 - 6.0 - OVERHEAD)
    assert limit.black_inc == pytest.approx(4.0 - OVERHEAD)
    assert (limit.white_clock, limit.white_inc) == (900.0, 10.0)
    short = clock("5", ArmTime.OWN).limit(WHITE, 0.0, arm=6.0)
    assert short.white_clock == pytest.approx(300.0 - 30 * (6.0 + OVERHEAD))  # motion of the moves to come as well
    assert short.white_inc == 0.0
    assert clock("0:20", ArmTime.OWN).limit(WHITE, 0.0, arm=6.0).white_clock == pytest.approx(20.0 * LEAST_SHARE)


@given(
    st.sampled_from(["5", "0:20", "5+3", "15+10", "40/90+30", "3b2", "3d2"]),
    st.floats(0.0, 30.0), st.floats(0.0, 1e4), st.sampled_from(list(ArmTime)), st.booleans(),
)  # fmt: skip
def test_an_engine_is_never_told_more_than_it_has(
    text: str, arm: float, now: float, arm_time: ArmTime, colour: bool
) -> None:
    game = clock(text, arm_time).start(colour, 0.0)
    limit = game.limit(colour, now, arm)
    told = limit.white_clock if colour else limit.black_clock
    assert told is not None
    assert 0.0 < told <= max(0.001, game.left(colour, now))


# ------------------------------------------------------------------------------------------------------ laws of a game


@given(seed=st.integers(0, 10_000), text=st.sampled_from(["5", "5+3", "5d3", "5b3", "3/5+1,2+1"]), own=st.booleans())
def test_all_time_is_accounted_for(seed: int, text: str, own: bool) -> None:
    """Thought, motion and pauses fill the time; what is left is what there was, less charges, plus what moves add."""
    rng = random.Random(seed)
    game, now = clock(text, ArmTime.OWN if own else ArmTime.NOBODY), 50.0
    start, free = now, 0.0
    for ply in range(rng.randrange(1, 14)):
        colour = ply % 2 == 0
        game = game.start(colour, now)
        if rng.random() < 0.5:
            now += rng.uniform(0.0, 3.0)
            game = game.pause(now)
            pause = rng.uniform(0.0, 9.0)
            now, free = now + pause, free + pause
            game = game.start(colour, now)
        now += rng.uniform(0.0, 5.0)
        if rng.random() < 0.5:
            game = game.press(now)
        else:
            if rng.random() < 0.5:  # a fault, of which the clock hears with the decision
                lost = rng.uniform(0.0, 5.0)
                now, free = now + lost, free + lost
                game = game.give_back(lost, now)
            game = game.decided(now).at(now + 0.5)
            arm = rng.uniform(0.5, 4.0)
            now += arm
            free += 0.0 if own else arm
            game = game.arm_clear(now)
        game = ChessClock.model_validate_json(game.model_dump_json())
    assert sum(m.thought + m.arm for m in game.moves) == pytest.approx(now - start - free)
    for colour in (WHITE, BLACK):
        left = game.control(colour).periods[0].base
        for move in [m for m in game.moves if m.white == colour]:
            assert move.before == pytest.approx(left)
            left = move.after
        assert game.left(colour) == pytest.approx(left)
    if text == "5":
        assert game.left(WHITE) + game.left(BLACK) == pytest.approx(600.0 - (now - start - free))
    plies = rng.randrange(len(game.moves) + 1)
    kept = game.take_back(plies)
    assert kept.moves == game.moves[: len(game.moves) - plies]
    for colour in (WHITE, BLACK):
        mine = [m.after for m in kept.moves if m.white == colour]
        assert kept.left(colour) == (mine[-1] if mine else kept.control(colour).periods[0].base)
