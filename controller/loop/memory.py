"""All numbers that one tick leaves to the next, in one array, so that a compiled tick takes and restores them at once.

Each part belongs to a class that names its numbers; here is only where it lies.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from controller.law.force_observer import OBSERVER_SIZE
from controller.law.tare import TARE_SIZE
from controller.loop.playback import PLAYBACK_SIZE
from controller.model.state import REFERENCE_SIZE
from controller.protection.encoders import ENCODERS_SIZE
from controller.protection.limits import Limits, clamp_torque
from controller.protection.screening import SCREEN_SIZE
from hardware.interfaces import Triple

TARE: Final = 0
OBSERVER: Final = TARE + TARE_SIZE
SCREEN: Final = OBSERVER + OBSERVER_SIZE
ENCODERS: Final = SCREEN + SCREEN_SIZE
PLAYBACK: Final = ENCODERS + ENCODERS_SIZE
REFERENCE: Final = PLAYBACK + PLAYBACK_SIZE
TAIL: Final = REFERENCE + REFERENCE_SIZE
"""Velocity of each finger [m/s], guard and its level [N] of the reference."""
TORQUE: Final = TAIL + 3
"""Of the next exchange, within its limits, (3,) [N m]."""
GIVEN: Final = TORQUE + 3
"""Of the last exchange, (3,) [N m]; no numbers on the brakes."""
ACTING: Final = GIVEN + 3
"""Of the one before, which acted in the tick that was measured, (3,) [N m]; no numbers on the brakes."""
CLAMP: Final = ACTING + 3
"""Limits of torque and of its change in a tick [N m], and the ticks in which it was clamped."""
TACTILE: Final = CLAMP + 3
"""What presses on the right and the left pad, tared, (2,) [N]."""
MARKED: Final = TACTILE + 2
"""Tick of the reference."""
FIRST: Final = MARKED + 1
"""Of the announced motion: tick of its first sample …"""
LENGTH: Final = FIRST + 1
"""… how many there are, 0 where none is announced …"""
RECEIVED: Final = LENGTH + 1
"""… contiguous samples received …"""
EXECUTED: Final = RECEIVED + 1
"""… and executed."""
GUARDING: Final = EXECUTED + 1
"""Ticks since a TOUCH guard has begun, force then along z3 [N], ticks for which what is HELD was loose."""
PEAKS: Final = GUARDING + 3
"""Largest torque [N m] and tactile force [N] of the motion."""
SIZE: Final = PEAKS + 2


class TickMemory:
    """The array and its parts, which are views.

    Attributes:
        block: all of it, shape (`SIZE`,).
    """

    def __init__(self) -> None:
        self.block = block = np.zeros(SIZE)
        self.tare = block[TARE:OBSERVER]
        self.observer = block[OBSERVER:SCREEN]
        self.screen = block[SCREEN:ENCODERS]
        self.encoders = block[ENCODERS:PLAYBACK]
        self.playback = block[PLAYBACK:REFERENCE]
        self.reference = block[REFERENCE:TAIL]
        self.tail = block[TAIL:TORQUE]
        self.tactile = block[TACTILE:MARKED]
        self.guarding = block[GUARDING:PEAKS]
        self.peaks = block[PEAKS:SIZE]


class ExchangedTorques:
    """Of the next exchange with the drives and of those before; all within limits.

    Args:
        memory: where they are kept.
        limits: of torque, and of its change in a tick.
    """

    def __init__(self, memory: TickMemory, limits: Limits) -> None:
        block = memory.block
        self._coming, self._given, self._acting = block[TORQUE:GIVEN], block[GIVEN:ACTING], block[ACTING:CLAMP]
        self._clamp = block[CLAMP:TACTILE]
        self._clamp[:] = limits.torque, limits.torque_rate, 0.0
        self._given[:] = self._acting[:] = math.nan

    @property
    def coming(self) -> Triple:
        """Of the next exchange [N m]."""
        a, b, c = self._coming.tolist()
        return a, b, c

    @coming.setter
    def coming(self, torque: Triple) -> None:
        self._coming[:] = torque

    @property
    def acting(self) -> Triple:
        """What acted in the tick that was measured [N m]; no numbers where that is not known: on the brakes."""
        a, b, c = self._acting.tolist()
        return a, b, c

    @property
    def clamped(self) -> int:
        """Ticks in which a torque was clamped."""
        return int(self._clamp[2])

    def give(self, braked: bool) -> None:
        """The next exchange takes them along. What acts in the tick that it measures is of the exchange before."""
        self._acting[:] = self._given
        self._given[:] = math.nan if braked else self._coming

    def take_back(self) -> None:
        """The last exchange did not take them: the one before still acts."""
        self._given[:] = self._acting

    def ask(self, torque: Triple) -> None:
        """Torques of the law for the next exchange, finite ones, as far as the limits admit [N m]."""
        limit, rate, _ = self._clamp.tolist()
        self.coming, clamped = clamp_torque(torque, self.coming, limit, rate)
        self._clamp[2] += clamped
