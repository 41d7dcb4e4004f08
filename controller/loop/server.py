"""The controller process: one loop that ticks with the plant and serves one client over UDP.

Exchange with the drives, estimate, protect, law, limit (all in ``Supervisor.advance``), serve the socket, publish. The
torque computed from the measurement of tick k is given to the drives with the exchange that brings tick k+1.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Final

from controller.law.task_space import TaskSpaceController
from controller.loop.flight import FlightRecorder
from controller.loop.realtime import set_up_real_time
from controller.loop.service import ClientService
from controller.loop.supervisor import Supervisor
from controller.loop.tick import LOOK_CLOSER
from controller.model.constants import DeltaModel
from controller.protection.limits import Limits, Violation, check_limits, default_limits
from controller.protocol.cause_sentences import explain
from controller.protocol.causes import Cause
from controller.protocol.key import KEY_FILE, KeyFileError, load_key
from controller.protocol.messages import Welcome
from controller.protocol.states import State
from controller.records.late_ticks import LoopClock
from controller.records.loop_statistics import write_statistics
from controller.settings import ControllerSettings
from controller.wire.address import ControllerFile
from controller.wire.endpoint import Endpoint
from controller.wire.sockets import LOCKSTEP_SILENCE, PortInUse
from hardware.interfaces import BusLost, Command, ServoBus, ServoBusInThread
from hardware.parameters import RobotParameters
from hardware.table import TableSettings

_NO_TORQUE = (0.0, 0.0, 0.0)
_MOST_PIECES: Final = 16
"""Of what can wait, after so many ticks that were missed; each takes some 50 µs."""
FIRST_CLIENT: Final = 120.0
"""A controller that ends without clients waits at least so long for its first one [s, wall]: the first time, a program
compiles for half a minute before it asks, on a busy machine for longer."""
Ready = Callable[[str, int], None]
"""Told address and UDP port of a controller that clients are welcome at."""


def _nobody(_host: str, _port: int) -> None:
    """Whom the default tells that a controller is ready."""


def serve(
    bus: ServoBus,
    parameters: RobotParameters,
    settings: ControllerSettings,
    run_directory: Path,
    limits: Limits | None = None,
    *,
    key_file: Path | None = None,
    ready: Ready = _nobody,
) -> int:
    """Run the controller until it is shut down, and leave the arm on its brakes.

    Args:
        bus: drives, gripper and sensors; closed at the end.
        parameters: of the robot.
        settings: of this process.
        run_directory: ``controller.json`` is written there as soon as clients are welcome.
        limits: of the protection; by default those of the robot and the default table.
        key_file: holds the secret shared with the clients; by default ``key`` in the run directory.
        ready: told the address once clients are welcome.

    Returns:
        Exit status: 0 the arm rests on its brakes, 1 the drives were lost or the arm did not come to rest, 2 set-up.
    """
    try:
        limits = limits or default_limits(parameters, TableSettings())
        check_limits(limits)
        key = load_key(key_file or run_directory / KEY_FILE)
        law = TaskSpaceController(DeltaModel(parameters))
        server = Server(bus, law, limits, settings, key=key, run_directory=run_directory, ready=ready)
    except (KeyFileError, PortInUse, ValueError) as error:
        bus.close()
        return _complain(f"the controller cannot start: {error}", 2)
    with _ending_by_signal(server), set_up_real_time(settings, bus) as granted:
        try:
            server.run()
        except BusLost as error:
            return _complain(f"the controller ends because the drives are lost: {error}", 1)
        finally:
            server.close()
            write_statistics(run_directory, server.clock.summary(), {"granted": granted.granted, **granted._asdict()})
    if server.supervisor.brakes.exhausted:
        return _complain(f"the controller ends with the arm on its brakes: {explain(*server.supervisor.cause[:3])}", 1)
    return 0


class Server:
    """Bus, supervisor and socket tied together by the loop.

    Args:
        bus: drives, gripper and sensors.
        law: estimator and law.
        limits: of the protection.
        settings: of this process.
        key: secret shared with the clients.
        run_directory: where ``controller.json`` goes.
        ready: told the address once clients are welcome.

    Attributes:
        supervisor: what decides.
        clock: how regularly the loop ticks.
        ending: set it to end as by a shutdown.

    Raises:
        PortInUse: the UDP port is taken.
    """

    def __init__(
        self,
        bus: ServoBus,
        law: TaskSpaceController,
        limits: Limits,
        settings: ControllerSettings,
        *,
        key: bytes,
        run_directory: Path,
        ready: Ready = _nobody,
    ) -> None:
        self.supervisor = Supervisor(law, limits, settings, bus.period, bus.lockstep)
        self.ending = False
        self.clock = LoopClock(bus.period, bus.lockstep)
        self._bus = bus
        self._inside = bus if isinstance(bus, ServoBusInThread) else None
        self._call = self.supervisor.plain.call
        self._settings = settings
        patience = max(settings.lease, LOCKSTEP_SILENCE) if bus.lockstep else settings.lease
        self._endpoint = Endpoint(settings.host, settings.port, key, settings.lease, self._welcome, patience=patience)
        self._file = ControllerFile(run_directory, *self._endpoint.address)
        self._flight = FlightRecorder(
            self.supervisor, run_directory, period=bus.period, duration=settings.flight_time,
            files=settings.flight_files,
        )  # fmt: skip
        self._service = ClientService(
            self.supervisor, self._endpoint, self._flight, self.clock, settings, lockstep=bus.lockstep
        )
        self._booted, self._tell_ready = False, ready
        self._alone_since, self._linger = 0.0, settings.linger
        if not settings.stays:
            self._linger = max(settings.linger, FIRST_CLIENT)
        self._tick, self._answered = -1, 0.0

    def run(self) -> None:
        """The loop; returns when the arm rests on its brakes for good.

        Raises:
            BusLost: the drives no longer answer.
        """
        supervisor, endpoint, clock = self.supervisor, self._endpoint, self.clock
        most, reading = self._settings.datagrams_per_tick, self._settings.reading_time
        monotonic, piecemeal = time.monotonic, not self._bus.lockstep
        flight, service = self._flight, self._service
        while not supervisor.brakes.finished:
            ping, asked, before = service.ping, monotonic(), self._tick
            if not supervisor.may_exchange:
                clock.stood(asked)
                endpoint.wait(1)
                if self._inside is not None:
                    self._inside.hear(0.0)
            elif not self._run_plainly(asked):
                self._exchange(asked)
            service.echo = ping
            now = monotonic()
            if piecemeal:
                pieces = max(1, min(self._tick - before, _MOST_PIECES))
                for _ in range(pieces):  # those of ticks that went by without an exchange are made up for
                    found = endpoint.sift(now, now + reading)
                    service.do_one_piece(now, self._tick, found=found)
                self._live(now)
            else:
                endpoint.drain(now, now + reading, most, service.handle)
                endpoint.relay()
                self._live(now)
                service.tell_if_due(now, self._tick)
            if self._tick != before:
                flight.record(self._answered)
            flight.watch(now)
            if clock.warning_due:
                clock.warn()
        service.say_goodbye(time.monotonic())

    def _exchange(self, asked: float) -> None:
        """One exchange with the drives, and all that follows from a new tick."""
        supervisor = self.supervisor
        measurement = self._bus.exchange(supervisor.command())
        answered = time.monotonic()
        if measurement.tick == self._tick:
            supervisor.told_again(measurement)
            self.clock.stood(asked)
            return
        self._tick, self._answered = measurement.tick, answered
        supervisor.advance(measurement)
        self.clock.ran(measurement.tick, asked, answered, time.monotonic())

    def _run_plainly(self, asked: float) -> bool:
        """On a bus in this thread: plain ticks without a line of Python, up to the next telemetry; whether there were.

        The measurement that ended them is looked at closer, if it was not plain itself.
        """
        bus, call, supervisor = self._inside, self._call, self.supervisor
        if bus is None or not call.function or not supervisor.plainly:
            return False
        call.command[:3], call.command[3] = supervisor.torque, supervisor.reference.finger_velocity
        span = self._settings.telemetry_ticks
        most = span - supervisor.measurement.tick % span
        ticks, said, measurement = bus.run(call, most, supervisor.busy)
        if not ticks:
            return False
        if said == LOOK_CLOSER:
            if ticks > 1:
                self._flight.record(asked)
            supervisor.look_closer(measurement)
        else:
            supervisor.took_plainly(measurement)
        self._tick, self._answered = measurement.tick, asked
        self.clock.ran_on(ticks, measurement.tick, asked, time.monotonic())
        return True

    def close(self) -> None:
        """Brakes, if the drives still answer; then give socket, file and bus up. A grip is not let go of."""
        grip = min(0.0, self.supervisor.reference.finger_velocity)
        try:
            self._bus.exchange(Command(_NO_TORQUE, grip, brake=True, enable=False, busy=False))
        except BusLost:
            pass  # the drives' own watchdog brakes
        finally:
            self._bus.close()
            self._endpoint.close()
            self._file.remove()
            self._flight.close(abnormal=not self.supervisor.brakes.finished)

    def _live(self, now: float) -> None:
        """What happens without the client: a listener's STOP, readiness, loss of the client, the end."""
        supervisor, endpoint = self.supervisor, self._endpoint
        if endpoint.pressed():
            supervisor.machine.press_stop()
        if not self._booted:
            self._booted, self._alone_since = self._ready(), now
        if endpoint.expire(now):
            self._alone_since = now
            supervisor.machine.stop(Violation(Cause.CLIENT_LOST, endpoint.silence(now), endpoint.lease))
        if endpoint.leased:
            self._linger = self._settings.linger
        alone = 0.0 if endpoint.leased else now - self._alone_since
        if self.ending or (alone > self._linger and not self._settings.stays):
            supervisor.machine.retire()
        elif alone > self._linger:
            supervisor.machine.park(alone)

    def _ready(self) -> bool:
        """Tell clients where to find this process once the arm holds (or cannot, which the telemetry explains)."""
        if self.supervisor.state is State.BOOT:
            return False
        self._file.publish()
        self._tell_ready(*self._endpoint.address)
        return True

    def _welcome(self) -> bytes:
        bus = self._bus
        return Welcome(bus.period, self._settings.capacity, bus.lockstep, self.supervisor.admission.last_motion).pack()


def _complain(sentence: str, status: int) -> int:
    print(sentence, file=sys.stderr, flush=True)
    return status


@contextlib.contextmanager
def _ending_by_signal(server: Server) -> Iterator[None]:
    """SIGINT, SIGTERM and the terminal's end have the effect of a shutdown; only the main thread may ask for that.

    Where the terminal's end is ignored it goes on being so: somebody wants the program to outlive it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(_number: int, _frame: FrameType | None) -> None:
        server.ending = True

    outlives = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    numbers = (signal.SIGINT, signal.SIGTERM) if outlives else (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, end) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
