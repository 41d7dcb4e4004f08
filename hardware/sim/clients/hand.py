"""The simulated person as the app sees them: somebody who can be asked to do something at the board."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hardware.interfaces import HardwareError
from hardware.sim.clients import wire
from hardware.sim.hand.actions import Action, Perform


class HandRefused(HardwareError):
    """The person cannot do what was asked; the message says why."""


class SimHand:
    """The hand of a world.

    Args:
        run_dir: of the world.

    Raises:
        HardwareError: no world answers, or it has no hand.
    """

    def __init__(self, run_dir: Path) -> None:
        self._link, answer = wire.connect(run_dir, "hand")
        self._period = float(answer["period"])
        self._asked = False
        self._early: dict[str, Any] | None = None

    def perform(self, *actions: Action) -> None:
        """Begin with some actions, one after the other; plant time runs until they are done.

        Raises:
            HandRefused: others are still under way.
            HardwareError: the world is gone.
        """
        if self._asked:
            raise HandRefused("the hand is busy: wait until its actions are done")
        self._send(Perform(actions=actions).model_dump_json().encode())
        self._asked = True

    def busy(self) -> bool:
        """Whether actions are under way; never blocks for them.

        Raises:
            HardwareError: the world is gone.
        """
        if self._asked and self._early is None:
            self._link.settimeout(0.0)
            try:
                self._early = self._receive()
            except BlockingIOError:
                return True
        return False

    def wait(self) -> float:
        """Wait until what was begun is done.

        Returns:
            Plant time of its end [s].

        Raises:
            HandRefused: it could not be done, or nothing was asked for.
            HardwareError: the world is gone.
        """
        if not self._asked:
            raise HandRefused("the hand was not asked to do anything")
        self._link.settimeout(None)
        answer = self._early or self._receive()
        self._asked, self._early = False, None
        if "error" in answer:
            raise HandRefused(str(answer["error"]))
        return int(answer["tick"]) * self._period

    def close(self) -> None:
        """Let the world go; a hand that is still at work withdraws."""
        self._link.close()

    def _send(self, message: bytes) -> None:
        self._link.settimeout(None)
        try:
            self._link.send(message)
        except OSError as error:
            raise HardwareError(
                f"the world does not answer ({error.strerror}); its log is in the run directory"
            ) from error

    def _receive(self) -> dict[str, Any]:
        try:
            message = self._link.recv(wire.LARGEST_MESSAGE)
        except BlockingIOError:
            raise
        except OSError as error:
            raise HardwareError(
                f"the world does not answer ({error.strerror}); its log is in the run directory"
            ) from error
        if not message:
            raise HardwareError("the world has ended; its log is in the run directory")
        answer: dict[str, Any] = json.loads(message)
        return answer
