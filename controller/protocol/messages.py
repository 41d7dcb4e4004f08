"""Typed messages of either side and their payloads on the wire."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from controller.protocol.cause_sentences import explain
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import (
    ADMIT_SPEED,
    ANNOUNCE,
    BUSY,
    HELLO,
    SAMPLE,
    SAMPLES,
    TELEMETRY,
    WELCOME,
    Flag,
    Layout,
    MotionFlag,
    Result,
)
from controller.protocol.states import State
from hardware.interfaces import DriveStatus, Triple


class Hello(NamedTuple):
    """Asks for the lease."""

    cookie: int
    name: str

    def pack(self) -> bytes:
        """Payload on the wire; a long name is cut."""
        return HELLO.struct.pack(self.cookie, _text(self.name, 48))

    @classmethod
    def unpack(cls, payload: bytes | memoryview) -> Self:
        """Read a payload."""
        cookie, name = HELLO.struct.unpack(payload)
        return cls(cookie, _string(name))


class Announce(NamedTuple):
    """Announces a motion: id, tick of its first sample, number of samples, flags."""

    motion: int
    first_tick: int
    length: int
    flags: MotionFlag

    @property
    def followed(self) -> bool:
        """Whether another motion will be announced right after this one."""
        return bool(self.flags & MotionFlag.FOLLOWED)

    def pack(self) -> bytes:
        """Payload on the wire."""
        return ANNOUNCE.struct.pack(*self)

    @classmethod
    def unpack(cls, payload: bytes | memoryview) -> Self:
        """Read a payload; flags that are not known are kept as they are."""
        motion, first_tick, length, flags = ANNOUNCE.struct.unpack(payload)
        return cls(motion, first_tick, length, MotionFlag(flags))


class AdmitSpeed(NamedTuple):
    """Nobody is near: the tool may go so fast [m/s] until a tick, between four planes in the base frame."""

    speed: float
    until: int
    borders: tuple[float, ...]
    """a, b, c, d of each: a x + b y + c z + d ≥ 0 [m] on the side where it may."""

    def pack(self) -> bytes:
        """Payload on the wire."""
        return ADMIT_SPEED.struct.pack(self.speed, self.until, *self.borders)

    @classmethod
    def unpack(cls, payload: bytes | memoryview) -> Self | None:
        """Read a payload, ``None`` where a number is none or the speed is below 0."""
        speed, until, *borders = ADMIT_SPEED.struct.unpack(payload)
        if not (math.isfinite(speed) and speed >= 0.0 and all(map(math.isfinite, borders))):
            return None
        return cls(speed, until, tuple(borders))


class Samples(NamedTuple):
    """Some samples of a motion, from index ``start`` on."""

    motion: int
    start: int
    rows: NDArray[Any]

    def pack(self) -> bytes:
        """Payload on the wire."""
        return SAMPLES.struct.pack(self.motion, self.start, len(self.rows)) + self.rows.tobytes()

    @classmethod
    def unpack(cls, payload: bytes | memoryview) -> Self | None:
        """Read a payload, ``None`` where its count belies its size. The rows are a view into the payload."""
        motion, start, count = SAMPLES.struct.unpack_from(payload)
        if SAMPLES.size + count * SAMPLE.itemsize != len(payload):
            return None
        return cls(motion, start, np.frombuffer(payload, SAMPLE, count, SAMPLES.size))


class Welcome(NamedTuple):
    """The lease was given."""

    period: float
    capacity: int
    lockstep: bool
    last_motion: int

    def pack(self) -> bytes:
        """Payload on the wire."""
        return WELCOME.struct.pack(*self)

    @classmethod
    def unpack(cls, payload: bytes | memoryview) -> Self:
        """Read a payload."""
        period, capacity, lockstep, last_motion = WELCOME.struct.unpack(payload)
        return cls(period, capacity, bool(lockstep), last_motion)


class Busy(NamedTuple):
    """Somebody else holds the lease."""

    name: str
    address: str
    port: int
    silence: float

    def pack(self) -> bytes:
        """Payload on the wire."""
        address = bytes(int(part) for part in self.address.split("."))
        return BUSY.struct.pack(_text(self.name, 48), address, self.port, self.silence)

    @classmethod
    def unpack(cls, payload: bytes | memoryview) -> Self:
        """Read a payload."""
        name, address, port, silence = BUSY.struct.unpack(payload)
        return cls(_string(name), ".".join(str(part) for part in address), port, silence)


class Telemetry(NamedTuple):
    """What the controller says of itself; fields, units and frames as in the layout of the same name."""

    tick: int
    echo: int
    command: int
    presses: int
    state: State
    flags: Flag
    cause: Cause
    cause_value: float
    cause_limit: float
    drive_status: DriveStatus
    angle: Triple
    angle_velocity: Triple
    position: Triple
    velocity: Triple
    reference: Triple
    torque: Triple
    finger_position: float
    tactile: tuple[float, float]
    force: Triple
    motion: int
    received: int
    executed: int
    ended_motion: int
    result: Result
    reason: Cause
    reason_value: float
    reason_limit: float
    first_tick: int
    end_tick: int
    ended_position: Triple
    ended_finger: float
    peak_torque: float
    peak_tactile: float
    clamped: int
    skipped: int
    period: float
    lateness: float
    work: float
    bad_size: int
    bad_version: int
    bad_tag: int
    bad_session: int
    bad_sequence: int
    bad_content: int

    def pack(self) -> bytes:
        """Payload on the wire."""
        values: tuple[Any, ...] = self
        flat: list[Any] = []
        for value, is_vector in zip(values, _TELEMETRY_VECTORS, strict=True):
            if is_vector:
                flat += value
            else:
                flat.append(value)
        return TELEMETRY.struct.pack(*flat)

    @classmethod
    def unpack(cls, payload: bytes | memoryview) -> Self:
        """Read a payload.

        Raises:
            ValueError: an enum holds a number that this version does not know.
        """
        values = TELEMETRY.struct.unpack(payload)
        return cls(*[convert(values[place]) for place, convert in _TELEMETRY_PLACES])

    @property
    def standing(self) -> bool:
        """Whether plant time stands at ``tick``: nothing moves, or the controller waits for the next motion."""
        return self.state in (State.HOLD, State.FAULT) and bool(self.flags & (Flag.STANDING | Flag.WAITING))

    @property
    def admitting(self) -> bool:
        """Whether a motion may be announced now."""
        return self.state is State.HOLD and bool(self.flags & Flag.ADMITTING) and not self.latched

    @property
    def latched(self) -> bool:
        """Whether somebody pressed STOP, and it was not released since."""
        return bool(self.flags & Flag.LATCHED)

    @property
    def warm(self) -> bool:
        """Whether motions are played slower than announced, to spare servomotors."""
        return bool(self.flags & Flag.WARM)

    def explain_cause(self) -> str:
        """Why the controller stopped or faulted last, as one sentence."""
        return explain(self.cause, self.cause_value, self.cause_limit)

    def explain_reason(self) -> str:
        """Why the last motion was stopped or refused, as one sentence."""
        return explain(self.reason, self.reason_value, self.reason_limit)


def _same(value: Any) -> Any:
    return value


def _places(layout: Layout) -> list[tuple[int | slice, Callable[[Any], Any]]]:
    """Where each field stands among the unpacked values, and what makes its type of them."""
    kinds: dict[str, Callable[[Any], Any]] = {
        "state": State,
        "flags": Flag,
        "cause": Cause,
        "drive_status": DriveStatus,
        "result": Result,
        "reason": Cause,
    }
    places: list[tuple[int | slice, Callable[[Any], Any]]] = []
    at = 0
    for field in layout.fields:
        place = slice(at, at + field.count) if field.count > 1 else at
        places.append((place, kinds.get(field.name, _same)))
        at += field.count
    return places


_TELEMETRY_PLACES = _places(TELEMETRY)
_TELEMETRY_VECTORS = tuple(field.count > 1 for field in TELEMETRY.fields)


def _text(name: str, size: int) -> bytes:
    return name.encode()[:size]


def _string(raw: bytes) -> str:
    return raw.rstrip(b"\0").decode(errors="replace")
