"""The secret that app and controller share: 32 random bytes in a file that only its owner can read."""

from __future__ import annotations

import os
import secrets
import stat
from pathlib import Path

from controller.protocol.datagram_fields import KEY_SIZE

KEY_FILE = "key"


class KeyFileError(Exception):
    """The key file is missing, readable by others or of the wrong size; the message says what to do."""


def create_key(path: Path) -> bytes:
    """Write a new random key, readable by its owner only, and return it.

    Raises:
        KeyFileError: the file exists already or cannot be written.
    """
    key = secrets.token_bytes(KEY_SIZE)
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise KeyFileError(
            f"key file {path} cannot be created: {error.strerror}: choose a new run directory"
        ) from error
    with os.fdopen(descriptor, "wb") as file:
        file.write(key)
    return key


def load_key(path: Path) -> bytes:
    """Read the key.

    Raises:
        KeyFileError: the file cannot be read, others may read it, or its size is wrong.
    """
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        key = path.read_bytes()
    except OSError as error:
        raise KeyFileError(
            f"key file {path} cannot be read: {error.strerror}: start the app that creates it"
        ) from error
    if mode & 0o077:
        raise KeyFileError(f"key file {path} has mode {mode:04o}, but only its owner may read it: run chmod 600 on it")
    if len(key) != KEY_SIZE:
        raise KeyFileError(f"key file {path} holds {len(key)} bytes instead of {KEY_SIZE}: delete it and start again")
    return key
