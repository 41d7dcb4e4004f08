"""Where the camera hangs, seen from the robot's base: from pictures of a point of the tool at known places.

The flange never turns, so one point is enough; its pictures over a volume fix all six numbers of the camera's pose.
Pixels alone decide: a stereo camera's depth errs systematically by a per cent or so. The other way round, the pose says
what depth should have been measured at the marker, and so by what factor depth is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from hardware.interfaces import Intrinsics
from vision.arrays import Array, Mask

LEAST_POINTS: Final = 8  # the marker has to be seen at so many points at least
LEAST_SPREAD: Final = 0.04
"""Points have to spread at least so far in every direction, as a standard deviation over the largest two; and at
least a third of it in the third [m]."""
ROBUST: Final = 0.5  # pictures that are further than this from where they should be count less [px]
OUTLIER: Final = 5.0  # and not at all beyond so many of the usual error …
LEAST_OUTLIER: Final = 1.0  # … if that is more than this [px]
LEAST_NOISE: Final = 0.05  # no picture of a marker is more exact, whatever the residuals of few points say [px]


class CalibrationFailed(Exception):
    """The camera's place cannot be told well enough; the message is one sentence with the next step."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraPose:
    """A calibrated camera."""

    intrinsics: Intrinsics  # of the camera
    camera_from_base: Array  # takes points of the base frame into the camera's, shape (4, 4), translation in [m]
    used: Mask  # which of the n points count, (n,) bool
    residual: Array  # how far each marker is seen from where it should be, (n,) [px]
    aside: Array  # the same across the view at the marker, (n,) [m]
    covariance: Array  # of a small rotation vector [rad] about the camera's axes and a shift [m] along them, (6, 6)

    @property
    def base_from_camera(self) -> Array:
        """Takes points of the camera frame into the base frame, shape (4, 4)."""
        rotation, shift = self.camera_from_base[:3, :3], self.camera_from_base[:3, 3]
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ shift
        return pose

    def expected_error(self, points: Array) -> Array:
        """How wrong points (n, 3) of the base frame come out that the camera sees, as a standard deviation (n,) [m].

        Of noise in the pictures alone: a marker that is not where the parameters say shifts all by as much.
        """
        seen = points @ self.camera_from_base[:3, :3].T + self.camera_from_base[:3, 3]
        turned = -np.array([_cross_matrix(one) for one in seen])
        jacobian = np.concatenate([turned, np.broadcast_to(np.eye(3), turned.shape)], axis=2)
        spread = np.einsum("nij,jk,nik->n", jacobian, self.covariance, jacobian)
        return np.asarray(np.sqrt(np.maximum(spread, 0.0)))


def solve_pose(intrinsics: Intrinsics, points: Array, pixels: Array) -> CameraPose:
    """The camera's pose from pictures (n, 2) [px] of the marker at known points, base frame (n, 3) [m].

    Raises:
        CalibrationFailed: too few points, too close together, or no pose explains them.
    """
    from scipy.optimize import least_squares  # takes half a second to load, and games only check what was found

    points, pixels = np.asarray(points, dtype=float), np.asarray(pixels, dtype=float)
    _check_points(points)
    found, turn, shift = cv2.solvePnP(points, pixels, intrinsics.matrix(), None, flags=cv2.SOLVEPNP_SQPNP)
    if not found:
        raise CalibrationFailed(_NO_POSE)
    start = np.concatenate([np.ravel(turn), np.ravel(shift)])

    def misses(pose: Array, taken: Mask) -> Array:
        return (_projected(intrinsics, pose, points[taken]) - pixels[taken]).ravel()

    everything = np.ones(len(points), dtype=bool)
    rough = least_squares(misses, start, args=(everything,), loss="cauchy", f_scale=ROBUST, x_scale="jac")
    far = np.linalg.norm(misses(rough.x, everything).reshape(-1, 2), axis=1)
    used = far <= max(LEAST_OUTLIER, OUTLIER * 1.4826 * float(np.median(far)))
    _check_points(points[used])
    final = least_squares(misses, rough.x, args=(used,), x_scale="jac")
    residual = np.linalg.norm(misses(final.x, everything).reshape(-1, 2), axis=1)
    rotation, translation = cv2.Rodrigues(final.x[:3])[0], final.x[3:]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    depth = points @ rotation[2] + translation[2]
    if not (depth > 0.0).all():
        raise CalibrationFailed(_NO_POSE)
    aside = residual * depth / intrinsics.fx
    covariance = _covariance(intrinsics, pose, points[used], residual[used])
    return CameraPose(intrinsics, pose, used, residual, aside, covariance)


def depth_factor(pose: CameraPose, points: Array, measured: Array) -> tuple[float, float]:
    """By what a camera's depth has to be multiplied, and how much single measurements scatter about it (standard
    deviation, as a share); (1, 0) where depth was measured nowhere.

    The marker was at points of the base frame (n, 3) [m]; depth measured there, (n,) [m], is 0 or NaN where there is
    none.
    """
    true = points @ pose.camera_from_base[2, :3] + pose.camera_from_base[2, 3]
    there = pose.used & np.isfinite(measured) & (measured > 0.0)
    if np.count_nonzero(there) < LEAST_POINTS:
        return 1.0, 0.0
    ratio = true[there] / measured[there]
    middle = float(np.median(ratio))
    return middle, 1.4826 * float(np.median(np.abs(ratio - middle)))


_NO_POSE: Final = (
    "no pose of the camera explains where the marker was seen: is it on the tool as the robot's parameters say, and "
    "are the camera's intrinsics its own?"
)


def _check_points(points: Array) -> None:
    if len(points) < LEAST_POINTS:
        raise CalibrationFailed(
            f"the marker was seen at {len(points)} points, at least {LEAST_POINTS} are needed: check that nothing "
            "hides it and that it is well lit, or turn the camera towards the board"
        )
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    if spread[1] < LEAST_SPREAD or spread[2] < LEAST_SPREAD / 3.0:
        raise CalibrationFailed(
            f"the points at which the marker was seen spread by only {1e3 * spread[1]:.0f} and {1e3 * spread[2]:.0f} "
            f"mm, {1e3 * LEAST_SPREAD:.0f} and {1e3 * LEAST_SPREAD / 3.0:.0f} mm are needed: turn the camera so that "
            "it sees the arm over the whole board"
        )


def _projected(intrinsics: Intrinsics, pose: Array, points: Array) -> Array:
    seen = points @ cv2.Rodrigues(pose[:3])[0].T + pose[3:]
    near = np.maximum(seen[:, 2:], 1e-3)
    return seen[:, :2] / near * (intrinsics.fx, intrinsics.fy) + (intrinsics.cx, intrinsics.cy)


def _covariance(intrinsics: Intrinsics, pose: Array, points: Array, residual: Array) -> Array:
    """Of the pose, from how well the points agree."""
    seen = points @ pose[:3, :3].T + pose[:3, 3]
    x, y, z = seen.T
    zero = np.zeros_like(x)
    across = np.stack(
        [
            np.stack([intrinsics.fx / z, zero, -intrinsics.fx * x / z**2], axis=1),
            np.stack([zero, intrinsics.fy / z, -intrinsics.fy * y / z**2], axis=1),
        ],
        axis=1,
    )
    turned = -np.array([_cross_matrix(one) for one in seen])
    moved = np.concatenate([turned, np.broadcast_to(np.eye(3), turned.shape)], axis=2)
    jacobian = (across @ moved).reshape(-1, 6)
    noise = max(LEAST_NOISE**2, float(np.sum(residual**2)) / (2 * len(points) - 6))
    return noise * np.linalg.inv(jacobian.T @ jacobian)


def _cross_matrix(vector: Array) -> Array:
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
