"""Puts a table together: arm, camera and record of one game on one rig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.execution.carrier import Carrier
from app.execution.state import Devices, Position
from app.execution.table import Table
from app.game.person import PersonAsker, UnattendedAsker
from app.players.person import Human
from app.records import GameRecord
from app.terminal.interface import Face
from hardware.interfaces import Intrinsics
from hardware.parameters import RobotParameters

if TYPE_CHECKING:
    from app.motion import MotionSettings
    from vision.board.view import BoardView


@dataclass(frozen=True, slots=True)
class Seating:
    """What all tables of a rig have in common.

    Attributes:
        motion: how the arm moves.
        parameters: of the robot.
        looks: whether the camera follows the game.
        view: where the board should be in the pictures of a camera, by calibration; None: nobody knows.
    """

    motion: MotionSettings
    parameters: RobotParameters
    looks: bool
    view: Callable[[Intrinsics], BoardView | None]

    def table(self, devices: Devices, record: GameRecord, position: Position, face: Face, human: Human | None) -> Table:
        """For one game or setting up.

        Args:
            devices: of the rig.
            record: of it.
            position: where it stands.
            face: shown what happens.
            human: who can be asked to put something right; None: nobody.

        """
        carrier = Carrier(devices, record, face, self.motion, self.parameters)
        mender = None
        if self.looks and devices.camera is not None:
            from app.execution.observation import Eyes  # loads what sees: not where nobody looks
            from app.execution.recovery import Mender

            eyes = Eyes(devices, position.inventory.table, self.view)
            asker = UnattendedAsker() if human is None else PersonAsker(human, face)
            mender = Mender(eyes, carrier, asker, record, face, devices.clock)
        return Table(position, devices, carrier, mender, record, face)
