"""Where the board is in the pictures of the rig's own camera, as it is meant to hang: until it is calibrated."""

from __future__ import annotations

import numpy as np

from hardware.interfaces import Intrinsics
from hardware.sim.bodies.scene import camera_poses
from hardware.table import TableSettings
from vision.board.view import BoardView


def nominal_view(intrinsics: Intrinsics, table: TableSettings) -> BoardView:
    """The view of a camera that hangs just where the simulated rig's is meant to, over board and trays of a table."""
    pose = camera_poses(table)["camera"]
    position, target = np.array(pose.position), np.array(pose.target)
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    camera_from_board = np.eye(4)
    camera_from_board[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    camera_from_board[:3, 3] = -camera_from_board[:3, :3] @ position
    return BoardView(intrinsics, camera_from_board, table)
