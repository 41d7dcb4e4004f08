"""What can wait for a tick: how it is divided among ticks."""

from __future__ import annotations

from itertools import pairwise
from typing import cast

from controller.law.task_space import TaskSpaceController
from controller.loop.flight import FlightRecorder
from controller.loop.service import ClientService
from controller.loop.supervisor import Supervisor
from controller.model.constants import DeltaModel
from controller.protection.limits import default_limits
from controller.protocol.datagram_fields import HEARTBEAT, SAMPLES, DatagramKind
from controller.records.late_ticks import LoopClock
from controller.settings import ControllerSettings
from controller.wire.endpoint import Endpoint, Handler
from hardware.parameters import load_parameters
from hardware.table import TableSettings


class Mailbag:
    """An endpoint with datagrams of the client that wait, found one at a time."""

    relays, last_command, dropped = False, 0, (0,) * 6

    def __init__(self) -> None:
        self.waiting: list[tuple[DatagramKind, bytes]] = []
        self.at_hand: list[tuple[DatagramKind, bytes]] = []
        self.done: list[str] = []

    def find(self) -> bool:
        if self.at_hand or not self.waiting:
            return False
        self.at_hand.append(self.waiting.pop(0))
        return True

    def take(self, handle: Handler) -> bool:
        if not self.at_hand:
            return False
        kind, payload = self.at_hand.pop()
        assert handle(kind, memoryview(payload))
        self.done.append("read")
        return True

    def relay(self) -> bool:
        return False

    def publish(self, telemetry: bytes, now: float) -> None:
        self.done.append("told")


def run(sent: list[tuple[DatagramKind, bytes]], ticks: int) -> list[list[str]]:
    """What each tick found and finished while a client sends."""
    parameters, settings, bag = load_parameters(), ControllerSettings(telemetry_interval=1e9), Mailbag()
    law, period = TaskSpaceController(DeltaModel(parameters)), parameters.drive.tick
    supervisor = Supervisor(law, default_limits(parameters, TableSettings()), settings, period, False)
    clock, flight = LoopClock(period, False), cast("FlightRecorder", None)
    service = ClientService(supervisor, cast("Endpoint", bag), flight, clock, settings, lockstep=False)
    bag.waiting = sent
    log = []
    for tick in range(ticks):
        found = bag.find()
        service.do_one_piece(0.0, tick, found=found)
        log.append([*(["found"] if found else []), *bag.done])
        bag.done.clear()
    return log


def test_a_tick_that_finds_a_datagram_does_nothing_else_than_carry_it_out() -> None:
    beats = [(DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(number)) for number in range(200)]
    log = run(beats, 400)
    busy = [tick for tick in log if "found" in tick]
    assert len(busy) > 90
    assert all(tick in (["found"], ["found", "read"]) for tick in busy)
    told = [number for number, tick in enumerate(log) if "told" in tick]
    assert max(b - a for a, b in pairwise(told)) <= 16  # though the client never pauses
    assert 400 - told[-1] <= 16


def test_samples_of_no_motion_take_no_tick_of_their_own() -> None:
    stale = [(DatagramKind.SAMPLES, SAMPLES.struct.pack(7, 0, 0))] * 20
    log = run(stale, 40)
    assert sum("read" in tick for tick in log[:30]) == 20
