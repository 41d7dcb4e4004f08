"""The answers of one exchange: collected as they come, each put with its controller; lost and damaged ones told.

An answer does not say to which exchange it belongs. But lines come in order, and the adapter acknowledges every frame
that it sends, or refuses to: what comes before an acknowledgement of this exchange answers one before, and is left out.
"""

import time
from collections.abc import Sequence
from typing import NamedTuple

from hardware.drives.moteus.adapter import Adapter
from hardware.drives.moteus.cycle import Controller, Told
from hardware.drives.moteus.fdcanusb import AdapterLineError, AdapterRefusal
from hardware.drives.moteus.frames import FrameError


class Answered(NamedTuple):
    """What came of an exchange, for each controller."""

    told: list[Told | None]
    """None: no answer that can be read."""
    damage: list[str | None]
    """What came instead; None: nothing."""


class AnswerCollector:
    """Collects answers.

    Args:
        adapter: where they come from.
        controllers: in the order of their places.
        patience: for all of them together [s].

    Attributes:
        sent: when the last frames set out …
        came: … and when the last lines were there (``time.monotonic``) [s].
    """

    def __init__(self, adapter: Adapter, controllers: Sequence[Controller], patience: float) -> None:
        self._adapter, self._controllers, self._patience = adapter, controllers, patience
        self._places = {controller.device: place for place, controller in enumerate(controllers)}
        self._unacknowledged = self._overdue = 0
        self.sent = self.came = time.monotonic()

    def expect(self) -> None:
        """A frame for each controller is sent now."""
        self.sent = time.monotonic()
        self._overdue = self._unacknowledged
        self._unacknowledged += len(self._controllers)

    def collect(self) -> Answered:
        """All answers, or those that came in time. Raises ``BusLost`` if the adapter is gone."""
        count = len(self._controllers)
        told: list[Told | None] = [None] * count
        damage: list[str | None] = [None] * count
        missing, until = count, time.monotonic() + self._patience
        while missing:
            lines = self._adapter.port.lines(until)
            self.came = time.monotonic()
            for line in lines:
                missing -= self._put(line, told, damage)
            if not lines and time.monotonic() >= until:
                if self._unacknowledged <= self._overdue:  # as many came as were sent: the others are lost, not late
                    self._unacknowledged = 0
                return Answered(told, damage)
        self._unacknowledged = 0
        return Answered(told, damage)

    def _put(self, line: bytes, told: list[Told | None], damage: list[str | None]) -> int:
        """Put a line with its controller; how many answers fewer are missing."""
        try:
            frame = self._adapter.take(line)
        except AdapterLineError as error:
            if isinstance(error, AdapterRefusal):
                self._acknowledge()
            return self._damaged(str(error), told, damage)
        if frame is None:
            self._acknowledge()
            return 0
        if self._unacknowledged >= len(self._controllers):
            return 0
        place = self._places.get(frame.source)
        if place is None or told[place] is not None:
            return 0
        try:
            told[place] = self._controllers[place].read(frame.data)
        except FrameError as error:
            damage[place] = str(error)
        return 1

    def _acknowledge(self) -> None:
        self._unacknowledged = max(0, self._unacknowledged - 1)

    @staticmethod
    def _damaged(what: str, told: list[Told | None], damage: list[str | None]) -> int:
        """A line of which nobody knows whose it is: one of those that are still missing; waiting on is harmless."""
        for place, one in enumerate(told):
            if one is None and damage[place] is None:
                damage[place] = what
                break
        return 0
