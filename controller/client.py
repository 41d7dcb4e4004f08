"""The app's end of the wire: takes the lease, keeps it alive, streams motions, reports what was really done.

```
ControllerError
├── ControllerUnavailable   nobody answers, or not in this version of the protocol
├── ControllerBusy          another client holds the lease
├── ControllerLost          it answered once and does no more
├── CommandFailed           a command has no effect in the controller's present state
├── MotionRefused           the motion was not begun
└── MotionStopped           the motion was begun and not finished
```
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from controller.causes import Cause
from controller.protocol.envelope import Drop, Envelope
from controller.protocol.key import KEY_FILE, load_key
from controller.protocol.layout import (
    CHALLENGE,
    COMMAND,
    HEARTBEAT,
    MAX_DATAGRAM,
    SAMPLE,
    SAMPLES_PER_DATAGRAM,
    VERSION,
    CommandCode,
    Flag,
    Kind,
    MotionFlag,
    Result,
)
from controller.protocol.messages import Announce, Busy, Hello, Samples, Telemetry, Welcome
from controller.states import State
from hardware.interfaces import Triple

HEARTBEAT_INTERVAL = 0.1
"""[s]"""
_SILENCE = 1.0
"""Without telemetry for so long the controller counts as lost [s]."""
_REPEAT = 0.02
"""An unanswered HELLO, announcement, command or ping is repeated after this [s]."""
_RESEND = 0.03
"""A sample not acknowledged is sent again after this [s]."""
_FLIGHT = 48 * SAMPLES_PER_DATAGRAM
"""Samples sent ahead of the acknowledgement: half a second, well within a socket's buffer."""
_LEAD_LOCKSTEP = 8
_LEAD_REAL_TIME = 30


class ControllerError(Exception):
    """Something about the controller; the message is one sentence with the next step."""


class ControllerUnavailable(ControllerError):
    """Nobody answers, or in another version of the protocol."""


class ControllerBusy(ControllerError):
    """Another client holds the lease."""


class ControllerLost(ControllerError):
    """The controller answered once and does no more."""


class CommandFailed(ControllerError):
    """A command had no effect."""


class MotionRefused(ControllerError):
    """The motion was not begun."""

    def __init__(self, telemetry: Telemetry) -> None:
        super().__init__(f"the controller refused motion {telemetry.ended_motion}: {telemetry.explain_reason()}")
        self.cause = telemetry.reason


class MotionStopped(ControllerError):
    """The motion was begun and not finished; the arm is at rest or comes to rest."""

    def __init__(self, telemetry: Telemetry) -> None:
        super().__init__(
            f"the controller stopped motion {telemetry.ended_motion} at tick {telemetry.end_tick}: "
            f"{telemetry.explain_reason()}"
        )
        self.cause = telemetry.reason


class MotionOutcome(NamedTuple):
    """What was really done."""

    result: Result
    """DONE or GRIPPED."""
    first_tick: int
    end_tick: int
    duration: float
    """Plant time from the first to the last tick [s]."""
    position: Triple
    """Measured tool point at the last tick, base frame [m]."""
    finger_position: float
    """Measured at the last tick [m]."""
    peak_torque: float
    """Largest torque commanded [N m]."""
    peak_tactile: float
    """Largest tactile force [N]."""

    @property
    def gripped(self) -> bool:
        """Whether the GRIP guard ended the motion."""
        return self.result is Result.GRIPPED


Listener = Callable[[Telemetry], None]


class ControllerClient:
    """One client of one controller. Methods may be called from one thread at a time.

    Args:
        host: IPv4 address of the controller.
        port: its UDP port.
        key: the shared secret.
        name: told to others who want the lease.
        lead: ticks between an announcement and its first sample; by default 8 on a lockstep bus, else 30.
        listener: called with each telemetry, in the client's own thread.
    """

    def __init__(
        self,
        host: str,
        port: int,
        key: bytes,
        name: str | None = None,
        lead: int | None = None,
        listener: Listener | None = None,
    ) -> None:
        self._where = f"{host}:{port}"
        self._name = name or f"process {os.getpid()} on {socket.gethostname()}"
        self._envelope = Envelope(key)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((host, port))
        self._socket.settimeout(HEARTBEAT_INTERVAL / 4)
        self._session = 0
        self._lead = lead
        self._listener = listener
        self._news = threading.Condition()
        self._sending = threading.Lock()
        self._sequence = 0
        self._newest = 0
        self._ping = 0
        self._motion = 0
        self._cookie = 0
        self._welcome: Welcome | None = None
        self._busy: Busy | None = None
        self._telemetry: Telemetry | None = None
        self._acted_on = 0
        self._heard = 0.0
        self._gone = False
        self._open = False
        self._thread: threading.Thread | None = None

    @classmethod
    def from_run_directory(
        cls, directory: Path, name: str | None = None, lead: int | None = None, listener: Listener | None = None
    ) -> Self:
        """A client of the controller that runs in this directory (not connected yet).

        Raises:
            ControllerUnavailable: there is no ``controller.json``, or it names another version of the protocol.
            KeyFileError: the key cannot be read.
        """
        file = directory / "controller.json"
        try:
            found = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ControllerUnavailable(f"{file} cannot be read ({error}): is the controller running?") from error
        if found["protocol"] != VERSION:
            raise ControllerUnavailable(
                f"the controller speaks protocol {found['protocol']:08x}, this program {VERSION:08x}: "
                "start both from the same version"
            )
        return cls(found["host"], found["port"], load_key(directory / KEY_FILE), name, lead, listener)

    def __enter__(self) -> Self:
        self.connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # state

    @property
    def telemetry(self) -> Telemetry:
        """The latest telemetry.

        Raises:
            ControllerLost: there was none for a second.
        """
        telemetry, silence = self._telemetry, time.monotonic() - self._heard
        if telemetry is None or self._gone or silence > _SILENCE:
            raise ControllerLost(f"no telemetry from {self._where} for {silence:.2f} s: is the controller running?")
        return telemetry

    @property
    def lockstep(self) -> bool:
        """Whether plant time waits for the controller."""
        return self._greeting.lockstep

    @property
    def period(self) -> float:
        """Length of one tick [s]."""
        return self._greeting.period

    @property
    def _greeting(self) -> Welcome:
        if self._welcome is None:
            raise ControllerLost(f"there is no connection to {self._where}: call connect first")
        return self._welcome

    # life

    def connect(self, timeout: float = 5.0) -> None:
        """Take the lease and wait for the first telemetry.

        Args:
            timeout: wall time to wait [s].

        Raises:
            ControllerBusy: another client holds the lease.
            ControllerUnavailable: nobody answered in time.
        """
        self._session, self._sequence, self._newest, self._cookie = secrets.randbits(64) | 1, 0, 0, 0
        self._welcome, self._busy, self._telemetry, self._gone = None, None, None, False
        self._heard = time.monotonic()
        self._open = True
        self._thread = threading.Thread(target=self._listen, name="controller client", daemon=True)
        self._thread.start()
        try:
            self._greet(time.monotonic() + timeout, timeout)
        except ControllerError:
            self.close()
            raise
        self._motion = self._greeting.last_motion

    def close(self) -> None:
        """Give up; the controller notices after a second of silence and holds."""
        self._open = False
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    # motions and commands

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
            raise ValueError(f"samples are {samples.dtype} of shape {samples.shape}, give shape (n,) of type SAMPLE")
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

        On a real-time bus it returns at once, with the latest telemetry.
        """
        if not self.lockstep:
            return self.telemetry
        self._ping = (self._ping + 1) % (1 << 32)
        asked = 0.0
        while True:
            telemetry = self.telemetry
            if telemetry.echo == self._ping and telemetry.standing:
                return telemetry
            if telemetry.echo != self._ping and time.monotonic() - asked > _REPEAT:
                asked = time.monotonic()
                self._beat()
            self._wait_for_news(telemetry)

    def hold(self) -> None:
        """Stop, and admit no motion until ``resume``."""
        self._command(CommandCode.HOLD, lambda t: not t.flags & Flag.ADMITTING and not _moving(t))

    def resume(self) -> None:
        """Admit motions again."""
        self._command(CommandCode.RESUME, lambda t: bool(t.flags & Flag.ADMITTING))

    def stop(self) -> None:
        """Stop the present motion."""
        self._command(CommandCode.STOP, lambda t: not _moving(t) and not t.flags & Flag.WAITING)

    def clear_fault(self) -> None:
        """Leave the state FAULT; the brakes stay closed until ``enable``."""
        self._command(CommandCode.CLEAR_FAULT, lambda t: t.state is not State.FAULT)

    def enable(self) -> None:
        """Open the brakes and hold."""
        self._command(CommandCode.ENABLE, lambda t: t.state is State.HOLD)

    def shutdown(self) -> None:
        """Stop, brake, and end the controller process; returns when the arm rests."""
        try:
            self._command(CommandCode.SHUTDOWN, lambda t: t.state is State.OFF and not t.flags & Flag.BUSY)
        except ControllerLost:
            # the last words may be lost on the way; that it was on its brakes is known
            if self._telemetry is None or self._telemetry.state is not State.OFF:
                raise
        finally:
            self.close()

    # inside

    def _greet(self, deadline: float, timeout: float) -> None:
        while self._telemetry is None:
            if self._busy is not None:
                busy = self._busy
                raise ControllerBusy(
                    f"the controller at {self._where} is held by {busy.name} ({busy.address}:{busy.port}, "
                    f"heard {busy.silence:.2f} s ago): end that program or wait until it is done"
                )
            if time.monotonic() > deadline or self._gone:
                raise ControllerUnavailable(
                    f"no answer from {self._where} within {timeout:g} s: "
                    "is the controller running, with the same key and the same version?"
                )
            if self._welcome is None:
                self._send(Kind.HELLO, Hello(self._cookie, self._name).pack())
            with self._news:
                self._news.wait(_REPEAT)

    def _try(self, samples: NDArray[Any], followed: bool) -> Telemetry:
        """Announce, stream, and return the telemetry that tells the end."""
        now = self.wait_standing()
        lead = self._lead or (_LEAD_LOCKSTEP if self.lockstep else _LEAD_REAL_TIME)
        self._motion = max(self._motion, now.ended_motion, now.motion) + 1
        flags = MotionFlag.FOLLOWED if followed else MotionFlag.NONE
        stream = _Stream(self._send, Announce(self._motion, now.tick + lead, len(samples), flags), samples)
        stream.window = min(_FLIGHT, self._greeting.capacity // 2)
        while True:
            telemetry = self.telemetry
            if telemetry.ended_motion == self._motion:
                return telemetry
            stream.push(telemetry, time.monotonic())
            self._wait_for_news(telemetry)

    def _outcome(self, telemetry: Telemetry) -> MotionOutcome:
        return MotionOutcome(
            telemetry.result,
            telemetry.first_tick,
            telemetry.end_tick,
            (telemetry.end_tick - telemetry.first_tick) * self.period,
            telemetry.ended_position,
            telemetry.ended_finger,
            telemetry.peak_torque,
            telemetry.peak_tactile,
        )

    def _command(self, code: CommandCode, done: Callable[[Telemetry], bool], timeout: float = 5.0) -> None:
        """Repeat a command until the telemetry shows its effect."""
        self._greeting  # noqa: B018 - raises where there is no connection
        deadline, sent = time.monotonic() + timeout, False
        while True:
            telemetry = self.telemetry
            if sent and done(telemetry):
                return
            if time.monotonic() > deadline:
                raise CommandFailed(
                    f"{code.name.lower()} had no effect within {timeout:g} s in state {telemetry.state.name}: "
                    f"{telemetry.explain_cause()}"
                )
            self._send(Kind.COMMAND, COMMAND.struct.pack(code))
            sent = True
            self._wait_for_news(telemetry)

    def _wait_for_news(self, seen: Telemetry) -> None:
        """Wait until there is newer telemetry than this, but not long."""
        with self._news:
            if self._telemetry is seen:
                self._news.wait(_REPEAT)

    def _beat(self) -> None:
        self._send(Kind.HEARTBEAT, HEARTBEAT.struct.pack(self._ping))

    def _send(self, kind: Kind, payload: bytes) -> None:
        with self._sending:
            self._sequence += 1
            try:
                self._socket.send(self._envelope.seal(kind, self._session, self._sequence, payload))
            except ConnectionRefusedError:
                self._gone = True

    def _listen(self) -> None:
        """The client's own thread: telemetry in, heartbeats out."""
        buffer = bytearray(MAX_DATAGRAM + 1)
        beaten = 0.0
        while self._open:
            now = time.monotonic()
            if self._welcome is not None and now - beaten >= HEARTBEAT_INTERVAL:
                beaten = now
                self._beat()
            try:
                size = self._socket.recv_into(buffer)
            except TimeoutError:
                continue
            except ConnectionRefusedError:
                self._gone = True
                time.sleep(_REPEAT)
                continue
            self._receive(memoryview(buffer)[:size])

    def _receive(self, data: memoryview) -> None:
        opened = self._envelope.open(data)
        if isinstance(opened, Drop) or opened.session != self._session or opened.sequence <= self._newest:
            return
        self._newest = opened.sequence
        self._gone, self._heard = False, time.monotonic()
        if opened.kind == Kind.TELEMETRY:
            self._take(Telemetry.unpack(opened.payload))
            return
        with self._news:
            if opened.kind == Kind.CHALLENGE:
                (self._cookie,) = CHALLENGE.struct.unpack(opened.payload)
            elif opened.kind == Kind.WELCOME:
                self._welcome = Welcome.unpack(opened.payload)
            elif opened.kind == Kind.BUSY:
                self._busy = Busy.unpack(opened.payload)
            self._news.notify_all()

    def _take(self, telemetry: Telemetry) -> None:
        before, self._telemetry = self._telemetry, telemetry
        if before is None or _matters(before, telemetry, self._acted_on):
            self._acted_on = telemetry.received
            with self._news:
                self._news.notify_all()
        if self._listener is not None:
            self._listener(telemetry)


def _matters(before: Telemetry, now: Telemetry, acted_on: int) -> bool:
    """Whether a waiting thread should be woken: something changed that it may act on (waking it costs more)."""
    return (
        now.state is not before.state
        or now.flags != before.flags
        or now.echo != before.echo
        or now.motion != before.motion
        or now.ended_motion != before.ended_motion
        or abs(now.received - acted_on) >= _FLIGHT // 4
    )


class _Stream:
    """One motion on its way: what to send next, what again."""

    def __init__(self, send: Callable[[Kind, bytes], None], announce: Announce, samples: NDArray[Any]) -> None:
        self.window = _FLIGHT
        self._send = send
        self._announce = announce
        self._samples = samples
        self._sent_at = np.full(-(-len(samples) // SAMPLES_PER_DATAGRAM), -np.inf)
        self._announced_at = -np.inf

    def push(self, telemetry: Telemetry, now: float) -> None:
        """Announce until admitted; send what is new within the window, and again what was not acknowledged."""
        motion = self._announce.motion
        admitted = telemetry.motion == motion
        if not admitted and now - self._announced_at > _REPEAT:
            self._announced_at = now
            self._send(Kind.ANNOUNCE, self._announce.pack())
        received = telemetry.received if admitted else 0
        first = received // SAMPLES_PER_DATAGRAM
        last = min(len(self._sent_at), -(-(received + self.window) // SAMPLES_PER_DATAGRAM))
        due = np.flatnonzero(now - self._sent_at[first:last] > _RESEND) + first
        self._sent_at[due] = now
        for chunk in due.tolist():
            start = chunk * SAMPLES_PER_DATAGRAM
            rows = self._samples[start : start + SAMPLES_PER_DATAGRAM]
            self._send(Kind.SAMPLES, Samples(motion, start, rows).pack())


def _moving(telemetry: Telemetry) -> bool:
    return telemetry.state in (State.TRACK, State.STOPPING)
