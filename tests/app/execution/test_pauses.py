"""A game goes on where the arm stopped by itself, as this program was late or it was pushed; on an arm of paper."""

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
from app.execution.carrier import MOST_PAUSES, MOST_YIELDS, Carrier
from app.execution.table import Table
from app.game import Devices, Game, Position
from app.motion import Motion, MotionSettings, Plan
from app.motion.obstacles import closed_position
from app.pieces.inventory import Inventory, Stage
from app.pieces.layout import start_layout
from app.players.players import Decision, LinePlayer, Player, Players
from app.records import GameRecord, GameSetup, PlyEvent, StepEvent, read_events
from app.rig.arm import ArmAtRest, ArmGaveWay, ArmPaused, Outcome
from app.terminal.interface import UserInterface
from controller.protocol import Guard
from hardware.parameters import load_parameters
from hardware.table import Kind, TableSettings

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

    def __init__(self, stage: Stage, share: float, *, always: bool = False, pushed: bool = False) -> None:
        self.pauses = self.resumed = 0
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

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        if self._state.gave_way:
            raise ArmGaveWay("a hold is in force")
        for each in plan.motions:
            motion = each.continued(self._state.reference)
            begin = begin or (lambda _: None)
            np.testing.assert_allclose(motion.samples[0]["position"], self._state.reference, atol=1e-9)
            begin(motion)
            self.begun.append((motion.transfer, motion.stage))
            late = motion.stage is self._at[0] and (self._always or not self.pauses)
            last = round(self._at[1] * (len(motion.samples) - 1)) if late else len(motion.samples) - 1
            if motion.touches and not late:
                last = (
                    int(np.flatnonzero(motion.samples["guard"] == Guard.TOUCH)[0]) + 120
                )  # some mm below where the guard is on
            self._follow(motion, last)
            if late:
                self.pauses += 1
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


def play(folder: Path, arm: LateArm, line: str = "e4 d5 exd5", wrap: Callable[[Player], Player] = lambda p: p) -> Game:
    board = chess.Board()
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    moves, walk = [], board.copy()
    for san in line.split():
        moves.append(walk.push_san(san))
    player = wrap(LinePlayer(board, moves))
    record = GameRecord.begin(folder, GameSetup("a", "b", 1, "real"), board, inventory, 0.0)
    devices = Devices(arm, Clock(), None, None)
    with record, Players(player, player) as players:
        carrier = Carrier(devices, record, UserInterface(), MOTION, PARAMETERS)
        table = Table(Position(board, inventory), devices, carrier, None, record, UserInterface())
        game = Game(table, players, UserInterface())
        game.play(10)
    return game


@pytest.mark.parametrize(
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
        Carrier(Devices(arm, Clock(), None, None), record, UserInterface(), MOTION, PARAMETERS).be_ready(inventory)
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
                    assert asked.wait_for(lambda: self.homes in asked_for, 10.0), "nobody thinks"

    arm = Waiting(Stage.RETURN, 0.0)
    play(tmp_path / "game", arm, wrap=Told)
    assert asked_for == [0, 1, 2, 3]
    assert arm.homes == 3
