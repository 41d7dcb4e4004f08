"""What can wait for a tick: datagrams of the client carried out, telemetry gathered, packed and sent."""

from __future__ import annotations

from typing import Final

from controller.loop.flight import FlightRecorder
from controller.loop.supervisor import Supervisor
from controller.loop.telemetry import report
from controller.protocol.datagram_fields import COMMAND, HEARTBEAT, RELEASE, CommandCode, DatagramKind
from controller.protocol.messages import AdmitSpeed, Announce, Samples, Telemetry
from controller.records.late_ticks import LoopClock
from controller.settings import ControllerSettings
from controller.wire.endpoint import Endpoint

_COMMANDS: Final = {int(code): code for code in CommandCode}
_READ, _TELL, _RELAY = 0, 1, 2
_TURNS: Final = ((_TELL, _RELAY, _READ), (_RELAY, _READ, _TELL), (_READ, _TELL, _RELAY))
"""In which order they are asked for work, by who worked last."""


class ClientService:
    """Between the supervisor and its client and listeners.

    Args:
        supervisor: carries out what the client says.
        endpoint: their socket.
        flight: notes what was said.
        clock: how regularly the loop ticks.
        settings: of this process.
        lockstep: plant time waits for the controller.

    Attributes:
        ping: number of the client's newest heartbeat.
        echo: what telemetry says of it: the newest that came before the last exchange.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        endpoint: Endpoint,
        flight: FlightRecorder,
        clock: LoopClock,
        settings: ControllerSettings,
        *,
        lockstep: bool,
    ) -> None:
        self.ping = self.echo = 0
        self._supervisor, self._endpoint, self._flight, self._clock = supervisor, endpoint, flight, clock
        self._ticks, self._interval = settings.telemetry_ticks, settings.telemetry_interval
        self._lockstep = lockstep
        self._turn = _READ
        self._samples: Samples | None = None
        self._gathered: Telemetry | None = None
        self._packed: bytes | None = None
        self._published: object = None
        self._published_tick = -1
        self._published_at = 0.0

    def handle(self, kind: int, payload: memoryview) -> bool:
        """Carry a client's datagram out; false where its content is impossible."""
        if kind == DatagramKind.SAMPLES:
            samples = Samples.unpack(payload)
            if samples is None:
                return False
            self._supervisor.take_samples(samples)
        elif kind == DatagramKind.HEARTBEAT:
            (self.ping,) = HEARTBEAT.struct.unpack(payload)
        elif kind == DatagramKind.ANNOUNCE:
            announce = Announce.unpack(payload)
            self._flight.note(announce)
            self._supervisor.announce(announce)
        elif kind == DatagramKind.ADMIT_SPEED:
            admitted = AdmitSpeed.unpack(payload)
            if admitted is None:
                return False
            self._supervisor.admission.playback.admit(admitted, self._supervisor.measurement.tick)
        elif kind == DatagramKind.COMMAND:
            code = _COMMANDS.get(COMMAND.struct.unpack(payload)[0])
            if code is None:
                return False
            self._flight.note(code)
            self._supervisor.obey(code)
        elif kind == DatagramKind.STOP:
            self._supervisor.machine.press_stop()
        elif kind == DatagramKind.RELEASE:
            self._supervisor.admission.latch.release(*RELEASE.struct.unpack(payload))
        else:
            return False
        return True

    def do_one_piece(self, now: float, tick: int, *, found: bool) -> None:
        """On a bus in real time: one piece of what can wait for a tick, so that no tick has much to do.

        A datagram of the client is carried out in one tick, and the samples in it are checked in a later one. Telemetry
        is gathered, packed and sent in three; what it tells is of the first. Reading, telling and relaying take turns,
        so that a client that sends much silences nobody.

        Args:
            now: wall time [s].
            tick: of the plant.
            found: a datagram of the client was found in this tick, which takes as long as a piece: all but carrying it
                out waits for the next tick, in which none is looked for unless this one was carried out.
        """
        if found and self._busy:
            return
        if self._samples is not None:
            samples, self._samples = self._samples, None
            self._supervisor.take_samples(samples)
        elif self._packed is not None:
            packed, self._packed = self._packed, None
            self._endpoint.publish(packed, now)
        elif self._gathered is not None:
            self._packed, self._gathered = self._gathered.pack(), None
        else:
            for turn in _TURNS[self._turn]:
                if found and turn != _READ and self._has_turn(turn, now, tick):
                    return
                if self._take_turn(turn, now, tick):
                    self._turn = turn
                    return

    def tell_if_due(self, now: float, tick: int) -> None:
        """On a lockstep bus: telemetry at once, where it is due."""
        if self._is_due(now, tick):
            self._told(now, tick)
            self._endpoint.publish(self._telemetry().pack(), now)

    def say_goodbye(self, now: float) -> None:
        """Tell client and listeners that the arm rests; some copies, as one may get lost."""
        telemetry = self._telemetry().pack()
        for _ in range(5):
            self._endpoint.take_leave(telemetry, now)

    def _take_turn(self, turn: int, now: float, tick: int) -> bool:
        """Whether there was something to do."""
        if turn == _READ:
            return self._endpoint.take(self._handle_later)
        if turn == _RELAY:
            return self._endpoint.relay()
        if self._is_due(now, tick):
            self._told(now, tick)
            self._gathered = self._telemetry()
            return True
        return False

    @property
    def _busy(self) -> bool:
        """Whether something was begun that takes another piece."""
        return self._samples is not None or self._packed is not None or self._gathered is not None

    def _has_turn(self, turn: int, now: float, tick: int) -> bool:
        """Whether there is something to tell, or to relay."""
        return self._is_due(now, tick) if turn == _TELL else self._endpoint.relays

    def _handle_later(self, kind: int, payload: memoryview) -> bool:
        """As ``handle``, but samples wait for a later tick; nothing else is taken before, so the view lasts."""
        if kind != DatagramKind.SAMPLES:
            return self.handle(kind, payload)
        samples = Samples.unpack(payload)
        if samples is not None and self._supervisor.admission.motion.takes(samples):
            self._samples = samples  # of no other motion: those that a client still sends after one take no more time
        return samples is not None

    def _is_due(self, now: float, tick: int) -> bool:
        """On every change, once in every so many ticks, and at least every so often in wall time.

        In lockstep that once is at their begin, whatever was told in between: so two runs tell the same of those ticks.
        """
        due = tick // self._ticks != self._published_tick // self._ticks
        return due or now - self._published_at >= self._interval or self._change() != self._published

    def _told(self, now: float, tick: int) -> None:
        """It is told now."""
        self._published, self._published_tick, self._published_at = self._change(), tick, now

    def _change(self) -> tuple[object, ...]:
        """What is told at once when it changes."""
        supervisor = self._supervisor
        return (
            supervisor.state,
            supervisor.admission.ended,
            supervisor.admission.latch.presses,
            supervisor.may_exchange,
            self._endpoint.last_command,
            self.echo,
        )

    def _telemetry(self) -> Telemetry:
        endpoint = self._endpoint
        return report(
            self._supervisor, self._lockstep, self.echo, endpoint.last_command, self._clock.statistics(),
            endpoint.dropped,
        )  # fmt: skip
