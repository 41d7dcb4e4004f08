"""The secret that two robots share: from a file that only its owner reads, or typed. Never shown, never recorded."""

from __future__ import annotations

import hashlib
import os
import secrets
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from app.linked.errors import LinkError

SHORTEST_SECRET: Final = 12
LONGEST_SECRET: Final = 200
"""Of a secret [characters]."""
_NEW: Final = 20
"""Of a secret drawn by lot [bytes]."""
_COST, _BLOCK, _LANES, _MEMORY = 1 << 15, 8, 1, 1 << 26
"""Of scrypt: 32 MiB and some 0.1 s a guess, as for the page's password."""


@dataclass(frozen=True, slots=True)
class LinkSecret:
    """A key made of the secret; the secret itself is not kept."""

    key: bytes = field(repr=False)

    @classmethod
    def of(cls, text: str) -> LinkSecret:
        """Of what both people know; white space around it does not count.

        Raises:
            LinkError: it is too short or too long.
        """
        text = text.strip()
        if not SHORTEST_SECRET <= len(text) <= LONGEST_SECRET:
            raise LinkError(
                f"the secret has {len(text)} characters: choose one with {SHORTEST_SECRET} to {LONGEST_SECRET}"
            )
        salt = b"touchmove link 1"  # both ends must come to the same key before they have exchanged anything
        return cls(hashlib.scrypt(text.encode(), salt=salt, n=_COST, r=_BLOCK, p=_LANES, maxmem=_MEMORY, dklen=32))

    @classmethod
    def load(cls, path: Path) -> LinkSecret:
        """Read it from a file.

        Raises:
            LinkError: the file cannot be read, others may read it, or it holds no secret.
        """
        try:
            if stat.S_IMODE(path.stat().st_mode) & 0o077:
                raise LinkError(f"others can read the secret in {path}: run 'chmod 600 {path}'")
            text = path.read_text(encoding="utf-8")
        except OSError as error:
            raise LinkError(
                f"the secret {path} cannot be read ({error.strerror}): copy the file from the other robot, or let "
                "'touchmove host --secret FILE' make a new one"
            ) from error
        except ValueError as error:
            raise LinkError(f"{path} is no text, so no secret: put the secret there as one line") from error
        return cls.of(text)


def make_secret(path: Path) -> None:
    """Draw a secret by lot and write it to a new file that only its owner reads.

    Raises:
        LinkError: it cannot be written.
    """
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(f"{secrets.token_hex(_NEW)}\n")
    except OSError as error:
        raise LinkError(f"the secret {path} cannot be written ({error.strerror}): name another file") from error
