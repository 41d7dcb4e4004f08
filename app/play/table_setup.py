"""Puts a table together: arm, camera and record of one game on one rig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.execution.carrier import Carrier
from app.execution.state import Attendant, Devices, Position
from app.execution.table import Table
from app.game.person import PersonAsker, PersonAttendant, UnattendedAsker, UnattendedAttendant
from app.players.person import Human, Lines
from app.records import GameRecord
from app.terminal.game_display import UserInterface
from hardware.interfaces import Intrinsics
from hardware.parameters import RobotParameters
from hardware.table import TableSettings

if TYPE_CHECKING:
    from app.execution.observation import GameObserver
    from app.motion import MotionSettings
    from app.records.robot import Row
    from vision.board.view import BoardView


@dataclass(frozen=True, slots=True)
class TableSetup:
    """What all tables of a rig have in common.

    Attributes:
        motion: how the arm moves.
        parameters: of the robot.
        looks: whether the camera follows the game.
        view: where the board should be in the pictures of a camera, by calibration; None: nobody knows.
        camera: where it hangs, asked once the rig is open; see ``RobotRecord``; None: nobody knows.
        lines: what whoever watches says where nobody plays, such as 'go' after a STOP; None: nobody says anything.
    """

    motion: MotionSettings
    parameters: RobotParameters
    looks: bool
    view: Callable[[Intrinsics], BoardView | None]
    camera: Callable[[], tuple[Row, Row, Row] | None] = lambda: None
    lines: Lines | None = None

    def table(
        self, devices: Devices, record: GameRecord, position: Position, ui: UserInterface, human: Human | None,
        mending: Callable[[bool], None] = lambda _: None,
    ) -> Table:  # fmt: skip
        """For one game or setting up.

        Args:
            devices: of the rig.
            record: of it.
            position: where it stands.
            ui: shown what happens.
            human: who can be asked to put something right; None: nobody.
            mending: told when the board must be put right, and when it has been.
        """
        record.robot(self.parameters, None if devices.camera is None else self.camera())
        attendant: Attendant = UnattendedAttendant(self.lines, ui)
        if human is not None:
            attendant = PersonAttendant(human.lines, ui, require=human.require, refusal=human.refusal)
        carrier = Carrier(devices, record, ui, self.motion, self.parameters, attendant)
        if position.begun and human is None and carrier.permission.stopped:
            carrier.permission.go_on()  # whoever has said 'touchmove resume' has said so
        recovery = None
        if self.looks and devices.camera is not None:
            from app.execution.recovery import Recovery  # loads what sees: not where nobody looks

            observer = self.observer(devices, position.inventory.table, ui)
            asker = UnattendedAsker() if human is None else PersonAsker(human, ui)
            recovery = Recovery(observer, carrier, asker, record, ui, devices.clock, mending)
        return Table(position, devices, carrier, recovery, record, ui)

    def observer(self, devices: Devices, table: TableSettings, ui: UserInterface) -> GameObserver:
        """Of one game; the devices have a camera, and what it sees is shown."""
        from app.execution.observation import GameObserver

        return GameObserver(devices, table, self.view, ui.look)
