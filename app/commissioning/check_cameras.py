"""A camera, alone: whether pictures come, in time, and whether something can be seen in them."""

from __future__ import annotations

import time
from typing import Final

import cv2
import numpy as np

from app.commissioning.check_report import Finding, Judge
from hardware.interfaces import Camera, Frame, HardwareError, StaleFrame

FRAMES: Final = 6
MOST_AGE: Final = 0.5
"""Of a frame when it is read [s]."""
PATIENCE: Final = 5.0
"""For the first such one [s, wall]."""
DARK, BRIGHT = 40.0, 215.0
"""Mean brightness of a picture, of 255."""
BLOWN: Final = 0.10
"""Share of pixels that may be white or black through and through."""
SHARP: Final = 20.0
"""Variance of the picture's Laplacian; a lens out of focus stays far below."""
DEPTH_SHARE: Final = 0.5
"""Of pixels with depth."""
NEAR, FAR = 0.2, 2.0
"""Between which most of the picture lies [m]."""


def check_camera(camera: Camera) -> list[Finding]:
    """Read some frames of a camera that is open."""
    judge = Judge("camera")
    try:
        frames = [_first(camera)]
        since = time.perf_counter()
        for _ in range(FRAMES):
            frames.append(camera.read(MOST_AGE))
    except HardwareError as error:
        judge.wrong("pictures", str(error), "see to its cable, then check again")
        return judge.findings
    rate = FRAMES / (time.perf_counter() - since)
    last = frames[-1]
    height, width = last.colour.shape[:2]
    stamps = np.array([frame.stamp for frame in frames])
    judge.judge(
        "pictures", f"{width}×{height}, {rate:.0f} reads a second", bool((np.diff(stamps) >= 0.0).all()),
        "its clock runs backwards: give it a newer firmware",
    )  # fmt: skip
    _judge_light(judge, last)
    _judge_depth(judge, last)
    return judge.findings


def _first(camera: Camera) -> Frame:
    """The first frame that is young enough; a camera that has just been opened may need a while."""
    give_up = time.monotonic() + PATIENCE
    while True:
        try:
            return camera.read(MOST_AGE)
        except StaleFrame:
            if time.monotonic() > give_up:
                raise


def _judge_light(judge: Judge, frame: Frame) -> None:
    grey = cv2.cvtColor(frame.colour, cv2.COLOR_RGB2GRAY)
    mean = float(grey.mean())
    lost = float(((grey <= 1) | (grey >= 254)).mean())
    advice = "more light, or a longer exposure" if mean < DARK else "less light, or a shorter exposure"
    judge.judge("brightness", f"{mean:.0f} of 255", DARK <= mean <= BRIGHT, advice)
    judge.judge(
        "contrast", f"{100.0 * lost:.1f} % of the pixels are black or white through and through", lost <= BLOWN,
        "turn the lamp so that nothing shines, and choose the exposure for the board",
    )  # fmt: skip
    sharpness = float(cv2.Laplacian(grey, cv2.CV_64F).var())
    judge.judge("sharpness", f"{sharpness:.0f}", sharpness >= SHARP, "clean the lens and set its focus on the board")


def _judge_depth(judge: Judge, frame: Frame) -> None:
    if frame.depth is None:
        judge.left_out("depth", "this camera has none: the game sees by colour alone")
        return
    measured = frame.depth[frame.depth > 0.0]
    share = measured.size / frame.depth.size
    middle = float(np.median(measured)) if measured.size else 0.0
    judge.judge(
        "depth", f"{100.0 * share:.0f} % of the pixels, {middle:.2f} m in the middle",
        share >= DEPTH_SHARE and NEAR <= middle <= FAR,
        "switch its emitter on, clean its three windows, and put it 0.3 to 1 m from the board",
    )  # fmt: skip
