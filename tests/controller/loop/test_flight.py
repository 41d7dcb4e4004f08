"""The flight recorder: what it holds, when it writes, and that the loop never waits for it."""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.law.task_space import TaskSpaceController
from controller.loop import flight as flight_module
from controller.loop.flight import AFTERMATH, FlightRecorder
from controller.loop.supervisor import Supervisor
from controller.model.constants import DeltaModel
from controller.offline.document import refresh
from controller.protection.limits import Violation, default_limits
from controller.protocol import CommandCode, MotionFlag
from controller.protocol.causes import Cause
from controller.protocol.messages import Announce, Samples
from controller.protocol.states import State
from controller.records.flight_file import (
    FLIGHT,
    FlightFileError,
    FlightHead,
    FlightRecord,
    Order,
    Trigger,
    load_flight,
    write_flight,
)
from controller.settings import ControllerSettings
from controller.wire.errors import ControllerError
from hardware.interfaces import DriveStatus
from hardware.parameters import load_parameters
from hardware.table import TableSettings
from tests.waiting import PATIENCE, until

HOME, AWAY = (0.0, 0.0, 0.35), (0.10, 0.05, 0.40)
PERIOD = 0.00088
AFTER = round(AFTERMATH / PERIOD)
STOP = Violation(Cause.STOP_COMMAND, 0.0, 0.0)
LOST = Violation(Cause.CLIENT_LOST, 1.5, 1.0)
HEAD = FlightHead(PERIOD, False, (), ())
Launch = Callable[..., Any]
Line = Callable[..., NDArray[Any]]


class Recorded:
    """A supervisor with a plant and a recorder, ticked by the test."""

    def __init__(self, bus: Any, directory: Path, duration: float = 30.0, files: int = 8) -> None:
        parameters = load_parameters()
        self.bus, self.directory = bus, directory
        limits = default_limits(parameters, TableSettings())
        law = TaskSpaceController(DeltaModel(parameters))
        self.supervisor = Supervisor(law, limits, ControllerSettings(), bus.period, bus.lockstep)
        self.recorder = FlightRecorder(self.supervisor, directory, period=bus.period, duration=duration, files=files)
        self.expected: list[tuple[Any, ...]] = []
        self.now = 100.0

    def run(self, ticks: int) -> None:
        """Tick; plant time goes on whether anybody is busy or not."""
        for _ in range(ticks):
            command = self.supervisor.command()._replace(busy=True)
            measurement = self.bus.exchange(command)
            self.supervisor.advance(measurement)
            self.recorder.record(self.now)
            row = self.supervisor.reference.row.copy()
            self.expected.append((measurement, self.supervisor.torque, self.supervisor.state, row))
            self.watch()

    def watch(self, passed: float = PERIOD) -> None:
        """One turn of the loop without a tick."""
        self.now += passed
        self.recorder.watch(self.now)

    def files(self) -> list[Path]:
        """Those written, by tick."""
        return sorted(self.directory.glob("flight-*.npz"), key=lambda path: int(path.stem.split("-")[1]))

    def close(self, abnormal: bool = False) -> list[FlightRecord]:
        """End, and read all files."""
        self.recorder.close(abnormal)
        return [load_flight(path) for path in self.files()]


@pytest.fixture
def recorded(fake_bus: Callable[..., Any], tmp_path: Path, patient: None) -> Callable[..., Recorded]:
    """Makes a recorded plant."""
    return lambda **options: Recorded(fake_bus(), tmp_path, **options)


# what it holds


def test_a_row_is_what_happened_in_the_tick(recorded: Callable[..., Recorded]) -> None:
    flying = recorded()
    flying.bus.object_at = 0.010
    flying.run(50)
    flying.supervisor.reference.finger_velocity = -0.025
    flying.run(50)
    (flight,) = flying.close(abnormal=True)
    assert flight.ticks.shape == (100,)
    for row, (measured, torque, state, reference) in zip(flight.ticks, flying.expected, strict=True):
        assert row["tick"] == measured.tick
        assert tuple(row["angle"]) == measured.angle
        assert tuple(row["angle_velocity"]) == measured.velocity
        assert row["finger_position"] == measured.finger_position
        assert tuple(row["tactile"]) == measured.tactile
        assert row["drive_status"] == measured.status
        assert tuple(row["torque"]) == torque
        assert row["state"] == state
        columns = ("reference", "reference_velocity", "reference_acceleration", "stiffness", "damping")
        found = [*np.concatenate([row[name] for name in columns]), row["tactile_gain"]]
        assert np.array_equal(found, reference)
    last, law = flight.ticks[-1], flying.supervisor.law.state
    assert np.array_equal(last["position"], law.position)
    assert np.array_equal(last["velocity"], law.velocity)
    assert np.array_equal(last["torque_asked"], law.torque)
    assert tuple(last["force"]) == tuple(flying.supervisor.force)
    assert last["finger_velocity"] == -0.025
    assert (last["state"], last["cause"]) == (State.HOLD, Cause.NONE)
    assert np.all(np.diff(flight["wall"]) > 0.0)
    assert np.all(np.isfinite(flight["work"]))


def test_motion_and_index_are_told(recorded: Callable[..., Recorded], line: Line) -> None:
    flying, samples = recorded(), line(HOME, AWAY, 400)
    flying.run(20)
    start = flying.supervisor.reference.position.copy()
    samples["position"] += start - samples["position"][0]
    first = flying.supervisor.measurement.tick + 3
    flying.supervisor.announce(Announce(4, first, len(samples), MotionFlag.NONE))
    flying.supervisor.take_samples(Samples(4, 0, samples))
    flying.run(100)
    (flight,) = flying.close(abnormal=True)
    under_way = flight["motion"] == 4
    assert under_way.sum() == 100
    assert flight["index"][-1] == 100 - 2
    assert flight["state"][-1] == State.TRACK


def test_the_ring_wraps_and_keeps_the_newest_in_order(recorded: Callable[..., Recorded]) -> None:
    flying = recorded(duration=64 * PERIOD)
    for ticks, kept in ((40, 40), (24, 64), (1, 64), (100, 64)):
        flying.run(ticks)
        rows = np.concatenate(flying.recorder._ring.parts())
        assert rows["tick"].tolist() == [m.tick for m, *_ in flying.expected[-kept:]]
    (flight,) = flying.close(abnormal=True)
    assert flight["tick"].tolist() == [m.tick for m, *_ in flying.expected[-64:]]


def test_every_number_has_eight_bytes_and_a_meaning() -> None:
    assert {np.dtype(FLIGHT.dtype[name]).base.itemsize for name in FLIGHT.dtype.names or ()} == {8}
    assert FLIGHT.dtype.itemsize == FLIGHT.size
    assert all(field.meaning for field in FLIGHT.fields)


def test_recording_allocates_nothing_that_stays(recorded: Callable[..., Recorded], memory: Callable[[], int]) -> None:
    flying = recorded(duration=1.0)
    flying.run(20)
    tracemalloc.start()
    before = memory()
    for _ in range(5000):
        flying.recorder.record(flying.now)
        flying.recorder.watch(flying.now)
    grown = memory() - before
    tracemalloc.stop()
    flying.close()
    assert grown < 2000


# when it writes


def test_the_file_of_a_fault_holds_the_ticks_before_it_and_what_came_of_it(recorded: Callable[..., Recorded]) -> None:
    flying = recorded()
    flying.recorder.note(CommandCode.RESUME)
    flying.run(300)
    flying.recorder.note(Announce(5, 1400, 10, MotionFlag.FOLLOWED))
    flying.recorder.note(Announce(5, 1400, 10, MotionFlag.FOLLOWED))
    flying.bus.status = DriveStatus.FAULT
    flying.run(1)
    fault = flying.supervisor.measurement.tick
    flying.run(AFTER - 1)
    assert flying.files() == []
    flying.run(2)
    until(lambda: bool(flying.files()))
    assert flying.files() == [flying.directory / f"flight-{fault}.npz"]
    flying.run(20)
    (flight,) = flying.close()
    (trigger,) = flight.head.triggers
    assert (trigger.tick, trigger.cause) == (fault, Cause.DRIVE_FAULT)
    assert "a drive reports a fault (ENABLED|FAULT)" in trigger.explain()
    assert flight["tick"].tolist() == [m.tick for m, *_ in flying.expected[: 300 + 1 + AFTER]]
    (place,) = np.flatnonzero(flight["tick"] == fault)
    assert flight["state"][place - 1 : place + 1].tolist() == [State.HOLD, State.FAULT]
    orders = [order.order for order in flight.head.orders]
    assert orders == [CommandCode.RESUME, Announce(5, 1400, 10, MotionFlag.FOLLOWED)]
    assert isinstance(orders[1], Announce)
    assert flight.head.orders[1].tick == fault - 1
    assert (flight.head.period, flight.head.abnormal) == (pytest.approx(PERIOD), False)


@pytest.mark.parametrize("cause", sorted(flight_module.ORDERLY))
def test_what_somebody_asked_for_is_not_written(recorded: Callable[..., Recorded], cause: Cause) -> None:
    flying = recorded()
    flying.run(20)
    flying.supervisor.machine.stop(Violation(cause, 0.0, 0.0))
    flying.run(AFTER + 20)
    assert flying.close() == []


@pytest.mark.parametrize("cause", sorted(set(Cause) - flight_module.ORDERLY))
def test_every_other_stop_is(recorded: Callable[..., Recorded], cause: Cause) -> None:
    flying = recorded(duration=0.1)
    flying.run(20)
    flying.supervisor.machine.stop(Violation(cause, 1.0, 0.0))
    flying.watch()
    (flight,) = flying.close()
    assert [trigger.cause for trigger in flight.head.triggers] == [cause]


def test_while_plant_time_stands_the_file_is_written_after_a_moment(recorded: Callable[..., Recorded]) -> None:
    flying = recorded()
    flying.run(20)
    flying.supervisor.machine.stop(LOST)
    flying.watch()
    flying.watch(0.4)
    time.sleep(0.02)
    assert flying.files() == []
    flying.watch(0.2)
    until(lambda: bool(flying.files()))
    flying.close()


def test_faults_during_writing_are_noted_and_never_wait(
    recorded: Callable[..., Recorded], monkeypatch: pytest.MonkeyPatch
) -> None:
    gate, began = threading.Event(), threading.Event()

    def slowly(*arguments: Any) -> None:
        began.set()
        assert gate.wait(PATIENCE)
        write_flight(*arguments)

    monkeypatch.setattr(flight_module, "write_flight", slowly)
    flying = recorded(duration=2.0)
    flying.run(50)
    flying.supervisor.machine.stop(LOST)
    flying.run(AFTER + 2)
    assert began.wait(PATIENCE)
    for value in (2.0, 3.0):
        flying.supervisor.machine.stop(Violation(Cause.CLIENT_LOST, value, 1.0))
        flying.run(AFTER + 10)  # else it would wait for the writing, and the writing for the end of this
    assert flying.files() == []
    gate.set()
    until(lambda: flying.recorder._spare is not None)
    flying.run(1)
    first, second = flying.close()
    assert [t.value for t in first.head.triggers] == [1.5]
    assert [t.value for t in second.head.triggers] == [2.0, 3.0]
    # no tick is lost between two files, none stands in both
    ticks = np.concatenate([first["tick"], second["tick"]])
    assert np.all(np.diff(ticks) == 1)


def test_no_more_than_so_many_files_the_newest(recorded: Callable[..., Recorded]) -> None:
    flying = recorded(files=3)
    faults = []
    for k in range(5):
        flying.run(10)
        faults.append(flying.supervisor.measurement.tick)
        flying.supervisor.machine.stop(Violation(Cause.CLIENT_LOST, float(k), 1.0))
        flying.watch()
        flying.watch(1.0)
        until(lambda: flying.recorder._spare is not None)
    flying.close()
    assert [int(path.stem.split("-")[1]) for path in flying.files()] == faults[-3:]


def test_a_disk_that_refuses_is_one_sentence(
    recorded: Callable[..., Recorded], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    flying = recorded()
    flying.run(20)
    monkeypatch.setattr(flight_module, "write_flight", refuse)
    assert flying.close(abnormal=True) == []
    tick = flying.supervisor.measurement.tick
    path = flying.directory / f"flight-{tick}.npz"
    assert capfd.readouterr().err == (
        f"{path} cannot be written (No space left on device): the ticks before the fault are lost; free some space\n"
    )
    flying.recorder.close(abnormal=True)


@pytest.mark.parametrize(("policy", "asked"), [(os.SCHED_FIFO, [(0, 1, 78), (0, 0, 0)]), (os.SCHED_OTHER, [(0, 0, 0)])])
def test_the_helper_works_two_steps_below_the_loop(
    recorded: Callable[..., Recorded], monkeypatch: pytest.MonkeyPatch, policy: int, asked: list[Any]
) -> None:
    loops, found, turns = [], [], []
    monkeypatch.setattr(os, "sched_getscheduler", lambda thread: loops.append(thread) or policy)
    monkeypatch.setattr(os, "sched_getparam", lambda thread: os.sched_param(80))
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda thread, kind, param: found.append((thread, kind, param.sched_priority))
    )
    monkeypatch.setattr(
        flight_module,
        "write_flight",
        lambda *arguments: (turns.append(sys.getswitchinterval()), write_flight(*arguments)),
    )
    before, flying = sys.getswitchinterval(), recorded()
    flying.run(5)
    assert len(flying.close(abnormal=True)) == 1
    assert (loops, found) == ([threading.get_native_id()], asked)
    assert turns[0] == pytest.approx(1e-4)
    assert sys.getswitchinterval() == before


# in the controller


def test_a_lost_client_leaves_a_flight_and_the_controller_goes_on(launch: Launch, line: Line) -> None:
    running = launch(lease=1.0)
    client = running.client()
    client.connect()
    client.execute(line(HOME, AWAY, 400))
    client.close()
    until(lambda: bool(list(running.directory.glob("flight-*.npz"))))
    (path,) = running.directory.glob("flight-*.npz")
    flight = load_flight(path)
    assert flight.head.triggers[0].cause is Cause.CLIENT_LOST
    assert {State.BOOT, State.HOLD, State.TRACK} <= set(flight["state"])
    assert [order.order.length for order in flight.head.orders if isinstance(order.order, Announce)] == [401]
    moved = flight["position"][-1] - flight["position"][flight["state"] == State.TRACK][0]
    assert moved == pytest.approx(np.subtract(AWAY, HOME), abs=1e-3)
    with running.client() as another:
        assert another.execute(line(AWAY, HOME, 400)).end_tick > flight["tick"][-1]


def test_a_client_may_ask_for_what_is_in_memory(launch: Launch, line: Line) -> None:
    """Once is enough, however often it is asked for; and nothing went wrong, so nothing is called a flight."""
    running = launch()
    with running.client() as client:
        done = client.execute(line(HOME, AWAY, 400))
        client.record()
        client.record()
        until(lambda: bool(list(running.directory.glob("record-*.npz"))))
        client.shutdown()
    assert running.join() == 0
    (path,) = running.directory.glob("record-*.npz")
    record = load_flight(path)
    assert record.head.triggers == ()
    assert not record.head.abnormal
    assert record.head.orders[-1].order is CommandCode.RECORD
    assert set(range(done.first_tick, done.end_tick)) <= set(record["tick"].tolist())
    assert int(path.stem.split("-")[1]) == record["tick"][-1]
    assert list(running.directory.glob("flight-*")) == []


def test_an_orderly_end_leaves_none(launch: Launch, line: Line) -> None:
    running = launch()
    with running.client() as client:
        client.execute(line(HOME, AWAY, 400))
        client.shutdown()
    assert running.join() == 0
    assert list(running.directory.glob("flight-*")) == []


def test_drives_that_are_lost_leave_one(launch: Launch, capfd: pytest.CaptureFixture[str]) -> None:
    running = launch()
    running.bus.lost = True
    assert running.join() == 1
    (path,) = running.directory.glob("flight-*")
    flight = load_flight(path)
    assert flight.head.abnormal
    assert flight.head.triggers == ()
    assert flight["tick"][-1] == running.bus.log[-1][0].tick
    capfd.readouterr()


def test_a_defect_leaves_one_with_the_tick_it_happened_in(
    launch: Launch, line: Line, monkeypatch: pytest.MonkeyPatch
) -> None:
    running = launch()

    def fail(supervisor: Supervisor, measurement: Any) -> None:
        supervisor.measurement = measurement
        raise ZeroDivisionError

    with running.client() as client:
        monkeypatch.setattr("controller.loop.supervisor.Supervisor.advance", fail)
        with pytest.raises(ControllerError):
            client.execute(line(HOME, AWAY, 400))
    running.kill()
    (path,) = running.directory.glob("flight-*")
    flight = load_flight(path)
    assert flight.head.abnormal
    assert flight["tick"][-1] == running.bus.log[-1][0].tick


# files


def test_a_file_is_an_ordinary_npz(tmp_path: Path) -> None:
    path, rows = tmp_path / "flight-1.npz", np.zeros(5, FLIGHT.dtype)
    rows["tick"], rows["angle"][3] = range(5), (1.0, 2.0, 3.0)
    write_flight(path, HEAD, [rows[3:], rows[:3]])
    with np.load(path) as archive:
        assert archive["ticks"]["tick"].tolist() == [3, 4, 0, 1, 2]
        assert archive["ticks"]["angle"][0].tolist() == [1.0, 2.0, 3.0]
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        columns = json.loads(archive.read("flight.json"))["columns"]
    assert columns[0] == {"name": "tick", "type": "u64", "unit": "tick", "meaning": "tick of the measurement"}
    assert list(tmp_path.iterdir()) == [path]


def test_heads_come_back_whole(tmp_path: Path) -> None:
    triggers = (Trigger(3, 1.5, Cause.BAD_MEASUREMENT, math.inf, -2.0), Trigger(4, 2.5, Cause.TRACKING, 0.02, 0.01))
    orders = (Order(1, 0.5, CommandCode.HOLD), Order(2, 0.75, Announce(9, 10, 11, MotionFlag.FOLLOWED)))
    head = FlightHead(0.25, True, triggers, orders)
    write_flight(tmp_path / "flight-3.npz", head, [np.zeros(0, FLIGHT.dtype)])
    flight = load_flight(tmp_path / "flight-3.npz")
    assert flight.head == head
    assert type(flight.head.orders[1].order) is Announce
    assert flight.ticks.shape == (0,)


def test_a_flight_is_frozen_and_names_its_columns(tmp_path: Path) -> None:
    write_flight(tmp_path / "flight-3.npz", HEAD, [np.zeros(2, FLIGHT.dtype)])
    flight = load_flight(tmp_path / "flight-3.npz")
    with pytest.raises(ValueError, match="read-only"):
        flight["angle"][0] = 1.0
    with pytest.raises(KeyError, match="a flight has no column 'speed': choose one of tick, wall, work"):
        flight["speed"]


def test_what_is_no_flight_is_said(tmp_path: Path) -> None:
    path = tmp_path / "flight-1.npz"
    with pytest.raises(FlightFileError, match=r"flight-1.npz cannot be read: No such file or directory: name a flight"):
        load_flight(path)
    path.write_bytes(b"nonsense")
    with pytest.raises(
        FlightFileError,
        match=r"flight-1.npz is not a flight record \(File is not a zip file\): name "
        r"a flight",
    ):
        load_flight(path)
    np.savez(path, other=np.zeros(3))
    with pytest.raises(FlightFileError, match=r"is not a flight record \(.*flight.json.*\): name a flight-\*.npz file"):
        load_flight(path)
    write_flight(path, HEAD, [np.zeros(3, FLIGHT.dtype)])
    with zipfile.ZipFile(path) as archive:
        head = archive.read("flight.json")
    with zipfile.ZipFile(path, "w") as archive, archive.open("ticks.npy", "w") as entry:
        np.save(entry, np.zeros(3, [("tick", "<u8")]))
        entry.close()
        archive.writestr("flight.json", head)
    with pytest.raises(
        FlightFileError, match=r"has the columns .*, this version reads tick, wall, .*: read it with the"
    ):
        load_flight(path)


def test_the_page_of_the_recorder_is_up_to_date() -> None:
    page = (Path(__file__).parents[3] / "docs" / "flight.md").read_text(encoding="utf-8")
    assert refresh(page) == page, "run python -m controller.offline.document docs/flight.md"
