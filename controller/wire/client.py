"""The app's client of the controller: executes motions, gives commands, reports what was really done."""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple, Self

from numpy.typing import NDArray

from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import (
    COMMAND,
    RELEASE,
    SAMPLE,
    STOP,
    CommandCode,
    DatagramKind,
    Flag,
    MotionFlag,
    Result,
)
from controller.protocol.messages import AdmitSpeed, Announce, Telemetry, Welcome
from controller.protocol.states import State
from controller.wire.errors import CommandFailed, ControllerLost, MotionRefused, MotionStopped
from controller.wire.link import REPEAT, Link, Listener
from controller.wire.resending import AHEAD, REPEAT_TOLD, RESEND, MotionStream, Repeats
from hardware.interfaces import Triple

_LEAD_LOCKSTEP = 8
_LEAD_REAL_TIME = 30
_COMMAND_TIMEOUT = 5.0
"""[s]"""


class MotionOutcome(NamedTuple):
    """What was really done."""

    result: Result
    """DONE, GRIPPED or TOUCHED."""
    first_tick: int
    end_tick: int
    duration: float
    """Plant time from the first to the last tick [s]."""
    position: Triple
    """Measured tool point at the last tick, base frame [m]."""
    reference: Triple
    """Where the reference rests since then, base frame [m]: what comes next begins there."""
    finger_position: float
    """Measured at the last tick [m]."""
    peak_torque: float
    """Largest torque commanded [N m]."""
    peak_tactile: float
    """Largest tactile force [N]."""
    tactile: tuple[float, float]
    """What the pads felt when the end was told: right, left [N]."""

    @property
    def gripped(self) -> bool:
        """Whether the GRIP guard ended the motion."""
        return self.result is Result.GRIPPED

    @property
    def touched(self) -> bool:
        """Whether the TOUCH guard ended the motion."""
        return self.result is Result.TOUCHED


class ControllerClient:
    """One client of one controller. Commands may be given from any thread, also while another one is in ``execute``.

    Args:
        host: IPv4 address of the controller.
        port: its UDP port.
        key: the shared secret.
        name: told to others who want the lease.
        lead: ticks between an announcement and its first sample; by default 8 on a lockstep bus, else 30.
        listener: called with each telemetry, in a thread of its own.
    """

    def __init__(
        self,
        host: str,
        port: int,
        key: bytes,
        *,
        name: str | None = None,
        lead: int | None = None,
        listener: Listener | None = None,
    ) -> None:
        self._host, self._port, self._key = host, port, key
        self._name = name or f"process {os.getpid()} on {socket.gethostname()}"
        self._lead = lead
        self._listener = listener
        self._link: Link | None = None
        self._welcome = Welcome(0.0, 0, False, 0)
        self._motion = 0
        self._asking = threading.Lock()

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def telemetry(self) -> Telemetry:
        """The newest telemetry.

        Raises:
            ControllerLost: there was none for three seconds.
        """
        return self._connected.telemetry

    @property
    def latched(self) -> bool:
        """Whether somebody pressed STOP and it was not released since, by the newest telemetry, however old."""
        telemetry = self._connected.last_telemetry
        return telemetry is not None and telemetry.latched

    @property
    def lockstep(self) -> bool:
        """Whether plant time waits for the controller; known once connected."""
        return self._welcome.lockstep

    @property
    def period(self) -> float:
        """Length of one tick; known once connected [s]."""
        return self._welcome.period

    def connect(self, timeout: float = 5.0) -> None:
        """Take the lease and wait for the first telemetry.

        Args:
            timeout: wall time to wait [s].

        Raises:
            ControllerBusy: another client holds the lease.
            ControllerUnavailable: nobody answered in time.
        """
        self.close()
        link = Link(self._host, self._port, self._key, name=self._name, listener=self._listener)
        try:
            self._welcome = link.greet(timeout)
        except BaseException:
            link.close()
            raise
        self._link, self._motion = link, self._welcome.last_motion

    def close(self) -> None:
        """Fall silent; the controller notices after a second and holds."""
        if self._link is not None:
            self._link.close()
            self._link = None

    def execute(self, samples: NDArray[Any], followed: bool = False) -> MotionOutcome:
        """Announce and stream a motion, and wait for its end.

        Args:
            samples: shape (n,) of type ``SAMPLE``; it starts at the controller's reference and ends at rest.
            followed: another motion is announced right after this one; on a lockstep bus plant time waits for it.

        Raises:
            MotionRefused: the controller did not begin it.
            MotionStopped: the controller did not finish it.
            ControllerLost: the controller does not answer any more.
        """
        if samples.dtype != SAMPLE or samples.ndim != 1:
            raise ValueError(f"samples are {samples.dtype} of shape {samples.shape}: give shape (n,) of type SAMPLE")
        telemetry = self._try(samples, followed)
        if telemetry.result is Result.REFUSED and telemetry.reason is Cause.LATE and not self.lockstep:
            # on a real-time bus a hiccup of this process may eat the lead: once more with the newer tick
            telemetry = self._try(samples, followed)
        if telemetry.result is Result.REFUSED:
            raise MotionRefused(telemetry)
        if telemetry.result is Result.STOPPED:
            raise MotionStopped(telemetry)
        return self._outcome(telemetry)

    def wait_standing(self) -> Telemetry:
        """Wait until plant time stands, on a lockstep bus; returns telemetry that is newer than this call.

        On a real-time bus it returns at once, with the newest telemetry.
        """
        return self._standing(or_held=False)

    def _standing(self, or_held: bool) -> Telemetry:
        """As ``wait_standing``; ``or_held``: or until a hold is in force, as time may run for others meanwhile."""
        link = self._connected
        if not self.lockstep:
            return link.telemetry
        # the echo comes with the first exchange that began after the ping arrived: nothing older can pass for it
        ping, asked = link.ping(), 0.0
        while True:
            telemetry = link.telemetry
            answered = telemetry.echo == ping
            held = or_held and telemetry.state is State.HOLD and not telemetry.admitting
            if answered and (telemetry.standing or held):
                return telemetry
            if not answered and time.monotonic() - asked > REPEAT:
                asked = time.monotonic()
                link.beat()
            link.wait_for_news(telemetry)

    def hold(self) -> None:
        """Stop, and admit no motion until ``resume``."""
        self._command(CommandCode.HOLD, lambda t: not _moving(t))

    def ask_to_hold(self) -> None:
        """As ``hold``, but returns as soon as the controller has begun to stop; the arm still moves for up to 0.1 s.

        For whoever keeps plant time waiting meanwhile, on a lockstep bus, and for whoever is in a hurry.
        """
        self._command(CommandCode.HOLD, lambda t: True)

    def admit_speed(self, speed: float, until: float, borders: tuple[float, ...]) -> None:
        """Nobody is near: let the tool go faster than near people.

        Args:
            speed: of the tool, at most [m/s].
            until: plant time at which this ends [s].
            borders: four planes between which it is admitted; see ``AdmitSpeed``.
        """
        admitted = AdmitSpeed(speed, max(0, round(until / self.period)), borders)
        self._ask(DatagramKind.ADMIT_SPEED, admitted.pack(), lambda t: True)

    def resume(self) -> None:
        """Admit motions again; another thread may tell it to hold right afterwards."""
        self._command(CommandCode.RESUME, lambda t: bool(t.flags & Flag.ADMITTING) or t.cause is Cause.HOLD_COMMAND)

    def stop(self) -> None:
        """Stop the present motion."""
        self._command(CommandCode.STOP, lambda t: not _moving(t))

    def press_stop(self) -> None:
        """STOP: come to rest, whatever goes on, and admit no motion until ``release``; `TelemetryWatch.stop` does the
        same.
        """
        self._ask(DatagramKind.STOP, STOP.struct.pack(0), lambda t: t.latched and not _moving(t), "STOP")

    def release(self) -> None:
        """Admit motions again after a STOP, whoever has pressed it. One that comes meanwhile stays in force."""
        presses = self.telemetry.presses
        self._ask(
            DatagramKind.RELEASE,
            RELEASE.struct.pack(presses),
            lambda t: not t.latched or t.presses != presses,
            "release",
        )

    def clear_fault(self) -> None:
        """Leave the state FAULT; the brakes stay closed until ``enable``."""
        self._command(CommandCode.CLEAR_FAULT, lambda t: t.state is not State.FAULT)

    def enable(self) -> None:
        """Open the brakes and hold."""
        self._command(CommandCode.ENABLE, lambda t: t.state is State.HOLD)

    def record(self) -> int:
        """Have the controller write its flight record of the last half minute into its run directory.

        Returns:
            A tick that is in it, if there was time for it since the last one was written: the file is the one of
            `controller.loop.flight.RECORD_NAME` with no earlier tick in its name. It is there some moments later.
        """
        tick = self.telemetry.tick
        self._command(CommandCode.RECORD, lambda t: True)
        return tick

    def shutdown(self) -> None:
        """Stop, brake, and end the controller process; returns when the arm rests."""
        link = self._connected
        try:
            self._command(CommandCode.SHUTDOWN, lambda t: t.state is State.OFF and not t.flags & Flag.BUSY)
        except ControllerLost:
            # its last words may be lost on the way; what is needed is that it was on its brakes
            if link.last_telemetry is None or link.last_telemetry.state is not State.OFF:
                raise
        finally:
            self.close()

    @property
    def _connected(self) -> Link:
        if self._link is None:
            raise ControllerLost(f"there is no connection to {self._host}:{self._port}: call connect first")
        return self._link

    def _try(self, samples: NDArray[Any], followed: bool) -> Telemetry:
        """Announce, stream, and return the telemetry that tells the end."""
        link, now = self._connected, self._standing(or_held=True)
        lead = self._lead or (_LEAD_LOCKSTEP if self.lockstep else _LEAD_REAL_TIME)
        self._motion = max(self._motion, now.ended_motion, now.motion) + 1
        flags = MotionFlag.FOLLOWED if followed else MotionFlag.NONE
        announce = Announce(self._motion, now.tick + lead, len(samples), flags)
        ahead = min(AHEAD, self._welcome.capacity // 2)
        stream = MotionStream(link.send, announce, samples, ahead, self._ticks(REPEAT_TOLD), self._ticks(RESEND))
        while True:
            telemetry = link.telemetry
            if telemetry.ended_motion == announce.motion:
                return telemetry
            stream.push(telemetry, time.monotonic())
            link.wait_for_news(telemetry)

    def _outcome(self, telemetry: Telemetry) -> MotionOutcome:
        return MotionOutcome(
            telemetry.result,
            telemetry.first_tick,
            telemetry.end_tick,
            (telemetry.end_tick - telemetry.first_tick) * self.period,
            telemetry.ended_position,
            telemetry.reference,
            telemetry.ended_finger,
            telemetry.peak_torque,
            telemetry.peak_tactile,
            telemetry.tactile,
        )

    def _ticks(self, duration: float) -> int:
        """A duration [s] in ticks of the plant; none where plant time waits for what is sent."""
        return 0 if self.lockstep else round(duration / self.period)

    def _command(self, code: CommandCode, done: Callable[[Telemetry], bool]) -> None:
        """As ``_ask``."""
        self._ask(DatagramKind.COMMAND, COMMAND.struct.pack(code), done, code.name)

    def _ask(
        self, kind: DatagramKind, payload: bytes, done: Callable[[Telemetry], bool], name: str = "admit_speed"
    ) -> None:
        """Repeat what is asked for until it was carried out, and wait until its effect shows.

        One order after the other, whichever thread asks: telemetry tells the last one that was carried out, and a later
        one would pass for one that was lost.
        """
        link = self._connected
        deadline = time.monotonic() + _COMMAND_TIMEOUT
        with self._asking:
            first, again = link.sequence + 1, Repeats(1, REPEAT, self._ticks(REPEAT_TOLD))
            while (telemetry := link.telemetry).command < first:
                _require_time(deadline, telemetry, name)
                if again.due(0, 1, telemetry.tick, time.monotonic()):
                    link.send(kind, payload)
                link.wait_for_news(telemetry)
        while not done(telemetry := link.telemetry):
            _require_time(deadline, telemetry, name)
            link.wait_for_news(telemetry)


def _require_time(deadline: float, telemetry: Telemetry, name: str) -> None:
    if time.monotonic() > deadline:
        raise CommandFailed(
            f"{name.lower()} had no effect within {_COMMAND_TIMEOUT:g} s in state {telemetry.state.name}: "
            f"{telemetry.explain_cause()}"
        )


def _moving(telemetry: Telemetry) -> bool:
    return telemetry.state in (State.TRACK, State.STOPPING)
