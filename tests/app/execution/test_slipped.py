"""A piece that is lost on its way is missed when the fingers come to its place, whatever holds them up there."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import chess
import numpy as np
import pytest

from app.motion import MotionSettings, Plan, Planner
from app.pieces.inventory import Inventory, Stage
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.rig.arm import ASIDE, ControllerArm, GraspedAside, PieceSlipped
from controller.protocol.datagram_fields import Result
from controller.wire.client import MotionOutcome
from hardware.parameters import load_parameters
from hardware.table import TableSettings

TABLE, MOTION = TableSettings(), MotionSettings()


class Client:
    """Does what it is told; the pads feel what the test says from the carrying on."""

    lockstep, period = True, 0.001

    def __init__(self, plan: Plan, felt: tuple[float, float], aside: float, slides: bool) -> None:
        self._plan, self._felt, self._aside, self._slides = plan, felt, aside, slides
        zeros = (0.0, 0.0, 0.0)
        self.telemetry = SimpleNamespace(
            warm=False, admitting=True, tactile=(4.0, 4.0), reference=zeros, position=zeros, finger_position=0.0, tick=0
        )
        self.done = 0
        self.stopped = False

    def execute(self, samples: Any, *, followed: bool) -> MotionOutcome:
        motion = self._plan.motions[self.done]
        self.done += 1
        grips = motion.grips
        result = Result.GRIPPED if grips else Result.TOUCHED if motion.touches else Result.DONE
        tactile = (4.0, 4.0) if grips else self._felt if motion.stage is Stage.CARRY else (0.0, 0.0)
        at = tuple(samples["position"][-1].tolist())
        finger = (motion.seats_at or 0.0) + self._aside
        self.telemetry.finger_position = motion.seats_at if self._slides else finger
        return MotionOutcome(result, 0, 10, 0.01, at, at, finger, 1.0, 4.0, tactile)  # type: ignore[arg-type]

    def stop(self) -> None:
        self.stopped = True

    def wait_standing(self) -> SimpleNamespace:
        return self.telemetry


def carried_out(felt: tuple[float, float], aside: float = 0.0, *, slides: bool = False, left: float = 4.0) -> Client:
    """A ply whose piece stands so far aside that the fingers close by ``aside`` less; ``left`` is what they feel as
    they rest.
    """
    board = chess.Board()
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    ply = transfers(board, chess.Move.from_uci("e2e4"), inventory)
    plan = Planner.of(MOTION, load_parameters(), inventory.table, np.array(MOTION.home), 0.02, 8).ply(
        "e4", ply.transfers, inventory
    )
    client = Client(plan, felt, aside, slides)
    client.telemetry.tactile = (left, left)
    arm = ControllerArm(client)  # type: ignore[arg-type]
    try:
        arm.execute(plan)
    finally:
        assert client.stopped == (min(felt) < 0.5 or aside > ASIDE)
    return client


def test_a_piece_between_both_pads_is_set_down() -> None:
    assert carried_out((3.8, 4.1)).done == 4


@pytest.mark.parametrize("slides", [False, True])
def test_a_piece_that_the_pads_edges_hold_is_not_lifted(slides: bool) -> None:
    assert carried_out((3.8, 4.1), 0.0004, slides=slides).done == 4
    with pytest.raises(GraspedAside, match=r"^could not grasp pawn on e2: the pads held it by their edges") as held:
        carried_out((3.8, 4.1), 0.0034, slides=slides)
    assert held.value.seated == slides
    assert held.value.finger_position == pytest.approx(0.0046, abs=1e-4)


def test_what_was_squeezed_out_of_the_edges_has_not_slid_into_the_grooves() -> None:
    with pytest.raises(GraspedAside) as held:
        carried_out((3.8, 4.1), 0.0034, slides=True, left=0.0)
    assert not held.value.seated


@pytest.mark.parametrize("felt", [(0.0, 0.0), (4.0, 0.1)])
def test_empty_fingers_have_lost_it(felt: tuple[float, float]) -> None:
    with pytest.raises(PieceSlipped, match=r"^pawn e2 to e4: the fingers arrived empty; where has it gone\?$"):
        carried_out(felt)


def test_the_way_home_from_what_holds_the_tool_up_begins_softly_and_straight_up() -> None:
    parameters, stroke = load_parameters(), 0.009
    held = TABLE.base_from_board(np.array([(0.02, -0.08, 0.028)]))[0]
    reference = held + np.array([0.0, 0.0, stroke])
    plan = Planner.of(MOTION, parameters, TABLE, reference, 0.0).home(held_up_at=held)
    first, second = plan.motions
    rows = first.samples
    assert rows["position"][0] == pytest.approx(reference, abs=1e-7)
    assert rows["position"][-1] == pytest.approx(held, abs=1e-7)
    assert second.samples["position"][0] == pytest.approx(held, abs=1e-6)
    assert np.all(np.diff(rows["position"][:, 2]) <= 1e-9), "z3 points down"
    assert np.abs(rows["velocity"]).max() < 0.06
    assert rows["stiffness"][:, 2] == pytest.approx(MOTION.gains.frequency_at_contact**2, rel=1e-6)
    assert Planner.of(MOTION, parameters, TABLE, reference, 0.0).home().motions[0].label == "home"


def test_who_carries_plans_out_loads_nothing_that_plans() -> None:
    """What follows a touch was planned before: it comes with the plan."""
    script = "import sys, app.rig.arm; print(*(name for name in sys.modules if name.startswith('app.motion')))"
    assert not subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True).stdout.split()
