"""The moteus bus by itself: controllers that answer at once, a port that is a list, and a clock that is a number."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from hardware.drives import clock
from hardware.drives.moteus import answers, bus, frames
from hardware.drives.moteus.bus import MoteusServoBus
from hardware.drives.moteus.fdcanusb import CanFrame, parse_frame, received_line
from hardware.drives.moteus.registers import Mode, Register, Resolution, raw_of
from hardware.drives.moteus.settings import MoteusSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import Command, DriveStatus, DriveTrouble, Measurement, fault_of
from hardware.parameters import load_parameters

DRIVES = DriveSettings()
SETTINGS = MoteusSettings(port=Path("port"))
REST = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
HELD = Command((0.0, 0.0, 0.0), 0.0, brake=False, enable=True, busy=True)
BEGAN = 1000.0
"""[s]"""
OK, REFUSED = b"OK", b"ERR unknown command"
Lines = list[bytes]


class Port:
    """The adapter's serial port, and the controllers behind it; takes the place of ``SerialPort``.

    Attributes:
        now: of its computer's clock, on which a look takes 1 µs [s].
        spoil: makes of the lines of an exchange, each acknowledgement followed by its answer, what comes of them.
    """

    def __init__(self, turning: float) -> None:
        self.now, self._turning = BEGAN, turning
        self.spoil: Callable[[Lines], Lines] = as_they_are
        self._lines = Lines()

    def look(self) -> float:
        self.now += 1e-6
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def write(self, data: bytes) -> None:
        sent = [parse_frame(line, b"can send").destination for line in data.splitlines()]
        self._lines += self.spoil([line for device in sent for line in (OK, self._answer(device))])

    def lines(self, until: float) -> Lines:
        came, self._lines = self._lines, Lines()
        self.now = self.now if came else max(self.now, until)
        return came

    def close(self) -> None:
        """It is."""

    def _answer(self, device: int) -> bytes:
        speed = self._turning / math.tau if device == SETTINGS.ids[0] else 0.0
        volts, degrees = (
            raw_of(register, Resolution.INT8, value)
            for register, value in ((Register.VOLTAGE, 24.0), (Register.TEMPERATURE, 30.0))
        )
        data = (
            frames.reply(Resolution.INT8, Register.MODE, [Mode.POSITION])
            + frames.reply(Resolution.FLOAT, Register.POSITION, [speed * (self.now - BEGAN), speed, 0.0])
            + frames.reply(Resolution.INT8, Register.VOLTAGE, [volts, degrees, 0.0])
        )
        return received_line(CanFrame(device << 8, frames.padded(data)))


def as_they_are(lines: Lines) -> Lines:
    """Nothing is wrong."""
    return lines


class Bench:
    """A bus, the port behind it, and what it has told; the first motor turns [rad/s]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, turning: float = 0.0) -> None:
        self.port, self.told = Port(turning), list[str]()
        time = SimpleNamespace(monotonic=self.port.look, sleep=self.port.sleep)
        for module in (clock, bus, answers):
            monkeypatch.setattr(module, "time", time)
        monkeypatch.setattr(bus, "SerialPort", lambda _: self.port)
        monkeypatch.setattr(bus, "start", lambda *_: None)
        self.bus = MoteusServoBus(DRIVES, SETTINGS, DRIVES.robot(load_parameters()), self.told.append)
        for _ in range(20):
            self.exchange()

    def exchange(self, spoil: Callable[[Lines], Lines] = as_they_are, command: Command = HELD) -> Measurement:
        """One exchange, and what becomes of it."""
        self.port.spoil = spoil
        return self.bus.exchange(command)

    @property
    def owed(self) -> list[int]:
        """How many answers each controller owes, in a row."""
        return [watch._missing for watch in self.bus._watches]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


@pytest.mark.parametrize("place", range(4))
def test_a_frame_that_the_adapter_refuses_costs_its_own_answer_alone(bench: Bench, place: int) -> None:
    bench.exchange(lambda lines: [*lines[: 2 * place], REFUSED, *lines[2 * place + 2 :]])
    assert bench.owed == [int(one == place) for one in range(4)]
    for _ in range(20):
        assert bench.exchange().status == DriveStatus.ENABLED
        assert bench.owed == [0, 0, 0, 0]
    assert not bench.told


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("instead", [[], [b"O"]])
def test_acknowledgements_that_are_lost_shift_no_answers_for_good(bench: Bench, place: int, instead: Lines) -> None:
    bench.exchange(lambda lines: [*lines[: 2 * place], *instead, *lines[2 * place + 1 :]])
    for _ in range(2):
        bench.exchange()
    for _ in range(20):
        assert bench.exchange().status == DriveStatus.ENABLED
        assert bench.owed == [0, 0, 0, 0]
    assert not bench.told


@pytest.mark.parametrize("late", range(9))
@pytest.mark.parametrize("stalled", [1, 2])
def test_answers_that_come_late_are_not_taken_for_those_of_the_next_exchange(
    monkeypatch: pytest.MonkeyPatch, late: int, stalled: int
) -> None:
    """The last lines of an exchange, and then all of another one, come when nobody waits for them any more."""
    bench, kept = Bench(monkeypatch, turning=3.0), Lines()

    def hold_back(lines: Lines) -> Lines:
        come = lines[: len(lines) - late] if not kept else []
        kept.extend(lines[len(come) :])
        return come

    for _ in range(stalled):
        bench.exchange(hold_back)
    for behind in (kept, Lines(), Lines()):
        sent = bench.port.now
        said = bench.exchange(lambda lines, behind=behind: [*behind, *lines])  # type: ignore[misc]
        assert said.angle[0] >= 3.0 * (sent - BEGAN) - 1e-3
        assert bench.owed == [0, 0, 0, 0]
    assert not bench.told


def test_a_controller_that_falls_silent_is_not_said_to_turn_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, turning=3.0)

    def without_the_first(lines: Lines) -> Lines:
        return [lines[0], *lines[2:]]

    for _ in range(SETTINGS.lost_replies):
        said = bench.exchange(without_the_first)
        assert said.velocity[0] == pytest.approx(3.0), "it is taken to move on as it did"
    said = bench.exchange(without_the_first)
    assert fault_of(said.status) == (1, DriveTrouble.NO_REPLY)
    lost = said.angle
    for _ in range(100):
        said = bench.exchange(without_the_first, REST)
        assert (said.angle, said.velocity) == (lost, (0.0, 0.0, 0.0))
    said = bench.exchange(command=REST)
    assert said.velocity[0] == pytest.approx(3.0), "it is there again"
    assert said.angle[0] == pytest.approx(3.0 * (bench.port.now - BEGAN), abs=0.01)
