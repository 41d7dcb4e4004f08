"""A controller without a robot: its listeners hear of an arm that swings, and may stop it."""

from __future__ import annotations

import math
import socket
import threading
import time
from pathlib import Path
from typing import Any, Self

import numpy as np

from controller.model.constants import DeltaModel
from controller.model.reach import tool_point_at
from controller.protocol.datagram_fields import MAX_DATAGRAM, TELEMETRY, DatagramKind, Flag
from controller.protocol.envelope import Drop, Envelope
from controller.protocol.key import create_key
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from controller.wire.subscribers import Subscribers
from hardware.parameters import load_parameters

TICK = 0.00088
NOTHING = Telemetry.unpack(bytes(TELEMETRY.size))
PERIOD = 0.02
"""From one telemetry to the next [s], as a controller's in real time."""


class FakeController:
    """Answers listeners in a thread of its own, at ``address``: host, port and key file. A context manager."""

    def __init__(self, folder: Path) -> None:
        self._key_file = folder / "key"
        self._envelope = Envelope(create_key(self._key_file))
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.005)
        self._subscribers = Subscribers(self._send)
        self._model = DeltaModel(load_parameters())
        self._sequence = 0
        self.presses = 0
        self.deaf = False
        """It says what it does and hears nobody."""
        self.state = State.TRACK
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def address(self) -> tuple[str, int, Path]:
        """Where listeners find it."""
        return "127.0.0.1", self._socket.getsockname()[1], self._key_file

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        began = time.monotonic()
        due = began
        while not self._over.is_set():
            self._subscribers.relay()
            self._hear()
            now = time.monotonic()
            if now >= due:
                due = max(due + PERIOD, now)
                self._subscribers.publish(self.telemetry(now - began).pack(), now)

    def _hear(self) -> None:
        try:
            data, address = self._socket.recvfrom(MAX_DATAGRAM)
        except TimeoutError:
            return
        opened = self._envelope.open(memoryview(data))
        if isinstance(opened, Drop):
            return
        now = time.monotonic()
        if opened.kind == DatagramKind.WATCH:
            self._subscribers.admit(opened, address, now)
        elif (
            opened.kind == DatagramKind.STOP and not self.deaf and self._subscribers.press(opened, now) is None
        ):  # fmt: skip
            self.presses += 1
            if self.state is State.TRACK:
                self.state = State.HOLD

    def _send(self, address: Any, kind: DatagramKind, session: int, payload: bytes) -> None:
        self._sequence += 1
        self._socket.sendto(self._envelope.seal(kind, session, self._sequence, payload), address)

    def telemetry(self, t: float) -> Telemetry:
        """What the arm does at a plant time [s]."""
        moves = self.state is State.TRACK
        swing = [0.35 + 0.12 * math.sin(1.5 * t * moves + phase) for phase in (0.0, 2.0, 4.0)]
        tool = tuple(tool_point_at(self._model, np.array(swing)).tolist())
        return NOTHING._replace(
            tick=round(t / TICK), state=self.state, flags=Flag.LATCHED if self.presses else Flag.NONE,
            angle=tuple(swing),
            position=tool, reference=tuple(x + 0.0004 * math.sin(9.0 * t) for x in tool), presses=self.presses,
            force=(0.2 * math.sin(t), 0.1, -0.3), torque=(0.5, 0.4 + 0.1 * math.sin(3 * t), 0.3), motion=7,
            executed=round(t / TICK) % 2000, lateness=40e-6 + 10e-6 * math.sin(t), work=300e-6, period=TICK,
            finger_position=0.012, tactile=(1.5 + math.sin(t), 1.4),
        )  # fmt: skip
