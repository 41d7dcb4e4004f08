"""What is no result of a game. Workers raise it, and whoever hands tasks out decides; the text says what there was."""

from __future__ import annotations


class EnvironmentDiffers(Exception):
    """A worker would play other games; the text says what it has otherwise."""


class MachineTrouble(Exception):
    """The machine could not carry the game, which is no fault of the game."""


class GameDied(Exception):
    """Processes of the game did not start, were killed, or have crashed."""


class BrokenOff(Exception):
    """The worker was told to end."""
