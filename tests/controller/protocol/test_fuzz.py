"""A million random, mutated and replayed datagrams at the door: nothing comes of them, and nothing grows."""

from __future__ import annotations

import random
import time
import tracemalloc
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from controller.protocol.datagram_fields import (
    COMMAND,
    HEARTBEAT,
    PAYLOADS,
    RELEASE,
    SAMPLE,
    STOP,
    CommandCode,
    DatagramKind,
)
from controller.protocol.envelope import Drop, Envelope
from controller.protocol.messages import AdmitSpeed, Announce, Hello, MotionFlag, Samples, Welcome
from controller.wire.endpoint import Endpoint

KEY, WRONG_KEY = bytes(range(32)), bytes(32)
CLIENT, STRANGER = ("127.0.0.1", 4000), ("127.0.0.1", 4001)
SESSION = 7
FROM_CLIENT = (
    DatagramKind.HELLO,
    DatagramKind.HEARTBEAT,
    DatagramKind.COMMAND,
    DatagramKind.ANNOUNCE,
    DatagramKind.SAMPLES,
    DatagramKind.WATCH,
    DatagramKind.STOP,
    DatagramKind.RELEASE,
)


class House:
    """A door with a client inside, and what it let through."""

    def __init__(self) -> None:
        self.envelope = Envelope(KEY)
        self.door = Endpoint("127.0.0.1", 0, KEY, 1e9, lambda: Welcome(0.00088, 8192, True, 0).pack())
        self.heard: list[tuple[int, bytes]] = []
        self.sent = 0
        self.recorded = [self.seal(DatagramKind.HELLO, Hello(0, "owner").pack())]
        self.admit(self.recorded[0])
        self.recorded.append(self.seal(DatagramKind.HELLO, Hello(self.door._cookie, "owner").pack()))
        self.admit(self.recorded[1])
        assert self.door.leased
        for kind, payload in (
            (DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(3)),
            (DatagramKind.COMMAND, COMMAND.struct.pack(CommandCode.HOLD)),
            (DatagramKind.ADMIT_SPEED, AdmitSpeed(1.5, 900, (0.0, 0.0, 1.0, -0.3) * 4).pack()),
            (DatagramKind.ANNOUNCE, Announce(1, 1000, 10, MotionFlag.NONE).pack()),
            (DatagramKind.SAMPLES, Samples(1, 0, np.zeros(10, SAMPLE)).pack()),
            (DatagramKind.STOP, STOP.struct.pack(0)),
            (DatagramKind.RELEASE, RELEASE.struct.pack(1)),
        ):
            self.recorded.append(self.seal(kind, payload))
            assert self.admit(self.recorded[-1]) is None
        self.heard.clear()

    def seal(self, kind: DatagramKind, payload: bytes, session: int = SESSION, key: bytes = KEY) -> bytes:
        """The client's next datagram."""
        self.sent += 1
        return (self.envelope if key is KEY else Envelope(key)).seal(kind, session, self.sent, payload)

    def admit(self, data: bytes, address: tuple[str, int] = CLIENT) -> Drop | None:
        """Put a datagram before the door."""
        drop = self.door._admit(memoryview(data), address, time.monotonic())
        self.door.take(self._handle)
        return drop

    def _handle(self, kind: int, payload: memoryview) -> bool:
        self.heard.append((kind, bytes(payload)))
        return True


@pytest.fixture
def house() -> Iterator[House]:
    made = House()
    yield made
    made.door.close()


def hostile(house: House, rng: random.Random) -> bytes:
    """Noise, a recorded datagram again, changed in a bit, cut, made longer, or one sealed with another key."""
    choice, data = rng.randrange(6), rng.choice(house.recorded)
    if choice == 0:
        return rng.randbytes(rng.randrange(1500))
    if choice == 1:
        return data
    if choice == 2:
        place = rng.randrange(len(data))
        return data[:place] + bytes([data[place] ^ 1 << rng.randrange(8)]) + data[place + 1 :]
    if choice == 3:
        return data[: rng.randrange(len(data))]
    if choice == 4:
        return data + rng.randbytes(1 + rng.randrange(40))
    kind = rng.choice(FROM_CLIENT)
    return Envelope(WRONG_KEY).seal(kind, SESSION, rng.randrange(1 << 40), rng.randbytes(PAYLOADS[kind].size))


@pytest.mark.slow
def test_a_million_hostile_datagrams_have_no_effect_and_leave_nothing_behind(
    house: House, memory: Callable[[], int]
) -> None:
    rng, counted = random.Random(11), 0
    batch = [hostile(house, rng) for _ in range(20_000)]
    for _ in range(48):
        for data in batch:
            counted += house.admit(data, STRANGER) is not None
    tracemalloc.start()
    before = memory()
    for data in batch * 2:
        counted += house.admit(data, STRANGER) is not None
    after = memory()
    tracemalloc.stop()
    assert house.heard == []
    assert house.door._session == SESSION
    assert house.door._client == CLIENT
    assert house.door.listeners == 0
    assert not house.door.pressed()
    assert counted == 50 * len(batch) == 1_000_000
    assert after - before < 10_000
    assert house.admit(house.seal(DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(4))) is None
    assert house.heard == [(DatagramKind.HEARTBEAT, HEARTBEAT.struct.pack(4))]


def test_whoever_has_the_key_but_not_the_lease_commands_nothing(house: House) -> None:
    rng = random.Random(12)
    for _ in range(20_000):
        kind = rng.choice(FROM_CLIENT)
        size = PAYLOADS[kind].size + (SAMPLE.itemsize * rng.randrange(4) if kind is DatagramKind.SAMPLES else 0)
        session = rng.choice((0, rng.randrange(1 << 64)))
        house.admit(house.envelope.seal(kind, session, rng.randrange(1, 1 << 40), rng.randbytes(size)), STRANGER)
    assert house.heard == []
    assert not house.door.pressed()
    assert house.door._session == SESSION


def test_a_client_that_talks_nonsense_breaks_nothing(launch: Callable[..., Any]) -> None:
    """Right key, right session, impossible content: the running controller counts it and goes on."""
    running, rng = launch(), random.Random(13)
    with running.client() as client:
        link = client._connected
        for _ in range(3000):
            kind = rng.choice((DatagramKind.HEARTBEAT, DatagramKind.ANNOUNCE, DatagramKind.SAMPLES))
            size = PAYLOADS[kind].size + (SAMPLE.itemsize * rng.randrange(1, 4) if kind is DatagramKind.SAMPLES else 0)
            link.send(kind, rng.randbytes(size))
        assert client.telemetry.state.name in ("HOLD", "TRACK", "STOPPING")
        assert not running.bus.last.brake
