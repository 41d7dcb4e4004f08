"""Messages between the world's process and its clients, over a Unix socket in the run directory.

The socket keeps message borders (SEQPACKET). A client's first message is JSON with its role; servo messages are then
packed structs, all others JSON.
"""

import contextlib
import json
import os
import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import Field, TypeAdapter, ValidationError

from hardware.frozen import Frozen
from hardware.interfaces import Command, DriveStatus, HardwareError, Measurement, RigGone
from hardware.sim.render.settings import ExposureSettings, LightSettings, MountSettings

SOCKET_NAME = "world.sock"
LARGEST_MESSAGE = 1 << 16
LONGEST_ADDRESS = 100
"""A Unix socket's address has room for 107 bytes."""

SPIN = 150e-6
"""How long a receiver spins for a message [s, wall]."""
MOST_SLEEPS = 256
"""At most so many messages are slept for after one that was spun for in vain."""

COMMAND = struct.Struct("<4dB")
MEASUREMENT = struct.Struct("<Q9dI")
GOODBYE = b"bye"

_BRAKE, _ENABLE, _BUSY = 1, 2, 4
_STATUS: Final = tuple(DriveStatus(bits) for bits in range(1 << len(DriveStatus)))
"""Made once: building a flag takes longer than the rest of a message."""


class Greeting(Frozen):
    """First message of a client: what it is to the world."""

    role: str


class Sleep(Frozen):
    """A clock's question: the tick, once so many more have passed."""

    sleep_ticks: int = Field(0, ge=0, le=10**12)


class Exposure(Frozen):
    """A camera's wish: one frame of the world as it is now."""

    camera: str
    depth: bool = False


class Subscription(Frozen):
    """A camera's wish: one frame at every multiple of so many ticks, without depth."""

    camera: str
    stream_ticks: int = Field(ge=1, le=10**12)


class Taken(Frozen):
    """A subscriber has read its frame and can take another."""

    taken: Literal[True]


class WatchWish(Frozen):
    """A camera's wish: a frame as its sensors see it at every multiple of so many ticks, until the visitor leaves.

    Each is delivered the camera's latency after its exposure. In pace fast plant time then waits until it is taken, so
    that whoever watches the arm is never late.
    """

    camera: str
    watch_ticks: int = Field(ge=1, le=10**12)
    depth: bool = False
    colour_asleep: bool = True
    """Whether frames have colour also while the visitor has not woken plant time up; False wants depth."""
    glance: bool = False
    """Depth alone, always, as the left imager has it with fewer pixels: a tenth of the price."""

    @property
    def shows_something(self) -> bool:
        """Whether its frames have colour or depth at all times."""
        return self.depth or (self.colour_asleep and not self.glance)


class Wake(Frozen):
    """Whether plant time shall run for those who watch, also while nothing moves."""

    wake: bool


class RecordWish(Frozen):
    """A camera's wish: positions at every multiple of so many ticks go into a new file, until the visitor leaves."""

    record: Path
    record_ticks: int = Field(ge=1, le=10**12)


class RecordEnd(Frozen):
    """A visitor's wish that its file ends here; answered when it has."""

    recorded: Literal[True]


class TruthRequest(Frozen):
    """The referee's question; it may also start a new peak of the contact force."""

    reset_peak: bool = False


class Positions(Frozen):
    """The referee's other question: every generalised position, for a viewer."""

    positions: Literal[True]


REFEREE_REQUEST: Final[TypeAdapter[TruthRequest | Positions]] = TypeAdapter(TruthRequest | Positions)


class Change(Frozen):
    """What people around the table do to how it looks; what is left out stays as it is."""

    light: LightSettings | None = None
    exposure: ExposureSettings | None = None
    mount: MountSettings | None = None


CameraRequest = Exposure | Subscription | WatchWish | Wake | Taken | RecordWish | RecordEnd
CAMERA_REQUEST: Final[TypeAdapter[CameraRequest]] = TypeAdapter(CameraRequest)


def explain(error: ValidationError) -> str:
    """What is wrong with a message, in a few words."""
    first = error.errors(include_url=False)[0]
    return f"malformed request: {'.'.join(map(str, first['loc'])) or 'JSON'}: {first['msg']}"


def pack_command(command: Command) -> bytes:
    """A command as sent by the servo client."""
    (u1, u2, u3), finger, brake, enable, busy = command
    return COMMAND.pack(u1, u2, u3, finger, _BRAKE * brake | _ENABLE * enable | _BUSY * busy)


def unpack_command(message: bytes) -> Command:
    """Inverse of ``pack_command``; raises ``ValueError`` if the message has another size."""
    if len(message) != COMMAND.size:
        raise ValueError(f"a servo command has {COMMAND.size} bytes, this message {len(message)}")
    u1, u2, u3, finger, flags = COMMAND.unpack(message)
    return Command((u1, u2, u3), finger, flags & _BRAKE != 0, flags & _ENABLE != 0, flags & _BUSY != 0)


def pack_measurement(measurement: Measurement) -> bytes:
    """A measurement as sent by the world."""
    tick, (a1, a2, a3), (w1, w2, w3), finger, (right, left), status = measurement
    return MEASUREMENT.pack(tick, a1, a2, a3, w1, w2, w3, finger, right, left, status)


def unpack_measurement(message: bytes) -> Measurement:
    """Inverse of ``pack_measurement``."""
    tick, a1, a2, a3, w1, w2, w3, finger, right, left, status = MEASUREMENT.unpack(message)
    return Measurement(tick, (a1, a2, a3), (w1, w2, w3), finger, (right, left), _STATUS[status])


@contextlib.contextmanager
def socket_address(run_dir: Path) -> Iterator[str]:
    """Address of the world's socket; a long path is reached through an open directory, as addresses are short."""
    path = run_dir / SOCKET_NAME
    if len(str(path).encode()) < LONGEST_ADDRESS:
        yield str(path)
        return
    directory = os.open(run_dir, os.O_PATH | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{directory}/{SOCKET_NAME}"
    finally:
        os.close(directory)


def connect(run_dir: Path, role: str, timeout: float = 30.0) -> tuple[socket.socket, dict[str, Any]]:
    """Connect to the world and say who we are; waits for a world that is still starting.

    ``role`` is ``servo``, ``camera``, ``clock``, ``hand``, ``stage`` or ``referee``; ``timeout`` is for the connection,
    and then for every answer [s, wall]. Returns the socket and the world's answer (pace, period, …). Raises
    ``HardwareError`` if no world answers in time, or it refuses the role.
    """
    link = _reach(run_dir, timeout)
    link.settimeout(timeout)
    try:
        return link, ask(link, {"role": role})
    except HardwareError as error:
        link.close()
        raise HardwareError(f"no connection as {role}: {error}") from error


class WorldClient:
    """A connection to the world of a run directory in a role, as of ``connect``."""

    def __init__(self, run_dir: Path, role: str) -> None:
        self._link, self._told = connect(run_dir, role)
        self._period = float(self._told["period"])

    def close(self) -> None:
        """Let the world go."""
        self._link.close()


def _reach(run_dir: Path, timeout: float) -> socket.socket:
    deadline = time.monotonic() + timeout
    link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    while True:
        try:
            with socket_address(run_dir) as address:
                link.connect(address)
            return link
        except (FileNotFoundError, ConnectionRefusedError) as error:
            if time.monotonic() > deadline:
                link.close()
                raise HardwareError(
                    f"no world answers at {run_dir / SOCKET_NAME} after {timeout:.0f} s: is it running? "
                    "Its log is beside the socket."
                ) from error
            time.sleep(0.02)


def world_pid(run_dir: Path) -> int | None:
    """Process id of the world that answers at a run directory, None where none does."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as link, socket_address(run_dir) as address:
        try:
            link.connect(address)
        except OSError:
            return None
        credentials = link.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
        return int(struct.unpack("3i", credentials)[0])


class Receiver:
    """Takes messages from a socket that has no time-out, and spins for them where that pays.

    In pace fast two processes hand each other a message every few dozen microseconds; a sleeping receiver costs its
    sender and itself more than that. But where both share one processor, a spinning receiver only keeps its sender
    from working. So after spinning in vain some messages are slept for: few when it happens once, as the sender may
    just have had more to do, twice as many each time it happens again.
    """

    def __init__(self, link: socket.socket) -> None:
        self._receive = link.recv
        self._sleeps = 0
        self._penalty = 1

    def spin(self) -> bytes | None:
        """The next message if it is there or comes at once; None: better sleep for it."""
        receive = self._receive
        with contextlib.suppress(BlockingIOError):
            return receive(LARGEST_MESSAGE, socket.MSG_DONTWAIT)
        if self._sleeps:
            self._sleeps -= 1
            return None
        give_up = time.perf_counter() + SPIN
        while time.perf_counter() < give_up:
            with contextlib.suppress(BlockingIOError):
                message = receive(LARGEST_MESSAGE, socket.MSG_DONTWAIT)
                self._penalty = 1
                return message
        self._sleeps = self._penalty
        self._penalty = min(2 * self._penalty, MOST_SLEEPS)
        return None


def ask(link: socket.socket, request: dict[str, Any]) -> dict[str, Any]:
    """A JSON question and its answer; raises ``HardwareError`` if the world is gone, silent or refuses the question."""
    send(link, json.dumps(request).encode())
    return understood(receive(link))


def send(link: socket.socket, message: bytes) -> None:
    """One message; raises ``HardwareError`` if the world is gone."""
    try:
        link.send(message)
    except OSError as error:
        raise _lost(link, error) from error


def receive(link: socket.socket) -> bytes:
    """One message, within the socket's time-out; raises ``HardwareError`` if the world is gone or silent."""
    try:
        return link.recv(LARGEST_MESSAGE)
    except OSError as error:
        raise _lost(link, error) from error


def _lost(link: socket.socket, error: OSError) -> HardwareError:
    if isinstance(error, TimeoutError):
        link.close()  # a late answer would be taken for that of the next question
        return HardwareError("the world does not answer in time; its log is in the run directory")
    return RigGone(f"the world does not answer ({error.strerror}); its log is in the run directory")


def understood(message: bytes) -> dict[str, Any]:
    """An answer of the world; raises ``HardwareError`` if the world is gone, or refuses."""
    answer = decoded(message)
    if "error" in answer:
        raise HardwareError(f"the world refuses: {answer['error']}")
    return answer


def decoded(message: bytes) -> dict[str, Any]:
    """An answer of the world, which may refuse; raises ``HardwareError`` if the world is gone."""
    if not message:
        raise RigGone("the world has ended; its log is in the run directory")
    answer: dict[str, Any] = json.loads(message)
    return answer
