"""A simulated rig: a rig file of our own, world and controller in processes or one, and then a rig as any other.

``SimRig`` starts the processes, or takes over those of a program that was killed, and sees to it that nothing is left
running and the arm is at rest, however the game ends.
"""

import json
import math
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Self

from app.records import recording
from app.records.files import full_disk
from app.rig.devices import EndState, RigFailed
from app.rig.remote import RemoteRig
from app.rig.rig_file import RIG_FILE, RigFile, save_rig
from app.rig.simulation.adopted import Adopted, Process, adopt
from app.rig.simulation.ahead import RigAhead
from app.rig.simulation.processes import END_TIMEOUT, last_words, log_of, spawn
from app.rig.simulation.settings import world_settings
from controller.protocol.key import KEY_FILE, KeyFileError, create_key
from controller.settings import CONTROLLER_FILE
from controller.wire.errors import ControllerError
from controller.wire.link import Listener
from hardware.interfaces import HardwareError
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.clients.wire import world_pid
from hardware.sim.plant.live_state import LIVE_FILE, load_live_state
from hardware.sim.plant.snapshot import STATE_FILE, load_snapshot
from hardware.sim.process.settings import END_FILE, keep_settings

_AHEAD = 10
"""So far a record may be ahead of a world's state that is written aside [ticks]."""
START_TIMEOUT = 120.0
"""World and controller together; the first start on a machine compiles the law [s, wall]."""
LAST_WORDS_TIME = 2.0
"""For a world that may be ending to say why, when another process has failed first [s, wall]."""
_NAMES = {"simulation": "the simulation", "world": "the simulated world", "controller": "the controller"}
"""Of the processes, for people."""


class SimRig(RemoteRig):
    """A rig whose world and controller are processes of its own, or in pace fast one. Use as a context manager."""

    def __init__(
        self, rig: RigFile, progress: Callable[[str], None], listener: Listener | None = None, *, new: bool = True
    ) -> None:
        """Start everything of a rig of ``own_rig``, and connect as to any; returns when the arm holds.

        ``new=False`` takes over what a program that was killed has left running in the run directory, in which key,
        sockets, logs and the world's snapshot lie, and starts a controller where that is gone, too. Raises
        ``RigFailed`` if the board does not fit the arm, a process ended or did not answer in time, or there is no world
        to take over, and ``RecordError`` if the run directory cannot be written.
        """
        self._begin(rig, progress, new)
        self.connect(progress, listener)

    @classmethod
    def begin(
        cls, rig: RigFile, progress: Callable[[str], None], *, new: bool = True, ahead: RigAhead | None = None
    ) -> Self:
        """Its processes start, or go on where they were started ahead; ``connect`` when everything else is ready.

        Raises as they do together.
        """
        rig_begun = cls.__new__(cls)
        rig_begun._begin(rig, progress, new, ahead)
        return rig_begun

    def _begin(self, rig: RigFile, progress: Callable[[str], None], new: bool, ahead: RigAhead | None = None) -> None:
        self._rig, self._run_dir, self._new, self._ahead = rig, rig.run_dir, new, ahead
        self._processes: dict[str, Process] = {}
        """The world's first."""
        self._together = rig.world_section.together
        self._connected, self._open = False, True
        self._cause: str | None = None
        """Why a process has ended, found when the rig was closed."""
        with self._failing():
            if new:
                self._start(progress)
            else:
                self._take_over(progress)

    def connect(self, progress: Callable[[str], None], listener: Listener | None = None) -> Self:
        """Wait until the arm holds, and take it over."""
        with self._failing():
            _require_fit(self._rig)
            self._await_controller()
            self._connect(progress, listener, forgive=not self._new)
            self._connected = True
        return self

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """Nothing is left of a rig that could not be opened as a whole."""
        try:
            yield
        except (ControllerError, KeyFileError, HardwareError) as error:
            cause = self.failure() or full_disk(self._run_dir) or str(error)
            self._give_up()
            raise RigFailed(cause) from error
        except BaseException:
            self._give_up()
            raise

    def _give_up(self) -> None:
        """Of what could not be opened as a whole; processes that others have started go on as they did."""
        spawned = [name for name, process in self._processes.items() if not isinstance(process, Adopted)]
        if len(spawned) == len(self._processes):
            self.close()
            return
        self._open = False
        for name in spawned:
            self._end(name, orderly=False)

    def _start(self, progress: Callable[[str], None]) -> None:
        """Start world and controller."""
        self._prepare()
        self._start_processes(progress, "")

    def _start_processes(self, progress: Callable[[str], None], whence: str) -> None:
        progress(f"starting the simulated world{whence} (a machine's first start takes 20 s more)")
        self._spawn("simulation" if self._together else "world")
        if not self._together:
            self._spawn("controller")

    def _take_over(self, progress: Callable[[str], None]) -> None:
        """Adopt the world, and the controller where there still is one."""
        pid, controller = world_pid(self._run_dir), self._old_controller()
        world = adopt(pid, str(self._run_dir)) if pid is not None else None
        if world is not None and controller is not None:
            self._together = world.pid == controller.pid
            self._processes = {"simulation": world} if self._together else {"world": world, "controller": controller}
            return
        if world is None and not any((self._run_dir / left).exists() for left in (STATE_FILE, LIVE_FILE)):
            raise RigFailed(
                f"the simulated world in {self._run_dir} has left no state, so the positions of the "
                "pieces are unknown: start a new game"
            )
        for left in (CONTROLLER_FILE, KEY_FILE):
            (self._run_dir / left).unlink(missing_ok=True)
        create_key(self._run_dir / KEY_FILE)
        if not (self._run_dir / RIG_FILE).exists():
            save_rig(self._rig, self._run_dir / RIG_FILE)
        if world is None:
            self._start_processes(progress, " from where it ended")
        else:
            self._processes["world"], self._together = world, False
            self._spawn("controller")

    def _old_controller(self) -> Process | None:
        try:
            pid = int(json.loads((self._run_dir / CONTROLLER_FILE).read_text(encoding="utf-8"))["pid"])
        except (OSError, ValueError, KeyError):
            return None
        return adopt(pid, str(self._run_dir))

    def _prepare(self) -> None:
        world = world_settings(self._rig)
        with recording(self._run_dir):
            self._run_dir.mkdir(parents=True, mode=0o700)
            save_rig(self._rig, self._run_dir / RIG_FILE)
            keep_settings(world, self._run_dir)
            create_key(self._run_dir / KEY_FILE)
        if full := full_disk(self._run_dir):
            raise RigFailed(full)

    def _spawn(self, name: str) -> None:
        with recording(self._run_dir):
            self._processes[name] = spawn(name, self._rig, self._ahead)

    def _await_controller(self) -> None:
        deadline = time.monotonic() + START_TIMEOUT
        while not (self._run_dir / CONTROLLER_FILE).exists():
            if culprit := self._culprit():
                raise RigFailed(self._sentence(culprit, "could not start"))
            if time.monotonic() > deadline:
                raise RigFailed(f"the controller is not ready after {START_TIMEOUT:.0f} s; logs are in {self._run_dir}")
            time.sleep(0.02)

    def _culprit(self) -> str | None:
        """The process that ended by itself and took others along: one with a failure, the world before others."""
        status = self._settled()
        failed = [name for name, code in status.items() if code]
        if not failed and status and None not in status.values():
            failed = list(status)
        killed = [name for name in failed if (status[name] or 0) < 0]  # others end by themselves, since one is gone
        return next(iter([*killed, *failed]), None)

    def _settled(self) -> dict[str, int | None]:
        """Statuses of all processes, once a world that is ending has ended.

        Its connections are gone before it is gone itself, and a quick controller ends first.
        """
        status = self._statuses()
        world = next(iter(self._processes), None)
        gone = self._connected and world_pid(self._run_dir) is None
        if world is not None and status[world] is None and (gone or any(status.values())):
            with suppress(subprocess.TimeoutExpired):
                self._processes[world].wait(LAST_WORDS_TIME)
            status = self._statuses()
        return status

    def _statuses(self) -> dict[str, int | None]:
        return {name: process.poll() for name, process in self._processes.items()}

    def _sentence(self, name: str, what: str) -> str:
        """What became of a process, and why: who killed it is more than what it said last."""
        status = self._processes[name].poll()
        if status is not None and status < 0:
            why = f"it was killed ({signal.Signals(-status).name})"
        else:
            why = full_disk(self._run_dir) or last_words(log_of(name, self._run_dir)) or f"exit status {status}"
        return f"{_NAMES[name]} {what}: {why}"

    def failure(self) -> str | None:
        """A sentence on a process that has ended unexpectedly, also while the rig was closed; None: none has."""
        if self._open and self._cause is None and (culprit := self._culprit()):
            self._cause = self._sentence(culprit, "has ended")
        return self._cause

    def close(self) -> EndState | None:
        """Stop the arm, brake, end every process; nothing is left running. A second call does nothing.

        Returns the world's last state, None where it left none.
        """
        if not self._open:
            return None
        with _uninterrupted():
            self.failure()
            orderly = self._connected and self._shut_down()
            if not orderly and self._connected and self._cause is None:
                # whoever ends well now was told to, and the last word of it was lost on its way
                self._settled()
                orderly = all(map(self._ended_well, self._processes.values()))
            if not orderly:  # somebody has ended meanwhile, and could not be asked
                self.failure()
            self._open = False
            killed = [name for name in reversed(self._processes) if not self._end(name, orderly)]
            if self._cause is None and orderly and not killed:
                self._cause = self._ended_otherwise()
            (self._run_dir / KEY_FILE).unlink(missing_ok=True)
        return self._end_state()

    def _shut_down(self) -> bool:
        """Ask the controller to brake and end; the world follows it. False where nobody can be asked."""
        self._devices.close()
        try:
            self.client.shutdown()
        except ControllerError:
            self.client.close()  # it is gone or deaf: signals and watchdogs do the rest
            return False
        return True

    def _end(self, name: str, orderly: bool) -> bool:
        """Wait for a process that was told to end, SIGTERM for one that was not; whether it did so without force."""
        process = self._processes.get(name)
        if process is None:
            return True
        if not orderly or (name == "world" and self._rig.drives.emulated):  # on no bus there is a goodbye
            process.terminate()
        try:
            process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            return False
        return True

    def _ended_well(self, process: Process) -> bool:
        """Whether it did; of an adopted one nobody knows, but that the arm rests on its brakes where it has ended."""
        status = process.poll()
        if isinstance(process, Adopted):
            left = self._end_state()
            return status is not None and left is not None and left.at_rest
        return status == 0

    def _ended_otherwise(self) -> str | None:
        """A sentence on a process that was told to end, and ended for another reason; of adopted ones nobody knows."""
        ours = {name: process.poll() for name, process in self._processes.items() if not isinstance(process, Adopted)}
        culprit = next((name for name, status in ours.items() if status), None)
        return self._sentence(culprit, "has ended") if culprit else None

    def _end_state(self) -> EndState | None:
        path = self._run_dir / END_FILE
        if not path.exists():  # it was killed: from what it kept it goes on as after a power cut
            return EndState(False, math.nan) if (self._run_dir / LIVE_FILE).exists() else None
        summary = json.loads(path.read_text(encoding="utf-8"))
        return EndState(bool(summary["at_rest"] and summary["braked"]), float(summary["arm_speed"]))


def _require_fit(rig: RigFile) -> None:
    """Refuse a board on which the arm cannot play with the heaviest piece."""
    from controller.model.constants import DeltaModel  # it takes half a second, in which the processes start
    from controller.model.workspace import BoardDoesNotFit, require_fit

    heaviest = max(shape.mass for shape in PIECE_SHAPES.values())
    try:
        require_fit(DeltaModel(rig.robot(), heaviest), rig.table)
    except BoardDoesNotFit as error:
        raise RigFailed(str(error)) from error


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """A second Ctrl-C must not leave processes behind, nor a shell that tells its jobs of a terminal's end once more;
    none reaches any other thread than the first.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def require_present(run_dir: Path, recorded: float, period: float) -> None:
    """Refuse to go on with a world that was left as it stood earlier than the record ends [s, plant], in ticks of a
    period [s].

    That is so where a computer lost its power before the newest state was on its disk: nobody knows then where the
    pieces are. Nothing is started or written here. A world that runs is not asked. Raises ``RigFailed`` if it is so, or
    what lies there is no state of a world.
    """
    if world_pid(run_dir) is not None:
        return
    try:
        left = load_snapshot(run_dir / STATE_FILE) or load_live_state(run_dir / LIVE_FILE)
    except HardwareError as error:
        raise RigFailed(str(error)) from error
    if left is not None and left.tick < recorded / period - _AHEAD:
        raise RigFailed(
            f"the simulated world in {run_dir} was kept as it stood at {left.tick * period:.2f} s, but the record "
            f"continues until {recorded:.2f} s, so the positions of the pieces are unknown: start a new game from its "
            "last position"
        )
