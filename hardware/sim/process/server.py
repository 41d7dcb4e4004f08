"""The world's process: runs the plant for one controller, and answers cameras, clocks and the referee.

Pace ``real``: ticks follow the wall clock; a missing command repeats the last one until the drives' watchdog brakes.
Pace ``fast``: plant time belongs to the world. A tick runs when the controller asks for it and something needs time:
a body awake, a busy controller, a sleeper on the clock, a frame due. Else the controller gets the same measurement
again, within about 1 ms, so that it goes on reading its sockets while plant time stands.

Each answer is the measurement at the present tick; then the plant advances under the command just received. What a
controller computes from the measurement of tick k thus acts from tick k + 1 on, as on the paper's motion board.
"""

import contextlib
import json
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final

import mujoco

from hardware.interfaces import Command, HardwareError, Measurement, Pace, PlantCall, Stretch
from hardware.realtime import real_time
from hardware.sim.clients import wire
from hardware.sim.hand.hand import Hand
from hardware.sim.plant.live_state import LIVE_FILE, LiveState, load_live_state
from hardware.sim.plant.snapshot import STATE_FILE, load_snapshot, save_snapshot
from hardware.sim.process.cameras.camera_service import CameraService
from hardware.sim.process.connections import Service, Visitors
from hardware.sim.process.construction import Construction
from hardware.sim.process.hand_service import HandService
from hardware.sim.process.journal import Journal
from hardware.sim.process.pacing import Pacer, SpeedMeter
from hardware.sim.process.scene_control import SceneControlService
from hardware.sim.process.services import NEVER, ClockService, DriveService, RefereeService
from hardware.sim.process.settings import END_FILE, WorldSettings, load_settings
from hardware.sim.render.renderer import MODEL_FILE, Renderer, StartedDrawing

STANDING_WAIT = 0.001
"""Pace fast: how long a standing plant listens to others before it answers the controller [s]."""
NAP = 0.010
"""How long the world listens at a time while nobody holds the drives and nothing moves [s]."""
PATIENCE = 0.1
"""Pace fast: how long the world listens at a time while the controller does not ask for a tick [s]."""
MOMENT = 0.002
"""Pace fast: how long the world listens at a time while plant time waits for a picture [s]."""
OTHERS_EVERY = 8
"""Pace fast, while the controller is busy: others are heard once in so many ticks; none of them is in a hurry."""
LONGEST_UNREST = 5.0
"""Pace fast: time stands after so long even if something does not come to rest, as a piece that trembles under the
fingers, while nobody needs time for anything else [s, plant]."""
LONGEST_REST = 20.0
"""Plant time in which everything must have come to rest at the end [s]."""
REALTIME_PRIORITY = 90  # above the controller's


_SERVED: Final = object()
Tell = Callable[[Measurement], None]


class World:
    """One simulated world and its clients; socket, frames and the snapshot at the end lie in its run directory."""

    def __init__(self, run_dir: Path, settings: WorldSettings, drawing: StartedDrawing | None = None) -> None:
        self._run_dir = run_dir
        construction = Construction.of(settings)
        drive = construction.drawn.parameters.drive
        self._renderer: Renderer | None = None
        if settings.cameras:
            mujoco.mj_saveModel(construction.model(looks=True), str(run_dir / MODEL_FILE))
            self._renderer = Renderer(run_dir, alone=settings.pace is Pace.FAST, started=drawing)
        before = load_snapshot(run_dir / STATE_FILE) or load_live_state(run_dir / LIVE_FILE)
        self.plant = plant = construction.plant(before)
        self._left_in_motion = before is not None and not before.at_rest
        self._journal = Journal() if settings.journal else None
        self._fast = settings.pace is Pace.FAST
        self._live = LiveState(run_dir / LIVE_FILE, plant.model, plant.data, plant.tick)
        for left in (END_FILE, STATE_FILE):  # of a world before this one: from here on they would be untrue
            (run_dir / left).unlink(missing_ok=True)
        self._realtime = settings.realtime and not self._fast
        self._watchdog_ticks = drive.watchdog_ticks
        self._pacer, self._speed = Pacer(drive.tick), SpeedMeter()
        facts = {"period": drive.tick, "lockstep": self._fast}
        self._drives = DriveService(facts, settings.first_controller, settings.linger)
        self._clocks = ClockService(facts, self.plant)
        latency = round(settings.camera_latency / drive.tick)
        stage = SceneControlService(facts, self.plant, construction.looks)
        self._cameras = CameraService(
            facts, self.plant, self._renderer, run_dir, latency, construction.camera, settings.seed, stage
        )
        hand = Hand(plant, settings.hand, settings.pieces, settings.table, settings.seed) if settings.hand else None
        self._hand = HandService(facts, self.plant, hand)
        referees = RefereeService(facts, self.plant, self._speed)
        services: dict[str, Service] = {
            "servo": self._drives, "camera": self._cameras, "clock": self._clocks, "referee": referees, "stage": stage,
            "hand": self._hand, "positions": self._cameras.positions,
        }  # fmt: skip
        self._visitors = Visitors(run_dir, services)
        self._applied: Command | None = None
        self._said = plant.measure(standing=False)
        self._serving: Iterator[None] | None = None
        self._again = False
        self._reported, self._missed, self._turns = -1, 0, 0
        self._idle, self._longest_idle = 0, round(LONGEST_UNREST / drive.tick)
        self._ending = False

    def run(self) -> None:
        """Serve until the controller says goodbye or none comes, or SIGTERM; then rest and leave a snapshot.

        Raises ``HardwareError`` if the cameras have no OpenGL.
        """
        for number in (signal.SIGINT, signal.SIGHUP):  # the app decides when a world ends
            signal.signal(number, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, self._end)
        with self.open(), self._punctual():
            if not self._fast:
                self._live.write_aside()
            while not self._ending:
                self._turn()

    @contextlib.contextmanager
    def open(self) -> Iterator[None]:
        """Ready to serve; afterwards at rest, with a snapshot on the disk. Raises as ``run``."""
        try:
            if self._renderer is not None:
                self._renderer.wait_ready()
            if self._left_in_motion:
                self._come_to_rest()  # as after a power cut: on the brakes, before anybody is there again
            yield
            self._come_to_rest()
            self._write_snapshot()
        finally:
            self._close()

    @contextlib.contextmanager
    def _punctual(self) -> Iterator[None]:
        """Real time where it is wanted: the drives come before the controller that they wake up.

        Never in pace fast, where the loop has no pauses, nor while the world comes to rest.
        """
        if not self._realtime:
            yield
            return
        with real_time("the simulated world", REALTIME_PRIORITY) as granted:
            for note in granted.notes:
                print(note, file=sys.stderr, flush=True)
            yield

    def _turn(self) -> None:
        """One round of the loop, with at most one tick."""
        drives = self._drives
        if not self._fast:
            self._real_turn()
        elif drives.controller is not None:
            self._fast_turn()
        else:
            self._lonely_turn()
        if drives.silent:
            if drives.controller is None:
                self._ending = True
            else:
                drives.controller.dismiss()
        self._ending = self._ending or drives.goodbye

    # pace fast

    def _fast_turn(self) -> None:
        drives = self._drives
        if drives.command is None and self._reported < self.plant.tick:  # a running plant: the command comes at once
            drives.spin()
        command = drives.take()
        if command is None:
            self.listen(MOMENT if self.held_up else PATIENCE)
        else:
            self.exchange(command, self._tell)

    def exchange(self, command: Command, tell: Tell) -> None:
        """Pace fast: take a command in, and tell its controller the measurement at the present tick.

        The command is carried out where something needs time, and then it acts from this tick on. While plant time
        waits for a picture, and once after that, the last measurement is told again: the controller goes on reading its
        sockets, and has read them once more before it gives the command for the tick that comes.
        """
        if self._again:
            self._again = self.held_up
            self.listen(MOMENT if self.held_up else 0.0)
            tell(self._said)
            return
        self._turns += 1
        if not command.busy or self._turns % OTHERS_EVERY == 0:
            self.listen(0.0)
        if not self._needs_time(command):
            self._speed.stood()
            self.listen(STANDING_WAIT)
        if self._needs_time(command):  # perhaps somebody asked for time meanwhile
            self._exchange(command, tell)
        else:
            self._answer(tell)

    def run_plainly(self, controller: PlantCall, most: int, busy: bool) -> Stretch:
        """Pace fast: as many exchanges as nobody has to be asked for; see ``ServoBusInThread.run``."""
        self.listen(0.0)
        plant, last = self.plant, self._applied
        standing = self._reported == plant.tick
        if self._again or standing or last is None or not plant.may_run:
            return Stretch(0, 0, self._said)
        asked = Command(last.torque, float(controller.command[3]), False, True, busy)
        needed = busy or self._others_wait()
        if not needed:
            if plant.resting or self._differs(asked):
                return Stretch(0, 0, self._said)
            most = min(most, self._longest_idle - self._idle)
        most = min(most, min(self._clocks.due, self._cameras.due) - plant.tick)
        ticks, said = plant.run(controller, most, until_rest=not needed, followed=self._hand.followed)
        if not ticks:  # somebody waits for this one, or the hand is to be led further
            return Stretch(0, 0, self._said)
        self._idle = 1 if needed else self._idle + ticks  # as exchanges one by one would leave it
        self._missed, self._reported, self._said = 0, plant.tick - 1, controller.measured()
        applied = plant.applied(ticks)
        *torque, finger = applied[-1].tolist()
        self._applied = asked._replace(torque=tuple(torque), finger_velocity=finger)
        if self._journal is not None:
            for *torque, finger in applied.tolist():
                self._journal.ran(asked._replace(torque=tuple(torque), finger_velocity=finger))
        self._speed.ran(ticks)
        self._advanced()
        return Stretch(ticks, said, self._said)

    def hold_drives(self) -> None:
        """Nobody who comes to the door gets the drives."""
        self._drives.taken = True

    @property
    def held_up(self) -> bool:
        """Pace fast: plant time waits for a picture, or for its taker."""
        return self._serving is not None

    def _needs_time(self, command: Command) -> bool:
        if command.busy or self._others_wait():
            self._idle = 0
            return True
        return self._idle < self._longest_idle and (not self.plant.resting or self._differs(command))

    def _differs(self, command: Command) -> bool:
        """Compared without torques: at rest those only repeat what holds the arm."""
        return self._applied is None or command[1:] != self._applied[1:]

    def _others_wait(self) -> bool:
        return self._clocks.due != NEVER or self._cameras.waiting or self._hand.busy

    def _lonely_turn(self) -> None:
        """Nobody holds the drives: if somebody did, come to rest on the brakes, then stand unless others need time."""
        self._speed.stood()
        self._reported, self._again = -1, False
        moving = self._applied is not None and not (self.plant.resting and self.plant.braked)
        if self.held_up:
            self.listen(MOMENT)
        elif moving or self._others_wait():
            self.listen(0.0)
            self._miss()
        else:
            self.listen(NAP)

    # pace real

    def _real_turn(self) -> None:
        drives, now = self._drives, time.monotonic()
        due, latest = self._pacer.next(now)
        self.listen(0.0)
        if drives.controller is None and self.plant.resting and due > now:
            due += NAP  # a bunch of ticks at a time will do
        while (left := due - time.monotonic()) > 0.0:
            self.listen(left)
        while drives.command is None and drives.controller and (left := latest - time.monotonic()) > 0.0:
            self.listen(left)
        self._pacer.ran(time.monotonic())
        command = drives.take()
        if command is None:
            self._miss()
        else:
            self._exchange(command, self._tell)

    # a tick

    def _exchange(self, command: Command, tell: Tell) -> None:
        """Answer with the present measurement, then advance: the command acts from this tick on."""
        self._missed = 0
        self._idle += 1
        self._answer(tell)
        self.plant.apply(command)
        self._applied = command
        self._advance(command)

    def _answer(self, tell: Tell) -> None:
        tick = self.plant.tick
        self._said = self.plant.measure(standing=tick == self._reported)
        self._reported = tick
        tell(self._said)

    def _tell(self, measurement: Measurement) -> None:
        """Tell the controller, which may be gone."""
        if self._drives.controller is not None:
            self._drives.controller.send(wire.pack_measurement(measurement))

    def _miss(self) -> None:
        """A tick without a command: the last one stays in force until the watchdog of the drives brakes."""
        self._missed += 1
        if self._missed >= self._watchdog_ticks:
            self._trip()
        self._advance(None)

    def _trip(self) -> None:
        self.plant.trip_watchdog()
        if self._journal is not None:
            self._journal.tripped()

    def _advance(self, command: Command | None) -> None:
        plant = self.plant
        if self._hand.busy:
            self._hand.drive()
        plant.step()
        if self._journal is not None:
            self._journal.ran(command)
        self._speed.ran(1)
        self._advanced()

    def _advanced(self) -> None:
        """Ticks have passed: keep the state, and serve whoever was waiting for this one."""
        plant = self.plant
        self._live.keep(plant.tick)
        if self._clocks.due <= plant.tick:
            self._clocks.serve()
        if self._cameras.due <= plant.tick:
            self._serving = self._cameras.serve(waits=self._fast)
            self._go_on_serving()
            self._again = self.held_up

    def _go_on_serving(self) -> None:
        if self._serving is None:
            return
        if next(self._serving, _SERVED) is _SERVED:
            self._serving = None
        else:
            self._speed.stood()
            self._drives.excuse()

    def listen(self, seconds: float, also: Sequence[int] = ()) -> bool:
        """Hear visitors, or wait for some, or for a picture [s, wall]; go on with pictures that plant time waits for.

        ``also`` are other open files that end the wait; whether one of them has something to read.
        """
        others = self._visitors.listen(seconds, (*also, *(self._cameras.awaited if seconds else ())))
        self._cameras.look()
        self._go_on_serving()
        return not others.isdisjoint(also)

    # the end

    def _end(self, *_: object) -> None:
        self._ending = True

    def _come_to_rest(self) -> None:
        """Without a controller the drives' watchdog brakes; the plant goes on until all rests."""
        self._hand.withdraw()
        for ticks in range(round(LONGEST_REST / self.plant.parameters.drive.tick)):
            if ticks >= self._watchdog_ticks:
                self._trip()
                if self.plant.resting and not self._hand.busy:
                    break
            self._hand.drive()
            self.plant.step()
            self._live.keep(self.plant.tick)
            if self._journal is not None:
                self._journal.ran(None)

    def _write_snapshot(self) -> None:
        plant = self.plant
        if self._journal is not None:
            self._journal.write(self._run_dir)
        save_snapshot(self._run_dir / STATE_FILE, plant.model, plant.data, plant.tick)
        summary = {**asdict(plant.truth(False)), "braked": plant.braked, "at_rest": plant.resting}
        new = self._run_dir / (END_FILE + ".new")
        new.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
        new.replace(self._run_dir / END_FILE)  # who finds it finds it whole
        self._live.end()

    def _close(self) -> None:
        self._visitors.close()
        self._cameras.close()
        (self._run_dir / MODEL_FILE).unlink(missing_ok=True)


def world_of(run_dir: Path, drawing: StartedDrawing | None = None) -> World:
    """The world of a run directory; ``HardwareError``: its settings or parameters are missing or impossible."""
    try:
        return World(run_dir, load_settings(run_dir), drawing)
    except ValueError as error:
        raise HardwareError(f"this world cannot be made: {error}") from error
