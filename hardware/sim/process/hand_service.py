"""What the world does for whoever tells the simulated person what to do: role ``hand`` on the world's socket."""

from typing import Any

from hardware.sim.hand.actions import REQUEST, Perform
from hardware.sim.hand.hand import Hand
from hardware.sim.hand.routines import HandFailed
from hardware.sim.plant.plant import Plant
from hardware.sim.plant.tick import NOTHING, ServoStrokes
from hardware.sim.process.connections import Refused, Service, Visitor


class HandService(Service):
    """Actions for the hand, one list at a time; the answer comes when the last one is done, or one is impossible."""

    def __init__(self, facts: dict[str, Any], plant: Plant, hand: Hand | None) -> None:
        super().__init__(facts)
        self._plant, self._hand = plant, hand
        self._master: Visitor | None = None

    @property
    def busy(self) -> bool:
        """The hand does something, so that plant time has to run."""
        return self._hand is not None and self._hand.busy

    @property
    def followed(self) -> ServoStrokes:
        """What its servos follow, as ``Hand.followed`` says."""
        return NOTHING if self._hand is None else self._hand.followed

    def welcome(self, visitor: Visitor) -> dict[str, Any]:
        """See ``Service``."""
        if self._hand is None:
            raise Refused("this world was started without a hand: set 'hand' in its settings")
        return super().welcome(visitor)

    def hear(self, visitor: Visitor, message: bytes) -> None:
        """See ``Service``."""
        request = REQUEST.validate_json(message)
        if self._hand is None:
            return
        if not isinstance(request, Perform):
            visitor.tell({"busy": self._hand.busy, "holding": self._hand.holding, "tick": self._plant.tick})
            return
        try:
            self._hand.perform(request.actions)
        except HandFailed as failure:
            visitor.tell({"error": str(failure)})
        else:
            self._master = visitor

    def leave(self, visitor: Visitor) -> None:
        """See ``Service``. A hand that nobody leads any more withdraws."""
        if self._hand is not None and visitor is self._master:
            self._master = None
            self._hand.withdraw()

    def drive(self) -> None:
        """Lead the hand through the tick that comes, and tell its master when it is done."""
        if self._hand is not None and self._hand.drive() and self._master is not None:
            failed = self._hand.failed
            self._master.tell({"error": failed} if failed else {"done": True, "tick": self._plant.tick})

    def withdraw(self) -> None:
        """The world ends: leave off, put down what is held, and withdraw."""
        if self._hand is not None:
            self._hand.withdraw()
