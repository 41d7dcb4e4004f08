"""Where a controller is reached: the file that says so, and a socket to it."""

from __future__ import annotations

import json
import os
import socket
from pathlib import Path
from typing import NamedTuple

from controller.protocol.datagram_fields import VERSION
from controller.protocol.key import KEY_FILE, load_key
from controller.settings import CONTROLLER_FILE
from controller.wire.errors import ControllerUnavailable


class ControllerAddress(NamedTuple):
    """IPv4 address, UDP port and shared secret of a controller."""

    host: str
    port: int
    key: bytes


class ControllerFile:
    """``controller.json`` of a controller in its run directory; one that a killed controller has left goes."""

    def __init__(self, directory: Path, host: str, port: int) -> None:
        """Everything slow about it is done here; nobody finds it yet."""
        self._file = directory / CONTROLLER_FILE
        self._prepared = self._file.with_suffix(".new")
        self._file.unlink(missing_ok=True)
        content = {"host": host, "port": port, "pid": os.getpid(), "protocol": VERSION}
        self._prepared.write_text(json.dumps(content) + "\n", encoding="utf-8")

    def publish(self) -> None:
        """Clients are welcome."""
        self._prepared.replace(self._file)

    def remove(self) -> None:
        """They are no longer."""
        for file in (self._file, self._prepared):
            file.unlink(missing_ok=True)


def find_controller(directory: Path, key_file: Path | None = None) -> ControllerAddress:
    """The controller that runs in this directory.

    Args:
        directory: its run directory.
        key_file: holds the shared secret; None: the file ``key`` there.

    Raises:
        ControllerUnavailable: there is no ``controller.json``, or it names another version of the protocol.
        KeyFileError: the key cannot be read.
    """
    file = directory / CONTROLLER_FILE
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        host, port, version = str(found["host"]), int(found["port"]), int(found["protocol"])
    except (OSError, ValueError, KeyError) as error:
        raise ControllerUnavailable(f"{file} cannot be used ({error}): is the controller running?") from error
    if version != VERSION:
        raise ControllerUnavailable(
            f"the controller speaks protocol {version:08x}, this program {VERSION:08x}: "
            "start both from the same version"
        )
    return ControllerAddress(host, port, load_key(key_file or directory / KEY_FILE))


def open_socket(host: str, port: int, timeout: float) -> socket.socket:
    """A UDP socket that sends to a controller and hears it alone.

    Args:
        host: IPv4 address.
        port: UDP port.
        timeout: of each receive [s].

    Raises:
        ControllerUnavailable: the address cannot be used.
    """
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.settimeout(timeout)
    try:
        end.connect((host, port))
    except OSError as error:
        end.close()
        raise ControllerUnavailable(f"{host}:{port} cannot be used: {error}: give the controller's address") from error
    return end
