"""Messages between the world's process and its clients, over a Unix socket in the run directory.

The socket keeps message borders (SEQPACKET). A client's first message is JSON with its role; servo messages are then
packed structs, all others JSON.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from hardware.interfaces import Command, DriveStatus, HardwareError, Measurement

SOCKET_NAME = "world.sock"
LARGEST_MESSAGE = 1 << 16
LONGEST_ADDRESS = 100
"""A Unix socket's address has room for 107 bytes."""

SPIN = 150e-6
"""How long ``spin`` tries [s]."""

COMMAND = struct.Struct("<4dB")
MEASUREMENT = struct.Struct("<Q9dI")
GOODBYE = b"bye"

_BRAKE, _ENABLE, _BUSY = 1, 2, 4


class Hello(BaseModel):
    """First message of a client."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    role: str


def pack_command(command: Command) -> bytes:
    """A command as sent by the servo client."""
    flags = _BRAKE * command.brake + _ENABLE * command.enable + _BUSY * command.busy
    return COMMAND.pack(*command.torque, command.finger_velocity, flags)


def unpack_command(message: bytes) -> Command:
    """Inverse of ``pack_command``.

    Raises:
        ValueError: the message has another size.
    """
    if len(message) != COMMAND.size:
        raise ValueError(f"a servo command has {COMMAND.size} bytes, this message {len(message)}")
    u1, u2, u3, finger, flags = COMMAND.unpack(message)
    return Command((u1, u2, u3), finger, bool(flags & _BRAKE), bool(flags & _ENABLE), bool(flags & _BUSY))


def pack_measurement(m: Measurement) -> bytes:
    """A measurement as sent by the world."""
    return MEASUREMENT.pack(m.tick, *m.angle, *m.velocity, m.finger_position, *m.tactile, m.status)


def unpack_measurement(message: bytes) -> Measurement:
    """Inverse of ``pack_measurement``."""
    tick, a1, a2, a3, w1, w2, w3, finger, right, left, status = MEASUREMENT.unpack(message)
    return Measurement(tick, (a1, a2, a3), (w1, w2, w3), finger, (right, left), DriveStatus(status))


@contextmanager
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

    Returns:
        The socket and the world's answer (pace, period, …).

    Raises:
        HardwareError: no world answers in time, or it refuses the role.
    """
    path = run_dir / SOCKET_NAME
    deadline = time.monotonic() + timeout
    link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    while True:
        try:
            with socket_address(run_dir) as address:
                link.connect(address)
            break
        except (FileNotFoundError, ConnectionRefusedError) as error:
            if time.monotonic() > deadline:
                link.close()
                raise HardwareError(
                    f"no world answers at {path} after {timeout:.0f} s: is it running? Its log is beside the socket."
                ) from error
            time.sleep(0.02)
    link.settimeout(timeout)
    link.send(json.dumps({"role": role}).encode())
    try:
        answer = json.loads(link.recv(LARGEST_MESSAGE) or b'{"error": "it closed the connection"}')
    except OSError as error:
        link.close()
        raise HardwareError(f"the world does not answer as {role}: {error}") from error
    if "error" in answer:
        link.close()
        raise HardwareError(f"the world refuses the role {role}: {answer['error']}")
    return link, answer


def spin(link: socket.socket) -> bytes | None:
    """The next message if it comes within the time that falling asleep and waking up again would take, else None.

    In pace fast two processes hand each other a message every few dozen microseconds; a sleeping receiver costs its
    sender and itself more than that.
    """
    give_up = time.perf_counter() + SPIN
    receive = link.recv
    while True:
        try:
            return receive(LARGEST_MESSAGE, socket.MSG_DONTWAIT)
        except BlockingIOError:
            if time.perf_counter() > give_up:
                return None


def ask(link: socket.socket, request: dict[str, Any]) -> dict[str, Any]:
    """One JSON question and its answer.

    Raises:
        HardwareError: the world is gone or refuses the question.
    """
    try:
        link.send(json.dumps(request).encode())
        message = link.recv(LARGEST_MESSAGE)
    except OSError as error:
        raise HardwareError(f"the world does not answer: {error}") from error
    if not message:
        raise HardwareError("the world has ended; its log is in the run directory")
    answer: dict[str, Any] = json.loads(message)
    if "error" in answer:
        raise HardwareError(f"the world refuses: {answer['error']}")
    return answer
