"""What runs inside the processes that a rig starts, and inside ``touchmove controller``."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from app import UserError
from app.rig.drives import Opener, opener_of
from app.rig.rig_file import ETHERCAT, RIG_FILE, RigFile, WorldSection, load_rig, save_rig
from app.settings.defaults import SIMULATED
from controller.protocol.key import KeyFileError, create_key
from hardware.loading import begin_loading, end_loading
from hardware.sim.clients.wire import world_pid
from hardware.sim.plant.live_state import LIVE_FILE
from hardware.sim.plant.snapshot import STATE_FILE
from hardware.sim.process.settings import keep_settings

if TYPE_CHECKING:
    from app.rig.simulation.ahead import RigAhead
    from hardware.sim.render.renderer import StartedDrawing

WORLD_TIMEOUT: Final = 60.0
"""A world with cameras takes a few seconds to start [s, wall]."""
END_TIMEOUT: Final = 8.0
"""For each process to end by itself; then it is killed, and the drives' watchdog brakes [s, wall]."""
_ALONE: Final = 15.0
"""How long a world waits for the controller that has started it, and has nothing else to do then [s, wall]."""


_COMMANDS: Final = {
    "world": ("app.cli", "world", "--run-dir"),
    "controller": ("app.cli", "controller", "--run-dir"),
    "simulation": ("app.cli", "world", "--controlled", "--run-dir"),
}
"""Modules, and arguments before the run directory, by which each of a rig's processes runs. A simulation is a world
with its controller."""
_SLAVES: Final = ("hardware.sim.emulated.ethercat.process",)
"""A world behind emulated EtherCAT drives: it makes a network before anything else …"""
_INSIDE: Final = "hardware.sim.emulated.ethercat.enter_namespace"
"""… in which its controller has to be before anything else."""


def spawn(name: str, rig: RigFile, ahead: RigAhead | None = None) -> subprocess.Popen[bytes]:
    """Start a process of a rig: world, controller, or simulation; what it says goes to its log in the run directory.

    One that was started ahead goes on instead.
    """
    run_dir, command = rig.run_dir, _COMMANDS[name]
    if ahead is not None and (started := ahead.take(name, run_dir, log_of(name, run_dir))):
        return started
    if _has_network(rig):
        command = _SLAVES if name == "world" else (_INSIDE, str(run_dir), "-m", *command)
    with log_of(name, run_dir).open("ab") as log:
        return subprocess.Popen(
            # -P: a folder of the user's named like one of ours must not come first
            [sys.executable, "-P", "-m", *command, str(run_dir)],
            stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            start_new_session=True,  # Ctrl-C reaches its starter alone, which ends the others in order
        )  # fmt: skip


def log_of(name: str, run_dir: Path) -> Path:
    """Where a process of a run directory writes what it has to say."""
    return run_dir / f"{name}.log"


def last_words(log: Path) -> str | None:
    """The last line of a log, None where nothing was said."""
    lines = log.read_text(encoding="utf-8", errors="replace").split("\n") if log.exists() else []
    return next((line.strip() for line in reversed(lines) if line.strip()), None)


def _is_told(log: Path) -> bool:
    """Wait, in a process that was started ahead and has loaded; whether it is wanted: then it speaks to its log."""
    if not sys.stdin.readline():
        return False
    with log.open("ab") as file, Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), sys.stdin.fileno())
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
            os.dup2(file.fileno(), stream.fileno())
    return True


def run_world(run_dir: Path, *, ahead: bool = False, drawn: bool = False) -> int:
    """The simulated world until it is no longer needed; exit status.

    ``ahead``: it loads now and begins when it is told; so does what draws, where the world is ``drawn``.
    """
    from hardware.sim.process.settings import load_settings

    begin_loading()
    drawing = _drawing(run_dir, alone=False) if drawn else None
    if ahead:
        _load_world()
        if not _is_told(log_of("world", run_dir)):
            return 0
    if load_settings(run_dir).drives is None:
        from hardware.sim.process.server import world_of

        world = world_of(run_dir, drawing)
        end_loading()
        world.run()
    else:
        from hardware.sim.emulated.process import run_emulated

        run_emulated(run_dir)
    return 0


def _load_world() -> None:
    """What a world runs."""
    import hardware.sim.process.server  # noqa: F401


def _drawing(run_dir: Path, *, alone: bool) -> StartedDrawing:
    """What draws begins to load, too."""
    from hardware.sim.render.renderer import StartedDrawing

    return StartedDrawing(run_dir, alone=alone)


def run_simulation(run_dir: Path, *, ahead: bool = False, drawn: bool = False) -> int:
    """World and controller of a run directory in one thread, until the controller is shut down; exit status.

    ``ahead`` and ``drawn`` as of ``run_world``.
    """
    begin_loading()
    for number in (signal.SIGINT, signal.SIGHUP):  # the app decides when a world ends
        signal.signal(number, signal.SIG_IGN)
    drawing = _drawing(run_dir, alone=True) if drawn else None
    from hardware.sim.process.inner_bus import InnerServoBus
    from hardware.sim.process.server import world_of

    if ahead:
        _load_controller()
        if not _is_told(log_of("simulation", run_dir)):
            return 0
    rig, world = load_rig(run_dir / RIG_FILE), world_of(run_dir, drawing)
    _load_controller()  # takes a while, in which the renderer starts

    with world.open():
        return _serve(rig, lambda _parameters: InnerServoBus(world), lambda _host, _port: None)


def view_world(game: Path | None, progress: Callable[[str], None]) -> int:
    """MuJoCo's viewer on a world that runs, of a game's folder or a rig's run directory, or the newest; exit status.

    Raises ``UserError`` if none runs, and ``HardwareError`` if there is no screen, or the viewer is not installed.
    """
    from app.records.files import GAMES
    from hardware.sim.clients.viewer import watch_world

    games = sorted(GAMES.glob("*/run"), reverse=True) if game is None else [game / "run", game]
    running = next((folder for folder in games if folder.is_dir() and world_pid(folder) is not None), None)
    if running is None:
        where = f"in {GAMES}/" if game is None else f"in {game}"
        raise UserError(f"no world runs {where}: start one with 'touchmove demo', or name the folder of its game")
    watch_world(running, progress)
    return 0


def _load_controller() -> None:
    """What a controller runs."""
    import controller.loop.server
    import controller.model.reach  # noqa: F401


def run_controller(run_dir: Path, *, ahead: bool = False) -> int:
    """The controller of a run directory until it is shut down; exit status. ``ahead`` as of ``run_world``."""
    begin_loading()
    if ahead:
        import hardware.sim.clients.bus  # noqa: F401

        _load_controller()
        if not _is_told(log_of("controller", run_dir)):
            return 0
    rig = load_rig(run_dir / RIG_FILE)
    return _serve(rig, opener_of(rig, lambda: None), lambda _host, _port: None)


def run_controller_of_rig(name: str, progress: Callable[[str], None]) -> int:
    """The controller of a rig, ``sim`` or the path of a rig file, until Ctrl-C, SIGTERM or a client's shutdown; exit
    status.

    A simulated world is started with it, unless one runs already in the rig's run directory: then a controller before
    this one was killed, and this one goes on with what it held. ``progress`` is told what is being waited for, and
    where clients find the controller. Raises ``UserError`` if the rig file, the key, the driver or the world is not as
    it should be, and ``HardwareError`` if the drives do not answer.
    """
    with _rig(name) as (rig, file):

        def ready(host: str, port: int) -> None:
            progress(f"ready: clients connect to {host}:{port}, with --rig {file}; Ctrl-C brakes the arm and ends")

        with drives_of(rig, progress) as drives:
            key = rig.controller.key
            try:
                if not key.exists():
                    create_key(key)
                    progress(f"created the key {key}: copy it to every computer that must reach this controller")
            except KeyFileError as error:
                raise UserError(str(error)) from error
            status = _serve(rig, drives.open, ready)
            drives.lost = status != 0
            return status


def _end_world(rig: RigFile) -> None:
    """A simulated world ends with its controller; its last state must be on the disk before this process ends."""
    pid = world_pid(rig.run_dir) if rig.simulated else None
    if pid is None:
        return
    try:
        process = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    try:
        with contextlib.suppress(ProcessLookupError):  # perhaps no controller came that would have said goodbye
            signal.pidfd_send_signal(process, signal.SIGTERM)
        select.select([process], [], [], WORLD_TIMEOUT)  # its end, whosever child it is: it writes until then
    finally:
        os.close(process)


def _serve(rig: RigFile, open_bus: Opener, ready: Callable[[str, int], None]) -> int:
    """Run a controller.

    The law is compiled before the drives are opened: they would brake on a controller that says nothing for so long.
    """
    from controller.law.task_space import TaskSpaceController
    from controller.loop.server import serve
    from controller.model.constants import DeltaModel
    from controller.protection.limits import default_limits

    parameters = rig.robot()
    TaskSpaceController(DeltaModel(parameters))
    try:
        limits = default_limits(parameters, rig.table)
    except ValueError as error:  # the board is out of reach: said before the drives are opened
        raise UserError(str(error)) from error
    bus, section = open_bus(parameters), rig.controller
    end_loading()
    return serve(bus, parameters, section, rig.run_dir, limits, key_file=section.key, ready=ready)


@contextlib.contextmanager
def _rig(name: str) -> Iterator[tuple[RigFile, Path]]:
    """The rig that a name stands for, and its file; of ``sim`` one of its own, which goes with it."""
    if name != SIMULATED:
        yield load_rig(Path(name)), Path(name)
        return
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        from app.rig.simulation.settings import own_rig

        rig = own_rig(Path(folder) / "run", WorldSection(), {"stays": True})
        save_rig(rig, Path(folder) / RIG_FILE)
        yield rig, Path(folder) / RIG_FILE


def require_world(rig: RigFile, progress: Callable[[str], None]) -> None:
    """Start the world of a simulated rig, unless one runs in its run directory; ``UserError`` if it does not start."""
    if world_pid(rig.run_dir) is None:
        progress("starting the simulated world")
        _start_world(rig)
    else:
        progress(f"a simulated world is already running in {rig.run_dir}: taking it over")


@dataclass(slots=True)
class RigDrives:
    """A rig's drives, not open yet."""

    open: Opener
    lost: bool = False
    """They do not answer any more, or have failed; a world behind them waits for the next program, as a robot would."""


@contextlib.contextmanager
def drives_of(rig: RigFile, progress: Callable[[str], None]) -> Iterator[RigDrives]:
    """A rig's drives; a simulated world is started for them, and ends with them unless they are lost.

    A driver that is not installed is found out before anything starts: ``UserError``.
    """
    with contextlib.suppress(FileExistsError):
        rig.run_dir.mkdir(mode=0o700, parents=True)
    if _has_network(rig):
        require_world(rig, progress)
        _enter_network(rig.run_dir)
    drives = RigDrives(opener_of(rig, lambda: require_world(rig, progress)))
    try:
        yield drives
    finally:
        if not drives.lost:
            _end_world(rig)


def _has_network(rig: RigFile) -> bool:
    """Emulated EtherCAT devices are in a network of their own."""
    return rig.drives.emulated and rig.drives.bus == ETHERCAT


def _enter_network(run_dir: Path) -> None:
    """Become this same program once more where the devices' network is, unless it is there already.

    Only root and those in its own user namespace may open a socket there, and only a program that has just begun can
    enter that.
    """
    from hardware.sim.emulated.ethercat.namespace import network_pid, shares_user_namespace

    if not shares_user_namespace(network_pid(run_dir)):
        command = [sys.executable, "-P", "-m", _INSIDE, str(run_dir), "-m", "app.cli", *sys.argv[1:]]
        os.execv(sys.executable, command)


def _start_world(rig: RigFile) -> None:
    """Start a simulated world that ends with its controller, and wait until it answers; the pieces are set up anew."""
    from app.rig.simulation.settings import world_settings

    settings = world_settings(rig, **({} if rig.drives.emulated else {"first_controller": _ALONE}))
    for left in (STATE_FILE, LIVE_FILE):  # of a world before: nobody resumes a game from it here
        (rig.run_dir / left).unlink(missing_ok=True)
    keep_settings(settings, rig.run_dir)
    process = spawn("world", rig)
    threading.Thread(target=process.wait, daemon=True).start()  # it ends by itself: nothing of it is left then
    deadline = time.monotonic() + WORLD_TIMEOUT
    try:
        while world_pid(rig.run_dir) is None:
            if process.poll() is not None or time.monotonic() > deadline:
                log = log_of("world", rig.run_dir)
                raise UserError(last_words(log) or f"the simulated world did not start; see {log}")
            time.sleep(0.02)
    except BaseException:  # nobody could tell it to end: it does not listen yet
        process.kill()
        raise
