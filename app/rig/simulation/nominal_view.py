"""Where the board is in the pictures of the rig's own camera, as it is meant to hang: until it is calibrated."""

import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Intrinsics
from hardware.sim.bodies.scene import camera_poses
from hardware.table import TableSettings
from vision.board.view import BoardView


def nominal_view(intrinsics: Intrinsics, table: TableSettings) -> BoardView:
    """The view of a camera that hangs just where the simulated rig's is meant to, over board and trays of a table."""
    return BoardView(intrinsics, nominal_pose(table), table)


def nominal_pose(table: TableSettings) -> NDArray[np.float64]:
    """Takes points of the board frame into the frame of that camera, shape (4, 4) [m]."""
    pose = camera_poses(table)["camera"]
    camera_from_board = np.eye(4)
    camera_from_board[:3, :3] = pose.axes()
    camera_from_board[:3, 3] = -pose.axes() @ np.array(pose.position)
    return camera_from_board
