"""The page's password: its file, a form to say it, and a cookie for who knew it."""

from __future__ import annotations

import base64
import hashlib
import hmac
import os
import secrets
import stat
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from app import UserError

_COST, _BLOCK, _LANES = 1 << 15, 8, 1
"""Of scrypt: 32 MiB and some 0.1 s a guess, twice what RFC 7914 recommends for a sign-in."""
_MEMORY: Final = 1 << 26
_SALT, _HASH, _KEY = 16, 32, 16
"""[bytes]"""
_SCHEME: Final = "touchmove-scrypt"
SHORTEST: Final = 10
LONGEST: Final = 200
"""Of a password [characters]."""
TRIES: Final = 10.0
"""So often in a row somebody may sign in with a wrong password, whoever it is; then one try in ``AGAIN`` seconds."""
AGAIN: Final = 3.0
SIGNED_IN: Final = 7 * 24 * 3600
"""A sign-in is good for so long [s, wall]."""


class PasswordFileError(UserError):
    """A password's file cannot be used or written."""


@dataclass(frozen=True, slots=True)
class PasswordHash:
    """What is kept of a password: enough to tell it from others, not to find it."""

    salt: bytes
    hash: bytes

    @classmethod
    def of(cls, password: str) -> Self:
        """Of a new password, with a salt drawn by lot.

        Raises:
            PasswordFileError: it is too short or too long.
        """
        if not SHORTEST <= len(password) <= LONGEST:
            raise PasswordFileError(
                f"the password has {len(password)} characters: choose one with {SHORTEST} to {LONGEST}"
            )
        salt = secrets.token_bytes(_SALT)
        return cls(salt, _scrypt(password, salt))

    def matches(self, password: str) -> bool:
        """Whether it is that password; takes as long for every other one."""
        return hmac.compare_digest(_scrypt(password, self.salt), self.hash)

    def save(self, path: Path) -> None:
        """Write it to a file that only its owner reads.

        Raises:
            PasswordFileError: that cannot be written.
        """
        text = f"{_SCHEME} {_COST} {_BLOCK} {_LANES} {self.salt.hex()} {self.hash.hex()}\n"
        part = path.with_name(path.name + ".part")
        try:
            part.unlink(missing_ok=True)
            with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(text)
            part.replace(path)
        except OSError as error:
            raise PasswordFileError(f"{path} cannot be written: {error.strerror}: name another file") from error

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read the file again.

        Raises:
            PasswordFileError: it cannot be read, holds something else, or others may read it.
        """
        again = f"make it with 'touchmove page --set-password {path}'"
        try:
            if stat.S_IMODE(path.stat().st_mode) & 0o077:
                raise PasswordFileError(f"others can read the password file {path}: run 'chmod 600 {path}'")
            scheme, cost, block, lanes, salt, digest = path.read_text(encoding="ascii").split()
            if (scheme, cost, block, lanes) != (_SCHEME, str(_COST), str(_BLOCK), str(_LANES)):
                raise PasswordFileError(f"{path} is the password file of another version: {again}")
            found = cls(bytes.fromhex(salt), bytes.fromhex(digest))
        except OSError as error:
            raise PasswordFileError(f"password file {path} cannot be read: {error.strerror}: {again}") from error
        except ValueError as error:
            raise PasswordFileError(f"{path} is not a password file: {again}") from error
        if len(found.salt) != _SALT or len(found.hash) != _HASH:
            raise PasswordFileError(f"{path} is not a password file: {again}")
        return found


class SignIn:
    """Cookies for who has said the password; a page that is started anew knows them still.

    Args:
        password: what is kept of it.
        port: of the page: two pages on a computer have a cookie each.
        secure: browsers send it over TLS alone.
        now: wall time [s since 1970].
    """

    def __init__(
        self, password: PasswordHash, port: int, *, secure: bool, now: Callable[[], float] = time.time
    ) -> None:
        self._password, self._secure, self._now = password, secure, now
        self._name = f"touchmove-{port}"
        # who has changed the password has signed everybody out
        self._key = hashlib.blake2b(password.hash, key=password.salt, person=b"page cookie").digest()

    def accepts(self, password: str) -> bool:
        """Whether it is the password; takes a tenth of a second."""
        return len(password) <= LONGEST and self._password.matches(password)

    def cookie(self) -> str:
        """``Set-Cookie`` for who has said it."""
        until = f"{int(self._now()) + SIGNED_IN:x}"
        value = f"{until}.{self._seal(until)}"
        secure = "; Secure" if self._secure else ""
        return f"{self._name}={value}; Path=/; Max-Age={SIGNED_IN}; HttpOnly; SameSite=Strict{secure}"

    def knows(self, cookies: str) -> bool:
        """Whether the header ``Cookie`` shows that somebody has said it.

        A browser sends the cookies of all ports of a computer, and other programs write into theirs what they like.
        """
        named = (one.strip().partition("=") for one in cookies.split(";"))
        return any(self._good(value) for name, _, value in named if name == self._name)

    def _good(self, value: str) -> bool:
        until, _, seal = value.partition(".")
        if not hmac.compare_digest(seal.encode(), self._seal(until).encode()):
            return False
        return int(until, 16) > self._now()  # sealed by us, so a number

    def _seal(self, until: str) -> str:
        digest = hashlib.blake2b(until.encode(), key=self._key, digest_size=_KEY).digest()
        return base64.urlsafe_b64encode(digest).decode().rstrip("=")


def _scrypt(password: str, salt: bytes) -> bytes:
    return hashlib.scrypt(
        password.encode(errors="surrogatepass"), salt=salt, n=_COST, r=_BLOCK, p=_LANES, maxmem=_MEMORY, dklen=_HASH
    )
