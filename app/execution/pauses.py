"""Whether the arm may move, and what it waits for where it may not: hands to go, its own rest, somebody's 'go'."""

from __future__ import annotations

from typing import Final

from app.execution.interruption import BoardTouched
from app.execution.state import Attendant, Clearance, Devices
from app.records import GameRecord
from app.records.events import STOPPED
from app.rig.arm import ArmGaveWay, ArmHeld, ArmPaused, ArmStopped
from app.terminal.game_display import UserInterface

MOST_YIELDS: Final = 3
"""Within one job the arm gives way; what is in its way more often is no hand that passes."""
WENT_ON: Final = "somebody pressed STOP; the arm continued when it was told to"
STAYED: Final = "somebody pressed STOP, and nobody told the arm to continue"
"""What the record says of a STOP."""


class Permission:
    """To move, of one arm.

    Args:
        devices: of the rig.
        record: of the game; each STOP is in it.
        ui: shown what is being waited for.
        attendant: says 'go' after a STOP.
    """

    def __init__(self, devices: Devices, record: GameRecord, ui: UserInterface, attendant: Attendant) -> None:
        self._devices, self._record, self._ui, self._attendant = devices, record, ui, attendant

    @property
    def stopped(self) -> bool:
        """Whether somebody pressed STOP, and nobody has said 'go' since."""
        return self._devices.arm.stopped

    def await_clear(self, seen: Clearance | None = None) -> None:
        """Before a plan is carried out: no motion after a STOP, nor over the board while a hand is there.

        Args:
            seen: up to which hand the board was looked at, as far as the plan relies on that; None: on nothing.

        Raises:
            BoardTouched: somebody may have touched it since: a hand was there, or whoever has pressed STOP.
            UserError: nobody says 'go'.
        """
        stopped, guard = self.stopped, self._devices.guard
        if stopped:
            self.await_go(ArmStopped())
        if guard is not None:
            guard.clear()
        if seen is not None and (stopped or not seen.holds(guard)):
            self._ui.phase("a hand was over the board: looking again" if not stopped else "looking again after STOP")
            raise BoardTouched

    def await_go(self, stopped: ArmStopped) -> None:
        """After a STOP: until somebody says that the arm may move again.

        Raises:
            UserError: nobody does; it rests.
        """
        sentence = STAYED
        try:
            self._attendant.wait_for_go(str(stopped))
            sentence = WENT_ON
        finally:
            self._note(sentence)
        self._devices.arm.release()

    def go_on(self) -> None:
        """Somebody has said so without being asked: after a STOP the arm may move again."""
        self._note(WENT_ON)
        self._devices.arm.release()

    def admit_again(self, pushed: ArmGaveWay, times: int) -> None:
        """An arm that gave way goes on, once nobody is there who is seen, unless it does so again and again.

        Raises:
            ArmGaveWay: it does.
        """
        if times > MOST_YIELDS:
            raise pushed
        self._ui.phase(f"the arm gave way: {pushed}")
        self.await_clear()
        self._devices.arm.resume()

    def require_own_hold(self, pause: ArmPaused) -> None:
        """An arm that somebody else, or its protection, lets admit no motion waits for a person to look after it.

        Raises:
            ArmHeld: it is so.
        """
        if isinstance(pause, ArmHeld) and (self._devices.guard is None or not self._devices.guard.holding):
            raise pause

    def _note(self, sentence: str) -> None:
        self._record.trouble(STOPPED, (), sentence, None, self._devices.clock.now())
