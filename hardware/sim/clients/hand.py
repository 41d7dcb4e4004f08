"""The simulated person as the app sees them: somebody who can be asked to do something at the board."""

from pathlib import Path

from hardware.interfaces import HandRefused
from hardware.sim.clients import wire
from hardware.sim.hand.actions import Action, Perform


class SimHand(wire.WorldClient):
    """The hand of a world, which withdraws once this is closed.

    Raises ``HardwareError`` if no world answers in the run directory, or it has no hand.
    """

    def __init__(self, run_dir: Path) -> None:
        super().__init__(run_dir, "hand")
        self._link.settimeout(None)  # a person takes the time that it takes
        self._asked = False

    def perform(self, *actions: Action) -> None:
        """Begin with some actions, one after the other; plant time runs until they are done. Raises ``HandRefused`` if
        others are still under way and ``HardwareError`` if the world is gone.
        """
        if self._asked:
            raise HandRefused("the hand is busy: wait until its actions are done")
        wire.send(self._link, Perform(actions=actions).model_dump_json().encode())
        self._asked = True

    def wait(self) -> float:
        """Wait until what was begun is done; returns the plant time of its end [s].

        Raises ``HandRefused`` if it could not be done, or nothing was asked for, and ``HardwareError`` if the world is
        gone.
        """
        if not self._asked:
            raise HandRefused("the hand was not asked to do anything")
        answer = wire.decoded(wire.receive(self._link))
        self._asked = False
        if "error" in answer:
            raise HandRefused(str(answer["error"]))
        return int(answer["tick"]) * self._period

    def do(self, *actions: Action) -> float:
        """Actions from their beginning to their end; see ``perform`` and ``wait``."""
        self.perform(*actions)
        return self.wait()
