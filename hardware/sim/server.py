"""The world's process: runs the plant for one controller, and answers cameras, clocks and the referee.

Pace ``real``: ticks follow the wall clock, a missing command repeats the last one until the drives' watchdog brakes.
Pace ``fast``: plant time belongs to the world. A tick runs when the controller asks for it and something needs time:
a body awake, a busy controller, a sleeper on the clock, a frame due. Else the controller gets the same measurement
again, within 1 ms, so that it goes on reading its sockets while plant time stands.
"""

from __future__ import annotations

import json
import select
import signal
import socket
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hardware.interfaces import Command, HardwareError
from hardware.parameters import load_parameters
from hardware.sim import wire
from hardware.sim.plant import Plant
from hardware.sim.renderer import MODEL_FILE, Renderer, frame_path, intrinsics_for
from hardware.sim.scene import CAMERAS, build_model
from hardware.sim.settings import Pace, WorldSettings, load_settings, stand_pieces

SILENCE = 2.0
"""A controller that says nothing for so long, in wall time, is lost [s]."""
FIRST_CLIENT = 90.0
"""A world that no controller ever uses ends after this [s]; compiling a controller's law takes some of it."""
STANDING_WAIT = 1
"""Pace fast: how long a standing plant listens to others before it answers the controller [ms]."""
OTHERS_EVERY = 8
"""Pace fast, while the arm is busy: others are listened to in each so manieth tick; nothing they ask is urgent then."""
END_FILE = "world_end.json"
STATE_FILE = "world_state.npz"
_ROLES = ("servo", "camera", "clock", "referee")


@dataclass(slots=True)
class _Stream:
    """A client that gets a frame each so many ticks while plant time runs; it acknowledges each."""

    link: socket.socket
    slot: int
    camera: str
    ticks: int
    drawing: bool = False
    free: bool = True


@dataclass(slots=True)
class _Waiting:
    """A client that waits for plant time: a sleeper, or a camera whose frame is due."""

    link: socket.socket
    due: int
    answer: dict[str, Any]
    frame: int | None = None


class _Speed:
    """How fast plant time runs against the wall, counted only while it runs."""

    def __init__(self) -> None:
        self.ticks = 0
        self.wall = 0.0
        self._last: float | None = None

    def ticked(self) -> None:
        now = time.perf_counter()
        if self._last is not None:
            self.wall += now - self._last
            self.ticks += 1
        self._last = now

    def stood(self) -> None:
        self._last = None


class World:
    """One simulated world and its clients."""

    def __init__(self, run_dir: Path, settings: WorldSettings) -> None:
        self._run_dir, self._settings = run_dir, settings
        parameters = load_parameters(settings.parameters_file)
        self._period = parameters.drive.tick
        self._watchdog_ticks = parameters.drive.watchdog_ticks
        home = np.array(settings.home)
        model = build_model(parameters, settings.table, stand_pieces(settings), home)
        self.plant = Plant(model, parameters, tuple(piece.name for piece in settings.pieces))
        self._renderer: Renderer | None = None
        if settings.cameras:
            mujoco.mj_saveModel(model, str(run_dir / MODEL_FILE))
            self._renderer = Renderer(run_dir)
        self._fast = settings.pace is Pace.FAST
        self._servo: socket.socket | None = None
        self._last_heard = time.monotonic()
        self._unheard_limit = FIRST_CLIENT
        self._command: Command | None = None
        self._last_applied: Command | None = None
        self._reported_tick = -1
        self._missed = 0
        self._clients: dict[int, tuple[socket.socket, str]] = {}
        self._waiting: list[_Waiting] = []
        self._streams: dict[int, _Stream] = {}
        self._finished_frames: set[int] = set()
        self._next_slot = 0
        self._speed = _Speed()
        self._turns = 0
        self._ending = False
        self._poll = select.poll()
        self._listen()

    def _listen(self) -> None:
        path = self._run_dir / wire.SOCKET_NAME
        path.unlink(missing_ok=True)
        self._door = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with wire.socket_address(self._run_dir) as address:
            self._door.bind(address)
        self._door.listen(8)
        self._poll.register(self._door, select.POLLIN)

    # ---------------------------------------------------------------- clients

    def _accept(self) -> None:
        link, _ = self._door.accept()
        link.settimeout(SILENCE)
        try:
            role = wire.Hello.model_validate_json(link.recv(wire.LARGEST_MESSAGE)).role
            problem = self._refusal(role)
            answer = {"error": problem} if problem else self._welcome(role)
            link.send(json.dumps(answer).encode())
        except (OSError, ValueError):  # nobody of ours: no hello, or gone again
            link.close()
            return
        if problem:
            link.close()
            return
        link.settimeout(None)
        self._clients[link.fileno()] = (link, role)
        self._poll.register(link, select.POLLIN)
        if role == "servo":
            self._servo, self._last_heard, self._unheard_limit = link, time.monotonic(), SILENCE

    def _refusal(self, role: str) -> str | None:
        if role not in _ROLES:
            return f"'{role}' is none of {', '.join(_ROLES)}"
        if role == "servo" and self._servo is not None:
            return "another controller holds the drives"
        if role == "camera" and self._renderer is None:
            return "this world was started without cameras"
        return None

    def _welcome(self, role: str) -> dict[str, Any]:
        answer: dict[str, Any] = {"period": self._period, "lockstep": self._fast, "tick": self.plant.tick}
        if role == "camera":
            assert self._renderer is not None
            self._renderer.wait_ready()
            answer["slot"] = self._next_slot
            answer["intrinsics"] = {n: asdict(intrinsics_for(c.field_of_view)) for n, c in CAMERAS.items()}
            frame_path(self._run_dir, self._next_slot).touch()
            self._next_slot += 1
        return answer

    def _drop(self, fd: int) -> None:
        link, role = self._clients.pop(fd)
        self._poll.unregister(fd)
        self._waiting = [w for w in self._waiting if w.link is not link]
        self._streams.pop(fd, None)
        link.close()
        if role == "servo":
            self._servo, self._command = None, None
            self._last_heard, self._unheard_limit = time.monotonic(), self._settings.linger

    def _handle(self, fd: int) -> None:
        if fd == self._door.fileno():
            self._accept()
        elif self._renderer is not None and fd == self._renderer.fileno():
            self._take_frame()
        elif fd in self._clients:
            link, role = self._clients[fd]
            try:
                message = link.recv(wire.LARGEST_MESSAGE)
            except ConnectionError:
                message = b""
            if not message:
                self._drop(fd)
            elif role == "servo":
                self._hear_servo(message)
            else:
                self._answer(link, role, message)

    def _hear_servo(self, message: bytes) -> None:
        self._last_heard = time.monotonic()
        if message == wire.GOODBYE:
            self._ending = True
            return
        self._command = wire.unpack_command(message)

    # --------------------------------------------------------------- questions

    def _answer(self, link: socket.socket, role: str, message: bytes) -> None:
        try:
            request = json.loads(message)
            answer = getattr(self, f"_answer_{role}")(link, request)
        except (ValueError, KeyError, TypeError) as error:
            answer = {"error": f"malformed request: {error}"}
        if answer is not None:
            self._reply(link, answer)

    def _reply(self, link: socket.socket, answer: dict[str, Any]) -> None:
        try:
            link.send(json.dumps(answer).encode())
        except ConnectionError:
            self._drop(link.fileno())

    def _answer_clock(self, link: socket.socket, request: dict[str, Any]) -> dict[str, Any] | None:
        ticks = int(request.get("sleep_ticks", 0))
        if ticks <= 0:
            return {"tick": self.plant.tick}
        self._waiting.append(_Waiting(link, self.plant.tick + ticks, {}))
        return None

    def _answer_camera(self, link: socket.socket, request: dict[str, Any]) -> dict[str, Any] | None:
        assert self._renderer is not None
        if "taken" in request:
            self._streams[link.fileno()].free = True
            return None
        camera, slot = str(request["camera"]), int(request["slot"])
        if camera not in CAMERAS:
            return {"error": f"no camera '{camera}': there are {', '.join(CAMERAS)}"}
        if "stream_ticks" in request:
            self._streams[link.fileno()] = _Stream(link, slot, camera, max(1, int(request["stream_ticks"])))
            return None
        latency = round(self._settings.camera_latency / self._period)
        self._renderer.request(slot, camera, bool(request["depth"]), self.plant.positions())
        self._waiting.append(_Waiting(link, self.plant.tick + latency, {"exposed": self.plant.tick}, slot))
        return None

    def _answer_referee(self, link: socket.socket, request: dict[str, Any]) -> dict[str, Any]:
        truth = self.plant.truth(bool(request.get("reset_peak", False)))
        speed = self._speed
        return {
            **asdict(truth),
            "pieces": [[p.name, p.x, p.y, p.z, p.tilt] for p in truth.pieces],
            "ran_ticks": speed.ticks,
            "ran_wall": speed.wall,
        }

    def _take_frame(self) -> None:
        assert self._renderer is not None
        slot = self._renderer.take()
        for stream in list(self._streams.values()):
            if stream.slot == slot:
                stream.drawing, stream.free = False, False
                self._reply(stream.link, {"tick": self.plant.tick})
                return
        self._finished_frames.add(slot)

    def _serve_streams(self) -> None:
        """Expose the frames due now; in pace fast, plant time waits until the one before was drawn and taken."""
        for fd, stream in list(self._streams.items()):
            if self.plant.tick % stream.ticks:
                continue
            deadline = time.monotonic() + SILENCE
            while self._fast and (stream.drawing or not stream.free) and fd in self._streams:
                self._speed.stood()
                self._pump(5)
                self._last_heard = time.monotonic()
                if time.monotonic() > deadline:
                    self._drop(fd)
            if fd in self._streams and not stream.drawing and stream.free:
                assert self._renderer is not None
                self._renderer.request(stream.slot, stream.camera, False, self.plant.positions())
                stream.drawing = True

    def _serve_waiting(self) -> None:
        """Answer those whose plant time has come; in pace fast, plant time waits for a frame still being drawn."""
        for waiting in [w for w in self._waiting if w.due <= self.plant.tick]:
            if waiting.frame is not None and waiting.frame not in self._finished_frames:
                if not self._fast:
                    continue
                while waiting.frame not in self._finished_frames:
                    self._take_frame()
                self._last_heard = time.monotonic()
                self._speed.stood()
            if waiting.frame is not None:
                self._finished_frames.discard(waiting.frame)
            self._waiting.remove(waiting)
            self._reply(waiting.link, {**waiting.answer, "tick": self.plant.tick})

    # ------------------------------------------------------------------- ticks

    def _needs_time(self, command: Command) -> bool:
        # compared without torques: at rest those only repeat what holds the arm
        changed = self._last_applied is None or command[1:] != self._last_applied[1:]
        return command.busy or changed or bool(self._waiting) or not self.plant.resting

    def _measure_and_step(self, command: Command) -> None:
        """Answer with the present measurement, then advance: the command acts from this tick on."""
        standing = self.plant.tick == self._reported_tick
        self._reported_tick = self.plant.tick
        assert self._servo is not None
        try:
            self._servo.send(wire.pack_measurement(self.plant.measure(standing)))
        except ConnectionError:
            self._drop(self._servo.fileno())
            return
        self.plant.apply(command)
        self._last_applied = command
        self._advance()

    def _advance(self) -> None:
        self.plant.step()
        self._speed.ticked()
        if self._waiting:
            self._serve_waiting()
        if self._streams:
            self._serve_streams()

    def _pump(self, timeout_ms: float) -> None:
        for fd, _ in self._poll.poll(timeout_ms):
            self._handle(fd)

    def _fast_turn(self) -> None:
        if self._command is None and not self._spin_for_servo():
            self._pump(100)
            return
        command, self._command = self._command, None
        if command is None:
            return
        self._turns += 1
        if self._turns % OTHERS_EVERY == 0 or not command.busy:
            self._pump(0)
        if self._needs_time(command):
            self._measure_and_step(command)
            return
        self._speed.stood()
        self._pump(STANDING_WAIT)
        if self._needs_time(command):  # somebody asked for time meanwhile
            self._measure_and_step(command)
        elif self._servo is not None:
            standing = self.plant.tick == self._reported_tick
            self._reported_tick = self.plant.tick
            try:
                self._servo.send(wire.pack_measurement(self.plant.measure(standing)))
            except ConnectionError:
                self._drop(self._servo.fileno())

    def _spin_for_servo(self) -> bool:
        """Hear the controller's next message if it comes at once."""
        assert self._servo is not None
        try:
            message = wire.spin(self._servo)
        except ConnectionError:
            message = b""
        if message is None:
            return False
        if message:
            self._hear_servo(message)
        else:
            self._drop(self._servo.fileno())
        return True

    def _real_turn(self, boundary: float) -> None:
        self._pump(0)
        while (left := boundary - time.monotonic()) > 0.0:
            self._pump(max(0.0, left * 1e3 - 0.1) if left > 2e-4 else 0)
        if self._command is not None:
            command, self._command = self._command, None
            self._missed = 0
            self._measure_and_step(command)
            return
        self._missed += 1
        if self._missed >= self._watchdog_ticks:
            self.plant.trip_watchdog()
        self._advance()

    def _lost(self) -> bool:
        return time.monotonic() - self._last_heard > self._unheard_limit

    def _run_to_rest(self) -> None:
        """Without a controller the drives' watchdog brakes; the plant goes on until all rests."""
        for _ in range(self._watchdog_ticks):
            self.plant.step()
        self.plant.trip_watchdog()
        for _ in range(round(20.0 / self._period)):
            if self.plant.resting:
                break
            self.plant.step()

    def _wait_for_controller(self) -> None:
        """Nobody holds the drives: brake, come to rest, and wait for another controller until the linger is over."""
        if self.plant.tick > 0 or self._last_applied is not None:
            self._run_to_rest()
            self._serve_waiting()
        while self._servo is None and not self._ending:
            if self._lost():
                self._ending = True
            self._pump(50)
            self._serve_waiting_at_rest()

    def _serve_waiting_at_rest(self) -> None:
        while self._waiting and self._servo is None:
            self._advance()

    def run(self) -> None:
        """Serve until the controller says goodbye or stays away; then leave a snapshot."""
        if self._renderer is not None:
            self._poll.register(self._renderer, select.POLLIN)
        signal.signal(signal.SIGTERM, self._end)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the app decides when a world ends
        boundary = time.monotonic()
        try:
            while not self._ending:
                if self._servo is None:
                    self._wait_for_controller()
                    boundary = time.monotonic()
                elif self._fast:
                    self._fast_turn()
                else:
                    # late by more than a tick: plant time slips; catching up in a burst would outrun the controller
                    boundary = max(boundary + self._period, time.monotonic() - self._period)
                    self._real_turn(boundary)
                if self._servo is not None and self._lost():
                    self._drop(self._servo.fileno())
            self._run_to_rest()
            self._write_snapshot()
        finally:
            self._close()

    def _end(self, *_: object) -> None:
        self._ending = True

    def _write_snapshot(self) -> None:
        data, truth = self.plant.data, self.plant.truth(False)
        np.savez(self._run_dir / STATE_FILE, qpos=data.qpos, qvel=data.qvel, act=data.act, tick=self.plant.tick)
        summary = {**asdict(truth), "braked": True, "at_rest": self.plant.resting}
        (self._run_dir / END_FILE).write_text(json.dumps(summary, indent=1), encoding="utf-8")

    def _close(self) -> None:
        for link, _ in self._clients.values():
            link.close()
        self._door.close()
        (self._run_dir / wire.SOCKET_NAME).unlink(missing_ok=True)
        if self._renderer is not None:
            self._renderer.close()
            (self._run_dir / MODEL_FILE).unlink(missing_ok=True)
            for slot in range(self._next_slot):
                frame_path(self._run_dir, slot).unlink(missing_ok=True)


def serve(run_dir: Path) -> None:
    """Run a world from the settings in a run directory until it is no longer needed.

    Raises:
        HardwareError: settings missing, or no OpenGL for its cameras.
    """
    settings = load_settings(run_dir)
    world = World(run_dir, settings)
    if world._renderer is not None:
        try:
            world._renderer.wait_ready()
        except HardwareError:
            world._close()
            raise
    world.run()
