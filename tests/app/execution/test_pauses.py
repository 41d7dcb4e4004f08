"""A game goes on where the arm stopped, as this program was late, it was pushed or somebody pressed STOP; on paper."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import chess
import numpy as np
import pytest

from app import UserError
from app.execution.carrier import MOST_PAUSES, Carrier
from app.execution.pauses import MOST_YIELDS, STAYED, WENT_ON
from app.execution.state import Attendant
from app.execution.table import Table
from app.game import Devices, Game, Position
from app.game.person import NeedsGo, UnattendedAttendant
from app.motion import Motion, MotionSettings, Plan
from app.motion.obstacles import closed_position
from app.pieces.inventory import Inventory, Stage
from app.pieces.layout import start_layout
from app.players.players import Decision, LinePlayer, Player, Players
from app.records import GameRecord, GameSetup, PlyEvent, StepEvent, read_events
from app.records.events import TroubleEvent
from app.rig.arm import ArmAtRest, ArmGaveWay, ArmPaused, ArmStopped, Outcome
from app.terminal.game_display import UserInterface
from controller.protocol import Guard
from hardware.parameters import load_parameters
from hardware.piece_set import Kind
from hardware.table import TableSettings
from tests.waiting import PATIENCE

TABLE, PARAMETERS, MOTION = TableSettings(), load_parameters(), MotionSettings()
CLOSED = closed_position(Kind.PAWN, PARAMETERS.pads)


class Clock:
    def now(self) -> float:
        return 0.0

    def sleep(self, duration: float) -> None:
        raise AssertionError("nothing here waits")


class LateArm:
    """Carries plans out on paper, and stops where it is told: at a share of a stage, once or always."""

    lead_ticks = 30

    def __init__(
        self, stage: Stage, share: float, *, always: bool = False, pushed: bool = False, presses: int = 0
    ) -> None:
        self.pauses = self.resumed = self.released = 0
        self.stopped = False
        self._presses = presses
        """So often somebody presses STOP there."""
        self._pushed = pushed
        """It gives way where it stops, and admits no motion until it is told to."""
        self.begun: list[tuple[int | None, Stage | None]] = []
        self._at, self._always = (stage, share), always
        self._state = ArmAtRest(np.array(MOTION.home), 0.011, 0)

    def state(self) -> ArmAtRest:
        return self._state

    def settle(self) -> ArmAtRest:
        return self._state

    def resume(self) -> None:
        assert self._state.gave_way, "only an arm that gave way is told to go on"
        self.resumed += 1
        self._state = replace(self._state, gave_way=False)

    def release(self) -> None:
        assert self.stopped, "only an arm that was stopped is let go on"
        self.released += 1
        self.stopped = False

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        assert not self.stopped, "nobody has said 'go'"
        if self._state.gave_way:
            raise ArmGaveWay("a hold is in force")
        for each in plan.motions:
            motion = each.continued(self._state.reference)
            begin = begin or (lambda _: None)
            np.testing.assert_allclose(motion.samples[0]["position"], self._state.reference, atol=1e-9)
            begin(motion)
            self.begun.append((motion.transfer, motion.stage))
            late = motion.stage is self._at[0] and (self._always or self.pauses < max(1, self._presses))
            last = round(self._at[1] * (len(motion.samples) - 1)) if late else len(motion.samples) - 1
            if motion.touches and not late:
                last = (
                    int(np.flatnonzero(motion.samples["guard"] == Guard.TOUCH)[0]) + 120
                )  # some mm below where the guard is on
            self._follow(motion, last)
            if late:
                self.pauses += 1
                if self._presses:
                    self.stopped = True
                    raise ArmStopped
                if self._pushed:
                    self._state = replace(self._state, gave_way=True)
                    raise ArmGaveWay("the tool was 3 mm from its reference")
                raise ArmPaused("sample 7 was due, but only 5 had arrived: send further ahead")
        return Outcome(plan.expected, 2.0, 4.0, 100)

    def _follow(self, motion: Motion, last: int) -> None:
        samples: Any = motion.samples
        opening = samples["finger_velocity"][: last + 1] > 0.0
        felt = self._state.felt
        if motion.stage is Stage.GRASP and last == len(samples) - 1:
            felt = 4.0
        if opening.any():
            felt = 0.0
        finger = self._state.finger + float(samples["finger_velocity"][: last + 1].clip(0.0).sum() * 0.00088)
        finger = CLOSED if felt else finger
        self._state = ArmAtRest(samples["position"][last].copy(), finger, 0, felt)


NOBODY = UnattendedAttendant(None, UserInterface())


class Going:
    """An ``Attendant`` who says 'go' at once."""

    def __init__(self) -> None:
        self.asked = list[str]()

    def wait_for_go(self, sentence: str) -> None:
        self.asked.append(sentence)


def play(
    folder: Path, arm: LateArm, line: str = "e4 d5 exd5", wrap: Callable[[Player], Player] = lambda p: p,
    attendant: Attendant | None = None,
) -> Game:  # fmt: skip
    board = chess.Board()
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    moves, walk = [], board.copy()
    for san in line.split():
        moves.append(walk.push_san(san))
    player = wrap(LinePlayer(board, moves))
    record = GameRecord.begin(folder, GameSetup("a", "b", 1, "real"), board, inventory, 0.0)
    devices = Devices(arm, Clock(), None, None)
    with record, Players(player, player) as players:
        carrier = Carrier(devices, record, UserInterface(), MOTION, PARAMETERS, attendant or NOBODY)
        table = Table(Position(board, inventory), devices, carrier, None, record, UserInterface())
        game = Game(table, players, UserInterface())
        game.play(10)
    return game


STOPS = pytest.mark.parametrize(
    ("stage", "share", "again"),
    [
        (Stage.APPROACH, 0.0, Stage.APPROACH),
        (Stage.APPROACH, 0.6, Stage.APPROACH),
        (Stage.GRASP, 0.5, Stage.APPROACH),
        (Stage.CARRY, 0.0, Stage.CARRY),
        (Stage.CARRY, 0.3, Stage.CARRY),
        (Stage.CARRY, 0.7, Stage.CARRY),
        (Stage.RELEASE, 0.0, Stage.CARRY),
        (Stage.RELEASE, 0.95, Stage.RETURN),
    ],
)
"""Where the arm is stopped, and what it begins with afterwards."""


@STOPS
def test_a_ply_is_finished_from_where_the_arm_stopped(tmp_path: Path, stage: Stage, share: float, again: Stage) -> None:
    arm = LateArm(stage, share)
    play(tmp_path / "game", arm)
    assert arm.pauses == 1
    events = read_events(tmp_path / "game" / "events.jsonl")
    plies = [event for event in events if isinstance(event, PlyEvent)]
    assert [ply.san for ply in plies] == ["e4", "d5", "exd5"]
    assert [ply.resumed for ply in plies] == [True, False, False]
    steps = [event for event in events if isinstance(event, StepEvent) and event.ply == 1]
    stopped = next(i for i, step in enumerate(steps) if step.stage is stage)
    assert steps[stopped + 1].stage is again


@STOPS
@pytest.mark.parametrize("presses", [1, 3])
def test_a_ply_is_finished_from_where_somebody_stopped_the_arm_once_they_say_go(
    tmp_path: Path, stage: Stage, share: float, again: Stage, presses: int
) -> None:
    arm, going = LateArm(stage, share, presses=presses), Going()
    play(tmp_path / "game", arm, attendant=going)
    # a stage that is done over is stopped as often as is wanted, one that is done for good once
    asked = presses if again is stage else len(going.asked)
    assert going.asked == ["somebody pressed STOP: say 'go' when the arm may move again"] * asked
    assert arm.released == arm.pauses == asked >= 1
    events = read_events(tmp_path / "game" / "events.jsonl")
    plies = [event for event in events if isinstance(event, PlyEvent)]
    assert [ply.san for ply in plies] == ["e4", "d5", "exd5"]
    assert plies[0].resumed
    troubles = [event for event in events if isinstance(event, TroubleEvent)]
    assert [(one.kind, one.squares, one.sentence) for one in troubles] == [("stopped", (), WENT_ON)] * asked
    steps = [event for event in events if isinstance(event, StepEvent) and event.ply == 1]
    stopped = next(i for i, step in enumerate(steps) if step.stage is stage)
    assert steps[stopped + 1].stage is again


def test_no_number_of_stops_is_too_many(tmp_path: Path) -> None:
    arm = LateArm(Stage.CARRY, 0.3, presses=2 * MOST_PAUSES)
    play(tmp_path / "game", arm, attendant=Going())
    assert arm.released == 2 * MOST_PAUSES


def test_where_nobody_is_there_a_stop_ends_the_game_with_its_next_step_and_the_arm_rests(tmp_path: Path) -> None:
    arm = LateArm(Stage.CARRY, 0.5, presses=1)
    with pytest.raises(NeedsGo, match=r"somebody pressed STOP: .* continue with 'touchmove resume'$"):
        play(tmp_path / "game", arm)
    assert arm.stopped
    assert arm.state().felt > 0.5, "the piece is in its fingers yet"
    (trouble,) = (one for one in read_events(tmp_path / "game" / "events.jsonl") if isinstance(one, TroubleEvent))
    assert (trouble.kind, trouble.sentence) == ("stopped", STAYED)


def test_a_stop_while_nothing_moves_is_asked_about_before_anything_begins(tmp_path: Path) -> None:
    arm, going = LateArm(Stage.RETURN, 0.0), Going()
    arm.stopped = True
    play(tmp_path / "game", arm, attendant=going)
    assert (arm.released, len(going.asked)) == (1, 1)
    first, second = read_events(tmp_path / "game" / "events.jsonl")[1:3]
    assert isinstance(first, TroubleEvent)
    assert isinstance(second, StepEvent)
    assert not any(ply.resumed for ply in read_events(tmp_path / "game" / "events.jsonl") if isinstance(ply, PlyEvent))


def test_an_arm_that_is_always_late_ends_the_game_with_its_sentence(tmp_path: Path) -> None:
    arm = LateArm(Stage.APPROACH, 0.5, always=True)
    with pytest.raises(ArmPaused, match="send further ahead"):
        play(tmp_path / "game", arm)
    assert arm.pauses == MOST_PAUSES + 1


@pytest.mark.parametrize(("stage", "again"), [(Stage.APPROACH, Stage.APPROACH), (Stage.CARRY, Stage.CARRY)])
def test_an_arm_that_was_pushed_goes_on_once_it_rests(tmp_path: Path, stage: Stage, again: Stage) -> None:
    arm = LateArm(stage, 0.6, pushed=True)
    play(tmp_path / "game", arm)
    assert (arm.pauses, arm.resumed) == (1, 1)
    events = read_events(tmp_path / "game" / "events.jsonl")
    steps = [event.stage for event in events if isinstance(event, StepEvent) and event.ply == 1]
    assert steps[steps.index(stage) + 1] is again


def test_what_an_arm_meets_as_it_grasps_is_looked_at_from_home(tmp_path: Path) -> None:
    """Another piece may stand there than was thought; here nobody looks, so the game ends, and can be resumed."""
    arm = LateArm(Stage.GRASP, 0.5, pushed=True)
    with pytest.raises(UserError, match="3 mm from its reference"):
        play(tmp_path / "game", arm)
    assert arm.resumed == 1
    np.testing.assert_allclose(arm.state().reference, MOTION.home, atol=1e-9)


def test_an_arm_that_is_pushed_again_and_again_stays_where_it_is(tmp_path: Path) -> None:
    arm = LateArm(Stage.CARRY, 0.5, always=True, pushed=True)
    with pytest.raises(ArmGaveWay):
        play(tmp_path / "game", arm)
    assert (arm.pauses, arm.resumed) == (MOST_YIELDS + 1, MOST_YIELDS)


def test_an_arm_that_somebody_pushed_as_it_rested_goes_home(tmp_path: Path) -> None:
    arm = LateArm(Stage.CARRY, 0.5, pushed=True)
    arm._state = replace(arm._state, reference=np.add(MOTION.home, (0.01, -0.02, 0.0)), gave_way=True)
    board = chess.Board()
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    record = GameRecord.begin(tmp_path / "game", GameSetup("a", "b", 1, "real"), board, inventory, 0.0)
    with record:
        devices = Devices(arm, Clock(), None, None)
        Carrier(devices, record, UserInterface(), MOTION, PARAMETERS, NOBODY).be_ready(inventory)
    assert arm.resumed == 1
    np.testing.assert_allclose(arm.state().reference, MOTION.home, atol=1e-9)


def test_the_next_player_thinks_while_the_arm_lets_go_and_goes_home(tmp_path: Path) -> None:
    """On its way home after each ply this arm waits until the next player has been asked."""
    asked_for, asked = list[int](), threading.Condition()

    class Told:
        name = "told"

        def __init__(self, player: Player) -> None:
            self._player = player

        def choose(self, board: chess.Board) -> Decision:
            with asked:
                asked_for.append(board.ply())
                asked.notify()
            return self._player.choose(board)

    class Waiting(LateArm):
        homes = 0

        def _follow(self, motion: Motion, last: int) -> None:
            super()._follow(motion, last)
            if motion.stage is Stage.RELEASE and motion.label.endswith("home"):
                self.homes += 1
                with asked:
                    assert asked.wait_for(lambda: self.homes in asked_for, PATIENCE), "nobody thinks"

    arm = Waiting(Stage.RETURN, 0.0)
    play(tmp_path / "game", arm, wrap=Told)
    assert asked_for == [0, 1, 2, 3]
    assert arm.homes == 3
