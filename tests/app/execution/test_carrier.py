"""The carrier before it moves anything: what it planned must still be so; and the way home of an arm left elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import chess
import numpy as np
import pytest

from app.execution.carrier import SPARED, Carrier
from app.execution.interruption import Begun, BoardTouched, CarryFailed, Loss
from app.execution.pauses import WENT_ON
from app.execution.recovery_plans import Blocked, plan_feeling_board, plan_stand_up
from app.execution.state import Attendant, Clearance, Devices, Job
from app.game.person import GameLeft, UnattendedAttendant
from app.motion import Motion, MotionSettings, Plan, Planner, PlanRefused
from app.motion.obstacles import closed_position
from app.pieces.inventory import Inventory, Stage, Transfer
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.players.typed_commands import Word
from app.records import GameRecord, GameSetup
from app.records.events import TroubleEvent
from app.records.files import NotWritten
from app.rig.arm import (
    TOUCH_ERROR,
    ArmAtRest,
    ArmPaused,
    ArmStopped,
    GraspedAside,
    GraspFailed,
    Outcome,
    TouchedElsewhere,
)
from app.terminal.game_display import UserInterface
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import Place, TableSettings
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.poses import Pose

TABLE, PARAMETERS, MOTION = TableSettings(), load_parameters(), MotionSettings()
STANDS = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
HOME = np.array(MOTION.home)


class Arm:
    """Follows on paper what it is told to; where ``presses`` are left, somebody presses STOP half way of a plan.

    Its board may be ``lower`` than everybody believes [m].
    """

    lead_ticks = 8
    lower = 0.0

    def __init__(self, at: Any = HOME, presses: int = 0, *, warm: bool = False) -> None:
        self.at, self.done, self.warm = np.array(at), list[str](), warm
        self.stopped, self.presses = False, presses

    def state(self) -> ArmAtRest:
        return ArmAtRest(self.at, 0.01, 0)

    settle = state

    def release(self) -> None:
        self.stopped = False

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        assert not self.stopped, "nobody has said 'go'"
        for motion in plan.motions:
            if begin is not None:
                begin(motion)
        if self.presses:
            self.presses, self.stopped = self.presses - 1, True
            samples = plan.motions[0].samples
            self.at = np.array(samples[len(samples) // 2][0])
            raise ArmStopped
        self.at = np.array(plan.motions[-1].samples[-1][0])
        self.done.append(plan.label)
        first = plan.motions[0]
        if first.touches_at is not None and abs(off := BELIEVED + self.lower - first.touches_at) > TOUCH_ERROR:
            raise TouchedElsewhere(first, off)
        return Outcome(1.0, 1.0, 1.0, 100, self.warm, FELT_AT + self.lower)


class Grasping(Arm):
    """Closes on a piece that stands ``aside`` of where it is believed to, along z₂ [m]: the pads take what is near,
    hold by their edges what is less so, and squeeze away what is far.

    ``meanwhile`` is called as a motion begins, with the motion; at what it raises the arm rests.
    """

    TAKES, HOLDS = 0.002, 0.008

    def __init__(
        self, aside: float, *, slides: bool = False, meanwhile: Callable[[Motion], None] = lambda _: None
    ) -> None:
        super().__init__()
        self.aside, self.slides, self.meanwhile = aside, slides, meanwhile
        self.closed_at, self.lifted, self.felt, self.finger = list[float](), list[float](), 0.0, 0.01

    def state(self) -> ArmAtRest:
        return ArmAtRest(self.at, self.finger, 0, self.felt)

    settle = state

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        assert not self.stopped, "nobody has said 'go'"
        for motion in plan.motions:
            if begin is not None:
                begin(motion)
            if motion.stage is Stage.CARRY:
                self.lifted.append(self.finger)
            if motion.seats_at is not None:
                self._close(motion)
            self.meanwhile(motion)
            if motion.stage in (Stage.RELEASE, None):
                self.finger, self.felt = 0.01, 0.0
            self.at = np.array(motion.samples["position"][-1])
        return super().execute(plan)

    def _close(self, motion: Motion) -> None:
        self.at, believed = motion.samples["position"][-1], TABLE.base_from_board([*TABLE.xy(KNIGHT.place), 0.0])
        self.closed_at.append(float(self.at[1] - believed[1]))
        off, pads = abs(self.closed_at[-1] - self.aside), PARAMETERS.pads
        if off > self.HOLDS:
            self.finger, self.felt = 0.0, 0.0
            raise GraspFailed(motion, self.finger)
        self.finger, self.felt = closed_position(Kind.KNIGHT, pads), 4.0
        if off > self.TAKES:
            edge = math.sqrt(PIECE_SHAPES[Kind.KNIGHT].stem_radius ** 2 - (pads.half_width - off) ** 2)
            self.finger = self.finger if self.slides else edge
            self.meanwhile(motion)
            raise GraspedAside(motion, edge, seated=self.slides)


class Guard:
    """A hand is over the board, and gone when ``clear`` returns."""

    holding = False

    def __init__(self) -> None:
        self.arrivals = 0

    def clear(self) -> None:
        self.arrivals += 1


class Going:
    """An ``Attendant`` who says 'go' at once."""

    def __init__(self) -> None:
        self.asked = 0

    def wait_for_go(self, sentence: str) -> None:
        self.asked += 1


def carrier_of(
    arm: Arm, guard: Guard | None, folder: Path, attendant: Attendant | None = None
) -> tuple[Carrier, GameRecord]:
    clock: Any = SimpleNamespace(now=lambda: 0.0)
    record = GameRecord.begin(folder / "game", GameSetup("a", "b", 1, "fast"), chess.Board(), STANDS, 0.0)
    devices: Any = Devices(arm, clock, None, None, guard)  # type: ignore[arg-type]
    attendant = attendant or UnattendedAttendant(None, UserInterface())
    return Carrier(devices, record, UserInterface(), MOTION, PARAMETERS, attendant), record


BISHOP, KNIGHT = STANDS.at(Place.parse("c1")), STANDS.at(Place.parse("b1"))
assert BISHOP is not None
assert KNIGHT is not None
LYING = MisplacedPiece(BISHOP, BISHOP.place, Pose(-0.0739, -0.1167, 3.133))
_PLANNER = Planner.of(MOTION, PARAMETERS, TABLE, HOME, 0.01)
FREE = MisplacedPiece(LYING.piece, LYING.target, Pose(0.02, 0.01, 0.3))
BELIEVED = plan_stand_up(_PLANNER, FREE, [FREE], STANDS).motions[0].touches_at or 0.0
"""How low the tool should be on that one's rim, and on the board, base frame z₃ [m]."""
FELT_AT = plan_feeling_board(_PLANNER, FREE, [FREE], STANDS).expected


KNIGHTS = transfers(chess.Board(), chess.Move.from_uci("b1c3"), STANDS)
TO_C3 = Job("Nc3", KNIGHTS.transfers, uci=KNIGHTS.uci)


@pytest.mark.parametrize(
    ("aside", "closed_at"),
    [(0.0, [0.0]), (0.0037, [0.0, 0.0019]), (-0.0037, [0.0, 0.0019, -0.0019]), (-0.006, [0.0, 0.0042, -0.0042])],
)
def test_a_piece_that_stands_aside_is_taken_further_to_its_side(
    tmp_path: Path, aside: float, closed_at: list[float]
) -> None:
    """By so much that the grooves draw it in. On the wrong side the edges hold it again, or squeeze it away."""
    arm = Grasping(aside)
    carrier, record = carrier_of(arm, None, tmp_path)
    carried = carrier.carry(TO_C3, STANDS)
    assert arm.closed_at == pytest.approx(closed_at, abs=2e-5)
    assert arm.done == [*["home"] * (len(arm.closed_at) - 1), "Nc3"], "it opens, and goes home, before it tries again"
    assert arm.lifted == [closed_position(Kind.KNIGHT, PARAMETERS.pads)]
    assert carried.resumed == bool(aside)
    assert not carrier.midway
    record.close()


def test_what_has_slid_into_the_grooves_is_carried_as_it_is(tmp_path: Path) -> None:
    arm = Grasping(0.0037, slides=True)
    carrier, record = carrier_of(arm, None, tmp_path)
    assert carrier.carry(TO_C3, STANDS).resumed
    assert len(arm.closed_at) == 1
    assert arm.done == ["Nc3"]
    record.close()


def test_what_slides_into_the_grooves_again_and_again_and_out_of_them_is_not_grasped_for_ever(tmp_path: Path) -> None:
    def out(motion: Motion) -> None:
        arm.felt = 0.0

    arm = Grasping(0.0037, slides=True, meanwhile=out)
    arm.TAKES = 0.0
    carrier, record = carrier_of(arm, None, tmp_path)
    with pytest.raises(CarryFailed, match="the pads held it by their edges"):
        carrier.carry(TO_C3, STANDS)
    assert len(arm.closed_at) == 4
    record.close()


@pytest.mark.parametrize(("aside", "tries"), [(0.0075, 3), (0.02, 1)])
def test_a_piece_that_is_on_neither_side_is_not_gripped(tmp_path: Path, aside: float, tries: int) -> None:
    """Once it was held by the edges that is what is said, whatever is felt on its sides."""
    arm = Grasping(aside)
    arm.TAKES = 0.0
    carrier, record = carrier_of(arm, None, tmp_path)
    said = "the pads held it by their edges" if tries > 1 else "the fingers closed"
    with pytest.raises(CarryFailed, match=rf"^could not grasp knight on b1: {said}") as failed:
        carrier.carry(TO_C3, STANDS)
    assert failed.value.loss is Loss.NOT_GRIPPED
    assert failed.value.done == 0
    assert len(arm.closed_at) == tries
    assert arm.done == ["home"] * tries
    record.close()


def refuse(monkeypatch: pytest.MonkeyPatch, which: Callable[[Sequence[Transfer], bool], bool]) -> None:
    """Have plans refused, by what is left to carry and whether its first piece is in the fingers."""
    plain = Planner.ply

    def ply(self: Planner, label: str, rest: Sequence[Transfer], now: Inventory, *, holding: bool, **how: Any) -> Plan:
        if which(rest, holding):
            raise PlanRefused("the fingers do not get there")
        return plain(self, label, rest, now, holding=holding, **how)

    monkeypatch.setattr(Planner, "ply", ply)


def test_where_the_fingers_do_not_get_at_either_side_the_edges_are_the_cause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse(monkeypatch, lambda rest, _: rest[0].seen is not None)
    arm = Grasping(0.0037)
    carrier, record = carrier_of(arm, None, tmp_path)
    with pytest.raises(CarryFailed, match="the pads held it by their edges"):
        carrier.carry(TO_C3, STANDS)
    assert len(arm.closed_at) == 1
    record.close()


def interrupting(stage: Stage, *errors: Exception) -> Callable[[Motion], None]:
    """Raises them, one each time something of a stage begins."""
    left = list(errors)

    def interrupt(motion: Motion) -> None:
        if motion.stage is stage and left:
            raise left.pop(0)

    return interrupt


def test_what_the_edges_hold_as_a_hand_comes_is_not_lifted_either(tmp_path: Path) -> None:
    arm = Grasping(0.0037, meanwhile=interrupting(Stage.GRASP, ArmPaused("late")))
    carrier, record = carrier_of(arm, None, tmp_path)
    carrier.carry(TO_C3, STANDS)
    assert arm.closed_at == pytest.approx([0.0, 0.0, 0.0019], abs=2e-5)
    assert arm.lifted == [closed_position(Kind.KNIGHT, PARAMETERS.pads)]
    record.close()


@pytest.mark.parametrize("error", [NotWritten("no space left", "choose another folder"), GameLeft(Word.QUIT)])
def test_after_a_piece_was_taken_to_a_side_every_other_trouble_is_told_as_ever(
    tmp_path: Path, error: Exception
) -> None:
    arm = Grasping(0.0037, meanwhile=interrupting(Stage.CARRY, error))
    carrier, record = carrier_of(arm, None, tmp_path)
    with pytest.raises(type(error)):
        carrier.carry(TO_C3, STANDS)
    assert arm.felt, "and it is held as it was"
    record.close()


def test_a_piece_in_the_fingers_is_not_let_go_of_where_its_way_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse(monkeypatch, lambda _, holding: holding)
    arm = Grasping(0.0037, meanwhile=interrupting(Stage.CARRY, ArmPaused("late")))
    carrier, record = carrier_of(arm, None, tmp_path)
    with pytest.raises(PlanRefused):
        carrier.carry(TO_C3, STANDS)
    assert arm.felt
    record.close()


@pytest.mark.parametrize("what", ["carry", "push", "stand up"])
@pytest.mark.parametrize("came", [False, True])
def test_nothing_is_done_that_was_planned_before_a_hand_came(tmp_path: Path, what: str, came: bool) -> None:
    arm, guard = Arm(), Guard()
    carrier, record = carrier_of(arm, guard, tmp_path)
    pushed: list[str] = []

    seen = Clearance(arrivals=0 if came else 1)  # the guard counts one when the arm asks it for clearance

    def act() -> None:
        if what == "carry":
            ply = transfers(chess.Board(), chess.Move.from_uci("e2e4"), STANDS)
            carrier.carry(Job("e4", ply.transfers, uci=ply.uci), STANDS, seen=seen)
        elif what == "push":
            blocked = [Blocked(LYING.piece.name, "white-pawn-c")]
            push = carrier.push_for(blocked, [LYING], STANDS, seen)
            pushed.append(push.name)
            carrier.push_aside(push, STANDS)
        else:
            carrier.stand_up(FREE, [FREE], STANDS, seen)

    with record:
        if came:
            with pytest.raises(BoardTouched):
                act()
            assert carrier.untouched
        else:
            act()
    assert len(arm.done) == (0 if came else 1)
    assert len(pushed) == (1 if what == "push" and not came else 0)


@pytest.mark.parametrize("warm", [False, True])
def test_an_arm_that_spares_its_servomotors_is_said_to_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, warm: bool
) -> None:
    said: list[str] = []
    monkeypatch.setattr(UserInterface, "say", lambda _, sentence, squares=(): said.append(sentence))
    carrier, record = carrier_of(Arm(warm=warm), None, tmp_path)
    ply = transfers(chess.Board(), chess.Move.from_uci("e2e4"), STANDS)
    with record:
        for _ in range(2):
            carrier.carry(Job("e4", ply.transfers, uci=ply.uci), STANDS)
    assert said == [SPARED] * warm


@pytest.mark.parametrize(("lower", "tries"), [(0.001, 1), (0.002, 2), (-0.003, 2)])
def test_where_something_is_lower_than_it_should_be_the_board_is_felt_once(
    tmp_path: Path, lower: float, tries: int
) -> None:
    arm = Arm()
    arm.lower = lower
    carrier, record = carrier_of(arm, None, tmp_path)
    with record:
        for number in range(1, 4):
            stood = carrier.stand_up(FREE, [FREE], STANDS, None) is not None
            assert stood == (number >= tries)
    assert sum("how high the board is" in label for label in arm.done) == tries - 1
    assert arm.done[-1].startswith("stand up")
    assert np.allclose(arm.at, HOME, atol=1e-9)


def test_a_stop_while_the_board_is_felt_leads_home_and_to_another_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm, going = Arm(), Going()
    arm.lower, execute = 0.002, arm.execute

    def pressed(plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        arm.presses = int("how high the board is" in plan.label)
        return execute(plan, begin)

    monkeypatch.setattr(arm, "execute", pressed)
    carrier, record = carrier_of(arm, None, tmp_path, going)
    with record:
        assert carrier.stand_up(FREE, [FREE], STANDS, None) is None
    assert going.asked == 1
    assert [label.split()[0] for label in arm.done] == ["stand", "home", "home"]
    assert np.allclose(arm.at, HOME, atol=1e-9)


def test_an_arm_that_was_left_elsewhere_goes_home_and_one_at_home_stays(tmp_path: Path) -> None:
    for at, ways in ((HOME, 0), (HOME + np.array([0.03, -0.05, 0.02]), 1)):
        arm = Arm(at)
        carrier, record = carrier_of(arm, None, tmp_path / str(ways))
        with record:
            carrier.bring_home(STANDS)
        assert len(arm.done) == ways
        assert np.allclose(arm.at, HOME, atol=1e-9)


@pytest.mark.parametrize("what", ["push", "stand up", "bring home"])
@pytest.mark.parametrize("presses", [1, 3])
def test_what_somebody_stops_besides_carrying_ends_at_home_once_they_say_go(
    tmp_path: Path, what: str, presses: int
) -> None:
    arm, going = Arm(HOME if what != "bring home" else HOME + np.array([0.03, -0.05, 0.02]), presses), Going()
    carrier, record = carrier_of(arm, None, tmp_path, going)
    with record:
        if what == "push":
            push = carrier.push_for([Blocked(LYING.piece.name, "white-pawn-c")], [LYING], STANDS, None)
            carrier.push_aside(push, STANDS)
        elif what == "stand up":
            free = MisplacedPiece(LYING.piece, LYING.target, Pose(0.02, 0.01, 0.3))
            assert carrier.stand_up(free, [free], STANDS, None) is None, "the camera tells how far it came"
        else:
            carrier.bring_home(STANDS)
        troubles = [event for event in record.events if isinstance(event, TroubleEvent)]
    assert arm.done == ["home"]
    assert np.allclose(arm.at, HOME, atol=1e-9)
    assert going.asked == presses
    assert [(one.kind, one.sentence) for one in troubles] == [("stopped", WENT_ON)] * presses
    assert carrier.untouched
    assert not carrier.midway


def test_who_leaves_before_a_begun_job_is_gone_on_with_leaves_it_midway(tmp_path: Path) -> None:
    """So that whoever begins something else first does it to its end: there is a piece in the fingers."""

    class Leaving:
        def wait_for_go(self, sentence: str) -> None:
            raise GameLeft(Word.NEW)

    arm = Arm()
    arm.stopped = True
    arm.state = arm.settle = lambda: ArmAtRest(arm.at, 0.005, 0, 4.0)  # type: ignore[method-assign]
    carrier, record = carrier_of(arm, None, tmp_path, Leaving())
    ply = transfers(chess.Board(), chess.Move.from_uci("e2e4"), STANDS)
    with record:
        with pytest.raises(GameLeft):
            carrier.carry(Job("e4", ply.transfers, uci=ply.uci), STANDS, Begun(0, Stage.CARRY))
        assert carrier.midway


@pytest.mark.parametrize("what", ["carry", "push", "stand up"])
def test_what_was_planned_before_a_stop_is_planned_anew_after_another_look(tmp_path: Path, what: str) -> None:
    """Who presses STOP may have a reason on the board, and may have put it right by hand."""
    arm, going = Arm(), Going()
    carrier, record = carrier_of(arm, None, tmp_path, going)
    arm.stopped = True
    seen = Clearance(arrivals=0)
    ply = transfers(chess.Board(), chess.Move.from_uci("e2e4"), STANDS)
    acts: dict[str, Callable[[], object]] = {
        "carry": lambda: carrier.carry(Job("e4", ply.transfers, uci=ply.uci), STANDS, seen=seen),
        "push": lambda: carrier.push_for([Blocked(LYING.piece.name, "white-pawn-c")], [LYING], STANDS, seen),
        "stand up": lambda: carrier.stand_up(FREE, [FREE], STANDS, seen),
    }
    with record, pytest.raises(BoardTouched):
        acts[what]()
    assert carrier.untouched
    assert arm.done == []
    assert (going.asked, arm.stopped) == (1, False)
