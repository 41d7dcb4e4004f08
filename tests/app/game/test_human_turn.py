"""What was typed beside what is seen: when a move counts although its piece stands far off."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import chess
import pytest

from app.game import GameEnd, human_turn
from app.game.human_turn import HumanTurn
from app.players.person import PersonGone
from hardware.interfaces import HardwareError, RigGone
from vision.reading.moves import MoveReading
from vision.reading.outcome import ReadingOutcome, Situation

PUSHED, PROMOTED = "e2e4", "a7a8q"


class Turn(HumanTurn):
    """A turn in which every piece is badly set, unless somebody means it so, or else it ``fits``."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, fits: bool = False) -> None:
        monkeypatch.setattr(human_turn, "badly_set", self.badly_set)
        self.fits = fits
        self.meant, self.accepted, self.complained = list[bool](), list[chess.Move](), 0
        self.asked = list[str]()
        self._table: Any = SimpleNamespace(board=chess.Board("7k/P7/8/8/8/8/8/K7 w - - 0 1"))
        self._complaints: Any = SimpleNamespace(of_faults=self._complain)

    def badly_set(self, table: Any, moves: Sequence[chess.Move], *, said: bool) -> tuple[str, ...]:
        self.asked = [move.uci() for move in moves]
        self.meant.append(said)
        return () if said or self.fits else ("it stands half way",)

    def _complain(self, faults: tuple[str, ...]) -> None:
        self.complained += 1

    def _accept(self, move: chess.Move, then: float, reading: Any = None) -> None:
        self.accepted.append(move)


@pytest.mark.parametrize(
    ("typed", "seen", "counts"),
    [
        (None, PUSHED, False),  # nobody has said anything
        (PUSHED, PUSHED, True),
        ("d2d4", PUSHED, False),  # another one was typed
        ("e2e3", PUSHED, False),
        ("d2e4", PUSHED, False),
        ("a7a8n", PROMOTED, True),  # what it promotes to is not seen for sure
    ],
)
def test_a_piece_that_stands_far_off_counts_where_this_very_move_was_typed(
    monkeypatch: pytest.MonkeyPatch, typed: str | None, seen: str, counts: bool
) -> None:
    turn, move = Turn(monkeypatch), chess.Move.from_uci(seen)
    decision = MoveReading(ReadingOutcome.MOVE, (move,), 1.0, 1.0, (), promotion_unsure=move.promotion is not None)
    reading: Any = SimpleNamespace(decision=decision, finding=SimpleNamespace(situation=Situation.LEGAL))
    turn._judge(reading, None if typed is None else chess.Move.from_uci(typed), 0.0)
    assert turn.meant == [counts]
    assert turn.asked[0] == (typed if counts else seen), "whether that stands well"
    assert [one.uci() for one in turn.accepted] == ([typed] if counts else []), "and it promotes to what was typed"
    assert turn.complained == (not counts)


@pytest.mark.parametrize("verdict", [ReadingOutcome.MOVE, ReadingOutcome.DOUBT])
def test_a_pawn_may_have_become_any_piece_until_it_is_told_which(
    monkeypatch: pytest.MonkeyPatch, verdict: ReadingOutcome
) -> None:
    """A rook does not look like a queen that stands, so that the queen's outline alone would refuse it."""
    turn = Turn(monkeypatch, fits=True)
    turn._questions = cast(
        Any, SimpleNamespace(promotion=lambda _: chess.ROOK, yes=lambda question, *_: "=R" in question)
    )
    decision = MoveReading(verdict, (chess.Move.from_uci(PROMOTED),), 1.0, 1.0, (), promotion_unsure=True)
    reading: Any = SimpleNamespace(decision=decision, finding=SimpleNamespace(situation=Situation.LEGAL))
    turn._judge(reading, None, 0.0)
    assert turn.asked == ["a7a8q", "a7a8r", "a7a8b", "a7a8n"]
    assert [one.uci() for one in turn.accepted] == ["a7a8r"]


class Listening(HumanTurn):
    """A turn in which each line is answered by the next of some ends, or errors."""

    def __init__(self, *answers: GameEnd | Exception) -> None:
        self.answers, self.told = list(answers), list[str]()
        self._colour, self._remote = chess.WHITE, None
        self._table: Any = SimpleNamespace(board=chess.Board(), replied=False, give_up=lambda _: True)
        self._timing: Any = SimpleNamespace(start=lambda _colour: None)
        self._human: Any = SimpleNamespace(both=False, refusal=lambda _: None)
        self._ui: Any = SimpleNamespace(answered=lambda: None, say=self.told.append)
        self._told = ""

    def _prompt(self) -> None:
        pass

    def _heed(self) -> None:
        pass

    def _flag(self) -> None:
        pass

    def _listen(self) -> str:
        return "look"

    def _obey(self, command: Any) -> GameEnd:
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.mark.parametrize("gone", [False, True])
def test_the_guards_camera_is_awake_only_while_a_line_is_waited_for(gone: bool) -> None:
    """In pace fast plant time runs for it: it would never stand again."""
    woken = list[bool]()

    def typed(_patience: float) -> str:
        assert woken == [True]
        if gone:
            raise PersonGone
        return "look"

    turn = Listening()
    turn._notice = cast(Any, SimpleNamespace(wake=woken.append))
    turn._stopped = None
    turn._table.permission = SimpleNamespace(stopped=None)
    turn._human.lines = SimpleNamespace(next=typed)
    if gone:
        with pytest.raises(PersonGone):
            HumanTurn._listen(turn)
    else:
        assert HumanTurn._listen(turn) == "look"
    assert woken == [True, False]


LEFT = GameEnd("*", "left", complete=False)


def test_a_device_that_fails_is_told_and_may_be_tried_again() -> None:
    turn = Listening(HardwareError("the camera gives no picture"), LEFT)
    assert turn.take() is LEFT
    assert turn.told == ["the camera gives no picture"]


def test_what_left_a_piece_in_the_fingers_ends_the_game_for_another_program_to_go_on_with() -> None:
    turn = Listening(HardwareError("the camera gives no picture"), LEFT)
    turn._table.give_up = lambda _: False
    with pytest.raises(HardwareError):
        turn.take()
    assert turn.told == []


def test_nobodys_clock_starts_again_for_a_move_that_stands_though_the_look_after_it_failed() -> None:
    turn = Listening(HardwareError("the camera gives no picture"))
    started = list[chess.Color]()
    turn._timing.start = started.append
    obey = turn._obey

    def plays(command: Any) -> GameEnd:
        turn._table.board.push_uci("e2e4")
        return obey(command)

    turn._obey = plays  # type: ignore[method-assign]
    assert turn.take() is None
    assert started == [chess.WHITE], "as the turn began"


def test_where_all_devices_are_gone_nothing_is_tried_again() -> None:
    turn = Listening(RigGone("the world has ended"), LEFT)
    with pytest.raises(RigGone):
        turn.take()
    assert turn.told == []
