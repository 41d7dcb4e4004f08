"""What sees for the games of a session: whether the camera follows them, where it hangs, the guard against hands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app import UserError
from app.play.game_setup import RigSetup
from app.play.session import SessionVision
from app.players.person import Human
from app.settings.defaults import Settings
from app.terminal.game_display import UserInterface
from hardware.interfaces import Intrinsics

if TYPE_CHECKING:
    from app.records.robot import Row
    from vision.board.view import BoardView


def looks(settings: Settings, rig_setup: RigSetup, human: Human | None) -> bool:
    """Whether the camera follows the games.

    Raises:
        UserError: it should, and there is none.
    """
    if settings.vision.verify and not rig_setup.sees:
        raise UserError("this rig has no camera to check each ply: leave out --verify")
    wanted = human is not None or not rig_setup.simulated
    return rig_setup.sees and (wanted if settings.vision.verify is None else settings.vision.verify)


def believed_view(rig_setup: RigSetup, intrinsics: Intrinsics) -> BoardView | None:
    """Where the board should be in the pictures of a camera: by its calibration; in a simulation also as it is meant.

    Raises:
        UserError: the calibration is of another camera.
    """
    if rig_setup.calibration is not None:
        rig_setup.calibration.require_camera(intrinsics)
        return rig_setup.calibration.board_view(rig_setup.table)
    if not rig_setup.simulated:
        return None
    from app.rig.simulation.nominal_view import nominal_view

    return nominal_view(intrinsics, rig_setup.table)


def believed_camera(rig_setup: RigSetup) -> tuple[Row, Row, Row] | None:
    """Where the camera hangs, as far as that is known without a picture of it; see ``RobotRecord``."""
    table = rig_setup.table
    if rig_setup.calibration is not None:
        camera_from_board = rig_setup.calibration.pose() @ rig_setup.calibration.base_from_board(table)
    elif rig_setup.simulated:
        from app.rig.simulation.nominal_view import nominal_pose

        camera_from_board = nominal_pose(table)
    else:
        return None
    turned, moved = camera_from_board[:3, :3].T, camera_from_board[:3, 3]
    rows = [(*axis.tolist(), -float(axis @ moved)) for axis in turned]
    return rows[0], rows[1], rows[2]


def session_vision(settings: Settings, rig_setup: RigSetup, human: Human | None, ui: UserInterface) -> SessionVision:
    """What sees for the games: the camera, corrected by its calibration, and the guard where there is one.

    Raises:
        UserError: a guard is wanted where there is no camera, or where it would not know where the board is.
    """
    factor = 1.0 if rig_setup.calibration is None else rig_setup.calibration.depth_factor
    wanted = settings.vision.guard
    if wanted and not rig_setup.sees:
        raise UserError("this rig has no camera to watch for hands: leave out --guard")
    guarding = None
    if rig_setup.sees and (not rig_setup.simulated if wanted is None else wanted):
        from app.guard.game_guard import Guarding  # what sees takes a second to load

        knows = rig_setup.calibration is not None or rig_setup.simulated or looks(settings, rig_setup, human)
        if not knows:
            raise UserError(
                "a guard against hands must know where the board is: run 'touchmove calibrate', let the camera "
                "follow the game with --verify, or leave it out with --no-guard"
            )
        ui.device("hand guard", True, "watches for hands")

        def tell(text: str) -> None:
            ui.phase(text)
            ui.device("hand guard", True, text)

        guarding = Guarding(
            rig_setup.parameters, rig_setup.table, lambda intrinsics: believed_view(rig_setup, intrinsics), factor,
            1.0 / settings.vision.guard_rate, tell,
        )  # fmt: skip
    if factor == 1.0:
        return SessionVision(guarding=guarding)
    from app.rig.depth_scale import scaled_camera

    return SessionVision(lambda camera: scaled_camera(camera, factor), guarding)
