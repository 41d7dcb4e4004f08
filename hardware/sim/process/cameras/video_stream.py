"""Frames for those who watch the table while the arm moves: exposed at a steady rate, delivered a latency later.

In pace fast plant time waits for a frame to be drawn when it is due, and then for its taker: what the watcher does
about a frame is done before the next tick. In pace real a frame that is drawn late comes late, and one that nobody has
time for is left out.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from hardware.sim.process.connections import Visitor

PATIENCE = 20.0
"""Pace fast: who keeps plant time waiting for longer is dismissed [s, wall]."""


@dataclass(slots=True)
class FrameInFlight:
    """A frame between exposure and delivery."""

    slot: int
    """Into whose file it is drawn."""
    exposed: int
    """Tick of exposure."""
    due: int
    """Tick of delivery."""
    colour: bool = True
    """It has colour; else depth alone."""
    drawing: bool = True
    """It is not drawn yet."""


@dataclass(slots=True, eq=False)
class StreamClient:
    """One who watches."""

    visitor: Visitor
    """Told of each frame."""
    camera: str
    """View that is watched."""
    depth: bool
    """Whether depth is wanted."""
    every: int
    """Ticks from frame to frame."""
    latency: int
    """From exposure to delivery [ticks]."""
    free: list[int]
    """Slots that no frame is in."""
    exposes: int
    """Tick of the next exposure."""
    colour_asleep: bool = True
    """Frames have colour also while ``wake`` is False."""
    glance: bool = False
    """They never have, and depth is coarse."""
    wake: bool = False
    """Plant time runs for it, also while nothing moves."""
    flights: list[FrameInFlight] = field(default_factory=list)
    """Frames under way, oldest first."""
    held: int | None = None
    """Slot of the frame that was delivered and not taken."""

    @property
    def due(self) -> int:
        """Tick at which something has to be done next."""
        return min([self.exposes, *(flight.due for flight in self.flights)])

    def take(self) -> None:
        """The visitor has read its frame."""
        if self.held is not None:
            self.free.append(self.held)
            self.held = None

    def expose(self, tick: int) -> FrameInFlight | None:
        """The frame to be drawn now, if one is due and there is room for it."""
        if tick < self.exposes:
            return None
        self.exposes = (tick // self.every + 1) * self.every
        if not self.free:
            return None
        colour = not self.glance and (self.wake or self.colour_asleep)
        flight = FrameInFlight(self.free.pop(0), tick, tick + self.latency, colour)
        self.flights.append(flight)
        return flight

    def drawn(self, slot: int) -> None:
        """A slot's picture is finished."""
        for flight in self.flights:
            if flight.slot == slot:
                flight.drawing = False

    def deliver(self, tick: int, waits: bool, present: Callable[[], bool]) -> Iterator[None]:
        """Deliver what is due at a tick to a visitor who is still ``present``.

        Where plant time ``waits`` (pace fast), each step is a moment for which to hear visitors.
        """
        while self.flights and self.flights[0].due <= tick and present():
            flight = self.flights[0]
            if waits:
                yield from self._wait(lambda flight=flight: flight.drawing, present)  # type: ignore[misc]
            if flight.drawing:
                break
            self.flights.pop(0)
            if self.held is not None:  # the last one is still being read: this one is left out
                self.free.append(flight.slot)
                continue
            self.held = flight.slot
            self.visitor.tell({"exposed": flight.exposed, "tick": tick, "slot": flight.slot, "colour": flight.colour})
            if waits:
                yield from self._wait(lambda: self.held is not None, present)

    def _wait(self, going_on: Callable[[], bool], present: Callable[[], bool]) -> Iterator[None]:
        give_up = time.monotonic() + PATIENCE
        while going_on() and present():
            yield
            if time.monotonic() > give_up:
                self.visitor.dismiss()
                give_up += PATIENCE
