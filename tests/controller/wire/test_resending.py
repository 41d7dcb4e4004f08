"""When the client sends again: what is lost gets through, and a controller that falls behind is not buried."""

from __future__ import annotations

from collections import deque
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.protocol.datagram_fields import SAMPLE, SAMPLES_PER_DATAGRAM, DatagramKind
from controller.protocol.messages import Announce, Samples, Welcome
from controller.protocol.states import State
from controller.wire import client as client_module
from controller.wire.client import ControllerClient
from controller.wire.link import REPEAT
from controller.wire.resending import AHEAD, RESEND, MotionStream, Repeats

PERIOD = 0.00088
TURNS = 5
"""Ticks that a controller in real time takes for an order: to read it, and to tell of it in three pieces."""


class SlowController:
    """Ends of a link to a controller in real time, whose ticks take longer than their period; time is made up.

    Args:
        slower: so many times.
        flight: of a datagram, there or back [s].
    """

    def __init__(self, slower: float, flight: float) -> None:
        self.now, self.tick, self.sequence, self.longest = 0.0, 0, 0, 0
        self._period, self._flight = PERIOD * slower, flight
        self._inbox = deque[tuple[float, int]]()
        self._told = deque[tuple[float, int, int]]()
        self.telemetry: Any = SimpleNamespace(command=0, tick=0, state=State.HOLD, explain_cause=str)

    def monotonic(self) -> float:
        return self.now

    def send(self, _kind: DatagramKind, _payload: bytes) -> None:
        self.sequence += 1
        self._inbox.append((self.now + self._flight, self.sequence))

    def wait_for_news(self, seen: Any) -> None:
        """Tick on until telemetry has come that tells of another order, but no longer than the link waits."""
        until = self.now + REPEAT
        while self.now < until and self.telemetry.command == seen.command:
            self.tick += 1
            self.now += self._period
            self.longest = max(self.longest, len(self._inbox))
            if self.tick % TURNS == 0:
                command = self._told[-1][1] if self._told else self.telemetry.command
                if self._inbox and self._inbox[0][0] <= self.now:
                    command = self._inbox.popleft()[1]
                self._told.append((self.now + self._flight, command, self.tick))
            while self._told and self._told[0][0] <= self.now:
                _, command, tick = self._told.popleft()
                self.telemetry = SimpleNamespace(**{**vars(self.telemetry), "command": command, "tick": tick})


@given(st.floats(0.5, 12.0), st.floats(0.0, 0.2))
def test_orders_do_not_queue_up_behind_their_repetitions(slower: float, flight: float) -> None:
    controller = SlowController(slower, flight)
    client = ControllerClient("127.0.0.1", 1, bytes(32))
    client._welcome, client._link = Welcome(PERIOD, 0, False, 0), controller  # type: ignore[assignment]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(client_module, "time", controller)
        for _ in range(30):
            client._ask(DatagramKind.COMMAND, b"", lambda t: True, "hold")
    round_trip = 2.0 * flight + 3 * TURNS * PERIOD * slower
    assert controller.longest <= 3 + round_trip / REPEAT


@given(st.integers(1, 40), st.lists(st.tuples(st.integers(0, 50), st.floats(0.0, 0.7)), max_size=60))
def test_nothing_is_repeated_before_both_times_have_passed_and_all_is_after_half_a_second(
    ticks: int, turns: list[tuple[int, float]]
) -> None:
    repeats, now, tick = Repeats(1, REPEAT, ticks), 100.0, 7
    assert repeats.due(0, 1, tick, now) == [0]
    sent_at, sent_tick = now, tick
    for more_ticks, more_time in turns:
        now, tick = now + more_time, tick + more_ticks
        waited = now - sent_at
        ripe = waited > REPEAT and tick - sent_tick >= ticks
        assert repeats.due(0, 1, tick, now) == ([0] if ripe or waited > 0.5 else [])
        if ripe or waited > 0.5:
            sent_at, sent_tick = now, tick


def test_a_motion_is_sent_ahead_and_what_is_missing_again() -> None:
    sent = list[tuple[DatagramKind, bytes]]()
    samples = np.zeros(3 * AHEAD, SAMPLE)
    announce = Announce(5, 100, len(samples), 0)
    stream = MotionStream(lambda kind, payload: sent.append((kind, payload)), announce, samples, AHEAD, 16, 68)

    def firsts(tick: int, now: float, motion: int = 5, received: int = 0, executed: int = 0) -> list[int]:
        sent.clear()
        stream.push(SimpleNamespace(tick=tick, motion=motion, received=received, executed=executed), now)  # type: ignore[arg-type]
        return [found.start for kind, payload in sent if kind == DatagramKind.SAMPLES
                and (found := Samples.unpack(memoryview(payload))) is not None]  # fmt: skip

    ahead = list(range(0, AHEAD, SAMPLES_PER_DATAGRAM))
    assert firsts(70, 1.0, motion=4) == ahead
    assert sent[0] == (DatagramKind.ANNOUNCE, announce.pack())
    # admitted; half of it has arrived, and the rest is on its way
    half = AHEAD // 2
    assert firsts(100, 1.03, received=half) == []
    # the wall's time alone repeats nothing where the plant has hardly moved
    assert firsts(110, 1.0 + 2.0 * RESEND, received=half) == []
    assert firsts(140, 1.0 + 3.0 * RESEND, received=half) == ahead[len(ahead) // 2 :]
    # what was executed makes room for more
    assert firsts(150, 1.21, received=AHEAD, executed=SAMPLES_PER_DATAGRAM) == [AHEAD]
