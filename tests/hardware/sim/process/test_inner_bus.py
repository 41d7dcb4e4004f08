"""A world in the thread of its controller: many ticks in one call come to the same as one after the other."""

from __future__ import annotations

import threading
from pathlib import Path

import chess
import numpy as np
import pytest

from app.pieces.layout import start_layout
from controller.law.task_space import TaskSpaceController
from controller.loop.supervisor import Supervisor
from controller.loop.tick import LOOK_CLOSER
from controller.model.constants import DeltaModel
from controller.protection.limits import default_limits
from controller.protocol.datagram_fields import MotionFlag
from controller.protocol.messages import Announce, Samples
from controller.protocol.states import State
from controller.settings import ControllerSettings
from hardware.interfaces import HardwareError, Pace
from hardware.parameters import load_parameters
from hardware.sim.clients.bus import SimServoBus
from hardware.sim.hand.actions import Action, HandSettings, Move, Withdraw
from hardware.sim.plant.grip_faults import GripFaults
from hardware.sim.plant.imperfections import Imperfections
from hardware.sim.process.inner_bus import InnerServoBus
from hardware.sim.process.randomisation import Randomisation
from hardware.sim.process.server import World
from hardware.sim.process.settings import WorldSettings
from hardware.table import TableSettings, square_place
from tests.controller.conftest import line_samples

PARAMETERS = load_parameters()
HOME = (0.0, 0.075, 0.325)
LOOSE = Imperfections(grip=GripFaults(share=1.0, earliest=0.01, latest=0.02, duration=0.02))
TABLE = TableSettings()
KING = tuple(TABLE.base_from_board(np.array([*TABLE.xy(square_place(chess.E1)), 0.04])).tolist())
"""Where the fingers have a king between them, base frame [m]."""
ROUGH = Imperfections(torque_ripple=0.02, cogging=0.01, friction=0.3, tactile_noise=0.02, tactile_offset=0.05)
BOARD = chess.Board("4k3/8/8/8/8/8/4P3/4K3 w - - 0 1")


def settings(
    devices: Imperfections, person: HandSettings | None = None, home: tuple[float, ...] = HOME
) -> WorldSettings:
    return WorldSettings(
        pieces=start_layout(BOARD, TableSettings()), home=home, pace=Pace.FAST, cameras=False, linger=0.0,
        randomisation=Randomisation(devices=devices), hand=person,
    )  # fmt: skip


def play(
    folder: Path, devices: Imperfections, *, plainly: bool, moves: tuple[Action, ...] = (),
    home: tuple[float, ...] = HOME, fingers: float = 0.01,
) -> tuple[str, str, int, int]:  # fmt: skip
    """Two motions, with time for all to come to rest: the world's digest, what the controller knows, how many of its
    ticks were run without a line of Python, and how many grips were lost. Meanwhile a hand may do something, and the
    fingers close and open at so many m/s.
    """
    world = World(folder, settings(devices, HandSettings() if moves else None, home))
    with world.open():
        hand = world._hand._hand
        if moves:
            assert hand is not None
            hand.perform(moves)
        bus = InnerServoBus(world)
        law = TaskSpaceController(DeltaModel(PARAMETERS))
        supervisor = Supervisor(
            law, default_limits(PARAMETERS, TableSettings()), ControllerSettings(), bus.period, True
        )
        run, call = 0, supervisor.plain.call

        def ticks(number: int) -> None:
            nonlocal run
            last = supervisor.measurement.tick + number
            for _ in range(20 * number):
                if supervisor.measurement.tick >= last or not supervisor.may_exchange:
                    return
                if plainly and supervisor.plainly:
                    call.command[:3], call.command[3] = supervisor.torque, supervisor.reference.finger_velocity
                    most = min(16, last - supervisor.measurement.tick)
                    done, said, measured = bus.run(call, most, supervisor.busy)
                    run += done
                    if done:
                        close = supervisor.look_closer if said == LOOK_CLOSER else supervisor.took_plainly
                        close(measured)
                        continue
                measurement = bus.exchange(supervisor.command())
                if measurement.tick == supervisor.measurement.tick:
                    supervisor.told_again(measurement)
                else:
                    supervisor.advance(measurement)

        ticks(30)
        assert supervisor.state is State.HOLD
        for motion, way in enumerate(((0.02, -0.03, 0.01), (-0.02, 0.03, -0.01)), start=1):
            start = supervisor.reference.position.copy()
            samples = line_samples(tuple(start), tuple(start + way), 300, bus.period)
            samples["finger_velocity"] = fingers * (-1) ** motion
            supervisor.announce(Announce(motion, supervisor.measurement.tick + 5, 301, MotionFlag.NONE))
            for at in range(0, 301, 10):
                supervisor.take_samples(Samples(motion, at, samples[at : at + 10]))
            ticks(320)
            assert supervisor.admission.ended.motion == motion
        ticks(700)  # until plant time stands, and a little more
        while hand is not None and hand.busy:
            ticks(100)
        assert hand is None or not hand.failed
        knows = supervisor._memory.block.tobytes().hex() + law.memory.tobytes().hex()
        return world.plant.digest(), knows, run, world.plant.truth(False).grips_lost


@pytest.mark.parametrize(
    ("devices", "home", "fingers"), [(Imperfections(), HOME, 0.01), (ROUGH, HOME, 0.01), (LOOSE, KING, 0.05)],
    ids=["ideal", "rough", "loose"],
)  # fmt: skip
def test_many_ticks_in_one_call_are_the_same_in_every_bit(
    tmp_path: Path, devices: Imperfections, home: tuple[float, ...], fingers: float
) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    *same, run, lost = play(tmp_path / "a", devices, plainly=True, home=home, fingers=fingers)
    *other, none, others_lost = play(tmp_path / "b", devices, plainly=False, home=home, fingers=fingers)
    assert same == other
    assert none == 0
    assert run > 650, "nearly all"
    assert lost == others_lost
    assert (lost > 0) == (devices is LOOSE)


def test_a_hand_makes_the_same_move_without_a_line_of_python_between_its_strokes(tmp_path: Path) -> None:
    """Its strokes end between ticks of the arm's motions, long before and long after them."""
    e2, e4 = (TableSettings().xy(square_place(square)) for square in (chess.E2, chess.E4))
    moves = Move(start=e2, to=e4), Withdraw()
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    *same, run, _ = play(tmp_path / "a", Imperfections(), plainly=True, moves=moves)
    *other, none, _ = play(tmp_path / "b", Imperfections(), plainly=False, moves=moves)
    assert same == other
    assert none == 0
    assert run > 3000, "nearly all"


def test_its_drives_are_taken(tmp_path: Path) -> None:
    world = World(tmp_path, settings(Imperfections()))
    with world.open():
        bus = InnerServoBus(world)
        refused: list[str] = []

        def knock() -> None:
            try:
                SimServoBus(tmp_path, timeout=20.0)
            except HardwareError as error:
                refused.append(str(error))

        other = threading.Thread(target=knock)
        other.start()
        while other.is_alive():
            bus.hear(0.01)
        other.join()
    assert len(refused) == 1
    assert "another controller holds the drives" in refused[0]
