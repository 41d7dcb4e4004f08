"""The token of an account: read from a file that nobody else can read, or from the keyring; shown nowhere."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from app import UserError

SERVICE: Final = "touchmove"
"""Under which the keyring keeps tokens; the user's name there is the server's host."""
_TOKEN: Final = re.compile(r"[A-Za-z0-9_]{8,512}")
LOOPBACK: Final = ("127.0.0.1", "::1", "localhost")
"""Hosts that are this computer."""


class Token:
    """A secret: neither ``repr`` nor ``str`` show it, and it cannot be pickled."""

    __slots__ = ("_secret",)

    def __init__(self, secret: str) -> None:
        if not _TOKEN.fullmatch(secret):
            raise UserError(
                "the token is not one of Lichess: it has 8 to 512 letters, digits and underscores; make a new one in "
                "your account's settings, under API access tokens"
            )
        self._secret = secret

    def reveal(self) -> str:
        """For the header of a request, and nothing else."""
        return self._secret

    def __repr__(self) -> str:
        return "Token(…)"

    def __reduce__(self) -> str:
        raise TypeError("a token is not written anywhere")


def require_server(server: str) -> str:
    """The server's address without a slash at its end.

    Raises:
        UserError: it is no address, or the token would travel there in the clear.
    """
    parts = urlsplit(server)
    try:
        bad = parts.scheme not in ("http", "https") or not parts.hostname or (parts.port or 1) < 1
    except ValueError:
        bad = True
    if bad or parts.query or parts.fragment or parts.username:
        raise UserError(f"--server is '{server}': give an address such as https://lichess.org")
    if parts.scheme == "http" and parts.hostname not in LOOPBACK:
        raise UserError(f"--server is '{server}': without https everybody on the way could read the token")
    return server.rstrip("/")


def read_token(file: Path | None, server: str) -> Token:
    """The token for a server.

    Args:
        file: that holds it; None: the keyring does.
        server: its address.

    Raises:
        UserError: there is none, others could read the file, or no keyring is installed.
    """
    return _of_keyring(urlsplit(server).hostname or server) if file is None else _of_file(file)


def _of_file(path: Path) -> Token:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError as error:
        raise UserError(
            f"--token-file {path} cannot be read ({error.strerror}): write the token into a file of your own"
        ) from error
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(file.fileno())
        mode = stat.S_IMODE(status.st_mode)
        if not stat.S_ISREG(status.st_mode) or mode & 0o177 or status.st_uid != os.geteuid():
            raise UserError(
                f"--token-file {path} has mode {mode:04o}: only you may read it, so say 'chmod 600 {path}' and own it"
            )
        text = file.read(1024)
    return Token(text.decode("ascii", "replace").strip())


def _of_keyring(host: str) -> Token:
    try:
        import keyring  # noqa: PLC0415 - optional: only who keeps the token there has it
    except ImportError as error:
        raise UserError(
            "there is no token: give --token-file FILE with mode 0600, or install the package keyring and say "
            f"'keyring set {SERVICE} {host}'"
        ) from error
    try:
        secret = keyring.get_password(SERVICE, host)
    except keyring.errors.KeyringError as error:
        raise UserError(f"the keyring does not answer ({type(error).__name__}): give --token-file FILE") from error
    if secret is None:
        raise UserError(f"the keyring holds no token: say 'keyring set {SERVICE} {host}', or give --token-file FILE")
    return Token(str(secret).strip())
