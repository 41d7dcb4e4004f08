"""What the world does for controllers, clocks and the referee; the cameras' service has a module of its own."""

import sys
import time
from dataclasses import asdict
from typing import Any, Final

from hardware.interfaces import Command
from hardware.sim.clients import wire
from hardware.sim.plant.plant import Plant
from hardware.sim.process.connections import Refused, Service, Visitor
from hardware.sim.process.pacing import SpeedMeter

SILENCE = 2.0
"""A controller that says nothing for so long, in wall time, is lost [s] …"""
LOCKSTEP_SILENCE = 35.0
"""… and in pace fast after so long, where plant time waits for it: it may be waiting for a program that is held up, for
30 s, and is to be the one that tells of it. One that is gone is known by its closed socket, at once."""
PREPARING: Final = 20.0
"""Until its first command it may take so long, while it prepares itself and the brakes hold [s, wall]."""
NEVER: Final = 1 << 62
"""A tick that does not come."""


class DriveService(Service):
    """The servo bus: one controller at a time, None while nobody holds the drives.

    ``taken``: a controller in this very process holds them; ``command`` was received and is not yet carried out;
    ``goodbye``: a controller has ended in good order, and with it
    the world. It waits ``first`` for its first controller, ``linger`` for another one once that is gone [s, wall].
    """

    def __init__(self, facts: dict[str, Any], first: float, linger: float) -> None:
        super().__init__(facts)
        self.controller: Visitor | None = None
        self.taken = False
        self.command: Command | None = None
        self.goodbye = False
        self._receiver: wire.Receiver | None = None
        self._linger = linger
        self._patience = first
        self._silence = LOCKSTEP_SILENCE if facts["lockstep"] else SILENCE
        self._heard = time.monotonic()

    def welcome(self, visitor: Visitor) -> dict[str, Any]:
        """See ``Service``."""
        if self.taken or self.controller is not None:
            raise Refused("another controller holds the drives: there can be only one")
        self.controller, self._patience = visitor, PREPARING
        self._receiver = wire.Receiver(visitor.link)
        self.excuse()
        return self._facts

    def hear(self, visitor: Visitor, message: bytes) -> None:
        """See ``Service``. Whoever sends anything but commands cannot be trusted with the drives."""
        self._heard, self._patience = time.monotonic(), self._silence
        if message == wire.GOODBYE:
            self.goodbye = True
            return
        try:
            self.command = wire.unpack_command(message)
        except ValueError as error:
            print(f"the controller is dismissed: {error}", file=sys.stderr, flush=True)
            visitor.dismiss()

    def leave(self, visitor: Visitor) -> None:
        """See ``Service``."""
        self.controller = self.command = None
        self._patience = self._linger
        self.excuse()

    def take(self) -> Command | None:
        """The command to carry out now, if there is one."""
        command, self.command = self.command, None
        return command

    def spin(self) -> None:
        """Hear the controller's next command if it comes at once."""
        controller = self.controller
        if controller is None or self._receiver is None:
            return
        try:
            message = self._receiver.spin()
        except OSError:
            return  # gone: seen when the world listens to its visitors
        if message:
            self.hear(controller, message)

    def excuse(self) -> None:
        """The world was busy with others: silence begins anew."""
        self._heard = time.monotonic()

    @property
    def silent(self) -> bool:
        """The controller, or any other one, has kept the world waiting for too long."""
        return time.monotonic() - self._heard > self._patience


class ClockService(Service):
    """Plant time for those who ask, and for those who sleep until it has passed; ``due``: the next of them wakes up."""

    def __init__(self, facts: dict[str, Any], plant: Plant) -> None:
        super().__init__(facts)
        self.due = NEVER
        self._plant = plant
        self._sleepers: list[tuple[int, Visitor]] = []

    def hear(self, visitor: Visitor, message: bytes) -> None:
        """See ``Service``."""
        ticks = wire.Sleep.model_validate_json(message).sleep_ticks
        if ticks:
            self._keep([*self._sleepers, (self._plant.tick + ticks, visitor)])
        else:
            visitor.tell({"tick": self._plant.tick})

    def leave(self, visitor: Visitor) -> None:
        """See ``Service``."""
        self._keep([(due, sleeper) for due, sleeper in self._sleepers if sleeper is not visitor])

    def serve(self) -> None:
        """Wake those whose time has come."""
        tick = self._plant.tick
        awake = [sleeper for due, sleeper in self._sleepers if due <= tick]
        self._keep([(due, sleeper) for due, sleeper in self._sleepers if due > tick])
        for sleeper in awake:
            sleeper.tell({"tick": tick})

    def _keep(self, sleepers: list[tuple[int, Visitor]]) -> None:
        self._sleepers = sleepers
        self.due = min((due for due, _ in sleepers), default=NEVER)


class RefereeService(Service):
    """The truth about the plant, and how fast it ran, for the referee."""

    def __init__(self, facts: dict[str, Any], plant: Plant, speed: SpeedMeter) -> None:
        super().__init__(facts)
        self._plant, self._speed = plant, speed

    def hear(self, visitor: Visitor, message: bytes) -> None:
        """See ``Service``."""
        request = wire.REFEREE_REQUEST.validate_json(message)
        if isinstance(request, wire.Positions):
            visitor.tell({"positions": self._plant.positions().tolist()})
            return
        truth = self._plant.truth(request.reset_peak)
        pieces = [[p.name, p.x, p.y, p.z, p.tilt] for p in truth.pieces]
        ran = {"ran_ticks": self._speed.ticks, "ran_wall": self._speed.wall}
        visitor.tell({**asdict(truth), "pieces": pieces, **ran})
