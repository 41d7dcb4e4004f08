"""What every arm has to do, whoever is behind it: the controller of a simulated rig, and the one of rig ``board``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

import chess
import numpy as np
import pytest

from app.motion import Motion, MotionSettings, Plan, Planner
from app.pieces.inventory import Inventory, Ply, Stage
from app.pieces.judging import judge
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.rig.arm import FELT, GAVE_WAY, Arm, ArmGaveWay, ArmStopped
from app.rig.board import BoardRig
from app.rig.devices import Rig
from app.rig.rig_file import WorldSection
from app.rig.shown_arm import ShownArm
from app.rig.simulation.settings import own_rig
from app.rig.simulation.sim import SimRig
from app.terminal.shown import PathShown
from controller.protection.limits import REACTIONS, Reaction
from controller.wire.address import find_controller
from controller.wire.listener import TelemetryWatch
from hardware.interfaces import Pace
from hardware.parameters import load_parameters
from hardware.piece_set import Colour
from hardware.sim.clients.hand import SimHand
from hardware.sim.hand.actions import Hover, Withdraw
from hardware.table import TableSettings

TABLE, PARAMETERS, MOTION = TableSettings(), load_parameters(), MotionSettings()
BOARD = chess.Board()
INVENTORY = Inventory.of(start_layout(BOARD, TABLE), TABLE)


@pytest.fixture(scope="module", params=["board", "controller"])
def rig(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    if request.param == "board":
        with BoardRig(MOTION.home, PARAMETERS) as board:
            yield board
        return
    world = WorldSection(pace=Pace.FAST, cameras=False, linger=2.0, person=Colour.WHITE)
    with SimRig(own_rig(tmp_path_factory.mktemp("arm") / "run", world), lambda _: None) as sim:
        yield sim


def planned(arm: Arm, ply: Ply, inventory: Inventory) -> Plan:
    state = arm.state()
    return Planner.of(MOTION, PARAMETERS, inventory.table, state.reference, state.finger, arm.lead_ticks).ply(
        ply.san, ply.transfers, inventory
    )


def test_an_arm_keeps_its_contract(rig: Rig) -> None:
    """One after the other, since pieces move: a ply there, told stage by stage; then one broken off while it holds."""
    arm, home = rig.arm, np.array(MOTION.home)
    before, since = arm.state(), rig.clock.now()
    np.testing.assert_allclose(before.reference, home, atol=1e-6)
    assert before.felt < FELT

    ply = transfers(BOARD, chess.Move.from_uci("e2e4"), INVENTORY)
    plan, told = planned(arm, ply, INVENTORY), list[Motion]()
    outcome = arm.execute(plan, told.append)
    assert [motion.stage for motion in told] == [Stage.APPROACH, Stage.GRASP, Stage.CARRY, Stage.RELEASE]
    assert outcome.duration == pytest.approx(plan.expected, rel=0.1)
    after = arm.state()
    np.testing.assert_allclose(after.reference, home, atol=1e-6)
    np.testing.assert_allclose(after.position, home, atol=2e-3)
    assert after.felt < FELT
    assert 0.0 < after.finger <= PARAMETERS.gripper.stroke + 1e-4
    assert after.tick >= before.tick + 0.9 * outcome.duration / PARAMETERS.drive.tick
    assert rig.clock.now() - since >= 0.9 * outcome.duration, "plant time passes as the arm moves"

    inventory = INVENTORY.after(ply)
    ply = transfers(chess.Board("rnbqkbnr/pppppppp/8/8/4P3/8/PPPP1PPP/RNBQKBNR w - - 0 1"), D4, inventory)
    plan = planned(arm, ply, inventory)
    arm.execute(Plan(plan.label, plan.motions[:2], plan.lead))
    held = arm.settle()
    assert held.felt >= FELT, "it says that something is in its fingers"
    x, y, _ = TABLE.board_from_base(held.reference)
    assert np.hypot(x - TABLE.xy(ply.transfers[0].source)[0], y - TABLE.xy(ply.transfers[0].source)[1]) < 1e-3
    kind = ply.transfers[0].kind
    arm.execute(Planner.of(MOTION, PARAMETERS, TABLE, held.reference, held.finger).home(kind))
    assert arm.state().felt < FELT
    np.testing.assert_allclose(arm.state().reference, home, atol=1e-6)


D4 = chess.Move.from_uci("d2d4")


def test_an_arm_that_is_pushed_gives_way_and_goes_on_when_told_to(rig: Rig) -> None:
    """A hand comes up under the resting tool, and goes."""
    if not isinstance(rig, SimRig):
        pytest.skip("nobody pushes an arm of paper")
    arm, home = rig.arm, np.array(MOTION.home)
    assert not arm.state().gave_way
    x, y, z = TABLE.board_from_base(home)
    with closing(SimHand(rig._run_dir)) as hand:
        hand.do(Hover(at=(x, y), height=z, duration=0.3), Withdraw())
    state = arm.state()
    assert state.gave_way
    state = arm.settle()
    assert state.gave_way, "why it stopped is not forgotten"
    back = Planner.of(MOTION, PARAMETERS, TABLE, state.reference, state.finger, arm.lead_ticks).home()
    with pytest.raises(ArmGaveWay):
        arm.execute(back)
    arm.resume()
    assert not arm.state().gave_way
    arm.execute(back)
    np.testing.assert_allclose(arm.state().position, home, atol=2e-3)


def test_an_arm_that_somebody_stops_keeps_what_it_holds_and_goes_on_when_it_is_released(rig: Rig) -> None:
    """With a piece in its fingers, which it then sets down again; STOP comes from a listener, as of a page."""
    if not isinstance(rig, SimRig):
        assert not rig.arm.stopped
        rig.arm.release()
        pytest.skip("nobody stops an arm of paper")
    arm = rig.arm
    ply = transfers(BOARD, chess.Move.from_uci("a2a3"), INVENTORY)
    plan = planned(arm, ply, INVENTORY)
    with TelemetryWatch(*find_controller(rig._run_dir)) as watch:

        def begin(motion: Motion) -> None:
            if motion.stage is Stage.CARRY:
                watch.stop(60.0)

        with pytest.raises(ArmStopped, match="somebody pressed STOP: say 'go' when the arm may move again"):
            arm.execute(plan, begin)
    held = arm.settle()
    assert arm.stopped
    assert held.felt >= FELT
    planner = Planner.of(MOTION, PARAMETERS, TABLE, held.reference, held.finger, arm.lead_ticks)
    rest = planner.ply(ply.san, ply.transfers, INVENTORY, holding=True, low=True)
    arm.resume()
    with pytest.raises(ArmStopped):
        arm.execute(rest)
    arm.release()
    assert not arm.stopped
    paths = list[PathShown]()
    ended = list[int]()
    shown = ShownArm(arm, lambda path: (paths.append(path), ended.append(arm.last_motion)))
    shown.execute(rest)
    assert [path.motion for path in paths] == [*ended[1:], arm.last_motion], "of a rig on which motions were refused"
    assert paths[0].motion > 1
    assert arm.state().felt < FELT
    assert rig.referee is not None
    truth, _ = rig.referee.look()
    assert judge(truth, INVENTORY.after(ply)).errors["white-pawn-a"] < 1e-3


def test_causes_after_which_the_controller_admits_no_motion_are_known_here() -> None:
    held = {cause for cause, reaction in REACTIONS.items() if reaction in (Reaction.COMPLIANT, Reaction.LET_GO)}
    assert held == GAVE_WAY


def test_an_arm_has_few_verbs(rig: Rig) -> None:
    verbs = {name for name in dir(rig.arm) if not name.startswith("_") and callable(getattr(rig.arm, name))}
    assert verbs == {"state", "settle", "resume", "release", "execute"}
