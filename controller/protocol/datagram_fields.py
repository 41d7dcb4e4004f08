"""Layouts of all datagrams: packed little-endian structs, each field with its unit and meaning.

The version of the protocol is the hash of these tables, so it cannot be forgotten when one changes; the tables of
``docs/protocol.md`` are generated from them.
"""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag, unique
from functools import cached_property
from typing import Any

import numpy as np

from controller.protocol.causes import Cause
from controller.protocol.states import State

MAGIC = b"TMCP"
TAG_SIZE = 16
KEY_SIZE = 32
MAX_DATAGRAM = 1400
"""Below one Ethernet MTU with every header [bytes]."""
SAMPLES_PER_DATAGRAM = 10


@unique
class DatagramKind(IntEnum):
    """What a datagram is; below 64 from the client or a listener, above from the controller."""

    HELLO = 1
    HEARTBEAT = 2
    COMMAND = 3
    ANNOUNCE = 4
    SAMPLES = 5
    WATCH = 6
    ADMIT_SPEED = 7
    STOP = 8
    RELEASE = 9
    CHALLENGE = 64
    WELCOME = 65
    BUSY = 66
    TELEMETRY = 67


@unique
class CommandCode(IntEnum):
    """Commands of the client; each may be repeated without a further effect."""

    ENABLE = 1
    HOLD = 2
    RESUME = 3
    STOP = 4
    CLEAR_FAULT = 5
    SHUTDOWN = 6
    RECORD = 7


class MotionFlag(IntFlag):
    """Properties of an announced motion."""

    NONE = 0
    FOLLOWED = 1
    """Another motion will be announced right after this one."""


@unique
class Guard(IntEnum):
    """Condition that ends a motion at the sample that carries it: with success, but for HELD."""

    NONE = 0
    GRIP = 1
    """Both tactile forces are at least ``guard_level``."""
    TOUCH = 2
    """The table pushes the tool up with ``guard_level`` more than when the guard began."""
    HELD = 3
    """Either tactile force was below ``guard_level`` for some ticks: what was carried is lost, and the arm stops."""


@unique
class Result(IntEnum):
    """How the last motion ended."""

    NONE = 0
    DONE = 1
    GRIPPED = 2
    STOPPED = 3
    REFUSED = 4
    TOUCHED = 5


class Flag(IntFlag):
    """Flags in the telemetry."""

    NONE = 0
    STANDING = 1
    """Plant time did not advance at the last exchange."""
    WAITING = 2
    """The controller keeps plant time standing until a motion, a sample or a command comes (lockstep bus)."""
    LOCKSTEP = 4
    """Plant time waits for the controller; nothing can be late."""
    ADMITTING = 8
    """No hold is in force: motions are admitted in state HOLD."""
    BUSY = 16
    """Motion announced, stopping, booting or shutting down."""
    LATCHED = 32
    """Somebody pressed STOP: no motion is admitted until the client's RELEASE."""
    WARM = 64
    """Servomotors are so close to what they are rated for that motions are played slower than announced."""


@dataclass(frozen=True, slots=True)
class Field:
    """One field: name, struct code with count, unit, meaning."""

    name: str
    code: str
    unit: str
    meaning: str

    @property
    def count(self) -> int:
        """Number of values; a string of bytes is one value."""
        return int(self.code[:-1] or 1) if self.code[-1] != "s" else 1

    @property
    def size(self) -> int:
        """Size on the wire [bytes]."""
        return struct.calcsize("<" + self.code)

    @property
    def type_name(self) -> str:
        """Type as the documentation names it, e.g. ``f64[3]``."""
        if self.code[-1] == "s":
            return f"bytes[{self.size}]"
        name = {"B": "u8", "H": "u16", "I": "u32", "Q": "u64", "f": "f32", "d": "f64"}[self.code[-1]]
        return f"{name}[{self.count}]" if self.count > 1 else name


@dataclass(frozen=True)
class Layout:
    """A packed little-endian struct."""

    name: str
    fields: tuple[Field, ...]

    @cached_property
    def struct(self) -> struct.Struct:
        """The compiled struct."""
        return struct.Struct("<" + "".join(field.code for field in self.fields))

    @property
    def size(self) -> int:
        """Size on the wire [bytes]."""
        return self.struct.size

    @cached_property
    def dtype(self) -> np.dtype[Any]:
        """The same layout as a numpy structured type."""
        names = {"B": "u1", "H": "<u2", "I": "<u4", "Q": "<u8", "f": "<f4", "d": "<f8"}
        columns = [
            (f.name, names[f.code[-1]], (f.count,)) if f.count > 1 else (f.name, names[f.code[-1]]) for f in self.fields
        ]
        return np.dtype(columns)

    def signature(self) -> str:
        """What the version hash is taken of."""
        return self.name + "{" + ",".join(f"{f.name}:{f.code}:{f.unit}" for f in self.fields) + "}"


HEADER = Layout(
    "header",
    (
        Field("magic", "4s", "", "`TMCP`"),
        Field("version", "I", "", "hash of all layouts"),
        Field("kind", "H", "", "kind of datagram"),
        Field("size", "H", "bytes", "size of the whole datagram with header and tag"),
        Field("session", "Q", "", "random number chosen by the client for one connection"),
        Field("sequence", "Q", "", "rises with each datagram of a sender, starting from 1"),
    ),
)
SAMPLE_LAYOUT = Layout(
    "sample",
    (
        Field("position", "3d", "m", "reference r of the tool point, base frame"),
        Field("velocity", "3d", "m/s", "its first derivative"),
        Field("acceleration", "3d", "m/s²", "its second derivative"),
        Field("stiffness", "3f", "1/s²", "k_p of each axis"),
        Field("damping", "3f", "1/s", "k_v of each axis"),
        Field("tactile_gain", "f", "1/kg", "k*"),
        Field("finger_velocity", "f", "m/s", "of each finger, positive opening"),
        Field("guard", "B", "", "0 none, 1 grip, 2 touch, 3 held"),
        Field("guard_level", "f", "N", "force that fires the guard"),
    ),
)
HELLO = Layout(
    "HELLO",
    (
        Field("cookie", "Q", "", "cookie of the last CHALLENGE, 0 before there was one"),
        Field("name", "48s", "", "name of the client, UTF-8, filled with zero bytes"),
    ),
)
WATCH = Layout("WATCH", (Field("cookie", "Q", "", "cookie of the last CHALLENGE, 0 before there was one"),))
HEARTBEAT = Layout("HEARTBEAT", (Field("ping", "I", "", "number to be echoed in the telemetry"),))
COMMAND = Layout("COMMAND", (Field("code", "H", "", "command code"),))
ADMIT_SPEED = Layout(
    "ADMIT_SPEED",
    (
        Field("speed", "d", "m/s", "speed of the tool that is admitted, above the one near people"),
        Field("until", "Q", "tick", "last tick for which it is admitted, 0.25 s from now at most"),
        Field(
            "borders",
            "16d",
            "m",
            "a, b, c, d of four planes, base frame: admitted where a x + b y + c z + d ≥ 0 for all",
        ),
    ),
)
STOP = Layout(
    "STOP", (Field("cookie", "Q", "", "cookie by which the listener was admitted; any number from the client"),)
)
RELEASE = Layout(
    "RELEASE", (Field("presses", "Q", "", "as in the telemetry: a STOP carried out since then stays in force"),)
)
ANNOUNCE = Layout(
    "ANNOUNCE",
    (
        Field("motion", "I", "", "motion id, rising, from 1"),
        Field("first_tick", "Q", "tick", "tick of sample 0"),
        Field("length", "I", "samples", "number of samples"),
        Field("flags", "H", "", "bit 0 FOLLOWED: another motion will be announced right after this one"),
    ),
)
SAMPLES = Layout(
    "SAMPLES",
    (
        Field("motion", "I", "", "motion id"),
        Field("start", "I", "samples", "index of the first sample in this datagram"),
        Field("count", "H", "samples", "number of samples that follow, 1 to 10"),
    ),
)
CHALLENGE = Layout("CHALLENGE", (Field("cookie", "Q", "", "put this into the next HELLO or WATCH"),))
WELCOME = Layout(
    "WELCOME",
    (
        Field("period", "d", "s", "length of one tick"),
        Field("capacity", "I", "samples", "how far ahead of the executed sample the client may send samples"),
        Field("lockstep", "B", "", "1 if plant time waits for the controller"),
        Field("last_motion", "I", "", "highest motion id seen: continue above it"),
    ),
)
BUSY = Layout(
    "BUSY",
    (
        Field("name", "48s", "", "name of the lease holder, UTF-8, filled with zero bytes"),
        Field("address", "4s", "", "its IPv4 address"),
        Field("port", "H", "", "its port"),
        Field("silence", "d", "s", "wall time since it was last heard"),
    ),
)
TELEMETRY = Layout(
    "TELEMETRY",
    (
        Field("tick", "Q", "tick", "tick of the last measurement"),
        Field("echo", "I", "", "newest ping received before the last exchange"),
        Field("command", "Q", "", "sequence of the client's newest COMMAND, ADMIT_SPEED, STOP or RELEASE carried out"),
        Field("presses", "Q", "", "how often STOP was carried out since the start, for the client and for listeners"),
        Field("state", "H", "", "state of the controller"),
        Field("flags", "H", "", "flags"),
        Field("cause", "H", "", "why it stopped or faulted last, 0 once a motion is admitted"),
        Field("cause_value", "d", "", "number that belongs to the cause"),
        Field("cause_limit", "d", "", "its limit"),
        Field("drive_status", "H", "", "status word of the drives"),
        Field("angle", "3d", "rad", "servomotor angles y"),
        Field("angle_velocity", "3d", "rad/s", "their velocities"),
        Field("position", "3d", "m", "tool point z, base frame"),
        Field("velocity", "3d", "m/s", "its velocity"),
        Field("reference", "3d", "m", "reference r, base frame"),
        Field("torque", "3d", "N m", "torques of the next exchange, after the limits"),
        Field("finger_position", "d", "m", "a pad's front edge from the tool centre"),
        Field("tactile", "2d", "N", "forces on the right and the left pad"),
        Field("force", "3d", "N", "force on the tool, estimated from torques and motion, base frame; 0 on the brakes"),
        Field("motion", "I", "", "motion admitted and not ended, else 0"),
        Field("received", "I", "samples", "contiguous samples received of it"),
        Field("executed", "I", "samples", "samples of it executed"),
        Field("ended_motion", "I", "", "motion that ended last, 0 if none"),
        Field("result", "H", "", "how it ended"),
        Field("reason", "H", "", "cause of a stop or refusal"),
        Field("reason_value", "d", "", "number that belongs to the reason"),
        Field("reason_limit", "d", "", "its limit"),
        Field("first_tick", "Q", "tick", "its tick of sample 0"),
        Field("end_tick", "Q", "tick", "tick at which it ended"),
        Field("ended_position", "3d", "m", "measured tool point at that tick"),
        Field("ended_finger", "d", "m", "measured finger position at that tick"),
        Field("peak_torque", "d", "N m", "largest torque commanded in the current motion, or else the last one"),
        Field("peak_tactile", "d", "N", "largest tactile force in the current motion, or else the last one"),
        Field("clamped", "Q", "ticks", "ticks in which a torque was clamped since the start"),
        Field("skipped", "Q", "ticks", "ticks that passed without an exchange since the start"),
        Field("period", "d", "s", "mean wall time between two exchanges in the last second of ticks"),
        Field("lateness", "d", "s", "largest delay of a tick against the regular rhythm in that second"),
        Field("work", "d", "s", "longest computation of a tick in that second"),
        Field("bad_size", "I", "datagrams", "dropped: size or magic"),
        Field("bad_version", "I", "datagrams", "dropped: version"),
        Field("bad_tag", "I", "datagrams", "dropped: tag"),
        Field("bad_session", "I", "datagrams", "dropped: session without the lease"),
        Field("bad_sequence", "I", "datagrams", "dropped: sequence seen before or too old"),
        Field("bad_content", "I", "datagrams", "dropped: unknown kind or impossible content"),
    ),
)

PAYLOADS: dict[DatagramKind, Layout] = {
    DatagramKind.HELLO: HELLO,
    DatagramKind.HEARTBEAT: HEARTBEAT,
    DatagramKind.COMMAND: COMMAND,
    DatagramKind.ANNOUNCE: ANNOUNCE,
    DatagramKind.SAMPLES: SAMPLES,
    DatagramKind.WATCH: WATCH,
    DatagramKind.ADMIT_SPEED: ADMIT_SPEED,
    DatagramKind.STOP: STOP,
    DatagramKind.RELEASE: RELEASE,
    DatagramKind.CHALLENGE: CHALLENGE,
    DatagramKind.WELCOME: WELCOME,
    DatagramKind.BUSY: BUSY,
    DatagramKind.TELEMETRY: TELEMETRY,
}
"""Payload of each kind; SAMPLES is followed by ``count`` samples."""

SAMPLE: np.dtype[Any] = SAMPLE_LAYOUT.dtype
"""One sample of a motion, packed; a motion is an array (n,) of these, one a tick."""


def layout_version() -> int:
    """32-bit hash of every layout and enum; both sides must have the same."""
    parts = [layout.signature() for layout in (HEADER, SAMPLE_LAYOUT, *PAYLOADS.values())]
    enums = (DatagramKind, CommandCode, MotionFlag, Guard, Result, Flag, State, Cause)
    parts += [enum.__name__ + ",".join(f"{member.name}={member.value}" for member in enum) for enum in enums]
    text = ";".join(parts)
    return int.from_bytes(hashlib.blake2s(text.encode(), digest_size=4).digest(), "little")


VERSION = layout_version()
