"""The world as a process: what a controller, a clock, a camera and the referee get over the real socket."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hardware.interfaces import BusLost, Command, DriveStatus, HardwareError, Measurement, Pace, StaleFrame
from hardware.parameters import load_parameters
from hardware.piece_set import Colour, Kind
from hardware.sim.bodies.scene import build_model
from hardware.sim.clients import wire
from hardware.sim.clients.bus import SimServoBus
from hardware.sim.clients.camera import FrameStream, SimCamera, SimClock
from hardware.sim.clients.referee import SimReferee
from hardware.sim.plant.live_state import LIVE_FILE, load_live_state
from hardware.sim.plant.plant import Plant
from hardware.sim.plant.snapshot import STATE_FILE
from hardware.sim.process.pacing import CATCH_UP, Pacer
from hardware.sim.process.server import world_of
from hardware.sim.process.services import SILENCE
from hardware.sim.process.settings import END_FILE, FILE_NAME, WorldSettings, load_settings, stand_pieces
from hardware.sim.render.renderer import HEIGHT, MODEL_FILE, WIDTH
from hardware.table import PieceSpec, TableSettings, square_place
from tests.waiting import PATIENCE, until

TABLE = TableSettings()
PARAMETERS = load_parameters()
TICK = PARAMETERS.drive.tick
PIECES = (
    PieceSpec("king", Kind.KING, Colour.WHITE, square_place(4)),
    PieceSpec("pawn", Kind.PAWN, Colour.BLACK, square_place(12)),
    PieceSpec("rook", Kind.ROOK, Colour.WHITE, square_place(0)),
)
BRAKED = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
BUSY = BRAKED._replace(busy=True)
STANDING, WATCHDOG = DriveStatus.STANDING, DriveStatus.WATCHDOG
LONG = 300.0
"""A world that several tests share waits so long for the next one that uses it [s, wall]."""
PATIENTLY = """
import hardware.sim.process.services as services
services.SILENCE = services.LOCKSTEP_SILENCE = {}
from app.cli import main
main()
"""
"""A world for which a controller, or a reader of pictures, that says nothing is lost after so long [s, wall]."""


def settings_for(**changes: object) -> WorldSettings:
    """Three pieces, pace fast, no cameras."""
    x, y, z = TABLE.base_from_board(np.array([0.0, 0.0, 0.12])).tolist()
    usual = {"pieces": PIECES, "home": (x, y, z), "pace": "fast", "cameras": False, "seed": 3}
    waits = {"first_controller": LONG, "linger": LONG}
    return WorldSettings.model_validate({**usual, **waits, **changes})


def world_command(run_dir: Path, *, patient: bool = True) -> list[str]:
    """How a world is started; a patient one bears it when a test is held up between two exchanges."""
    begin = PATIENTLY.format(10.0 if patient else SILENCE)
    return [sys.executable, "-P", "-c", begin, "world", "--run-dir", str(run_dir)]


class WorldProcess:
    """A world as the app starts it, but patient unless it is not to be."""

    def __init__(
        self, run_dir: Path, settings: WorldSettings, environment: dict[str, str], *, patient: bool = True
    ) -> None:
        run_dir.mkdir(parents=True, exist_ok=True)
        (run_dir / FILE_NAME).write_text(settings.model_dump_json(), encoding="utf-8")
        self.run_dir = run_dir
        with (run_dir / "world.log").open("wb") as log:
            self.process = subprocess.Popen(
                world_command(run_dir.absolute(), patient=patient),
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, env={**os.environ, **environment}, cwd=run_dir,
            )  # fmt: skip

    @property
    def log(self) -> str:
        return (self.run_dir / "world.log").read_text(encoding="utf-8")

    @property
    def end(self) -> dict[str, Any]:
        """The snapshot's summary."""
        return dict(json.loads((self.run_dir / END_FILE).read_text(encoding="utf-8")))

    def cpu_seconds(self) -> float:
        """Processor time used so far."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text(encoding="ascii").rsplit(") ", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


Start = Callable[..., WorldProcess]


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Start]:
    """Starts worlds; none outlives the module."""
    worlds: list[WorldProcess] = []

    def start_one(
        folder: Path | None = None,
        environment: dict[str, str] | None = None,
        *,
        patient: bool = True,
        **changes: object,
    ) -> WorldProcess:
        run_dir = folder or tmp_path_factory.mktemp("world")
        worlds.append(WorldProcess(run_dir, settings_for(**changes), environment or {}, patient=patient))
        return worlds[-1]

    yield start_one
    for world in worlds:
        world.kill()


@pytest.fixture(scope="module")
def world(start: Start) -> WorldProcess:
    """One world in pace fast, shared by the tests that leave it running."""
    return start()


@pytest.fixture(scope="module")
def impatient(start: Start) -> WorldProcess:
    """One that waits for a silent controller no longer than one in pace real does outside of tests."""
    return start(patient=False)


NO_GL = "no OpenGL through EGL here: apt-get install libegl1 libgl1-mesa-dri"


@pytest.fixture(scope="module")
def gl() -> bool:
    """Whether pictures can be drawn; in CI they must."""
    if os.environ.get("CI"):
        return True
    code = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8)"
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    tried = subprocess.run([sys.executable, "-c", code], env=environment, check=False, capture_output=True)
    return tried.returncode == 0


class Controller:
    """Exchanges in a thread of its own, as the controller process does, on the brakes and not busy."""

    def __init__(self, run_dir: Path) -> None:
        self.bus = SimServoBus(run_dir)
        self.last = self.bus.exchange(BRAKED)
        self.standing = 0
        self._ending = False
        self._thread = threading.Thread(target=self._loop)
        self._thread.start()

    def _loop(self) -> None:
        while not self._ending:
            self.last = self.bus.exchange(BRAKED)
            self.standing = self.standing + 1 if self.last.status & STANDING else 0

    def settle(self) -> int:
        """The tick at which plant time stands."""
        self.standing = 0
        until(lambda: self.standing > 2)
        return self.last.tick

    def __enter__(self) -> Controller:
        return self

    def __exit__(self, *_: object) -> None:
        self._ending = True
        self._thread.join()
        leave(self.bus)


def leave(bus: SimServoBus) -> None:
    """Go without goodbye, as a killed controller does."""
    bus._link.close()


def raw_link(world: WorldProcess, greeting: bytes | None = None) -> socket.socket:
    """A connection that keeps to no rules."""
    link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    link.settimeout(10.0)
    door = world.run_dir / wire.SOCKET_NAME
    until(door.exists)
    until(lambda: link.connect_ex(str(door)) == 0)
    if greeting is not None:
        link.send(greeting)
    return link


# ---------------------------------------------------------------------------------------------------- the exchange


def commands() -> Iterator[Command]:
    """Brakes, free fall, torques, fingers; busy throughout."""
    rng = np.random.default_rng(6)
    for tick in range(400):
        a, b, c = rng.uniform(-2.0, 2.0, 3).tolist()
        yield Command((a, b, c), 0.05 if tick % 100 < 50 else -0.05, brake=tick < 40, enable=tick >= 20, busy=True)


def test_each_answer_is_the_present_measurement_and_the_command_acts_after_it(start: Start) -> None:
    """The world does exactly what a plant in this process does: measure, apply, step. So a run repeats bit by bit."""
    settings = settings_for()
    home = np.array(settings.home)
    model = build_model(PARAMETERS, settings.table, stand_pieces(settings), home, looks=False)
    plant = Plant(model, PARAMETERS, tuple(piece.name for piece in PIECES))
    world = start()
    with ExitStack() as stack:
        bus = SimServoBus(world.run_dir)
        stack.callback(leave, bus)
        referee = stack.enter_context(closing(SimReferee(world.run_dir)))
        assert bus.lockstep
        assert bus.period == TICK
        for tick, command in enumerate(commands()):
            measured = bus.exchange(command)
            assert measured.tick == tick
            assert measured == plant.measure(standing=False)
            plant.apply(command)
            plant.step()
        truth, speed = referee.look()
        assert truth == plant.truth(reset_peak=False)
        assert speed.plant == pytest.approx(399 * TICK)
        assert speed.ratio > 0.0


def test_a_busy_controller_runs_time_at_rest(world: WorldProcess) -> None:
    bus = SimServoBus(world.run_dir)
    first = bus.exchange(BUSY)
    answers = [bus.exchange(BUSY) for _ in range(400)]
    assert [answer.tick - first.tick for answer in answers] == list(range(1, 401))
    assert not any(answer.status & STANDING for answer in answers)
    leave(bus)


def test_at_rest_time_stands_and_answers_keep_coming(world: WorldProcess) -> None:
    bus = SimServoBus(world.run_dir)
    for _ in range(400):
        bus.exchange(BUSY)
    bus.exchange(BRAKED)
    bus.exchange(BRAKED)  # the tick that the change of busy is worth
    last = bus.exchange(BRAKED)
    answers, took = [], []
    for _ in range(100):
        started = time.monotonic()
        answers.append(bus.exchange(BRAKED))
        took.append(time.monotonic() - started)
    assert min(took) < 0.05  # a machine with time to spare takes 1 ms; each took 100 ms if the world waited for others
    assert all(answer == last._replace(status=last.status | STANDING) for answer in answers)
    assert bus.exchange(BUSY) == answers[-1]  # answered first, then advanced
    assert bus.exchange(BRAKED).tick == last.tick + 1
    leave(bus)


def test_moving_fingers_run_time_until_they_rest(world: WorldProcess) -> None:
    with Controller(world.run_dir) as controller:
        before = controller.settle()
    bus = SimServoBus(world.run_dir)
    bus.exchange(BRAKED._replace(finger_velocity=0.05))
    moved = 0
    while not bus.exchange(BRAKED).status & STANDING:
        moved += 1
    assert 20 < moved < 400
    assert bus.exchange(BRAKED).tick > before + 20
    leave(bus)


# ------------------------------------------------------------------------------------------------- clock and referee


@pytest.mark.parametrize("ticks", [1, 7, 1000])
def test_sleeping_runs_exactly_so_many_ticks(world: WorldProcess, ticks: int) -> None:
    with Controller(world.run_dir) as controller, closing(SimClock(world.run_dir)) as clock:
        before = controller.settle()
        assert clock.now() == before * TICK
        clock.sleep(ticks * TICK)
        assert controller.settle() == before + ticks
        assert clock.now() == (before + ticks) * TICK
        clock.sleep(0.0)
        clock.sleep(-1.0)
        clock.sleep((ticks - 0.5) * TICK)  # rounded up
        assert controller.settle() == before + 2 * ticks


def test_sleepers_wake_each_at_their_time(world: WorldProcess) -> None:
    with Controller(world.run_dir) as controller, ExitStack() as stack:
        before = controller.settle()
        links = [stack.enter_context(closing(wire.connect(world.run_dir, "clock")[0])) for _ in range(2)]
        clocks = dict(zip((200, 4000), links, strict=True))
        for ticks, link in clocks.items():
            link.send(json.dumps({"sleep_ticks": ticks}).encode())
        # The answer's tick is the waking's: asked for afterwards, it would tell when this process was run again.
        woken = {ticks: json.loads(link.recv(wire.LARGEST_MESSAGE))["tick"] for ticks, link in clocks.items()}
        assert woken[200] == before + 200
        assert before + 4000 <= woken[4000] <= before + 4200  # asked while the other slept


def test_a_sleeper_who_leaves_is_not_waited_for(world: WorldProcess) -> None:
    with Controller(world.run_dir) as controller:
        controller.settle()
        link, _ = wire.connect(world.run_dir, "clock")
        link.send(json.dumps({"sleep_ticks": 10**9}).encode())
        until(lambda: not controller.last.status & STANDING)
        link.close()
        controller.settle()


def test_time_runs_for_a_sleeper_without_any_controller(start: Start) -> None:
    world = start()
    with closing(SimClock(world.run_dir)) as clock:
        assert clock.now() == 0.0  # nothing happens before somebody wants something
        clock.sleep(0.1)
        assert clock.now() == pytest.approx(0.1, abs=TICK)
        used = world.cpu_seconds()
        time.sleep(1.0)
        assert world.cpu_seconds() - used < 0.3  # waiting is no work
        assert clock.now() == pytest.approx(0.1, abs=TICK)
    world.process.send_signal(signal.SIGTERM)
    assert world.process.wait(PATIENCE) == 0


def test_the_referee_keeps_the_peak_until_it_is_reset(world: WorldProcess) -> None:
    with Controller(world.run_dir) as controller, closing(SimReferee(world.run_dir)) as referee:
        controller.settle()
        referee.look(reset_peak=True)
        with closing(SimClock(world.run_dir)) as clock:
            clock.sleep(0.01)
        controller.settle()
        first, _ = referee.look()
        second, _ = referee.look(reset_peak=True)
        third, _ = referee.look()
        assert [piece.name for piece in first.pieces] == ["king", "pawn", "rook"]
        assert first == second
        assert third.peak_contact_force == 0.0  # since then nothing happened
        assert third.state_sha256 == first.state_sha256


# ----------------------------------------------------------------------------------------- visitors who do not behave


def test_a_second_controller_is_refused(world: WorldProcess) -> None:
    with Controller(world.run_dir) as controller:
        said = "no connection as servo: the world refuses: another controller holds the drives: there can be only one"
        with pytest.raises(HardwareError, match=said):
            SimServoBus(world.run_dir)
        controller.settle()  # the first one does not notice


def test_unknown_roles_and_absent_cameras_are_refused(world: WorldProcess) -> None:
    with pytest.raises(HardwareError, match="'cook' is none of servo, camera, clock, referee, stage"):
        wire.connect(world.run_dir, "cook")
    with pytest.raises(HardwareError, match=r"no connection as camera: .* this world was started without cameras"):
        SimCamera(world.run_dir)


GARBAGE = [
    b"[]", b"{}", b"nonsense", b"\xff\xfe", b"null", b"[" * 20000, b'{"sleep_ticks": -1}', b'{"sleep_ticks": 1e999}',
    b'{"sleep_ticks": "7"', b'{"reset_peak": []}', b'{"camera": 3}', b'{"taken": false}', b'{"role": "clock"}',
]  # fmt: skip


@pytest.mark.parametrize("role", ["clock", "referee"])
def test_malformed_questions_are_answered_and_harm_nobody(world: WorldProcess, role: str) -> None:
    with Controller(world.run_dir) as controller:
        link, _ = wire.connect(world.run_dir, role)
        for garbage in GARBAGE:
            link.send(garbage)
            answer = json.loads(link.recv(wire.LARGEST_MESSAGE))
            assert "malformed request: " in answer.get("error", "") or garbage == b"{}"
        assert "tick" in wire.ask(link, {})
        link.close()
        controller.settle()


def test_malformed_greetings_are_refused_and_harm_nobody(world: WorldProcess) -> None:
    with Controller(world.run_dir) as controller:
        for garbage in GARBAGE[:-1]:
            link = raw_link(world, garbage)
            assert "malformed request: " in json.loads(link.recv(wire.LARGEST_MESSAGE))["error"]
            assert link.recv(wire.LARGEST_MESSAGE) == b""
            link.close()
        controller.settle()


def ask_for_ever(link: socket.socket) -> None:
    """Thousands of questions, and no answer read."""
    while True:
        link.send(b"{}")


def test_who_never_greets_or_reads_holds_nobody_up(world: WorldProcess) -> None:
    silent = raw_link(world)
    deaf, _ = wire.connect(world.run_dir, "referee")
    deaf.settimeout(0.2)
    with Controller(world.run_dir) as controller:
        with pytest.raises(OSError, match=r"timed out|Broken pipe|reset"):
            ask_for_ever(deaf)
        controller.settle()
        controller.settle()
    silent.close()
    deaf.close()


def test_who_sends_no_command_loses_the_drives(world: WorldProcess) -> None:
    link, _ = wire.connect(world.run_dir, "servo")
    link.send(b"half a command")
    assert link.recv(wire.LARGEST_MESSAGE) == b""
    link.close()
    assert "the controller is dismissed: a servo command has 33 bytes, this message 14" in world.log
    with Controller(world.run_dir) as controller:
        controller.settle()


def test_a_controller_may_take_its_time_until_its_first_command(impatient: WorldProcess) -> None:
    bus = SimServoBus(impatient.run_dir)
    time.sleep(1.2 * SILENCE)  # a large program's garbage is collected, say, on a busy machine
    assert bus.exchange(BRAKED).status & DriveStatus.BRAKED
    leave(bus)


# ----------------------------------------------------------------------------------------------- life and death


FREE = Command((0.6, 0.6, 0.6), 0.0, brake=False, enable=True, busy=True)


def fall(bus: SimServoBus) -> Measurement:
    """Let the arm sink, brakes open."""
    for _ in range(3):
        bus.exchange(BUSY)
    return [bus.exchange(FREE) for _ in range(40)][-1]


def rest_after(world: WorldProcess, tick: int) -> Measurement:
    """What the next controller finds."""
    with closing(SimReferee(world.run_dir)) as referee:
        until(lambda: referee.look()[0].arm_speed < 2e-4)
        assert referee.look()[0].tick > tick + PARAMETERS.drive.watchdog_ticks
    bus = SimServoBus(world.run_dir)
    measured = bus.exchange(BRAKED)
    leave(bus)
    return measured


def test_a_killed_controller_leaves_an_arm_on_its_brakes_for_the_next_one(world: WorldProcess) -> None:
    bus = SimServoBus(world.run_dir)
    moving = fall(bus)
    assert min(moving.velocity) > 0.05
    leave(bus)
    found = rest_after(world, moving.tick)
    assert found.status == DriveStatus.BRAKED | WATCHDOG
    assert min(np.subtract(found.angle, moving.angle)) > 0.0  # the same plant, gone on from there


def test_a_stopped_controller_is_lost_and_told_so_when_it_wakes_up(impatient: WorldProcess) -> None:
    world = impatient
    bus = SimServoBus(world.run_dir)
    moving = fall(bus)  # and then silence, as under SIGSTOP
    used, since = world.cpu_seconds(), time.monotonic()
    found = rest_after_silence(world, moving.tick)
    assert world.cpu_seconds() - used < 0.5 * (time.monotonic() - since)
    assert found.status == DriveStatus.BRAKED | WATCHDOG
    with pytest.raises(BusLost, match="the simulated drives are gone: the world has ended, or heard nothing from this"):
        bus.exchange(FREE)
    leave(bus)


def rest_after_silence(world: WorldProcess, tick: int) -> Measurement:
    with closing(SimReferee(world.run_dir)) as referee:
        until(lambda: referee.look()[0].tick > tick + 1)
    return rest_after(world, tick)


@pytest.fixture(scope="module")
def ended(start: Start) -> WorldProcess:
    """A world whose controller has said goodbye in mid motion."""
    world = start()
    bus = SimServoBus(world.run_dir)
    fall(bus)
    bus.close()
    assert world.process.wait(PATIENCE) == 0
    return world


def test_goodbye_ends_the_world_at_rest_with_a_snapshot(ended: WorldProcess) -> None:
    world, end = ended, ended.end
    assert end["at_rest"]
    assert end["braked"]
    assert end["arm_speed"] < 2e-4
    assert {piece["name"] for piece in end["pieces"]} == {"king", "pawn", "rook"}
    with np.load(world.run_dir / STATE_FILE) as state:
        assert int(state["tick"]) == end["tick"] > 43 + PARAMETERS.drive.watchdog_ticks
        assert np.abs(state["qvel"]).max() < 1e-2
    assert not (world.run_dir / wire.SOCKET_NAME).exists()
    assert world.log == ""
    with pytest.raises(HardwareError, match=r"no world answers at .*world\.sock after 0 s: is it running\? Its log is"):
        SimServoBus(world.run_dir, timeout=0.0)


def test_a_world_goes_on_from_the_snapshot_of_the_one_before(start: Start, ended: WorldProcess, tmp_path: Path) -> None:
    left = ended.end
    run_dir = shutil.copytree(ended.run_dir, tmp_path / "run")
    again = start(run_dir)
    with closing(SimReferee(run_dir)) as referee:
        truth, _ = referee.look()
        assert truth.tick == left["tick"]
        assert truth.state_sha256 == left["state_sha256"], "to the last bit"
        assert not (run_dir / END_FILE).exists(), "the old one says nothing of the new one"
        bus = SimServoBus(run_dir)
        first = [bus.exchange(BRAKED) for _ in range(20)][-1]
        after, _ = referee.look()
    np.testing.assert_allclose(after.tool, truth.tool, atol=1e-6)
    assert first.status & DriveStatus.BRAKED
    bus.close()
    assert again.process.wait(PATIENCE) == 0


@pytest.mark.parametrize("pace", [Pace.FAST, pytest.param(Pace.REAL, marks=pytest.mark.real_time)])
def test_a_world_that_is_killed_in_mid_motion_goes_on_from_there_on_its_brakes(start: Start, pace: Pace) -> None:
    world = start(pace=pace)
    bus = SimServoBus(world.run_dir)
    falling = fall(bus)
    world.kill()
    leave(bus)
    assert not (world.run_dir / END_FILE).exists()
    live = load_live_state(world.run_dir / LIVE_FILE)
    assert live is not None
    aside = 10 if pace is Pace.REAL else 0  # written by a thread, which may be a little behind
    assert live.tick >= falling.tick - aside
    again = start(world.run_dir, pace=pace)
    with closing(SimReferee(world.run_dir)) as referee:
        truth, _ = referee.look()
        assert truth.tick >= live.tick + PARAMETERS.drive.watchdog_ticks, "it came to rest before anybody was there"
        assert truth.arm_speed < 2e-4
        assert truth.tool[2] - settings_for().home[2] > 0.001, "it fell, and did not start at home again"
        assert max(piece.tilt for piece in truth.pieces) < 0.01
    bus = SimServoBus(world.run_dir)
    assert bus.exchange(BRAKED).status & DriveStatus.BRAKED
    bus.close()
    assert again.process.wait(PATIENCE) == 0
    assert not (world.run_dir / LIVE_FILE).exists(), "the snapshot has taken its place"


def test_a_snapshot_that_is_none_is_one_sentence(start: Start, tmp_path: Path) -> None:
    (tmp_path / STATE_FILE).write_bytes(b"PK nonsense")
    world = start(tmp_path)
    assert world.process.wait(PATIENCE) == 2
    assert "snapshot" in world.log
    assert len(world.log.strip().splitlines()) == 1
    for content in (b"", b"PK nonsense"):
        (tmp_path / STATE_FILE).write_bytes(content)
        with pytest.raises(HardwareError, match="snapshot"):
            world_of(tmp_path)
    np.savez(tmp_path / STATE_FILE, state=np.zeros(7), tick=3)
    with pytest.raises(HardwareError, match="snapshot"):
        world_of(tmp_path)


def test_after_its_linger_a_world_without_controller_ends(start: Start) -> None:
    world = start(linger=0.5)
    bus = SimServoBus(world.run_dir)
    moving = fall(bus)
    leave(bus)
    assert world.process.wait(PATIENCE) == 0
    assert world.end["at_rest"]
    assert world.end["braked"]
    assert world.end["tick"] > moving.tick + PARAMETERS.drive.watchdog_ticks


def test_a_world_that_no_controller_ever_uses_ends(start: Start) -> None:
    world = start(first_controller=0.3)
    assert world.process.wait(PATIENCE) == 0
    assert world.end["at_rest"]


def exchange_for_ever(bus: SimServoBus) -> None:
    while True:
        bus.exchange(FREE)


def test_sigterm_brings_the_arm_to_rest_and_a_long_path_is_no_obstacle(start: Start, tmp_path: Path) -> None:
    folder = tmp_path / ("a long name " * 8) / "run"
    assert len(str(folder / wire.SOCKET_NAME)) > 108
    world = start(folder)
    bus = SimServoBus(world.run_dir)
    fall(bus)
    world.process.send_signal(signal.SIGINT)  # meant for the app alone
    fall(bus)
    world.process.send_signal(signal.SIGTERM)
    with pytest.raises(BusLost, match="the simulated drives are gone"):
        exchange_for_ever(bus)
    leave(bus)
    assert world.process.wait(PATIENCE) == 0
    assert world.end["at_rest"]
    assert world.end["braked"]


OUT_OF_REACH = settings_for(home=(0.0, 0.0, 0.8)).model_dump_json()
NO_PARAMETERS = settings_for(parameters_file="none.toml").model_dump_json()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, r"no world settings at .*world\.json: start the world through 'touchmove demo'"),
        ('{"pieces": []}', r"world\.json: home: Field required"),
        (OUT_OF_REACH, r"this world cannot be made: arm 1 cannot reach \[0\.0, 0\.0, 0\.8\] m"),
        (NO_PARAMETERS, r"this world cannot be made: parameter file none\.toml cannot be read: No such file"),
    ],
)
def test_a_world_that_cannot_be_made_says_why(tmp_path: Path, text: str | None, said: str) -> None:
    if text is not None:
        (tmp_path / FILE_NAME).write_text(text, encoding="utf-8")
    with pytest.raises(HardwareError, match=said):
        world_of(tmp_path)


def test_settings_survive_their_file(tmp_path: Path) -> None:
    settings = settings_for(linger=1.5, pace="real")
    (tmp_path / FILE_NAME).write_text(settings.model_dump_json(), encoding="utf-8")
    assert load_settings(tmp_path) == settings


# ------------------------------------------------------------------------------------------------------- pace real


@pytest.fixture(scope="module")
def real(start: Start, gl: bool) -> WorldProcess:
    return start(pace="real", cameras=gl)


def wall_for(bus: SimServoBus, duration: float) -> float:
    """Wall time that so much plant time takes [s]."""
    first, since = bus.exchange(BRAKED), time.monotonic()
    while bus.exchange(BRAKED).tick < first.tick + round(duration / TICK):
        pass
    return time.monotonic() - since


@pytest.mark.real_time
def test_pace_real_keeps_time(real: WorldProcess) -> None:
    bus = SimServoBus(real.run_dir)
    assert not bus.lockstep
    tries: list[
        float
    ] = []  # a machine that stands still for longer than the world makes up for is not the world's fault
    while len(tries) < 8 and not (tries and tries[-1] == pytest.approx(2.0, rel=0.01)):
        tries.append(wall_for(bus, 2.0))
    assert tries[-1] == pytest.approx(2.0, rel=0.01)
    leave(bus)


@pytest.mark.real_time
def test_in_pace_real_the_watchdog_trips_on_missing_commands(real: WorldProcess) -> None:
    bus = SimServoBus(real.run_dir)
    for _ in range(20):  # once is enough, unless the machine stumbles
        bus.exchange(BRAKED)
        held = [bus.exchange(FREE._replace(torque=(1.2, 1.2, 1.2))) for _ in range(5)][-1]
        if held.status == DriveStatus.ENABLED:
            break
    assert held.status == DriveStatus.ENABLED
    with closing(SimClock(real.run_dir)) as clock:
        clock.sleep(1.5 * PARAMETERS.drive.watchdog_ticks * TICK)
    late = bus.exchange(FREE)
    assert late.tick > held.tick + PARAMETERS.drive.watchdog_ticks
    assert late.status == DriveStatus.BRAKED | WATCHDOG
    leave(bus)


@pytest.mark.real_time
def test_in_pace_real_time_goes_on_without_a_controller(real: WorldProcess) -> None:
    with closing(SimClock(real.run_dir)) as clock:
        used, wall = real.cpu_seconds(), time.monotonic()
        plant = clock.now()
        clock.sleep(0.3)
        assert clock.now() - plant >= 0.3
        time.sleep(0.5)
        gone = clock.now() - plant
        passed = time.monotonic() - wall
        assert gone < passed + 0.05, "no faster than the wall's, whatever delays this process"
        until(lambda: clock.now() - plant >= 0.8)
        assert real.cpu_seconds() - used < 0.5 * (time.monotonic() - wall)


@pytest.mark.real_time
def test_in_pace_real_frames_come_when_they_are_due_or_drawn(real: WorldProcess, gl: bool) -> None:
    if not gl:
        pytest.skip(NO_GL)
    with closing(SimCamera(real.run_dir)) as camera, closing(SimClock(real.run_dir)) as clock:
        before = clock.now()
        frame = camera.read(max_age=20.0)
        assert before <= frame.stamp <= clock.now() - round(0.060 / TICK) * TICK
    with closing(FrameStream(real.run_dir, "film", 30)) as stream:
        ticks = [shot[1] for shot in (stream.next() for _ in range(3)) if shot is not None]
        assert len(ticks) == 3
        assert all(tick % 30 == 0 for tick in ticks)
        assert ticks == sorted(set(ticks))


def test_a_delay_is_made_up_for_tick_by_tick_and_a_long_one_is_not() -> None:
    metronome = Pacer(0.001)
    due, latest = metronome.next(0.0)
    start = due
    assert latest == pytest.approx(due)
    metronome.ran(start + 0.0050)  # the world was held up for 5 ms
    due, latest = metronome.next(start + 0.0051)
    assert due == pytest.approx(start + 0.001)  # overdue: runs as soon as the command is there …
    assert latest == pytest.approx(start + 0.0060)  # … for which the controller has its full millisecond
    metronome.ran(start + 0.0052)
    assert metronome.next(start + 0.0053)[0] == pytest.approx(start + 0.002)
    due, _ = metronome.next(start + 1.0)
    assert due == pytest.approx(start + 1.0 - CATCH_UP)  # the rest of that second is lost


# --------------------------------------------------------------------------------------------------------- cameras


@pytest.fixture(scope="module")
def seen(start: Start, gl: bool) -> WorldProcess:
    """A world with cameras."""
    if not gl:
        pytest.skip(NO_GL)
    return start(cameras=True)


def test_a_frame_is_exposed_now_and_delivered_its_latency_later(seen: WorldProcess) -> None:
    latency = round(0.060 / TICK)
    with Controller(seen.run_dir) as controller, closing(SimCamera(seen.run_dir)) as camera:
        before = controller.settle()
        frame = camera.read()
        assert frame.stamp == before * TICK
        assert controller.settle() == before + latency
        assert frame.colour.shape == (HEIGHT, WIDTH, 3)
        assert frame.depth is not None
        assert frame.depth.shape == (HEIGHT, WIDTH)
        board = frame.depth[HEIGHT // 2, WIDTH // 2]  # looks at the middle of the board from 0.62 m away, past the tool
        assert 0.2 < board < 0.7
        assert frame.colour.std() > 20.0
        again = camera.read()
        assert again.stamp == (before + latency) * TICK
        assert np.abs(again.colour.astype(float) - frame.colour).mean() < 3.0  # nothing moved: noise is all
        assert not np.shares_memory(again.colour, frame.colour)
        with pytest.raises(StaleFrame, match=r"the newest camera frame is 0\.060 s old, at most 0\.050 s is accepted"):
            camera.read(max_age=0.05)


def test_a_camera_without_depth_and_one_that_is_not_there(seen: WorldProcess) -> None:
    with Controller(seen.run_dir), closing(SimCamera(seen.run_dir, "film", depth=False)) as camera:
        assert camera.read().depth is None
    said = "the world has no camera 'telescope': there are camera, film"
    with pytest.raises(HardwareError, match=said):
        SimCamera(seen.run_dir, "telescope")
    with pytest.raises(HardwareError, match=said):
        FrameStream(seen.run_dir, "telescope", 10)


def test_malformed_wishes_of_cameras_are_answered(seen: WorldProcess) -> None:
    with Controller(seen.run_dir):
        link, _ = wire.connect(seen.run_dir, "camera")
        for garbage in GARBAGE:
            link.send(garbage)
            assert "malformed request: " in json.loads(link.recv(wire.LARGEST_MESSAGE))["error"]
        link.send(b'{"camera": "telescope"}')
        said = {"error": "no camera 'telescope': there are camera, film"}
        assert json.loads(link.recv(wire.LARGEST_MESSAGE)) == said
        link.send(b'{"camera": "camera"}')
        link.send(b'{"camera": "camera"}')
        answers = [json.loads(link.recv(wire.LARGEST_MESSAGE)) for _ in range(2)]
        assert answers[0] == {"error": "one frame or stream at a time: this one is under way"}
        assert answers[1]["tick"] - answers[1]["exposed"] == round(0.060 / TICK)
        link.close()


def test_a_stream_takes_frames_of_what_happens_and_lets_nothing_happen(seen: WorldProcess) -> None:
    with Controller(seen.run_dir) as controller:
        before = controller.settle()
        stream = FrameStream(seen.run_dir, "film", 20)
        time.sleep(0.1)
        assert controller.settle() == before
        frames: list[tuple[tuple[int, ...], int]] = []

        def read() -> None:
            while (shot := stream.next()) is not None:
                frames.append((shot[0].shape, shot[1]))

        reader = threading.Thread(target=read)
        reader.start()
        with closing(SimClock(seen.run_dir)) as clock:
            clock.sleep(100 * TICK)
        assert controller.settle() == before + 100
        until(lambda: len(frames) == 5)
        stream.cancel()
        reader.join()
        stream.close()
        first = (before // 20 + 1) * 20
        assert frames == [((HEIGHT, WIDTH, 3), tick) for tick in range(first, first + 100, 20)]


def test_a_stream_that_nobody_reads_is_given_up(start: Start, gl: bool) -> None:
    if not gl:
        pytest.skip(NO_GL)
    run_dir = start(cameras=True, patient=False).run_dir
    with Controller(run_dir) as controller, closing(FrameStream(run_dir, "film", 10)):
        before = controller.settle()
        with closing(SimClock(run_dir)) as clock:
            clock.sleep(100 * TICK)
        assert controller.settle() == before + 100


def kill_renderer(world: WorldProcess) -> None:
    """Kill the process that draws for a world, if there is one."""
    children = Path(f"/proc/{world.process.pid}/task/{world.process.pid}/children").read_text(encoding="ascii").split()
    for renderer in children:
        with suppress(ProcessLookupError):
            os.kill(int(renderer), signal.SIGKILL)


def kill_renderers(world: WorldProcess, enough: threading.Event) -> None:
    """Kill every process that begins to draw for a world, until it is enough."""
    while not enough.wait(0.05):
        kill_renderer(world)


def test_a_renderer_that_is_killed_is_replaced_and_nobody_misses_a_picture(seen: WorldProcess) -> None:
    with ExitStack() as stack:
        controller = stack.enter_context(Controller(seen.run_dir))
        camera = stack.enter_context(closing(SimCamera(seen.run_dir)))
        stream = stack.enter_context(closing(FrameStream(seen.run_dir, "film", 10)))
        frames: list[Any] = []
        reader = threading.Thread(target=lambda: [frames.append(frame) for frame in iter(stream.next, None)])
        reader.start()
        controller.settle()
        kill_renderer(seen)
        before = len(frames)
        assert camera.read().colour.std() > 10.0
        assert camera.read().colour.std() > 10.0
        controller.settle()
        stream.cancel()
        reader.join()
    assert len(frames) > before, "a film goes on"
    assert "the renderer has ended: another one is started" in seen.log
    assert "no more pictures" not in seen.log


def test_the_arm_goes_on_when_every_renderer_dies_and_who_comes_anew_sees_again(seen: WorldProcess) -> None:
    """The last one to use this world."""
    with ExitStack() as stack:
        controller = stack.enter_context(Controller(seen.run_dir))
        camera = stack.enter_context(closing(SimCamera(seen.run_dir)))
        stream = stack.enter_context(closing(FrameStream(seen.run_dir, "film", 10)))
        controller.settle()
        model, away = seen.run_dir / MODEL_FILE, seen.run_dir / "away"
        model.rename(away)  # so that one that is killed late has not drawn anything either
        killing = threading.Event()
        killer = threading.Thread(target=kill_renderers, args=(seen, killing))
        killer.start()
        for _ in range(2):
            with pytest.raises(HardwareError, match=r"stuck or has ended again and again; renderer\.log in"):
                camera.read()
        assert stream.next() is None
        controller.settle()
        killing.set()
        killer.join()
        away.rename(model)
        another = stack.enter_context(closing(SimCamera(seen.run_dir)))
        assert another.read().colour.std() > 10.0
        assert camera.read().colour.std() > 10.0
        controller.settle()
    assert "no more pictures: the renderer is stuck or has ended again and again" in seen.log
    seen.process.send_signal(signal.SIGTERM)
    assert seen.process.wait(PATIENCE) == 0
    assert not list(seen.run_dir.glob("frame-*"))


def test_without_opengl_the_world_ends_with_the_remedy(start: Start) -> None:
    world = start(environment={"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"}, cameras=True)
    assert world.process.wait(PATIENCE) == 2
    (line,) = world.log.splitlines()
    assert line.startswith("touchmove: pictures need OpenGL through EGL, and it does not start here (")
    assert "install it with 'sudo apt-get install libegl1 libgl1-mesa-dri', or leave the cameras out" in line
    assert not (world.run_dir / wire.SOCKET_NAME).exists()
