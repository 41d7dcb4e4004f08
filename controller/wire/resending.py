"""What a client sends of a motion, and when it sends again what shows no effect."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.protocol.datagram_fields import SAMPLES_PER_DATAGRAM, DatagramKind
from controller.protocol.messages import Announce, Samples, Telemetry
from controller.wire.link import REPEAT

RESEND = 0.06
"""A sample not acknowledged is sent again after this [s]: a controller in real time takes 50 ms to look at all that is
sent of a motion at first, and to say so."""
REPEAT_TOLD = 0.014
"""What else is not answered is repeated after ``REPEAT`` of the wall's time and this of the plant's, as telemetry tells
it [s]: in real time it does so every 16 ticks, in which three orders are taken."""
AHEAD = 20 * SAMPLES_PER_DATAGRAM
"""Samples sent ahead of the executed one: 0.18 s. A client that dies leaves no more of its motion behind than that, and
the controlled stop takes up to 0.1 s more; a loss can be mended by two repetitions or three, and a pause of the
network, or of this process, for so long does not show in the motion."""
_STANDING_PLANT = 0.5
"""For so long what shows no effect is repeated by the plant's time, and then by the wall's alone [s]: plant time stands
while drives do not answer, and an order may be lost all the same."""


class Repeats:
    """When to send datagrams, and send them again while they show no effect.

    A controller in real time takes one in every few ticks. Where the plant falls behind the wall, as a simulation on a
    busy machine does, what was repeated by the wall's time alone, or with each telemetry, would queue up there faster
    than it is taken, each order behind repetitions of those before: so the plant's time has to pass as well.

    Args:
        count: of datagrams.
        after: wall time until one is repeated [s].
        ticks: of the plant that have to pass, too.
    """

    def __init__(self, count: int, after: float, ticks: int) -> None:
        self._after, self._ticks = after, ticks
        self._sent_at, self._sent_tick = np.full(count, -np.inf), np.zeros(count)

    def due(self, first: int, end: int, tick: int, now: float) -> list[int]:
        """Which of these are to be sent at this tick and wall time [s]; from now on they count as sent."""
        waited = now - self._sent_at[first:end]
        ripe = (waited > self._after) & (tick - self._sent_tick[first:end] >= self._ticks)
        due = np.flatnonzero(ripe | (waited > _STANDING_PLANT)) + first
        self._sent_at[due], self._sent_tick[due] = now, tick
        found: list[int] = due.tolist()
        return found


class MotionStream:
    """One motion on its way: what to send next, what again, and after how many ticks."""

    def __init__(
        self, send: Callable[[DatagramKind, bytes], None], announce: Announce, samples: NDArray[Any], ahead: int,
        announced: int, sampled: int,
    ) -> None:  # fmt: skip
        self._send = send
        self._announce = announce
        self._samples = samples
        self._ahead = ahead
        self._announced = Repeats(1, REPEAT, announced)
        self._sampled = Repeats(-(-len(samples) // SAMPLES_PER_DATAGRAM), RESEND, sampled)

    def push(self, telemetry: Telemetry, now: float) -> None:
        """Announce until admitted; send what is due next, and again what was not acknowledged."""
        motion = self._announce.motion
        admitted = telemetry.motion == motion
        if not admitted and self._announced.due(0, 1, telemetry.tick, now):
            self._send(DatagramKind.ANNOUNCE, self._announce.pack())
        received, executed = (telemetry.received, telemetry.executed) if admitted else (0, 0)
        first = received // SAMPLES_PER_DATAGRAM
        last = -(-(executed + self._ahead) // SAMPLES_PER_DATAGRAM)
        for chunk in self._sampled.due(first, last, telemetry.tick, now):
            start = chunk * SAMPLES_PER_DATAGRAM
            rows = self._samples[start : start + SAMPLES_PER_DATAGRAM]
            self._send(DatagramKind.SAMPLES, Samples(motion, start, rows).pack())
