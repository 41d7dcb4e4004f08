"""What is no result of a game. Workers raise it, and whoever hands tasks out decides; the text says what there was."""

from __future__ import annotations

import errno
from typing import Final

MACHINE: Final = frozenset({
    errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.EIO, errno.EROFS,
})  # fmt: skip
"""Errors of a machine, not of a game; EAGAIN is what starting a process comes to beyond the limit of a container."""
DEATHS: Final = 2
"""After so many a task is tried alone."""
TROUBLES: Final = 3
"""A task that no machine could carry so often ends the campaign."""


class EnvironmentDiffers(Exception):
    """A worker would play other games; the text says what it has otherwise."""


class MachineTrouble(Exception):
    """The machine could not carry the game, which is no fault of the game."""


class GameDied(Exception):
    """Processes of the game did not start, were killed, or have crashed."""


class BrokenOff(Exception):
    """The worker was told to end."""
