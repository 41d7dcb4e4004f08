"""Pieces further aside than the grooves draw in: carrier, arm, controller and plant."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from app.execution.carrier import Carrier
from app.execution.state import Devices, Job
from app.game.person import UnattendedAttendant
from app.measure.bench.beds.bed import LEAD, Bed, plant_of
from app.motion import MotionSettings
from app.pieces.inventory import Inventory, Transfer
from app.rig.arm import ControllerArm
from app.terminal.game_display import UserInterface
from controller.protocol import Result
from controller.protocol.datagram_fields import CommandCode
from controller.wire.client import MotionOutcome
from hardware.parameters import load_parameters
from hardware.piece_set import Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.table import PieceSpec, Place, TableSettings

TABLE, MOTION = TableSettings(), MotionSettings()
SOURCE, TARGET = Place.parse("b4"), Place.parse("d5")
RESTS = 2e-3
"""What moves no faster rests [m/s, rad/s]."""


class BedClient:
    """The controller's client, of a controller in this process: what ``ControllerArm`` asks of it."""

    lockstep, lead_ticks, latched = True, LEAD, False

    def __init__(self, bed: Bed) -> None:
        self._bed, self.period = bed, bed.parameters.drive.tick

    def execute(self, samples: NDArray[Any], *, followed: bool) -> MotionOutcome:
        ended = self._bed.execute(samples, followed)
        assert ended.result in (Result.DONE, Result.GRIPPED, Result.TOUCHED), ended
        told = self.telemetry
        return MotionOutcome(
            ended.result, ended.first_tick, told.tick, 0.0, told.position, told.reference, ended.finger_position, 0.0,
            0.0, told.tactile,
        )  # fmt: skip

    def stop(self) -> None:
        self._bed.supervisor.obey(CommandCode.STOP)

    def wait_standing(self) -> SimpleNamespace:
        self._bed.wait(0.05)
        while float(np.abs(self._bed.plant.data.qvel).max()) > RESTS:
            self._bed.wait(0.05)
        return self.telemetry

    @property
    def telemetry(self) -> SimpleNamespace:
        supervisor = self._bed.supervisor
        measured = supervisor.measurement
        return SimpleNamespace(
            tick=measured.tick, tactile=tuple(measured.tactile), finger_position=measured.finger_position,
            reference=tuple(supervisor.reference.position), position=tuple(supervisor.law.state.position), warm=False,
            admitting=True,
        )  # fmt: skip


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("friction", [0.8, 1.3])
@pytest.mark.parametrize("aside", [0.0052, 0.0054])
@pytest.mark.parametrize("kind", [Kind.PAWN, Kind.KNIGHT, Kind.ROOK, Kind.KING])
def test_it_arrives_in_the_middle_of_its_square(kind: Kind, aside: float, side: float, friction: float) -> None:
    """Whichever side it stands on: the pads feel the same."""
    spec = PieceSpec("it", kind, Colour.WHITE, SOURCE)
    x, y = TABLE.xy(SOURCE)
    bed = Bed(plant_of((StandingPiece(spec, x, y + side * aside, 0.3, friction=friction),), TABLE, MOTION), TABLE)
    client: Any = BedClient(bed)
    record: Any = SimpleNamespace(step=lambda *_, **__: None)
    clock: Any = SimpleNamespace(now=lambda: 0.0)
    devices = Devices(ControllerArm(client), clock, None, None)
    ui = UserInterface()
    carrier = Carrier(devices, record, ui, MOTION, load_parameters(), UnattendedAttendant(None, ui))
    carried = carrier.carry(Job("it", (Transfer.of(spec, TARGET),), uci=None), Inventory.of([spec], TABLE))
    assert carried.resumed, "it was not grasped at once"
    assert math.dist(bed.positions()["it"][:2], TABLE.xy(TARGET)) < 0.0005
